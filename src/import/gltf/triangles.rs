//! Meshes: positions, indices, attributes and skins.

use glam::{DMat4, DVec2, DVec3, DVec4};

use super::{Loader, dvec3, layers, specular_glossiness};
use crate::error::{Error, Place, Result};
use crate::import::tangents::make_tangents;
use crate::scene::{Attribute, Mesh, moved_tangent};

impl Loader<'_> {
    /// Reads a primitive in the local space of its mesh, its morph targets added by their weights; `None` for points and
    /// lines.
    pub(super) fn primitive(
        &mut self,
        primitive: &gltf::Primitive,
        name: &str,
        weights: &[f64],
    ) -> Result<Option<Mesh>> {
        use gltf::mesh::Mode;
        if matches!(primitive.mode(), Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            self.warn(format!("{name}: points and lines are not drawn"));
            return Ok(None);
        }
        let uv_set = self.uv_set(&primitive.material());
        let reader = primitive.reader(|buffer| self.buffers.get(buffer.index()).map(Vec::as_slice));
        let fault = |what: &str| {
            let item = Place::item(&self.source.file, format!("{name}, primitive {}", primitive.index()));
            Error::input(item, what, "export the file again")
        };
        if let Some(accessor) = primitive.get(&gltf::Semantic::Positions) {
            use gltf::accessor::{DataType, Dimensions};
            if (accessor.data_type(), accessor.dimensions()) != (DataType::F32, Dimensions::Vec3) {
                return Err(fault("its positions are not three floating-point numbers each"));
            }
        }
        let positions: Vec<DVec3> = match reader.read_positions() {
            Some(positions) => positions.map(dvec3).collect(),
            None if primitive.get(&gltf::Semantic::Positions).is_none() => {
                self.warn(format!("{name}: a mesh without positions is not drawn"));
                return Ok(None);
            }
            None => return Err(fault("its positions lie outside their buffer")),
        };
        let count = positions.len();
        let order: Vec<u32> = match (reader.read_indices(), primitive.indices()) {
            (Some(indices), _) => indices.into_u32().collect(),
            (None, Some(_)) => return Err(fault("its indices lie outside their buffer")),
            (None, None) => (0..count as u32).collect(),
        };
        let mut triangles = into_triangles(&order, primitive.mode());
        let before = triangles.len();
        triangles.retain(|t| t.iter().all(|&i| (i as usize) < count));
        let out_of_range = before - triangles.len();

        // Attributes whose count differs from that of the positions are ignored.
        let normals = reader.read_normals().map(|values| values.map(dvec3).collect::<Vec<_>>());
        let uvs = reader.read_tex_coords(uv_set).map(|uvs| {
            uvs.into_f32().map(|[u, v]| DVec2::new(f64::from(u), f64::from(v))).collect::<Vec<_>>()
        });
        let colours = reader.read_colors(0).map(|c| c.into_rgb_f32().map(dvec3).collect::<Vec<_>>());
        let is_opaque = primitive.material().alpha_mode() == gltf::material::AlphaMode::Opaque;
        let alphas = reader.read_colors(0).filter(|_| !is_opaque && has_alpha(primitive));
        let alphas = alphas.map(|c| c.into_rgba_f32().map(|[.., a]| f64::from(a)).collect::<Vec<_>>());
        let tangents = primitive.material().normal_texture().and_then(|_| {
            let values = reader.read_tangents()?.map(|t| DVec4::from(t.map(f64::from))).collect::<Vec<_>>();
            // Tangents without normals are ignored (glTF 2.0, section 3.7.2.1).
            (values.len() == count && normals.is_some()).then(|| Attribute::per_position(values))
        });
        let mut mesh = Mesh {
            tangents,
            normals: normals.filter(|v| v.len() == count).map(Attribute::per_position),
            uvs: uvs.filter(|v| v.len() == count).map(Attribute::per_position),
            colours: colours.filter(|v| v.len() == count).map(Attribute::per_position),
            alphas: alphas.filter(|v| v.len() == count).map(Attribute::per_position),
            positions,
            triangles,
        };
        if !self.morph(primitive, weights, &mut mesh) {
            self.warn(format!("{name}: morph targets that differ from its positions in number are left out"));
        }
        if primitive.material().normal_texture().is_some() {
            make_tangents(&mut mesh);
        }
        if out_of_range > 0 {
            self.warn(format!("{name}: left out {out_of_range} triangle(s) with an index out of range"));
        }
        Ok(Some(mesh))
    }

    /// Adds the displacements of morph targets by their weights (glTF 2.0, section 3.7.2.2). Returns whether all fit.
    fn morph(&self, primitive: &gltf::Primitive, weights: &[f64], mesh: &mut Mesh) -> bool {
        let reader = primitive.reader(|buffer| self.buffers.get(buffer.index()).map(Vec::as_slice));
        let count = mesh.positions.len();
        let fits = |accessor: Option<gltf::Accessor>| {
            use gltf::accessor::{DataType, Dimensions};
            accessor.is_none_or(|accessor| {
                let kind = (accessor.data_type(), accessor.dimensions());
                kind == (DataType::F32, Dimensions::Vec3) && accessor.count() == count
            })
        };
        let mut all_fit = true;
        let targets = reader.read_morph_targets().zip(primitive.morph_targets());
        for (((positions, normals, tangents), target), &weight) in targets.zip(weights) {
            if weight == 0.0 || !weight.is_finite() {
                continue;
            }
            if ![target.positions(), target.normals(), target.tangents()].into_iter().all(fits) {
                all_fit = false;
                continue;
            }
            let by = |value: [f32; 3]| dvec3(value) * weight;
            for (position, value) in mesh.positions.iter_mut().zip(positions.into_iter().flatten()) {
                *position += by(value);
            }
            let of_mesh = mesh.normals.iter_mut().flat_map(|normals| &mut normals.values);
            of_mesh.zip(normals.into_iter().flatten()).for_each(|(normal, value)| *normal += by(value));
            let of_mesh = mesh.tangents.iter_mut().flat_map(|tangents| &mut tangents.values);
            for (tangent, value) in of_mesh.zip(tangents.into_iter().flatten()) {
                *tangent += by(value).extend(0.0);
            }
            for normal in mesh.normals.iter_mut().flat_map(|normals| &mut normals.values) {
                *normal = normal.try_normalize().unwrap_or(*normal);
            }
        }
        all_fit
    }

    /// The texture coordinate set of a material; kiln supports one set for all textures of a material.
    fn uv_set(&mut self, material: &gltf::Material) -> u32 {
        let first = texture_set(material);
        if core_sets(material).any(|set| set != first) {
            let name = material.name().unwrap_or("without a name");
            self.warn(format!(
                "material {name} has pictures by several sets of texture coordinates; all drawn by set {first}"
            ));
        }
        first
    }

    /// Skinning matrix of each vertex, from the rest pose of a skin's joints (glTF 2.0, section 3.7.3).
    pub(super) fn pose(
        &mut self,
        skin: &gltf::Skin,
        primitive: &gltf::Primitive,
        world_from_nodes: &[Option<DMat4>],
    ) -> Option<Vec<DMat4>> {
        let get = |buffer: gltf::Buffer| self.buffers.get(buffer.index()).map(Vec::as_slice);
        let reader = primitive.reader(get);
        // Each set has four joints a vertex.
        let sets: Vec<_> = (0..)
            .map_while(|set| {
                let (joints, weights) = (reader.read_joints(set)?, reader.read_weights(set)?);
                Some((joints.into_u16().collect::<Vec<_>>(), weights.into_f32().collect::<Vec<_>>()))
            })
            .collect();
        let count = sets.iter().map(|(joints, weights)| joints.len().min(weights.len())).min()?;
        let joint_from_mesh: Option<Vec<DMat4>> = skin
            .reader(get)
            .read_inverse_bind_matrices()
            .map(|matrices| matrices.map(|m| glam::Mat4::from_cols_array_2d(&m).as_dmat4()).collect());
        let world_from_mesh: Vec<DMat4> = skin
            .joints()
            .enumerate()
            .map(|(i, joint)| {
                let world_from_joint = world_from_nodes[joint.index()].unwrap_or(DMat4::IDENTITY);
                let inverse_bind = joint_from_mesh.as_ref().and_then(|m| m.get(i)).copied();
                world_from_joint * inverse_bind.unwrap_or(DMat4::IDENTITY)
            })
            .collect();
        let blend = |vertex: usize| {
            let mut sum = DMat4::ZERO;
            for (joints, weights) in &sets {
                for (&joint, &weight) in joints[vertex].iter().zip(&weights[vertex]) {
                    sum += *world_from_mesh.get(joint as usize)? * f64::from(weight);
                }
            }
            // The w component of the blended matrix is the sum of the weights.
            (sum.w_axis.w > 0.0).then(|| sum * (1.0 / sum.w_axis.w))
        };
        let matrices: Option<Vec<DMat4>> = (0..count).map(blend).collect();
        if matrices.is_none() {
            self.warn("a skin refers to joints it does not have; drawn without it");
        }
        matrices
    }
}

