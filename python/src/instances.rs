//! `kiln.Instances`: a mesh of parts that are placed by transforms.

use std::collections::HashMap;
use std::sync::Arc;

use kiln::bvh;
use kiln::bvh::{Bvh, InvalidMesh, NotFinite, Placed, Placement};
use kiln::glam::{DMat4, DVec3};
use numpy::{PyReadonlyArray1, PyUntypedArrayMethods};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;

use crate::arrays::{
    ONE, SEVERAL, any, check_finite, check_rows, chunks, converted, matrices, numbers, triangles, vector,
    zeros,
};
use crate::mesh::Mesh;
use crate::state::{ObjectPart, Parts, State, named, warn_of_rounding};
use crate::threads::in_threads;

/// Meshes placed by transforms, which can be moved, added and removed: a Mesh, with all its queries.
///
/// Instances(*, tier="double", preset="balanced"), whose arguments are those of Mesh
///
/// Objects are numbered as they are added; numbers of removed ones are not used again. Hits have their number in
/// `.object`, their triangle in `.triangle`, and equal those on moved copies of the vertices, to the bit but in tier
/// "fast". Moving an object, adding and removing one does not build the trees of others anew; `contains` and
/// `signed_distance` look at all edges again after it. Triangles of a mirrored object are turned over, so that its
/// outside stays outside. Queries that run, and their results, are of the earlier objects. Nothing is changed by a call
/// that raises.
#[pyclass(frozen, extends = Mesh, module = "kiln")]
pub(crate) struct Instances;

/// The state with these parts, whose meshes keep the trees that they have in `bvh`.
fn state_of(py: Python, mut bvh: Bvh, parts: Parts) -> PyResult<State> {
    let (mut objects, mut copies, mut primitives) = (Vec::new(), HashMap::new(), 0);
    for part in &parts {
        let mut object = ObjectPart { first: primitives as u32, instance: 0 };
        if let Some(placed) = part {
            let copies: &mut u32 = copies.entry(Arc::as_ptr(&placed.mesh)).or_default();
            object.instance = *copies;
            *copies += 1;
            primitives += placed.triangle_count();
        }
        objects.push(object);
    }
    let placed: Vec<Placed> = parts.iter().flatten().cloned().collect();
    let bvh = in_threads(py, || bvh.set_instances(&placed).map(|()| bvh))?;
    let locate = |primitive: usize| {
        let object = objects.partition_point(|object: &ObjectPart| object.first as usize <= primitive) - 1;
        (object, primitive - objects[object].first as usize)
    };
    let bvh = bvh.map_err(|why| match why {
        InvalidMesh::NotFinite(NotFinite::Primitive(primitive)) => {
            let (object, triangle) = locate(primitive);
            PyValueError::new_err(format!(
                "triangle {triangle} of object {object} has a coordinate that is not finite where it is placed, or too \
                 large for f32"
            ))
        }
        other => PyValueError::new_err(other.to_string()),
    })?;
    Ok(State { bvh, primitives, objects, scene: None, parts })
}

/// Warns of vertices of new and moved parts that the tier rounds coarsely.
fn warn_of_parts(py: Python, before: &Parts, state: &State) -> PyResult<()> {
    let numerics = state.bvh.accelerator().numerics();
    let is_same = |a: &Placed, b: &Placed| Arc::ptr_eq(&a.mesh, &b.mesh) && a.placement == b.placement;
    for (object, part) in state.parts.iter().enumerate() {
        let Some(placed) = part else { continue };
        if before.get(object).and_then(Option::as_ref).is_some_and(|before| is_same(before, placed)) {
            continue;
        }
        let triangles = || (0..placed.triangle_count() as u32).map(move |i| placed.corners_of(i).into());
        warn_of_rounding(py, numerics, triangles, &format!("object {object}: "))?;
    }
    Ok(())
}

/// The object of a number.
fn part_of(parts: &Parts, object: i64) -> PyResult<(usize, &Placed)> {
    let number = usize::try_from(object).ok();
    let known = number.and_then(|number| Some((number, parts.get(number)?.as_ref()?)));
    known.ok_or_else(|| PyIndexError::new_err(format!("there is no object {object}")))
}

