//! `kiln.Instances`: a mesh of parts that are placed by transforms.

use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, MutexGuard};

use kiln::bvh::{self, Bvh, Numerics, Placed, Placement};
use kiln::glam::{DMat4, DVec3};
use numpy::{PyReadonlyArray1, PyUntypedArrayMethods};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;

use crate::arrays::{
    ONE, SEVERAL, any, check_finite, check_rows, chunks, converted, matrices, numbers, triangles, vector,
    zeros,
};
use crate::mesh::Mesh;
use crate::state::{ObjectPart, State, named, warn_of_rounding};
use crate::threads::in_threads;

/// Meshes placed by transforms, which can be moved, added and removed: a Mesh, with all its queries.
///
/// Instances(*, tier="double", preset="balanced"), whose arguments are those of Mesh
///
/// Objects are numbered as they are added; numbers of removed ones are not used again. Hits have their number in
/// `.object`, their triangle in `.triangle`, and equal those on moved copies of the vertices, to the bit. The first query
/// after changes builds the trees of new objects, and one over all. Triangles of a mirrored object are turned over, so that its
/// outside stays outside. Queries that run, and their results, are of the earlier objects. Nothing is changed by a call
/// that raises.
#[pyclass(frozen, extends = Mesh, module = "kiln")]
pub(crate) struct Instances;

/// Meshes and transforms by the numbers of objects.
#[derive(Clone, Default)]
pub(crate) struct Parts {
    parts: BTreeMap<u32, Placed>,
    /// The number of the next object.
    next: u32,
    triangles: usize,
    /// The number of changes.
    pub version: u64,
}

impl Parts {
    /// The number of triangles.
    pub(crate) fn triangles(&self) -> usize {
        self.triangles
    }

    /// The state of these parts, whose meshes keep the trees that they have in `bvh`.
    pub(crate) fn state(&self, py: Python, mut bvh: Bvh) -> PyResult<State> {
        let (mut copies, mut primitives) = (HashMap::new(), 0);
        let part = |(&number, placed): (&u32, &Placed)| {
            let copies: &mut u32 = copies.entry(Arc::as_ptr(&placed.mesh)).or_default();
            let object = ObjectPart { number, first: primitives as u32, instance: *copies };
            *copies += 1;
            primitives += placed.triangle_count();
            object
        };
        let objects = self.parts.iter().map(part).collect();
        let placed: Vec<Placed> = self.parts.values().cloned().collect();
        let bvh = in_threads(py, || bvh.set_instances(&placed).map(|()| bvh))?;
        let bvh = bvh.map_err(|why| PyValueError::new_err(why.to_string()))?;
        let mut state = State::of(bvh, primitives, objects);
        state.version = self.version;
        Ok(state)
    }

    /// The object of a number.
    fn get(&self, object: i64) -> PyResult<(u32, &Placed)> {
        let number = u32::try_from(object).ok();
        let known = number.and_then(|number| Some((number, self.parts.get(&number)?)));
        known.ok_or_else(|| PyIndexError::new_err(format!("there is no object {object}")))
    }

    fn set(&mut self, number: u32, placed: Option<Placed>) {
        self.triangles += placed.as_ref().map_or(0, Placed::triangle_count);
        let before = match placed {
            Some(placed) => self.parts.insert(number, placed),
            None => self.parts.remove(&number),
        };
        self.triangles -= before.map_or(0, |before| before.triangle_count());
        self.next = self.next.max(number + 1);
    }
}

/// The parts of a change: their numbers, and what they become; `None` where they are removed.
type Change = Vec<(u32, Option<Placed>)>;

/// An error if a triangle is not finite where it is placed; a warning if the tier rounds it coarsely.
fn check(py: Python, numerics: Numerics, object: u32, placed: &Placed) -> PyResult<()> {
    let is_finite = |triangle: &u32| placed.corners_of(*triangle).iter().all(|p| p.as_vec3().is_finite());
    let mut all = 0..placed.triangle_count() as u32;
    let triangles = all.clone();
    if let Some(triangle) = py.detach(|| all.find(|triangle| !is_finite(triangle))) {
        return Err(PyValueError::new_err(format!(
            "triangle {triangle} of object {object} has a coordinate that is not finite where it is placed, or too \
             large for f32"
        )));
    }
    let primitives = || triangles.clone().map(move |i| placed.corners_of(i).into());
    warn_of_rounding(py, numerics, primitives, &format!("object {object}: "))
}