pub(super) fn deform(mesh: &mut Mesh, world_from_vertex: &[DMat4]) {
    for (position, m) in mesh.positions.iter_mut().zip(world_from_vertex) {
        *position = m.transform_point3(*position);
    }
    if let Some(normals) = &mut mesh.normals {
        for (normal, m) in normals.values.iter_mut().zip(world_from_vertex) {
            *normal = crate::scene::normal_matrix(m) * *normal;
        }
    }
    // Tangents computed from texture coordinates are indexed by corner, those of the file by vertex.
    if let Some(Attribute { values, triangles }) = &mut mesh.tangents {
        let mut moved = vec![false; values.len()];
        let corners = triangles.as_ref().unwrap_or(&mesh.triangles).as_flattened();
        for (&tangent, &position) in corners.iter().zip(mesh.triangles.as_flattened()) {
            if !std::mem::replace(&mut moved[tangent as usize], true) {
                let value = &mut values[tangent as usize];
                *value = moved_tangent(&world_from_vertex[position as usize], *value);
            }
        }
    }
}

/// Whether the vertex colours of a primitive have an alpha channel.
fn has_alpha(primitive: &gltf::Primitive) -> bool {
    let colours = primitive.get(&gltf::Semantic::Colors(0));
    colours.is_some_and(|accessor| accessor.dimensions() == gltf::accessor::Dimensions::Vec4)
}

