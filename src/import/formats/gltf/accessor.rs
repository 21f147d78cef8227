//! The numbers of accessors.

use gltf::accessor::{DataType, Dimensions};
use gltf::buffer::View;

use crate::error::{Result, Warnings};
use crate::import::formats::gltf::animation::Pose;
use crate::import::formats::gltf::check::node_places;
use crate::import::formats::gltf::{Loader, instancing};

/// The value of a component of an accessor (glTF 2.0, section 3.6.2.2).
pub(super) fn normalised(accessor: &gltf::Accessor) -> impl Fn(f64) -> f64 + use<> {
    let most = match accessor.data_type() {
        _ if !accessor.normalized() => None,
        DataType::I8 => Some(127.0),
        DataType::U8 => Some(255.0),
        DataType::I16 => Some(32767.0),
        DataType::U16 => Some(65535.0),
        DataType::U32 | DataType::F32 => None,
    };
    // The least integers are below -1.
    move |x| most.map_or(x, |most: f64| (x / most).max(-1.0))
}

impl Loader<'_> {
    /// Checks that the buffers of the meshes of the scene are loaded.
    ///
    /// # Errors
    /// [`Error::Input`] of the first buffer that is missing.
    pub(super) fn check_drawn(&self) -> Result<()> {
        if self.buffers.iter().all(Result::is_ok) {
            return Ok(());
        }
        let places =
            node_places(self.document, &Pose::default(), &self.source.file, &mut Warnings::default())?;
        let is_drawn =
            |node: &gltf::Node| places[node.index()].as_ref().is_some_and(|place| place.is_visible);
        let mut used = Vec::new();
        for node in self.document.nodes().filter(is_drawn) {
            let Some(mesh) = node.mesh() else { continue };
            for primitive in mesh.primitives() {
                used.extend(primitive.attributes().map(|(_, accessor)| accessor).chain(primitive.indices()));
                let targets = primitive.morph_targets();
                used.extend(
                    targets.flat_map(|all| [all.positions(), all.normals(), all.tangents()]).flatten(),
                );
            }
            used.extend(node.skin().and_then(|skin| skin.inverse_bind_matrices()));
            used.extend(instancing::accessors(&node, self.document));
        }
        for accessor in used.iter().filter(|accessor| !self.decoded.contains_key(&accessor.index())) {
            let sparse = accessor.sparse().map(|sparse| [sparse.indices().view(), sparse.values().view()]);
            for view in accessor.view().into_iter().chain(sparse.into_iter().flatten()) {
                if let Some(Err(e)) = self.buffers.get(view.buffer().index()) {
                    return Err(e.clone());
                }
            }
        }
        Ok(())
    }

    /// The elements of an accessor of `N` components each, in f64: normalised integers by section 3.6.2.2 of glTF 2.0;
    /// zeros where there is no buffer view. `None` if the accessor has other elements or lies outside its buffer.
    pub(super) fn vectors<const N: usize>(&self, accessor: &gltf::Accessor) -> Option<Vec<[f64; N]>> {
        if accessor.dimensions().multiplicity() != N {
            return None;
        }
        if let Some(decoded) = self.decoded.get(&accessor.index()) {
            return Some(decoded.as_chunks().0.to_vec());
        }
        let normal = normalised(accessor);
        match accessor.data_type() {
            DataType::I8 => self.read(accessor, |[byte]| normal(f64::from(byte as i8))),
            DataType::U8 => self.read(accessor, |[byte]| normal(f64::from(byte))),
            DataType::I16 => self.read(accessor, |bytes| normal(i16::from_le_bytes(bytes).into())),
            DataType::U16 => self.read(accessor, |bytes| normal(u16::from_le_bytes(bytes).into())),
            DataType::U32 => self.read(accessor, |bytes| u32::from_le_bytes(bytes).into()),
            DataType::F32 => self.read(accessor, |bytes| f32::from_le_bytes(bytes).into()),
        }
    }

    /// The components of an accessor's elements one after the other.
    pub(super) fn numbers(&self, accessor: &gltf::Accessor) -> Option<Vec<f64>> {
        match accessor.dimensions() {
            Dimensions::Scalar => self.vectors::<1>(accessor).map(Vec::into_flattened),
            Dimensions::Vec2 => self.vectors::<2>(accessor).map(Vec::into_flattened),
            Dimensions::Vec3 => self.vectors::<3>(accessor).map(Vec::into_flattened),
            Dimensions::Vec4 => self.vectors::<4>(accessor).map(Vec::into_flattened),
            Dimensions::Mat4 => self.vectors::<16>(accessor).map(Vec::into_flattened),
            Dimensions::Mat2 | Dimensions::Mat3 => None,
        }
    }

    /// The elements of an accessor, `N` components of `B` bytes each, with those that a sparse accessor replaces.
    fn read<const N: usize, const B: usize>(
        &self,
        accessor: &gltf::Accessor,
        component: impl Fn([u8; B]) -> f64,
    ) -> Option<Vec<[f64; N]>> {
        let vector = |bytes: &[u8]| -> [f64; N] {
            let components = bytes.as_chunks::<B>().0;
            std::array::from_fn(|i| component(components[i]))
        };
        let mut vectors: Vec<[f64; N]> = match accessor.view() {
            Some(view) => {
                let elements = self.elements(&view, accessor.offset(), accessor.count(), N * B)?;
                elements.map(vector).collect()
            }
            None => vec![[0.0; N]; accessor.count()],
        };
        if let Some(sparse) = accessor.sparse() {
            let (indices, values) = (sparse.indices(), sparse.values());
            let size = indices.index_type().size();
            let index =
                |bytes: &[u8]| bytes.iter().rev().fold(0, |index, &byte| index << 8 | usize::from(byte));
            let views = [indices.view(), values.view()];
            let indices = self.elements(&views[0], indices.offset(), sparse.count(), size)?;
            let values = self.elements(&views[1], values.offset(), sparse.count(), N * B)?;
            for (index, value) in indices.map(index).zip(values) {
                *vectors.get_mut(index)? = vector(value);
            }
        }
        Some(vectors)
    }

    /// The bytes of `count` elements of `size` bytes of a buffer view from `offset`.
    fn elements(
        &self,
        view: &View,
        offset: usize,
        count: usize,
        size: usize,
    ) -> Option<impl Iterator<Item = &[u8]>> {
        let stride = view.stride().unwrap_or(size);
        let bytes = crate::import::formats::gltf::look::bytes_of(&self.buffers, view)?.get(offset..)?;
        let needed = count.checked_sub(1)?.checked_mul(stride)?.checked_add(size)?;
        Some(bytes.get(..needed)?.chunks(stride).map(move |element| &element[..size]))
    }
}
