//! Meshes: positions, indices, attributes and skins.

use glam::{DMat4, DVec3, DVec4};
use gltf::Semantic;
use gltf::accessor::{DataType, Dimensions};

use crate::error::Result;
use crate::import::formats::gltf::Loader;
use crate::import::formats::gltf::check::{NodePlace, fault, is_allowed};
use crate::import::meshes::tangents::{make_tangents, normals_of_triangles};
use crate::scene::{Attribute, Material, Mesh, is_mirror, moved_tangent};

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
            self.left_out(format!("{name}: points and lines are not drawn"));
            return Ok(None);
        }
        let fault =
            |what: &str| fault(&self.source.file, format!("{name}, primitive {}", primitive.index()), what);
        let Some(positions) = primitive.get(&Semantic::Positions) else {
            self.left_out(format!("{name}: a mesh without positions is not drawn"));
            return Ok(None);
        };
        let positions =
            self.dvec3s(&positions).ok_or_else(|| fault("its positions lie outside their buffer"))?;
        let count = positions.len();
        let order: Vec<u32> = match primitive.indices() {
            Some(indices) => {
                let indices = self.vectors::<1>(&indices);
                let indices = indices.ok_or_else(|| fault("its indices lie outside their buffer"))?;
                indices.into_iter().map(|[index]| index as u32).collect()
            }
            None => (0..count as u32).collect(),
        };
        // Compressed indices are those of separate triangles, whatever the mode.
        let is_decoded =
            primitive.indices().is_some_and(|indices| self.decoded.contains_key(&indices.index()));
        let mode = if is_decoded { Mode::Triangles } else { primitive.mode() };
        let mut triangles = into_triangles(&order, mode);
        let before = triangles.len();
        triangles.retain(|t| t.iter().all(|&i| (i as usize) < count));
        let out_of_range = before - triangles.len();

        let material = primitive.material();
        let (colours, alphas) = self.colours(primitive);
        let normals = self.attribute(primitive, &Semantic::Normals).and_then(|normals| self.dvec3s(&normals));
        let normals = normals.filter(|normals| normals.len() == count);
        let known = material.index().and_then(|index| self.scene.materials.get(index));
        let tangent_coordinates = known.and_then(Material::tangent_coordinates);
        // Tangents without normals are ignored (glTF 2.0, section 3.7.2.1).
        let tangents = self
            .attribute(primitive, &Semantic::Tangents)
            .filter(|_| normals.is_some() && tangent_coordinates.is_some())
            .and_then(|tangents| self.vectors(&tangents));
        let tangents = tangents.map(|all| all.into_iter().map(DVec4::from_array).collect::<Vec<_>>());
        let differing = primitive.attributes().filter(|(_, accessor)| accessor.count() != count).count();
        if differing > 0 {
            self.left_out(format!(
                "{name}: {differing} attribute(s) of another count than its positions are not used"
            ));
        }
        let mut mesh = Mesh {
            tangents: tangents.filter(|v| v.len() == count).map(Attribute::per_position),
            normals: normals.map(Attribute::per_position),
            uvs: self.uvs(primitive, name, count),
            colours: colours.filter(|v| v.len() == count).map(Attribute::per_position),
            alphas: alphas.filter(|v| v.len() == count).map(Attribute::per_position),
            positions,
            triangles,
            is_mirrored: false,
        };
        if !self.morph(primitive, weights, &mut mesh) {
            self.left_out(format!(
                "{name}: morph targets that differ from its positions in number are left out"
            ));
        }
        if let Some(coordinates) = tangent_coordinates {
            make_tangents(&mut mesh, coordinates);
        }
        if out_of_range > 0 {
            self.left_out(format!("{name}: left out {out_of_range} triangle(s) with an index out of range"));
        }
        Ok(Some(mesh))
    }

    /// The accessor of an attribute of a type that it may have.
    pub(super) fn attribute<'b>(
        &self,
        primitive: &gltf::Primitive<'b>,
        semantic: &Semantic,
    ) -> Option<gltf::Accessor<'b>> {
        primitive.get(semantic).filter(|accessor| is_allowed(semantic, accessor))
    }

    /// The elements of an accessor of three components.
    fn dvec3s(&self, accessor: &gltf::Accessor) -> Option<Vec<DVec3>> {
        Some(self.vectors(accessor)?.into_iter().map(DVec3::from_array).collect())
    }

    /// The colours of vertices, and, where the material is not opaque, their opacities.
    fn colours(&self, primitive: &gltf::Primitive) -> (Option<Vec<DVec3>>, Option<Vec<f64>>) {
        let Some(accessor) = self.attribute(primitive, &Semantic::Colors(0)) else { return (None, None) };
        // Integers are normalised, whether the accessor says so or not (section 3.7.2.1).
        let scale = match accessor.data_type() {
            DataType::U8 if !accessor.normalized() => 255.0,
            DataType::U16 if !accessor.normalized() => 65535.0,
            _ => 1.0,
        };
        if accessor.dimensions() == Dimensions::Vec3 {
            let colours = self.dvec3s(&accessor);
            return (colours.map(|all| all.into_iter().map(|colour| colour / scale).collect()), None);
        }
        let Some(all) = self.vectors::<4>(&accessor) else { return (None, None) };
        let is_opaque = primitive.material().alpha_mode() == gltf::material::AlphaMode::Opaque;
        let alphas = (!is_opaque).then(|| all.iter().map(|[.., alpha]| alpha / scale).collect());
        (Some(all.into_iter().map(|[r, g, b, _]| DVec3::new(r, g, b) / scale).collect()), alphas)
    }

    /// Adds the displacements of morph targets by their weights (glTF 2.0, section 3.7.2.2). Returns whether all fit.
    fn morph(&self, primitive: &gltf::Primitive, weights: &[f64], mesh: &mut Mesh) -> bool {
        let count = mesh.positions.len();
        let mut all_fit = true;
        for (target, &weight) in primitive.morph_targets().zip(weights) {
            if weight == 0.0 || !weight.is_finite() {
                continue;
            }
            let accessors = [target.positions(), target.normals(), target.tangents()];
            if accessors.iter().flatten().any(|accessor| accessor.count() != count) {
                all_fit = false;
                continue;
            }
            let read = |accessor: Option<gltf::Accessor>| {
                accessor.map_or(Some(Vec::new()), |accessor| self.dvec3s(&accessor))
            };
            let [Some(positions), Some(normals), Some(tangents)] = accessors.map(read) else {
                all_fit = false;
                continue;
            };
            let by = |values: Vec<DVec3>| values.into_iter().map(move |value| value * weight);
            mesh.positions.iter_mut().zip(by(positions)).for_each(|(position, value)| *position += value);
            let of_mesh = mesh.normals.iter_mut().flat_map(|normals| &mut normals.values);
            of_mesh.zip(by(normals)).for_each(|(normal, value)| *normal += value);
            let of_mesh = mesh.tangents.iter_mut().flat_map(|tangents| &mut tangents.values);
            of_mesh.zip(by(tangents)).for_each(|(tangent, value)| *tangent += value.extend(0.0));
        }
        // After the sum over all targets (glTF 2.0, section 3.7.2.2).
        for normal in mesh.normals.iter_mut().flat_map(|normals| &mut normals.values) {
            *normal = normal.try_normalize().unwrap_or(*normal);
        }
        all_fit
    }

    /// Skinning matrix of each vertex, from the pose of a skin's joints (glTF 2.0, section 3.7.3).
    pub(super) fn pose(
        &mut self,
        skin: &gltf::Skin,
        primitive: &gltf::Primitive,
        nodes: &[Option<NodePlace>],
    ) -> Option<Vec<DMat4>> {
        // Each set has four joints a vertex.
        let sets: Vec<_> = (0..)
            .map_while(|set| {
                let joints = self.vectors::<4>(&self.attribute(primitive, &Semantic::Joints(set))?)?;
                Some((joints, self.vectors::<4>(&self.attribute(primitive, &Semantic::Weights(set))?)?))
            })
            .collect();
        let vertices = primitive.get(&Semantic::Positions)?.count();
        if sets.iter().any(|(joints, weights)| joints.len().min(weights.len()) < vertices) {
            self.left_out("a skin has fewer joints or weights than the mesh has positions; drawn without it");
            return None;
        }
        sets.first()?;
        let inverse_binds = skin.inverse_bind_matrices().and_then(|accessor| self.vectors::<16>(&accessor));
        if skin.joints().any(|joint| nodes[joint.index()].is_none()) {
            self.left_out("a skin has joints outside the scene; drawn as if they stood at the origin");
        }
        let world_from_mesh: Vec<DMat4> = skin
            .joints()
            .enumerate()
            .map(|(i, joint)| {
                let place = nodes[joint.index()].as_ref();
                let world_from_joint = place.map_or(DMat4::IDENTITY, |place| place.world_from_node);
                let inverse_bind = inverse_binds.as_ref().and_then(|matrices| matrices.get(i));
                world_from_joint * inverse_bind.map_or(DMat4::IDENTITY, DMat4::from_cols_array)
            })
            .collect();
        let blend = |vertex: usize| {
            let mut sum = DMat4::ZERO;
            for (joints, weights) in &sets {
                for (&joint, &weight) in joints[vertex].iter().zip(&weights[vertex]) {
                    sum += *world_from_mesh.get(joint as usize)? * weight;
                }
            }
            // The w component of the blended matrix is the sum of the weights. A vertex without weights moves with the
            // first joint.
            let first = world_from_mesh.first().copied();
            if sum.w_axis.w > 0.0 { Some(sum * (1.0 / sum.w_axis.w)) } else { first }
        };
        let matrices: Option<Vec<DMat4>> = (0..vertices).map(blend).collect();
        if matrices.is_none() {
            self.left_out("a skin refers to joints it does not have; drawn without it");
        }
        matrices
    }
}

