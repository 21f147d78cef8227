//! KHR_draco_mesh_compression: primitives compressed by Draco, decoded by `draco-core`.

use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};
use gltf::json::Value;

use crate::error::{Result, contain};
use crate::import::formats::gltf::Loader;
use crate::import::formats::gltf::accessor::normalised;
use crate::import::formats::gltf::check::fault;
use crate::import::formats::gltf::look::bytes_of;

pub(super) const NAME: &str = "KHR_draco_mesh_compression";

impl Loader<'_> {
    /// Decodes all compressed primitives. The results take the place of what their accessors refer to.
    pub(super) fn decode_draco(&mut self) -> Result<()> {
        for mesh in self.document.meshes() {
            for primitive in mesh.primitives() {
                let Some(value) = primitive.extension_value(NAME) else { continue };
                let view = value["bufferView"].as_u64().and_then(|index| usize::try_from(index).ok());
                let view = view.and_then(|index| self.document.views().nth(index));
                if let Some(Err(e)) = view.as_ref().and_then(|view| self.buffers.get(view.buffer().index())) {
                    return Err(e.clone());
                }
                self.decode_primitive(&primitive, value).map_err(|what| {
                    let item = format!("mesh {}, primitive {}, {NAME}", mesh.index(), primitive.index());
                    fault(&self.source.file, item, what)
                })?;
            }
        }
        Ok(())
    }

    fn decode_primitive(
        &mut self,
        primitive: &gltf::Primitive,
        value: &Value,
    ) -> std::result::Result<(), String> {
        let number = |value: &Value| value.as_u64().and_then(|index| usize::try_from(index).ok());
        let view = number(&value["bufferView"]).and_then(|index| self.document.views().nth(index));
        let bytes = view.as_ref().and_then(|view| bytes_of(&self.buffers, view));
        let bytes = bytes.ok_or("its data lies outside its buffer")?;
        let indices = primitive.indices();
        let most = primitive.attributes().map(|(_, accessor)| accessor.count()).max().unwrap_or(0);
        let mesh = decode(bytes, most, indices.as_ref().map_or(most, gltf::Accessor::count) / 3)?;
        for (semantic, accessor) in primitive.attributes() {
            // Attributes that are not listed are not compressed.
            let Some(id) = number(&value["attributes"][semantic.to_string()]) else { continue };
            let attribute = u32::try_from(id).ok().and_then(|id| mesh.attribute_by_unique_id(id));
            let attribute = attribute.ok_or_else(|| format!("it has no attribute {id}"))?;
            let numbers = attribute.read_f32s(mesh.num_points(), accessor.dimensions().multiplicity());
            let convert = normalised(&accessor);
            self.decoded
                .insert(accessor.index(), numbers.into_iter().map(|number| convert(number.into())).collect());
        }
        if let Some(indices) = indices {
            let corners = mesh.faces().as_flattened().iter().map(|point| f64::from(point.0));
            self.decoded.insert(indices.index(), corners.collect());
        }
        Ok(())
    }
}

/// Decodes a mesh. The counts are those of its accessors, whose memory has been checked; seams between attributes may
/// split points, so that a few times as many are accepted.
fn decode(bytes: &[u8], points: usize, triangles: usize) -> std::result::Result<Mesh, String> {
    const SPLIT: u64 = 6;
    let limits = DecodeLimits::default()
        .with_max_points((points as u64).saturating_mul(SPLIT))
        .with_max_faces((triangles as u64).saturating_mul(2).saturating_add(1));
    let mut mesh = Mesh::new();
    let parse = || MeshDecoder::new().decode(&mut DecoderBuffer::new(bytes).with_limits(limits), &mut mesh);
    match contain(parse) {
        Some(Ok(())) => Ok(mesh),
        Some(Err(e)) => Err(format!("its data is damaged: {e}")),
        None => Err("its data is damaged".to_owned()),
    }
}