fn into_triangles(order: &[u32], mode: gltf::mesh::Mode) -> Vec<[u32; 3]> {
    use gltf::mesh::Mode;
    match mode {
        Mode::TriangleStrip => order
            .windows(3)
            .enumerate()
            .map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] })
            .collect(),
        Mode::TriangleFan => order.windows(2).skip(1).map(|w| [order[0], w[0], w[1]]).collect(),
        _ => order.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
    }
}

/// The texture coordinate sets of the textures of glTF's core model, or of KHR_materials_pbrSpecularGlossiness, but
/// occlusion.
fn core_sets(material: &gltf::Material) -> impl Iterator<Item = u32> {
    let pbr = material.pbr_metallic_roughness();
    let [colour, other] = if material.extension_value(specular_glossiness::NAME).is_some() {
        specular_glossiness::sets(material)
    } else {
        let other = pbr.metallic_roughness_texture().map(|t| t.tex_coord());
        [pbr.base_color_texture().map(|t| t.tex_coord()), other]
    };
    let normal = material.normal_texture().map(|t| t.tex_coord());
    let emission = material.emissive_texture().map(|t| t.tex_coord());
    [colour, normal, other, emission].into_iter().flatten()
}

/// The texture coordinate set that all textures of a material are looked up by: that of its first texture.
pub(super) fn texture_set(material: &gltf::Material) -> u32 {
    let occlusion = || material.occlusion_texture().map(|t| t.tex_coord());
    core_sets(material).next().or_else(|| layers::first_set(material)).or_else(occlusion).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans() {
        use gltf::mesh::Mode;
        let order = [5, 6, 7, 8];
        assert_eq!(into_triangles(&order, Mode::TriangleStrip), [[5, 6, 7], [7, 6, 8]]);
        assert_eq!(into_triangles(&order, Mode::TriangleFan), [[5, 6, 7], [5, 7, 8]]);
        assert_eq!(into_triangles(&order, Mode::Triangles), [[5, 6, 7]]);
        assert!(into_triangles(&[], Mode::TriangleFan).is_empty());
    }
}
