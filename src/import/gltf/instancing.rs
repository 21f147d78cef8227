//! Mesh instancing: nodes that share a mesh, and EXT_mesh_gpu_instancing, which gives a node several placements.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DMat4, DQuat, DVec3, DVec4};

use super::Loader;
use crate::error::{Error, Place, Result};
use crate::scene::{Mesh, Placed, Placement, Shape};

/// Name of the extension.
pub(crate) const NAME: &str = "EXT_mesh_gpu_instancing";

/// Cache of the meshes with several placements.
#[derive(Default)]
pub(super) struct SharedMeshes {
    /// Number of placements by mesh index.
    places: HashMap<usize, usize>,
    /// Meshes read so far, by mesh and primitive index.
    read: HashMap<(usize, usize), Option<Arc<Mesh>>>,
}

impl SharedMeshes {
    /// Adds placements of a mesh.
    pub(super) fn count(&mut self, mesh: &gltf::Mesh, places: usize) {
        *self.places.entry(mesh.index()).or_default() += places;
    }
}

/// The first accessor of the extension of a node, whose count is the number of placements; `None` without the
/// extension.
pub(super) fn first_accessor<'a>(
    node: &gltf::Node,
    document: &'a gltf::Document,
) -> Option<gltf::Accessor<'a>> {
    let attributes = node.extension_value(NAME)?.get("attributes")?;
    let index_of = |key: &str| attributes.get(key)?.as_u64();
    let index = ["TRANSLATION", "ROTATION", "SCALE"].into_iter().find_map(index_of)?;
    document.accessors().nth(usize::try_from(index).ok()?)
}

impl Loader<'_> {
    /// The shapes of a primitive in each of the given placements.
    pub(super) fn placed(
        &mut self,
        mesh: &gltf::Mesh,
        primitive: &gltf::Primitive,
        name: &str,
        weights: &[f64],
        places: &[DMat4],
    ) -> Result<Vec<Shape>> {
        let is_placed_once = self.shared.places.get(&mesh.index()).is_none_or(|&places| places < 2);
        // Nodes weigh the morph targets of a mesh differently.
        if is_placed_once || primitive.morph_targets().len() > 0 {
            let own = self.primitive(primitive, name, weights)?;
            let Some(own) = own else { return Ok(Vec::new()) };
            if let [world_from_mesh] = places {
                return Ok(vec![moved(own, world_from_mesh)]);
            }
            let own = Arc::new(own);
            let place =
                |matrix: &DMat4| Shape::Placed(Placed::new(Arc::clone(&own), Placement::new(*matrix)));
            return Ok(places.iter().map(place).collect());
        }
        let key = (mesh.index(), primitive.index());
        let shared = match self.shared.read.get(&key) {
            Some(shared) => shared.clone(),
            None => {
                let shared = self.primitive(primitive, name, weights)?.map(Arc::new);
                self.shared.read.insert(key, shared.clone());
                shared
            }
        };
        let place = |world_from_mesh: &DMat4| {
            Some(Shape::Placed(Placed::new(shared.clone()?, Placement::new(*world_from_mesh))))
        };
        Ok(places.iter().filter_map(place).collect())
    }

    /// The placements of a node's mesh: those of the extension, or the node's own transform.
    pub(super) fn places_of(
        &self,
        node: &gltf::Node,
        world_from_node: &DMat4,
        document: &gltf::Document,
    ) -> Result<Vec<DMat4>> {
        let Some(value) = node.extension_value(NAME) else { return Ok(vec![*world_from_node]) };
        let fault = |what: &str| {
            let item = Place::item(&self.source.file, format!("node {}, {NAME}", node.index()));
            Err(Error::input(item, what, "export the file again"))
        };
        let index_of =
            |key: &str| value.get("attributes").and_then(|attributes| attributes.get(key)?.as_u64());
        let accessors = ["TRANSLATION", "ROTATION", "SCALE"]
            .map(|key| index_of(key).map(|index| document.accessors().nth(index as usize)));
        if accessors.iter().any(|accessor| matches!(accessor, Some(None))) {
            return fault("it names an accessor that is not there");
        }
        let [translation, rotation, scale] = accessors.map(Option::flatten);
        let counts = [&translation, &rotation, &scale].map(|accessor| accessor.as_ref().map(|a| a.count()));
        let Some(count) = counts.into_iter().flatten().next() else {
            // Custom attributes alone do not place anything.
            let is_empty = value.get("attributes").and_then(|a| a.as_object()).is_none_or(|a| a.is_empty());
            return if is_empty { fault("has no attributes") } else { Ok(vec![*world_from_node]) };
        };
        if counts.into_iter().flatten().any(|other| other != count) {
            return fault("its attributes differ in number");
        }
        let vectors = |accessor: Option<gltf::Accessor>, default: DVec3| match accessor {
            None => Some(vec![default; count]),
            Some(accessor) => Some(self.vectors(&accessor)?.into_iter().map(DVec3::from_array).collect()),
        };
        let (Some(translations), Some(scales)) =
            (vectors(translation, DVec3::ZERO), vectors(scale, DVec3::ONE))
        else {
            return fault("its translations or scales are not three numbers each");
        };
        // A quaternion that is not normalised would scale.
        let unit = |q: [f64; 4]| DVec4::from(q).try_normalize().map_or(DQuat::IDENTITY, DQuat::from_vec4);
        let rotations: Option<Vec<DQuat>> = match rotation {
            None => Some(vec![DQuat::IDENTITY; count]),
            Some(accessor) => self.vectors(&accessor).map(|all| all.into_iter().map(unit).collect()),
        };
        let Some(rotations) = rotations else { return fault("its rotations are not quaternions") };
        Ok(translations
            .iter()
            .zip(&rotations)
            .zip(&scales)
            .map(|((translation, rotation), scale)| {
                *world_from_node * DMat4::from_scale_rotation_translation(*scale, *rotation, *translation)
            })
            .collect())
    }
}

fn moved(mut mesh: Mesh, world_from_mesh: &DMat4) -> Shape {
    mesh.transform(world_from_mesh);
    Shape::Mesh(mesh)
}
