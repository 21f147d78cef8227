//! `kiln.Mesh`: ray and point queries of triangles.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};

use kiln::bvh::{
    Bvh, Closedness, ClosestPoint, InsideRule, PrimId, Primitive, RayList, Side, SignedHit, Traversal,
};
use kiln::glam::DVec3;
use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::{PyAttributeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};
use rayon::prelude::*;

use crate::arrays::{
    any, check_finite, check_rows, chunks, in_shape, numbers, rows, triangles, vector, vectors, vectors_of,
    zeros,
};
use crate::hits::{Columns, Found, result, set};
use crate::instances::Parts;
use crate::rays::{FEW, Filter, RayArguments, lists_of};
use crate::state::{Arrays, State, named};
use crate::threads::{POINTS, RAYS, in_ranges, in_threads};
use crate::warn;

/// Triangles for ray and point queries, for any number of threads.
///
/// Mesh(vertices, faces, *, tier="double", preset="balanced")
///
/// vertices: (n, 3) float64, finite in f32. faces: (m, 3) integers below n, counterclockwise seen from the front.
/// tier: the arithmetic that decides hits: "watertight" (vertices rounded to f32, with a warning where that merges
/// vertices or planes, or turns triangles over), "double" (vertices in f64) or "exact" (for the ray with its direction
/// normalised, which rounds). preset: "fast-build", "balanced" or "best-trace".
///
/// Distances are in the units of the vertices; directions need not have length 1. Queries release the GIL and use all
/// threads (RAYON_NUM_THREADS). Raises ValueError for arguments of another shape or type and for numbers that are not
/// finite. Where (n, 3) is said, any shape (..., 3) is taken, results have its leading dimensions, and one vector (3,)
/// of origins or directions goes with all rays.
#[pyclass(frozen, subclass, module = "kiln")]
pub(crate) struct Mesh {
    /// What queries read: each takes it once. Replaced as a whole, and locked for that alone.
    state: RwLock<Arc<State>>,
    /// The parts of [`Instances`](crate::instances::Instances), of which the state may be an earlier one. Locked as
    /// briefly, with the GIL and without a call of Python.
    parts: Option<Mutex<Parts>>,
}

/// The points of an argument.
struct Points<'py> {
    rows: PyReadonlyArray2<'py, f64>,
    /// Their shape without the dimension of vectors.
    shape: Vec<usize>,
}

impl<'py> Points<'py> {
    fn new(points: &Bound<'py, PyAny>) -> PyResult<Self> {
        let (rows, shape) = vectors_of(points, "points")?;
        check_finite::<3>(chunks(&rows)?, "points")?;
        Ok(Points { rows, shape })
    }

    fn get(&self) -> PyResult<&[DVec3]> {
        Ok(bytemuck::cast_slice(chunks::<3>(&self.rows)?))
    }

    /// The results of a query for all points; of few, by the calling thread. Of many, `query` takes them along a curve.
    fn results<R: Copy + Send + Sync>(
        &self,
        single: impl Fn(DVec3, &mut Traversal) -> R + Sync,
        query: impl Fn(&[DVec3]) -> Vec<R> + Sync,
    ) -> PyResult<Vec<R>> {
        let (py, points) = (self.rows.py(), self.get()?);
        if points.len() <= FEW {
            let traversal = &mut Traversal::default();
            return Ok(py.detach(|| points.iter().map(|point| single(*point, traversal)).collect()));
        }
        let order = in_threads(py, || along_curve(points))?;
        let sorted: Vec<DVec3> = order.iter().map(|index| points[*index as usize]).collect();
        let mut found = Vec::with_capacity(points.len());
        in_ranges(py, (points.len(), POINTS), |range| found.extend(query(&sorted[range])))?;
        drop(sorted);
        let mut places = vec![0; order.len()];
        (0..).zip(order).for_each(|(place, index): (u32, u32)| places[index as usize] = place);
        Ok(places.into_iter().map(|place| found[place as usize]).collect())
    }
}

/// The least and the greatest coordinates of points.
fn span(points: &[DVec3]) -> [DVec3; 2] {
    let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    points.iter().fold(none, |[min, max], point| [min.min(*point), max.max(*point)])
}