/// Moves each vertex by its own transform. A triangle is mirrored if the transforms of most of its vertices are.
pub(super) fn deform(mesh: &mut Mesh, world_from_vertex: &[DMat4]) {
    for (position, m) in mesh.positions.iter_mut().zip(world_from_vertex) {
        *position = m.transform_point3(*position);
    }
    // Normals and tangents of the file are indexed by position, computed ones by corner.
    if let Some(Attribute { values, triangles: None }) = &mut mesh.normals {
        for (normal, m) in values.iter_mut().zip(world_from_vertex) {
            *normal = crate::scene::normal_matrix(m) * *normal;
        }
    }
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
    turn_mirrored(mesh, world_from_vertex);
    if mesh.normals.as_ref().is_some_and(|normals| normals.triangles.is_some()) {
        mesh.normals = Some(normals_of_triangles(mesh));
    }
}

/// Sets [`Mesh::is_mirrored`] by the first triangle, and reverses the winding of triangles that differ from it.
fn turn_mirrored(mesh: &mut Mesh, world_from_vertex: &[DMat4]) {
    let mirrors: Vec<bool> = world_from_vertex.iter().map(is_mirror).collect();
    let is_mirrored =
        |triangle: &[u32; 3]| triangle.iter().filter(|&&vertex| mirrors[vertex as usize]).count() >= 2;
    let is_first_mirrored = mesh.triangles.first().is_some_and(is_mirrored);
    mesh.is_mirrored ^= is_first_mirrored;
    let differ = |triangle: &[u32; 3]| is_mirrored(triangle) != is_first_mirrored;
    let turned: Vec<usize> = (0..mesh.triangles.len()).filter(|&i| differ(&mesh.triangles[i])).collect();
    let Mesh { triangles, normals, uvs, colours, alphas, tangents, .. } = mesh;
    let attributes = [
        normals.as_mut().and_then(|all| all.triangles.as_mut()),
        colours.as_mut().and_then(|all| all.triangles.as_mut()),
        alphas.as_mut().and_then(|all| all.triangles.as_mut()),
        tangents.as_mut().and_then(|all| all.triangles.as_mut()),
    ];
    let of_uvs = uvs.iter_mut().filter_map(|all| all.triangles.as_mut());
    for corners in std::iter::once(triangles).chain(attributes.into_iter().flatten()).chain(of_uvs) {
        turned.iter().for_each(|&triangle| corners[triangle].swap(1, 2));
    }
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
