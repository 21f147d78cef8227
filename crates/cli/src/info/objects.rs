//! Objects: number of triangles, and whether each is closed.

use super::Lines;
use kiln::error::Result;
use kiln::scene::mesh::topology::Topology;
use kiln::scene::{Object, Scene, Shape};

/// Objects that the text lists.
const MOST: usize = 16;

/// Whether each object is closed; `None` where that is not known, and for one without triangles of
/// three distinct vertices.
pub(super) fn closed(scene: &Scene, topology: &Result<Topology>) -> Vec<Option<bool>> {
    let of_object = |(index, object): (usize, &Object)| match &object.shape {
        Shape::Analytic(shape) => Some(shape.is_closed()),
        Shape::Mesh(_) | Shape::Placed(_) => topology.as_ref().ok()?.closed_objects[index],
    };
    scene.objects.iter().enumerate().map(of_object).collect()
}

pub(super) fn triangles(object: &Object) -> usize {
    if object.shape.mesh().is_some() { object.shape.primitive_count() } else { 0 }
}

/// Adds a line for each object.
pub(super) fn add(lines: &mut Lines, scene: &Scene, topology: &Result<Topology>) {
    let closed = closed(scene, topology);
    for (object, closed) in scene.objects.iter().zip(&closed).take(MOST) {
        let kind = match &object.shape {
            Shape::Analytic(shape) => shape.name().to_owned(),
            Shape::Mesh(_) | Shape::Placed(_) => format!("{} triangles", triangles(object)),
        };
        let state = match closed {
            Some(true) => ", closed",
            Some(false) => ", open",
            None => "",
        };
        lines.add("object", format!("{}: {kind}{state}", object.name));
    }
    if let more @ 1.. = scene.objects.len().saturating_sub(MOST) {
        let closed = closed.iter().skip(MOST).filter(|closed| **closed == Some(true)).count();
        lines.add("object", format!("{more} more, {closed} of them closed; --json lists all"));
    }
}