impl Instances {
    /// Changes the parts; nothing if that fails. Queries build the tree over them.
    fn edit<R>(slf: &Bound<Self>, change: impl Fn(&Parts) -> PyResult<(Change, R)>) -> PyResult<R> {
        let (py, mesh) = (slf.py(), slf.as_super().get());
        let numerics = mesh.last().bvh.accelerator().numerics();
        loop {
            let (version, (changed, result)) = {
                let parts = Instances::parts(mesh);
                (parts.version, change(&parts)?)
            };
            for (number, placed) in &changed {
                placed.as_ref().map_or(Ok(()), |placed| check(py, numerics, *number, placed))?;
            }
            // Another thread, or what shows a warning, may have changed them.
            let mut parts = Instances::parts(mesh);
            if parts.version == version {
                parts.version += 1;
                changed.into_iter().for_each(|(number, placed)| parts.set(number, placed));
                return Ok(result);
            }
        }
    }

    fn parts(mesh: &Mesh) -> MutexGuard<'_, Parts> {
        mesh.parts().expect("instances have parts")
    }

    /// The number of an object, or several, and the transform of each.
    fn transforms(objects: &Bound<PyAny>, transforms: &Bound<PyAny>) -> PyResult<Vec<(i64, Placement)>> {
        let objects = converted(objects, "objects", ("iu", "int64"))?.call_method1("reshape", (-1,))?;
        let objects: PyReadonlyArray1<i64> = objects.extract()?;
        let placements = matrices(transforms, "transforms", &[ONE, SEVERAL])?;
        check_rows(("transforms", placements.len()), ("objects", objects.len()))?;
        let placements = placements.into_iter().map(Placement::new);
        Ok(objects.as_slice()?.iter().copied().zip(placements).collect())
    }
}

#[pymethods]
impl Instances {
    #[new]
    #[pyo3(signature = (*, tier = "double", preset = "balanced"))]
    fn new(py: Python, tier: &str, preset: &str) -> PyResult<PyClassInitializer<Self>> {
        let (numerics, preset) = named(tier, preset)?;
        let nothing = Bvh::from_instances(&[], preset, numerics).expect("no triangle is wrong");
        let parts = Parts::default();
        let state = parts.state(py, nothing)?;
        Ok(PyClassInitializer::from(Mesh::of(state, Some(parts))).add_subclass(Instances))
    }

    /// Adds a mesh. Returns the number of the object.
    ///
    /// vertices: (n, 3) float64. faces: (m, 3) integers below n. transform: (4, 4) affine, world from mesh.
    #[pyo3(signature = (vertices, faces, transform = None))]
    fn add(
        slf: &Bound<Self>,
        vertices: &Bound<PyAny>,
        faces: &Bound<PyAny>,
        transform: Option<&Bound<PyAny>>,
    ) -> PyResult<u32> {
        let vertices = numbers(vertices, "vertices", 3)?;
        let triangles = triangles(faces, "faces", vertices.shape()[0])?;
        let transform = transform.map(|transform| matrices(transform, "transform", &[ONE])).transpose()?;
        let transform = transform.map_or(DMat4::IDENTITY, |one| one[0]);
        let positions = positions(chunks(&vertices)?)?;
        let mesh = bvh::Mesh { positions, triangles, ..bvh::Mesh::default() };
        let placed = Placed::new(Arc::new(mesh), Placement::new(transform));
        Instances::edit(slf, |parts| Ok((vec![(parts.next, Some(placed.clone()))], parts.next)))
    }

