//! [`State`]: the structure, objects and scene of a mesh, which queries read.

use std::fmt::Display;
use std::sync::{Arc, OnceLock};

use kiln::bvh::{Bvh, CoarseRounding, Hit, InsideRule, Numerics, Preset, PrimId, Primitive, Ray};
use kiln::glam::{DVec2, DVec3};
use kiln::scene::Scene;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::threads::in_threads;
use crate::warn;

/// An immutable structure of the primitives of objects.
#[derive(Clone)]
pub(crate) struct State {
    pub bvh: Bvh,
    /// The number of primitives.
    pub primitives: usize,
    /// The objects, in the order of their primitives. One without primitives has the first of the next.
    pub objects: Vec<ObjectPart>,
    /// The scene of these objects, if they are of one.
    pub scene: Option<Arc<Scene>>,
    /// Of a mesh that is made from arrays.
    pub arrays: Option<Arc<Arrays>>,
    /// That of the parts of [`Instances`](crate::instances::Instances).
    pub version: u64,
    inside_rule: OnceLock<(InsideRule, usize)>,
}

/// What remains of the arrays that a mesh is made from.
pub(crate) struct Arrays {
    pub vertices: usize,
    pub faces: Vec<[u32; 3]>,
    pub preset: Preset,
}

/// The part of the primitives that is an object.
#[derive(Clone, Copy, Default)]
pub(crate) struct ObjectPart {
    /// Its index in a scene, or its number among instances.
    pub number: u32,
    /// Its first primitive.
    pub first: u32,
    /// Its index among the placements of the same mesh.
    pub instance: u32,
}

/// The tier and the preset with these names.
pub(crate) fn named(tier: &str, preset: &str) -> PyResult<(Numerics, Preset)> {
    let unknown = |argument: &str, given: &str, known: Vec<&str>| {
        PyValueError::new_err(format!("{argument}: `{given}` is none of {}", known.join(", ")))
    };
    // `fast` is for measurements: its rays may miss what they hit.
    let tiers = || Numerics::ALL.into_iter().filter(|numerics| *numerics != Numerics::Fast);
    let numerics = tiers().find(|numerics| numerics.name() == tier);
    let numerics = numerics.ok_or_else(|| unknown("tier", tier, tiers().map(Numerics::name).collect()))?;
    let known = Preset::named(preset);
    let preset = known.ok_or_else(|| unknown("preset", preset, Preset::ALL.map(Preset::name).to_vec()))?;
    Ok((numerics, preset))
}

/// Warns of primitives whose corners the tier rounds coarsely, with `prefix` before the text.
pub(crate) fn warn_of_rounding<I: Iterator<Item = Primitive>>(
    py: Python,
    numerics: Numerics,
    primitives: impl Fn() -> I + Send,
    prefix: &str,
) -> PyResult<()> {
    let rounding = py.detach(|| CoarseRounding::of(numerics, primitives));
    if rounding.triangles > 0 { warn(py, &format!("{prefix}{rounding}")) } else { Ok(()) }
}

/// The exception of a structure that is not built.
fn invalid(why: impl Display) -> PyErr {
    PyValueError::new_err(format!("vertices: {why}"))
}

/// The triangles of vertices.
fn corners(faces: &[[u32; 3]], vertices: &[[f64; 3]]) -> impl Iterator<Item = Primitive> + Send {
    faces.iter().map(|face| face.map(|index| vertices[index as usize]).into())
}

impl State {
    /// A state of objects alone.
    pub(crate) fn of(bvh: Bvh, primitives: usize, objects: Vec<ObjectPart>) -> Self {
        let inside_rule = OnceLock::new();
        State { bvh, primitives, objects, scene: None, arrays: None, version: 0, inside_rule }
    }

    /// The triangles of one object.
    pub(crate) fn of_triangles(
        py: Python,
        vertices: &[[f64; 3]],
        faces: Vec<[u32; 3]>,
        (numerics, preset): (Numerics, Preset),
    ) -> PyResult<Self> {
        // A copy, since other threads may change the array during the build.
        let vertices = vertices.to_vec();
        let bvh =
            in_threads(py, || Bvh::from_mesh_with(&vertices, &faces, preset, numerics))?.map_err(invalid)?;
        Self::of_object(py, bvh, &vertices, Arc::new(Arrays { vertices: vertices.len(), faces, preset }))
    }