/// The indices of finite points along a Morton curve through a grid of 2^30 cells, so that neighbours follow each other.
fn along_curve(points: &[DVec3]) -> Vec<u32> {
    let [min, max] = span(points);
    let scale = 1023.5 / (max - min).max_element();
    // Two zeros before each of ten bits.
    let spread = |x: f64| {
        [(16, 0x0300_00ff), (8, 0x0300_f00f), (4, 0x030c_30c3), (2, 0x0924_9249)]
            .into_iter()
            // NaN, of equal coordinates, becomes 0.
            .fold((x as u64).min(1023), |x, (shift, mask)| (x | x << shift) & mask)
    };
    let key = |(index, point): (usize, &DVec3)| {
        let [x, y, z] = ((*point - min) * scale).to_array().map(spread);
        (x << 2 | y << 1 | z) << 32 | index as u64
    };
    let mut keys: Vec<u64> = points.par_iter().enumerate().map(key).collect();
    keys.par_sort_unstable();
    keys.into_iter().map(|key| key as u32).collect()
}

/// A maximum distance from a point; infinite if it is not given.
fn max_distance_of(value: Option<f64>) -> PyResult<f64> {
    match value {
        None => Ok(f64::INFINITY),
        Some(distance) if distance >= 0.0 => Ok(distance),
        Some(distance) => Err(PyValueError::new_err(format!("max_distance: {distance} is not 0 or more"))),
    }
}

impl Mesh {
    /// A mesh whose queries read `state`, or one of these parts.
    pub(crate) fn of(state: State, parts: Option<Parts>) -> Self {
        Mesh { state: RwLock::new(Arc::new(state)), parts: parts.map(Mutex::new) }
    }

    /// What a query that begins now reads. Builds the tree over parts that have changed.
    pub(crate) fn now(&self, py: Python) -> PyResult<Arc<State>> {
        let state = self.last();
        let changed = self.parts().filter(|parts| parts.version != state.version).map(|parts| parts.clone());
        match changed {
            None => Ok(state),
            Some(parts) => self.replace(parts.state(py, state.bvh.clone())?),
        }
    }

    /// The last state that was built.
    pub(crate) fn last(&self) -> Arc<State> {
        Arc::clone(&self.state.read().unwrap_or_else(PoisonError::into_inner))
    }

    pub(crate) fn parts(&self) -> Option<MutexGuard<'_, Parts>> {
        self.parts.as_ref().map(|parts| parts.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Replaces what later queries read, unless that is of later parts. Returns `state`.
    fn replace(&self, state: State) -> PyResult<Arc<State>> {
        let (state, mut other) = (Arc::new(state), self.last());
        let mut now = self.state.write().unwrap_or_else(PoisonError::into_inner);
        if now.version <= state.version {
            other = std::mem::replace(&mut *now, Arc::clone(&state));
        }
        // The lock is released before the earlier state is dropped.
        drop(now);
        drop(other);
        Ok(state)
    }

    /// A mesh of the same class, which shares the state.
    pub(crate) fn copy(&self) -> Self {
        let parts = self.parts().map(|parts| Mutex::new(parts.clone()));
        Mesh { state: RwLock::new(self.last()), parts }
    }

    /// The arrays that it is made from.
    fn arrays(&self) -> Option<Arc<Arrays>> {
        self.last().arrays.clone()
    }

    /// The vertices of [`Mesh::arrays`], as they are stored. Those without a face are 0.
    fn positions(&self, arrays: &Arrays) -> Vec<[f64; 3]> {
        let mut vertices = vec![[0.0; 3]; arrays.vertices];
        self.last().bvh.accelerator().each_primitive(&mut |prim, primitive| {
            if let Primitive::Triangle(triangle) = primitive {
                for (index, corner) in arrays.faces[prim.0 as usize].into_iter().zip(triangle.0) {
                    vertices[index as usize] = corner.to_array();
                }
            }
        });
        vertices
    }

    /// The results of `query` for the points, and the shape of these without the dimension of vectors. Before that,
    /// warns of a surface that is not closed, if `warning` returns text on what that means.
    fn with_points<R: Copy + Send + Sync>(
        &self,
        points: &Bound<PyAny>,
        warning: impl FnOnce(InsideRule) -> Option<&'static str>,
        single: impl Fn(&Bvh, DVec3, &mut Traversal) -> R + Sync,
        query: impl Fn(&Bvh, &[DVec3]) -> Vec<R> + Sync,
    ) -> PyResult<(Vec<R>, Vec<usize>)> {
        let (py, points) = (points.py(), Points::new(points)?);
        let state = self.now(py)?;
        let (bvh, (rule, edges)) = (&state.bvh, state.inside_rule(py)?);
        if let Some(text) = warning(rule) {
            let what = "the surface is not closed";
            warn(
                py,
                &format!(
                    "{what}: {edges} edges are used more often in one direction than in the other; {text}"
                ),
            )?;
        }
        let found =
            points.results(|point, traversal| single(bvh, point, traversal), |points| query(bvh, points))?;
        Ok((found, points.shape))
    }
}

/// How it is decided what is inside of a surface that is not closed.
fn inside_rule(rule: InsideRule) -> Option<&'static str> {
    match rule {
        InsideRule::Crossings => None,
        InsideRule::Vote => {
            Some("triangles are wound in opposite directions, so a vote of three rays says what is inside")
        }
        InsideRule::GeneralisedWindingNumber => Some(
            "the generalised winding number says what is inside, contains(points, return_margin=True) how certain \
             that is",
        ),
    }
}

