//! Topology of all meshes of a scene.

use std::collections::HashMap;
use std::sync::Arc;

use glam::DVec3;

use crate::error::{Error, Result};
use crate::limits;
use crate::scene::mesh::topology::{Findings, Topology, normals};
use crate::scene::{Mesh, Placed, Scene, Shape};

/// Upper bounds of the memory for a triangle and for a position, in bytes.
const BYTES: [u64; 2] = [176, 96];

impl Topology {
    /// Topology of the meshes of a scene. Those with a copy of their own are welded together, because importers split
    /// meshes by material. A mesh that several objects share is analysed once, by itself, and counted for each of them.
    ///
    /// # Errors
    /// [`Error::Memory`] if the analysis takes more memory than there is.
    pub fn of_scene(scene: &Scene) -> Result<Self> {
        let mut own: Vec<(usize, &Mesh)> = Vec::new();
        let mut shared: HashMap<*const Mesh, (usize, &Placed, usize)> = HashMap::new();
        for (index, object) in scene.objects.iter().enumerate() {
            match &object.shape {
                Shape::Analytic(_) => {}
                Shape::Mesh(mesh) => own.push((index, mesh)),
                Shape::Placed(placed) => {
                    shared.entry(Arc::as_ptr(&placed.mesh)).or_insert((index, placed, 0)).2 += 1;
                }
            }
        }
        // Errors name the first object that cannot be analysed.
        let mut shared: Vec<_> = shared.into_values().collect();
        shared.sort_unstable_by_key(|(object, ..)| *object);
        let sum = |count: fn(&Mesh) -> usize| own.iter().map(|(_, mesh)| count(mesh)).sum::<usize>();
        let together = [sum(|mesh| mesh.triangles.len()), sum(|mesh| mesh.positions.len())];
        let largest = shared.iter().map(|(_, placed, _)| &placed.mesh);
        let largest = largest.map(|mesh| [mesh.triangles.len(), mesh.positions.len()]);
        for count in largest.chain([together]) {
            check_memory(count)?;
        }
        let mut topology = of_meshes(&own, together);
        let mut closed_objects = vec![None; scene.objects.len()];
        own.iter()
            .zip(&topology.closed_objects)
            .for_each(|((index, _), closed)| closed_objects[*index] = *closed);
        let mut closed_meshes: HashMap<*const Mesh, Option<bool>> = HashMap::new();
        for (object, placed, places) in shared {
            let mut of_mesh = Topology::of_triangles(&placed.mesh.positions, &placed.mesh.triangles);
            of_mesh.opposed_to_normals = normals::opposed(&placed.mesh);
            for findings in of_mesh.all_findings() {
                if let Some(first) = &mut findings.first {
                    (first.object, first.position) = (object, placed.placement.point(first.position));
                }
            }
            topology.add(&mut of_mesh, places);
            closed_meshes.insert(Arc::as_ptr(&placed.mesh), of_mesh.closed_objects[0]);
        }
        for (object, closed) in scene.objects.iter().zip(&mut closed_objects) {
            if let Shape::Placed(placed) = &object.shape {
                *closed = closed_meshes[&Arc::as_ptr(&placed.mesh)];
            }
        }
        topology.closed_objects = closed_objects;
        Ok(topology)
    }

    fn all_findings(&mut self) -> [&mut Findings; 7] {
        [
            &mut self.boundary_edges,
            &mut self.non_manifold_edges,
            &mut self.inconsistent_edges,
            &mut self.t_junctions,
            &mut self.duplicate_triangles,
            &mut self.inverted_components,
            &mut self.opposed_to_normals,
        ]
    }

    /// Adds the topology of a mesh that is there several times.
    fn add(&mut self, other: &mut Topology, times: usize) {
        self.vertices += times * other.vertices;
        self.edges += times * other.edges;
        self.holes += times * other.holes;
        self.components += times * other.components;
        self.closed_components += times * other.closed_components;
        self.t_junctions_cut_off |= other.t_junctions_cut_off;
        for (findings, other) in self.all_findings().into_iter().zip(other.all_findings()) {
            findings.add_all(other, times);
        }
    }
}

impl Findings {
    fn add_all(&mut self, other: &Findings, times: usize) {
        self.count += times * other.count;
        self.first = self.first.or(other.first);
    }
}

/// Topology of meshes as one, with as many triangles and positions as stated.
fn of_meshes(meshes: &[(usize, &Mesh)], [triangle_count, position_count]: [usize; 2]) -> Topology {
    let mut positions: Vec<DVec3> = Vec::with_capacity(position_count);
    let mut triangles: Vec<[u32; 3]> = Vec::with_capacity(triangle_count);
    let mut firsts: Vec<u32> = Vec::with_capacity(meshes.len());
    let mut opposed = Findings::default();
    for (object, mesh) in meshes {
        firsts.push(triangles.len() as u32);
        let first = positions.len() as u32;
        positions.extend_from_slice(&mesh.positions);
        triangles.extend(mesh.triangles.iter().map(|t| mesh.front(*t).map(|corner| first + corner)));
        let mut own = normals::opposed(mesh);
        if let Some(first) = &mut own.first {
            first.object = *object;
        }
        opposed.add_all(&own, 1);
    }
    let mut topology = Topology::of_objects(&positions, &triangles, &firsts);
    for findings in topology.all_findings() {
        if let Some(first) = &mut findings.first {
            // Of meshes with the same first triangle all but the last are empty.
            let mesh = firsts.partition_point(|&start| start <= first.triangle) - 1;
            (first.object, first.triangle) = (meshes[mesh].0, first.triangle - firsts[mesh]);
        }
    }
    topology.opposed_to_normals = opposed;
    topology
}

fn check_memory([triangles, positions]: [usize; 2]) -> Result<()> {
    let what = format!("the analysis of {triangles} triangles and {positions} vertices");
    if u32::try_from(triangles.max(positions)).is_err() {
        let what = format!("{what} takes more indices than 32 bits have");
        return Err(Error::Failed { what, hint: String::new() });
    }
    let bytes = [triangles, positions].map(|count| count as u64);
    let bytes = limits::product(&[bytes[0], BYTES[0]]).saturating_add(limits::product(&[bytes[1], BYTES[1]]));
    limits::check(bytes)
        .map_err(|excess| Error::Memory { what: format!("{what} {excess}"), hint: excess.remedy() })
}