    /// The same triangles of one object with other vertices.
    pub(crate) fn updated(&self, py: Python, vertices: &[[f64; 3]], arrays: &Arc<Arrays>) -> PyResult<Self> {
        let (mut bvh, vertices) = (self.bvh.clone(), vertices.to_vec());
        in_threads(py, || bvh.update_mesh(&vertices, &arrays.faces))?.map_err(invalid)?;
        Self::of_object(py, bvh, &vertices, Arc::clone(arrays))
    }

    /// The same state without what generalised winding numbers are computed from.
    pub(crate) fn lean(&self) -> Self {
        let mut lean = self.clone();
        lean.bvh.forget_expansions();
        lean
    }

    /// The structure of the triangles of one object. Warns of coarse rounding.
    fn of_object(py: Python, bvh: Bvh, vertices: &[[f64; 3]], arrays: Arc<Arrays>) -> PyResult<Self> {
        let faces = &arrays.faces;
        warn_of_rounding(py, bvh.accelerator().numerics(), || corners(faces, vertices), "")?;
        let state = State::of(bvh, faces.len(), vec![ObjectPart::default()]);
        Ok(State { arrays: Some(arrays), ..state })
    }

    /// The primitives of a scene.
    pub(crate) fn of_scene(
        py: Python,
        scene: Arc<Scene>,
        (numerics, preset): (Numerics, Preset),
    ) -> PyResult<Self> {
        let mut primitives = 0;
        let part = |(number, (object, instance)): (u32, (&kiln::scene::Object, u32))| {
            let first = primitives as u32;
            primitives += object.shape.primitive_count();
            ObjectPart { number, first, instance }
        };
        let objects = (0..).zip(scene.objects.iter().zip(scene.placement_indices())).map(part).collect();
        let bvh = in_threads(py, || scene.bvh_with(preset, numerics))?.map_err(invalid)?;
        warn_of_rounding(py, numerics, || scene.primitives(), "")?;
        Ok(State { scene: Some(scene), ..State::of(bvh, primitives, objects) })
    }

    /// What decides whether a point is inside, and the number of unbalanced edges. Found by the first call.
    pub(crate) fn inside_rule(&self, py: Python) -> PyResult<(InsideRule, usize)> {
        if let Some(known) = self.inside_rule.get() {
            return Ok(*known);
        }
        let found = in_threads(py, || (self.bvh.inside_rule(), self.bvh.unbalanced_edges()))?;
        Ok(*self.inside_rule.get_or_init(|| found))
    }

    /// The index of the object of a primitive, and that of the primitive in the object.
    #[inline]
    pub(crate) fn locate(&self, prim: PrimId) -> (usize, u32) {
        // Of objects with the same first primitive all but the last are empty.
        let object = match self.objects.len() {
            0 | 1 => 0,
            _ => self.objects.partition_point(|object| object.first <= prim.0).saturating_sub(1),
        };
        (object, prim.0 - self.objects[object].first)
    }

    /// The shading normal at a point of a primitive, on the side of `normal`.
    pub(crate) fn shading_normal(&self, prim: PrimId, barycentrics: [f64; 3], normal: DVec3) -> DVec3 {
        let Some(scene) = &self.scene else { return normal };
        let (object, primitive) = self.locate(prim);
        scene.objects[object].shape.shading_normal(primitive, barycentrics, normal)
    }

    /// The texture coordinates at a point of a primitive.
    pub(crate) fn uv(&self, prim: PrimId, barycentrics: [f64; 3]) -> Option<DVec2> {
        let (object, primitive) = self.locate(prim);
        self.scene.as_ref()?.objects[object].shape.uv(primitive, barycentrics, 0)
    }

    /// The index of the material of an object, if it is of a scene.
    pub(crate) fn material(&self, object: usize) -> Option<u32> {
        Some(self.scene.as_ref()?.objects[object].material.0)
    }

    /// Whether a ray hits the back of a primitive.
    pub(crate) fn is_back(&self, ray: &Ray, hit: &Hit) -> bool {
        // A triangle without area has neither side.
        self.bvh.geometric_normal(ray, hit).is_some_and(|normal| normal.dot(ray.direction()) > 0.0)
    }
}