    /// Adds copies of an object, which share its vertices. Returns their numbers: (k,) int64.
    ///
    /// transforms: (k, 4, 4) affine, world from mesh; the object's own one has no part in them.
    fn add_copies<'py>(
        slf: &Bound<'py, Self>,
        object: i64,
        transforms: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let transforms = matrices(transforms, "transforms", &[SEVERAL])?;
        let numbers = Instances::edit(slf, |parts| {
            let mesh = &parts.get(object)?.1.mesh;
            let copy = |&transform: &DMat4| Some(Placed::new(mesh.clone(), Placement::new(transform)));
            let copies: Change = (parts.next..).zip(transforms.iter().map(copy)).collect();
            let numbers: Vec<i64> = copies.iter().map(|(number, _)| (*number).into()).collect();
            Ok((copies, numbers))
        })?;
        Ok(vector(slf.py(), numbers))
    }

    /// Moves objects.
    ///
    /// objects: the number of one, or (k,) integers. transforms: (4, 4), or (k, 4, 4), affine, world from mesh.
    fn set_transform(slf: &Bound<Self>, objects: &Bound<PyAny>, transforms: &Bound<PyAny>) -> PyResult<()> {
        let moved = Instances::transforms(objects, transforms)?;
        Instances::edit(slf, |parts| {
            let placed = |(object, placement): &(i64, Placement)| {
                let (number, placed) = parts.get(*object)?;
                Ok((number, Some(Placed::new(placed.mesh.clone(), placement.clone()))))
            };
            Ok((moved.iter().map(placed).collect::<PyResult<Change>>()?, ()))
        })
    }

    /// Removes an object. The numbers of others stay.
    fn remove(slf: &Bound<Self>, object: i64) -> PyResult<()> {
        Instances::edit(slf, |parts| {
            let (number, _) = parts.get(object)?;
            Ok((vec![(number, None)], ()))
        })
    }

    /// Moves the vertices of an object, before its transform, and of its copies. Their tree is built anew.
    ///
    /// vertices: float64 of the same shape as before. object: its number, which may be left out of one object.
    #[pyo3(signature = (vertices, object = None))]
    fn update(slf: &Bound<Self>, vertices: &Bound<PyAny>, object: Option<i64>) -> PyResult<()> {
        let vertices = numbers(vertices, "vertices", 3)?;
        let positions = positions(chunks(&vertices)?)?;
        Instances::edit(slf, |parts| {
            let mut known = parts.parts.keys();
            let object = match (object, known.next(), known.next()) {
                (Some(object), ..) => object,
                (None, Some(&object), None) => object.into(),
                _ => return Err(PyValueError::new_err("object: needed where there is not one object")),
            };
            let before = &parts.get(object)?.1.mesh;
            check_rows(("vertices", positions.len()), ("the object", before.positions.len()))?;
            let (triangles, positions) = (before.triangles.clone(), positions.clone());
            let mesh = Arc::new(bvh::Mesh { positions, triangles, ..bvh::Mesh::default() });
            let copies = parts.parts.iter().filter(|(_, placed)| Arc::ptr_eq(&placed.mesh, before));
            let moved = copies
                .map(|(&number, placed)| (number, Some(Placed::new(mesh.clone(), placed.placement.clone()))));
            Ok((moved.collect(), ()))
        })
    }

    /// The numbers of the objects: (n,) int64.
    #[getter]
    fn objects<'py>(slf: &Bound<'py, Self>) -> Bound<'py, PyAny> {
        let numbers: Vec<i64> =
            Instances::parts(slf.as_super().get()).parts.keys().map(|n| (*n).into()).collect();
        vector(slf.py(), numbers)
    }

    /// The transform of an object: (4, 4) float64, world from mesh.
    fn transform<'py>(slf: &Bound<'py, Self>, object: i64) -> PyResult<Bound<'py, PyAny>> {
        let (linear, offset) = Instances::parts(slf.as_super().get()).get(object)?.1.placement.as_one();
        let mut map = DMat4::from_mat3(linear);
        map.w_axis = offset.extend(1.0);
        let mut matrix = zeros::<f64, 2>(slf.py(), [4, 4])?;
        matrix.as_slice_mut()?.copy_from_slice(&map.transpose().to_cols_array());
        Ok(any(&matrix))
    }

    /// Instances of its own, which share memory with these.
    fn __copy__(slf: &Bound<Self>) -> PyResult<Py<Self>> {
        let copy = slf.as_super().get().copy();
        Py::new(slf.py(), PyClassInitializer::from(copy).add_subclass(Instances))
    }

    fn __deepcopy__(slf: &Bound<Self>, _memo: &Bound<PyAny>) -> PyResult<Py<Self>> {
        Instances::__copy__(slf)
    }

    fn __repr__(slf: &Bound<Self>) -> String {
        let tier = slf.as_super().get().last().bvh.accelerator().numerics().name();
        let parts = Instances::parts(slf.as_super().get());
        format!(
            "<kiln.Instances of {} objects, {} triangles, tier {tier}>",
            parts.parts.len(),
            parts.triangles
        )
    }
}

/// The vertices of an argument.
fn positions(rows: &[[f64; 3]]) -> PyResult<Vec<DVec3>> {
    check_finite(rows, "vertices")?;
    Ok(rows.iter().map(|&row| row.into()).collect())
}