#[pymethods]
impl Mesh {
    #[new]
    #[pyo3(signature = (vertices, faces, *, tier = "double", preset = "balanced"))]
    fn new(vertices: &Bound<PyAny>, faces: &Bound<PyAny>, tier: &str, preset: &str) -> PyResult<Self> {
        let py = vertices.py();
        let vertices = numbers(vertices, "vertices", 3)?;
        // Before the vertices are borrowed: conversions may call Python, which may change them.
        let faces = triangles(faces, "faces", vertices.shape()[0])?;
        let vertices: &[[f64; 3]] = chunks(&vertices)?;
        check_finite(vertices, "vertices")?;
        Ok(Mesh::of(State::of_triangles(py, vertices, faces, named(tier, preset)?)?, None))
    }

    /// Moves the vertices of a mesh that was made from arrays. The tree is refitted, or built anew where that would
    /// make queries slow; hits are those of a new mesh. Queries that run, and their results, are of the earlier
    /// positions. The mesh is unchanged if it raises.
    ///
    /// vertices: float64 of the same shape as before.
    fn update(&self, vertices: &Bound<PyAny>) -> PyResult<()> {
        let py = vertices.py();
        let Some(arrays) = self.arrays() else {
            return Err(PyValueError::new_err("only a mesh of vertices and faces is updated by vertices"));
        };
        let vertices = numbers(vertices, "vertices", 3)?;
        let vertices: &[[f64; 3]] = chunks(&vertices)?;
        check_rows(("vertices", vertices.len()), ("the mesh", arrays.vertices))?;
        check_finite(vertices, "vertices")?;
        // Before another structure is built: that of two million triangles takes 200 MiB, expansions as much.
        let lean = self.replace(self.last().lean())?;
        self.replace(lean.updated(py, vertices, &arrays)?).map(|_| ())
    }