impl Instances {
    /// Changes the parts by `change`, and the state that queries read; nothing if that fails.
    fn edit<R>(slf: &Bound<Self>, change: impl Fn(&mut Parts) -> PyResult<R>) -> PyResult<R> {
        let (py, mesh) = (slf.py(), slf.as_super().get());
        let mut built = None;
        loop {
            let before = mesh.now();
            let mut parts = before.parts.clone();
            let result = change(&mut parts)?;
            let bvh = built.take().unwrap_or_else(|| before.bvh.clone());
            let state = state_of(py, bvh, parts)?;
            warn_of_parts(py, &before.parts, &state)?;
            // Another thread, or what shows the warning, may have changed them. The trees that are built are kept.
            match mesh.replace_if(&before, state) {
                Ok(()) => return Ok(result),
                Err(state) => built = Some(state.bvh),
            }
        }
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
        let state = state_of(py, nothing, Vec::new())?;
        Ok(PyClassInitializer::from(Mesh::of(state)).add_subclass(Instances))
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
    ) -> PyResult<usize> {
        let vertices = numbers(vertices, "vertices", 3)?;
        let triangles = triangles(faces, "faces", vertices.shape()[0])?;
        let transform = transform.map(|transform| matrices(transform, "transform", &[ONE])).transpose()?;
        let transform = transform.map_or(DMat4::IDENTITY, |one| one[0]);
        let positions = positions(chunks(&vertices)?)?;
        let mesh = bvh::Mesh { positions, triangles, ..bvh::Mesh::default() };
        let placed = Placed::new(Arc::new(mesh), Placement::new(transform));
        Instances::edit(slf, |parts| {
            parts.push(Some(placed.clone()));
            Ok(parts.len() - 1)
        })
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
            let mesh = part_of(parts, object)?.1.mesh.clone();
            let copy = |&transform: &DMat4| Some(Placed::new(mesh.clone(), Placement::new(transform)));
            let first = parts.len();
            parts.extend(transforms.iter().map(copy));
            Ok((first as i64..parts.len() as i64).collect::<Vec<_>>())
        })?;
        Ok(vector(slf.py(), numbers))
    }

    /// Moves objects.
    ///
    /// objects: the number of one, or (k,) integers. transforms: (4, 4), or (k, 4, 4), affine, world from mesh.
    fn set_transform(slf: &Bound<Self>, objects: &Bound<PyAny>, transforms: &Bound<PyAny>) -> PyResult<()> {
        let moved = Instances::transforms(objects, transforms)?;
        Instances::edit(slf, |parts| {
            for (object, placement) in &moved {
                let (number, placed) = part_of(parts, *object)?;
                parts[number] = Some(Placed::new(placed.mesh.clone(), placement.clone()));
            }
            Ok(())
        })
    }

    /// Removes an object. The numbers of others stay.
    fn remove(slf: &Bound<Self>, object: i64) -> PyResult<()> {
        Instances::edit(slf, |parts| {
            let (number, _) = part_of(parts, object)?;
            parts[number] = None;
            Ok(())
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
            let mut known = (0..).zip(&*parts).filter(|(_, part)| part.is_some()).map(|(number, _)| number);
            let object = match (object, known.next(), known.next()) {
                (Some(object), ..) | (None, Some(object), None) => object,
                _ => return Err(PyValueError::new_err("object: needed where there is not one object")),
            };
            let before = part_of(parts, object)?.1.mesh.clone();
            check_rows(("vertices", positions.len()), ("the object", before.positions.len()))?;
            let (triangles, positions) = (before.triangles.clone(), positions.clone());
            let mesh = Arc::new(bvh::Mesh { positions, triangles, ..bvh::Mesh::default() });
            for placed in parts.iter_mut().flatten().filter(|placed| Arc::ptr_eq(&placed.mesh, &before)) {
                *placed = Placed::new(mesh.clone(), placed.placement.clone());
            }
            Ok(())
        })
    }

    /// The numbers of the objects: (n,) int64.
    #[getter]
    fn objects<'py>(slf: &Bound<'py, Self>) -> Bound<'py, PyAny> {
        let state = slf.as_super().get().now();
        let numbers = (0i64..).zip(&state.parts).filter(|(_, part)| part.is_some()).map(|(number, _)| number);
        vector(slf.py(), numbers.collect::<Vec<_>>())
    }

    /// The transform of an object: (4, 4) float64, world from mesh.
    fn transform<'py>(slf: &Bound<'py, Self>, object: i64) -> PyResult<Bound<'py, PyAny>> {
        let state = slf.as_super().get().now();
        let (linear, offset) = part_of(&state.parts, object)?.1.placement.as_one();
        let mut map = DMat4::from_mat3(linear);
        map.w_axis = offset.extend(1.0);
        let mut matrix = zeros::<f64, 2>(slf.py(), [4, 4])?;
        matrix.as_slice_mut()?.copy_from_slice(&map.transpose().to_cols_array());
        Ok(any(&matrix))
    }

    /// Instances of its own, which share memory with these.
    fn __copy__(slf: &Bound<Self>) -> PyResult<Py<Self>> {
        let copy = slf.as_super().get().__copy__();
        Py::new(slf.py(), PyClassInitializer::from(copy).add_subclass(Instances))
    }

    fn __deepcopy__(slf: &Bound<Self>, _memo: &Bound<PyAny>) -> PyResult<Py<Self>> {
        Instances::__copy__(slf)
    }

    fn __repr__(slf: &Bound<Self>) -> String {
        let state = slf.as_super().get().now();
        let objects = state.parts.iter().flatten().count();
        let tier = state.bvh.accelerator().numerics().name();
        format!("<kiln.Instances of {objects} objects, {} triangles, tier {tier}>", state.primitives)
    }
}

/// The vertices of an argument.
fn positions(rows: &[[f64; 3]]) -> PyResult<Vec<DVec3>> {
    check_finite(rows, "vertices")?;
    Ok(rows.iter().map(|&row| row.into()).collect())
}