    /// A mesh of its own; it shares memory with this one until either is updated.
    fn __copy__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let py = slf.py();
        if slf.get_type().is(py.get_type::<Mesh>()) {
            return Ok(Bound::new(py, slf.get().copy())?.into_any());
        }
        let nothing = PyList::empty(py);
        let copy = py.get_type::<Mesh>().call_method1("__new__", (slf.get_type(), &nothing, &nothing))?;
        copy.cast::<Mesh>()?.get().replace(State::clone(&slf.get().last()))?;
        if let Some(own) = slf.getattr_opt("__dict__")? {
            copy.getattr("__dict__")?.call_method1("update", (own,))?;
        }
        Ok(copy)
    }

    fn __deepcopy__<'py>(slf: &Bound<'py, Self>, _memo: &Bound<PyAny>) -> PyResult<Bound<'py, PyAny>> {
        Mesh::__copy__(slf)
    }

    /// For pickle: the arrays as they are now, with vertices in the precision of the tier, and the attributes of an
    /// instance of a subclass.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let (py, mesh) = (slf.py(), slf.get());
        let Some(arrays) = mesh.arrays() else {
            let what = format!("cannot pickle '{}': it is not made of vertices and faces", slf.get_type());
            return Err(PyTypeError::new_err(what));
        };
        let options = PyDict::new(py);
        options.set_item("tier", mesh.tier())?;
        options.set_item("preset", arrays.preset.name())?;
        let new = py.import("copyreg")?.getattr("__newobj_ex__")?;
        let made_of = (rows(py, mesh.positions(&arrays))?, faces_of(py, &arrays)?);
        let attributes = slf.getattr_opt("__dict__")?;
        (new, (slf.get_type(), made_of, options), attributes).into_pyobject(py)
    }

    /// The vertices that the mesh is made from, as they are now: (n, 3) float64, in the precision of the tier. Those
    /// without a face are 0.
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let arrays = self.arrays().ok_or_else(|| not_of_arrays("vertices"))?;
        rows(py, py.detach(|| self.positions(&arrays)))
    }

    /// The vertex indices that the mesh is made from: (m, 3) uint32, counterclockwise seen from the front.
    #[getter]
    fn faces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let arrays = self.arrays().ok_or_else(|| not_of_arrays("faces"))?;
        faces_of(py, &arrays)
    }

    /// The least and the greatest corner of the bounding box: (2, 3) float64; None without triangles. Of spheres and
    /// disks rounded outwards to f32.
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let state = self.now(py)?;
        let [mut min, mut max] = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        py.detach(|| {
            state.bvh.accelerator().each_primitive(&mut |_, primitive| {
                let [low, high] = match primitive {
                    Primitive::Triangle(triangle) => span(&triangle.0),
                    other => [other.bounds().min.as_dvec3(), other.bounds().max.as_dvec3()],
                };
                (min, max) = (min.min(low), max.max(high));
            });
        });
        let corners = (min.x <= max.x).then(|| rows(py, vec![min.to_array(), max.to_array()]));
        corners.transpose()
    }

    /// The number of triangles.
    fn __len__(&self) -> usize {
        self.parts().map_or_else(|| self.last().primitives, |parts| parts.triangles())
    }

    fn __repr__(&self) -> String {
        format!("<kiln.Mesh of {} triangles, tier {}>", self.__len__(), self.tier())
    }

    /// The arithmetic that decides hits.
    #[getter]
    fn tier(&self) -> &'static str {
        self.last().bvh.accelerator().numerics().name()
    }

    /// The closest hit of every ray: Hits of n rows, with the triangle -1 and nan for a ray that hits nothing. Of hits
    /// at equal distance, the one of the lowest triangle.
    ///
    /// origins, directions: (n, 3) float64. max_distance: a number or (n,) float64 above 0, infinite by default. Hits
    /// are at 0 < distance < max_distance: a ray from a point of the surface does not hit it there. objects: indices of
    /// objects, or a bool for each; others are passed. cull_back_faces: whether faces seen from the back are passed.
    /// alpha: whether surfaces of a scene are passed where its pictures show none: of an opacity below the cutoff, or
    /// 1/2.
    #[pyo3(signature = (
        origins, directions, max_distance = None, *, objects = None, cull_back_faces = false, alpha = false
    ))]
    fn first<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
        objects: Option<&Bound<'py, PyAny>>,
        cull_back_faces: bool,
        alpha: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = origins.py();
        let arguments = RayArguments::new(origins, directions, max_distance)?;
        let state = self.now(py)?;
        let filter = Filter::new(&state, objects, cull_back_faces, alpha)?;
        let mut columns = Columns::new(py, arguments.shape.iter().product())?;
        let few = if filter.is_some() { None } else { arguments.few(&state.bvh)? };
        if let Some(rays) = few {
            let rays = rays.rays();
            let hits = py.detach(|| state.bvh.closest_hits(rays, &mut Traversal::default()));
            for ((mut row, ray), hit) in columns.slices()?.into_iter().zip(rays.iter()).zip(hits.iter()) {
                set(&mut row, &state, &ray, hit.as_ref());
            }
        } else {
            let rays = arguments.rays(py, &state.bvh)?;
            let mut rows = columns.slices()?;
            in_ranges(py, arguments.ranges(), |range| {
                let places = rows.split_first(range.len()).into_par_iter();
                let rays = rays.slice(range);
                match &filter {
                    None => state.bvh.par_each_closest_hit(&rays, places, |row, ray, hit| {
                        set(row, &state, ray, hit.as_ref());
                    }),
                    Some(filter) => {
                        let hits =
                            state.bvh.par_closest_hits_by(rays, |ray, hit| filter.accepts(&state, ray, hit));
                        places.zip(hits).enumerate().for_each(|(index, (mut row, hit))| {
                            set(&mut row, &state, &rays.get(index), hit.as_ref());
                        });
                    }
                }
            })?;
        }
        columns.result(None, state, arguments.shape)
    }

    /// Whether each ray hits anything: (n,) bool. Arguments as for `first`.
    #[pyo3(signature = (
        origins, directions, max_distance = None, *, objects = None, cull_back_faces = false, alpha = false
    ))]
    fn any<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
        objects: Option<&Bound<'py, PyAny>>,
        cull_back_faces: bool,
        alpha: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = origins.py();
        let arguments = RayArguments::new(origins, directions, max_distance)?;
        let state = self.now(py)?;
        let filter = Filter::new(&state, objects, cull_back_faces, alpha)?;
        let few = if filter.is_some() { None } else { arguments.few(&state.bvh)? };
        let mut occluded = Vec::new();
        if let Some(rays) = few {
            occluded = py.detach(|| state.bvh.are_occluded(rays.rays(), &mut Traversal::default()));
        } else {
            let rays = arguments.rays(py, &state.bvh)?;
            occluded.reserve_exact(rays.len());
            in_ranges(py, arguments.ranges(), |range| {
                let rays = rays.slice(range);
                match &filter {
                    None => occluded.extend(state.bvh.par_are_occluded(rays)),
                    Some(filter) => {
                        let hits =
                            state.bvh.par_closest_hits_by(rays, |ray, hit| filter.accepts(&state, ray, hit));
                        occluded.extend(hits.iter().map(Option::is_some));
                    }
                }
            })?;
        }
        in_shape(vector(py, occluded), &arguments.shape)
    }

    /// The number of hits of each ray, those of `all`: (n,) int64. Arguments as for `first`.
    #[pyo3(signature = (
        origins, directions, max_distance = None, *, objects = None, cull_back_faces = false, alpha = false
    ))]
    fn count<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
        objects: Option<&Bound<'py, PyAny>>,
        cull_back_faces: bool,
        alpha: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = origins.py();
        let arguments = RayArguments::new(origins, directions, max_distance)?;
        let state = self.now(py)?;
        let filter = Filter::new(&state, objects, cull_back_faces, alpha)?;
        let rays = arguments.rays(py, &state.bvh)?;
        let mut counts: Vec<i64> = Vec::with_capacity(rays.len());
        in_ranges(py, (rays.len(), RAYS), |range| {
            let of_rays = state.bvh.par_hit_counts(rays.slice(range), |ray, hit| {
                filter.as_ref().is_none_or(|filter| filter.accepts(&state, ray, hit))
            });
            counts.extend(of_rays.into_iter().map(|count| count as i64));
        })?;
        in_shape(vector(py, counts), &arguments.shape)
    }

    /// Every hit of every ray: AllHits, sorted by ray, then distance, then triangle. A ray through an edge or a corner
    /// hits every triangle there; `crossings` counts it once. A sphere has its nearer hit alone. In tier "exact", whose
    /// `first` compares exact distances, hits whose distances round to nearly the same may be in another order.
    /// Arguments as for `first`.
    #[pyo3(signature = (
        origins, directions, max_distance = None, *, objects = None, cull_back_faces = false, alpha = false
    ))]
    fn all<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
        objects: Option<&Bound<'py, PyAny>>,
        cull_back_faces: bool,
        alpha: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = origins.py();
        let arguments = RayArguments::new(origins, directions, max_distance)?;
        let state = self.now(py)?;
        let filter = Filter::new(&state, objects, cull_back_faces, alpha)?;
        let rays = arguments.rays(py, &state.bvh)?;
        let (lists, count) = lists_of(py, &rays, |rays| match &filter {
            None => state.bvh.par_all_hits(rays),
            Some(filter) => state.bvh.par_all_hits_by(rays, |ray, hit| filter.accepts(&state, ray, hit)),
        })?;
        let (mut index, mut columns) = (zeros(py, [count])?, Columns::new(py, count)?);
        let (mut indices, mut rows) = (index.as_slice_mut()?, columns.slices()?);
        in_threads(py, || {
            for (start, all) in lists {
                let own = indices.split_off_mut(..all.values()).unwrap_or_default();
                let places = own.par_iter_mut().zip(rows.split_first(all.values()).into_par_iter());
                all.par_each(places, |(index, mut row), ray, hit| {
                    *index = (start + ray) as i64;
                    set(&mut row, &state, &rays.get(start + ray), Some(hit));
                });
            }
        })?;
        columns.result(Some(any(&index)), state, vec![count])
    }

    /// Every crossing of every ray and the surface, once each, also through edges and corners: Crossings, sorted by
    /// ray, then distance. Exact: a ray through a closed surface enters and leaves it in turns. The origin is
    /// perturbed infinitesimally along +x, then +y, then +z (simulation of simplicity), which decides for rays that
    /// run in the plane of a triangle or start on it. The arguments are the first three of `first`.
    #[pyo3(signature = (origins, directions, max_distance = None))]
    fn crossings<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = origins.py();
        let arguments = RayArguments::new(origins, directions, max_distance)?;
        let state = self.now(py)?;
        let rays = arguments.rays(py, &state.bvh)?;
        let (lists, len) = lists_of(py, &rays, |rays| state.bvh.par_crossings(rays))?;
        let [mut index, mut triangle] = [zeros(py, [len])?, zeros(py, [len])?];
        let (mut distance, mut location) = (zeros(py, [len])?, zeros(py, [len, 3])?);
        let (mut entering, mut place) = (zeros(py, [len])?, zeros(py, [len, 1])?);
        let (indices, triangles, distances) =
            (index.as_slice_mut()?, triangle.as_slice_mut()?, distance.as_slice_mut()?);
        let (locations, sides, prims) =
            (vectors(&mut location)?, entering.as_slice_mut()?, place.as_slice_mut()?);
        in_threads(py, || {
            let mut end = 0;
            for (start, all) in lists {
                let own = end..end + all.values();
                end = own.end;
                let places = (
                    &mut indices[own.clone()],
                    &mut triangles[own.clone()],
                    &mut distances[own.clone()],
                    &mut locations[own.clone()],
                    &mut sides[own.clone()],
                    &mut prims[own],
                );
                type Place<'a> =
                    (&'a mut i64, &'a mut i64, &'a mut f64, &'a mut [f64; 3], &'a mut bool, &'a mut u32);
                let write = |place: Place, ray: usize, crossing: &SignedHit| {
                    let (SignedHit { t, prim, side, .. }, ray) = (*crossing, start + ray);
                    (*place.0, *place.1, *place.2) = (ray as i64, state.locate(prim).1.into(), t);
                    (*place.3, *place.4) = (rays.get(ray).at(t).to_array(), side == Side::Entering);
                    *place.5 = prim.0;
                };
                all.par_each(places.into_par_iter(), write);
            }
        })?;
        let fields = [any(&index), any(&triangle), any(&distance), any(&location), any(&entering)];
        Found::result("Crossings", fields, state, &place, vec![len])
    }

    /// Whether points are inside the surface: (n,) bool. Of a closed surface, with consistent winding, those whose
    /// winding number is not 0, exactly. Warns of another: of an open one those whose generalised winding number is
    /// above 1/2 or below -1/2; with inconsistent winding, those from which two of three rays cross it an odd number of
    /// times.
    ///
    /// points: (n, 3) float64. return_margin: Containment instead, with a margin of certainty and the rule, without a
    /// warning.
    #[pyo3(signature = (points, return_margin = false))]
    fn contains<'py>(&self, points: &Bound<'py, PyAny>, return_margin: bool) -> PyResult<Bound<'py, PyAny>> {
        let py = points.py();
        let mut rule = InsideRule::Crossings;
        let warning = |of_surface| {
            rule = of_surface;
            inside_rule(of_surface).filter(|_| !return_margin)
        };
        let (found, shape) = self.with_points(
            points,
            warning,
            |bvh, point, traversal| bvh.contains(point, traversal),
            Bvh::par_contains,
        )?;
        let is_inside = vector::<bool>(py, found.iter().map(|of| of.is_inside).collect());
        let is_inside = in_shape(is_inside, &shape)?;
        if !return_margin {
            return Ok(is_inside);
        }
        let margin = vector::<f64>(py, found.iter().map(|of| of.margin).collect());
        let answer = result(py, "Containment", [is_inside, in_shape(margin, &shape)?])?;
        answer.setattr("rule", rule.to_string())?;
        Ok(answer)
    }

    /// The solid angle of the surface, seen from points, over 4 pi: WindingNumbers of n rows. 1 well inside of a
    /// surface with holes, 0 outside, anything between near the holes; the exact winding number for a closed surface.
    ///
    /// points: (n, 3) float64. beta: at least 1; the error falls with its third power, and time grows with its second.
    #[pyo3(signature = (points, beta = 1.0))]
    fn generalised_winding_number<'py>(
        &self,
        points: &Bound<'py, PyAny>,
        beta: f64,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = points.py();
        if beta.is_nan() || beta < 1.0 {
            return Err(PyValueError::new_err(format!("beta: {beta} is not 1 or more")));
        }
        let (numbers, shape) = self.with_points(
            points,
            |_| None,
            |bvh, point, traversal| bvh.generalised_winding_number(point, beta, traversal),
            |bvh, points| bvh.par_generalised_winding_numbers(points, beta),
        )?;
        let [value, error] = [
            numbers.iter().map(|number| number.value).collect(),
            numbers.iter().map(|number| number.error).collect(),
        ]
        .map(|column: Vec<f64>| in_shape(vector(py, column), &shape));
        result(py, "WindingNumbers", [value?, error?])
    }

    /// How often the surface winds around points: (n,) int32, 1 inside of a closed mesh and 0 outside. Warns of a
    /// surface that is not closed. points: (n, 3) float64.
    fn winding_number<'py>(&self, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let by_ray = |rule| {
            inside_rule(rule).map(|_| "winding numbers are those of one ray; see generalised_winding_number")
        };
        let (numbers, shape) = self.with_points(
            points,
            by_ray,
            |bvh, point, traversal| bvh.winding_number(point, traversal),
            Bvh::par_winding_numbers,
        )?;
        in_shape(vector(points.py(), numbers), &shape)
    }

    /// The closest points of the surface: ClosestPoints of n rows, with the triangle -1 and nan where there is none:
    /// for a mesh without triangles, and farther than max_distance, which saves time. points: (n, 3) float64.
    #[pyo3(signature = (points, max_distance = None))]
    fn closest_point<'py>(
        &self,
        points: &Bound<'py, PyAny>,
        max_distance: Option<f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (py, points) = (points.py(), Points::new(points)?);
        let (state, limit) = (self.now(py)?, max_distance_of(max_distance)?);
        let found = points.results(
            |point, traversal| state.bvh.closest_point_within(point, limit, traversal),
            |points| state.bvh.par_closest_points_within(points, limit),
        )?;
        let location =
            found.iter().map(|closest| closest.map_or([f64::NAN; 3], |closest| closest.point.to_array()));
        let distance = found.iter().map(|closest| closest.map_or(f64::NAN, |closest| closest.distance));
        let triangle =
            found.iter().map(|closest| closest.map_or(-1, |closest| state.locate(closest.prim).1.into()));
        let (location, distance) = (rows(py, location.collect())?, vector(py, distance.collect()));
        let fields = [location, distance, vector(py, triangle.collect::<Vec<i64>>())];
        let places = Found::places(py, found.iter().map(|closest| closest.map(|closest| closest.prim)))?;
        Found::result("ClosestPoints", fields, state, &places, points.shape)
    }

    /// The triangles near points, each with its closest point: NearPoints, sorted by point, then distance, then
    /// triangle.
    ///
    /// points: (n, 3) float64. count: the most triangles of each point; all within max_distance if it is None, and one
    /// of both is needed. max_distance: a number; infinite by default.
    #[pyo3(signature = (points, count = None, max_distance = None))]
    fn nearest<'py>(
        &self,
        points: &Bound<'py, PyAny>,
        count: Option<i64>,
        max_distance: Option<f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (py, points) = (points.py(), Points::new(points)?);
        let of_count = |count: i64| {
            let mistake = |_| PyValueError::new_err(format!("count: {count} is not 0 or more"));
            usize::try_from(count).map_err(mistake)
        };
        let count = count.map(of_count).transpose()?;
        if count.is_none() && max_distance.is_none() {
            return Err(PyValueError::new_err("count: give it, max_distance, or both"));
        }
        let (count, limit) = (count.unwrap_or(usize::MAX), max_distance_of(max_distance)?);
        let state = self.now(py)?;
        let (rows_of_points, mut found) = (points.get()?, Vec::new());
        in_ranges(py, (rows_of_points.len(), POINTS), |range| {
            let lists = state.bvh.par_nearest(&rows_of_points[range.clone()], count, limit);
            let of_point = |(index, list): (usize, &[ClosestPoint])| {
                list.iter().map(|near| (index, *near)).collect::<Vec<_>>()
            };
            found.extend(range.zip(lists.iter()).flat_map(of_point));
        })?;
        let point: Vec<i64> = found.iter().map(|(index, _)| *index as i64).collect();
        let triangle: Vec<i64> = found.iter().map(|(_, near)| state.locate(near.prim).1.into()).collect();
        let distance: Vec<f64> = found.iter().map(|(_, near)| near.distance).collect();
        let location = rows(py, found.iter().map(|(_, near)| near.point.to_array()).collect())?;
        let fields = [vector(py, point), vector(py, triangle), vector(py, distance), location];
        let places = Found::places(py, found.iter().map(|(_, near)| Some(near.prim)))?;
        Found::result("NearPoints", fields, state, &places, vec![found.len()])
    }

    /// The triangles that have a point in a box, its border included: Primitives, sorted by object, then triangle.
    /// Exact. Of spheres and disks, those whose bounds have one.
    ///
    /// min, max: (3,) float64, the corners of the box.
    fn in_box<'py>(&self, min: &Bound<'py, PyAny>, max: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let py = min.py();
        let corner = |value: &Bound<PyAny>, name: &str| match vectors_of(value, name)? {
            (array, shape) if shape.is_empty() => Ok(DVec3::from(chunks(&array)?[0])),
            (_, shape) => Err(PyValueError::new_err(format!("{name}: expected one vector, not {shape:?}"))),
        };
        let [min, max] = [corner(min, "min")?, corner(max, "max")?];
        if !min.cmple(max).all() {
            return Err(PyValueError::new_err(format!("max: {max} is not above {min} on each axis")));
        }
        let state = self.now(py)?;
        let found = in_threads(py, || state.bvh.in_box(min, max, &mut Traversal::default()))?;
        result(py, "Primitives", located(py, &state, found.into_iter()))
    }

    /// The pairs of a triangle of this mesh and one of another that have a point in common: IntersectingTriangles,
    /// sorted by the triangles of this mesh, then those of the other. Exact, also where they touch or lie in one plane;
    /// triangles without area intersect none.
    fn intersecting_triangles<'py>(&self, other: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let py = other.py();
        let Ok(other) = other.cast::<Mesh>() else {
            let what = format!("other: expected a Mesh, not {}", other.get_type().name()?);
            return Err(PyTypeError::new_err(what));
        };
        let [own, other] = [self.now(py)?, other.get().now(py)?];
        let pairs = in_threads(py, || own.bvh.par_intersecting_triangles(&other.bvh))?;
        let [object, triangle] = located(py, &own, pairs.iter().map(|pair| pair[0]));
        let [other_object, other_triangle] = located(py, &other, pairs.iter().map(|pair| pair[1]));
        result(py, "IntersectingTriangles", [object, triangle, other_object, other_triangle])
    }

    /// The distances of points from the surface, negative inside as `contains` decides: (n,) float64; nan for a mesh
    /// without triangles. Warns as `contains`. points: (n, 3) float64.
    fn signed_distance<'py>(&self, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let (distances, shape) = self.with_points(
            points,
            inside_rule,
            |bvh, point, traversal| bvh.signed_distance(point, traversal),
            Bvh::par_signed_distances,
        )?;
        let distances: Vec<f64> =
            distances.into_iter().map(|distance| distance.unwrap_or(f64::NAN)).collect();
        in_shape(vector(points.py(), distances), &shape)
    }

    /// The edges that keep the surface from being closed: Closedness. Computed at the first call.
    fn closedness<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let state = self.now(py)?;
        let closedness = in_threads(py, || state.bvh.closedness())?;
        let Closedness { boundary_edges, non_manifold_edges, unbalanced_edges, inconsistent_edges } =
            closedness;
        let counts = [boundary_edges, non_manifold_edges, unbalanced_edges, inconsistent_edges];
        let counts = counts.map(|count| count.into_pyobject(py).map(Bound::into_any));
        result(py, "Closedness", counts.into_iter().collect::<Result<Vec<_>, _>>()?)
    }
}

/// The error of an attribute that only a mesh of arrays has.
fn not_of_arrays(name: &str) -> PyErr {
    PyAttributeError::new_err(format!("{name}: only a Mesh that is made of vertices and faces has them"))
}

/// The faces of arrays: (m, 3) uint32.
fn faces_of<'py>(py: Python<'py>, arrays: &Arrays) -> PyResult<Bound<'py, PyAny>> {
    let mut faces = zeros::<u32, 2>(py, [arrays.faces.len(), 3])?;
    faces.as_slice_mut()?.copy_from_slice(arrays.faces.as_flattened());
    Ok(any(&faces))
}

/// The objects of primitives, and their indices in these.
fn located<'py>(
    py: Python<'py>,
    state: &State,
    primitives: impl Iterator<Item = PrimId>,
) -> [Bound<'py, PyAny>; 2] {
    let (objects, triangles): (Vec<i64>, Vec<i64>) = primitives
        .map(|prim| state.locate(prim))
        .map(|(object, triangle)| (i64::from(state.objects[object].number), i64::from(triangle)))
        .unzip();
    [vector(py, objects), vector(py, triangles)]
}
