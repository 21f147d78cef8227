//! `kiln.Mesh`: ray and point queries of triangles.

use kiln::bvh::{Bvh, InvalidRays, NotClosed, NotFinite, Preset, Primitive, RayArrays, RayList, SignedHit};
use kiln::geometry::{Hit, Numerics, Ray, Side};
use kiln::glam::DVec3;
use numpy::{PyReadonlyArray2, PyReadwriteArray1, PyReadwriteArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use rayon::prelude::*;

use crate::arrays::{
    any, check_finite, check_rows, chunks, column, numbers, rows, triangles, vector, vectors, zeros,
};
use crate::threads::in_threads;
use crate::warn;

/// Triangles for ray and point queries, immutable, for any number of threads.
///
/// Mesh(vertices, faces, *, tier="watertight", preset="balanced")
///
/// vertices: (n, 3) float64, finite in f32. faces: (m, 3) integers below n, counterclockwise seen from the front.
/// tier: the arithmetic that decides hits: "fast" (f32, rays may miss what they hit), "watertight" (vertices rounded to
/// f32), "double" (vertices in f64) or "exact" (for the ray with its direction normalised, which rounds). preset:
/// "fast-build", "balanced" or "best-trace".
///
/// Distances are in the units of the vertices; directions need not have length 1. Queries release the GIL and use all
/// threads (RAYON_NUM_THREADS). Raises ValueError for arguments of another shape or type and for numbers that are not
/// finite.
#[pyclass(frozen, module = "kiln")]
pub(crate) struct Mesh {
    bvh: Bvh,
    primitives: usize,
}

/// Output arrays of hits.
struct Columns<'py> {
    triangle: PyReadwriteArray1<'py, i64>,
    distance: PyReadwriteArray1<'py, f64>,
    location: PyReadwriteArray2<'py, f64>,
    barycentrics: PyReadwriteArray2<'py, f64>,
}

/// The elements of a hit in [`Columns`].
type Row<'a> = (&'a mut i64, &'a mut f64, &'a mut [f64; 3], &'a mut [f64; 3]);

impl<'py> Columns<'py> {
    fn new(py: Python<'py>, len: usize) -> PyResult<Self> {
        let (triangle, distance) = (zeros(py, [len])?, zeros(py, [len])?);
        Ok(Columns { triangle, distance, location: zeros(py, [len, 3])?, barycentrics: zeros(py, [len, 3])? })
    }

    fn rows(&mut self) -> PyResult<impl IndexedParallelIterator<Item = Row<'_>>> {
        let (triangle, distance) = (self.triangle.as_slice_mut()?, self.distance.as_slice_mut()?);
        let (location, barycentrics) = (vectors(&mut self.location)?, vectors(&mut self.barycentrics)?);
        Ok((triangle, distance, location, barycentrics).into_par_iter())
    }

    fn arrays(&self) -> [Bound<'py, PyAny>; 4] {
        [any(&self.triangle), any(&self.distance), any(&self.location), any(&self.barycentrics)]
    }
}

/// Writes the hit of a ray, or a miss.
#[inline]
fn set((triangle, distance, location, barycentrics): &mut Row, ray: &Ray, hit: Option<&Hit>) {
    let Some(hit) = hit else {
        (**triangle, **distance) = (-1, f64::NAN);
        [**location, **barycentrics] = [[f64::NAN; 3]; 2];
        return;
    };
    let [v, w] = hit.barycentrics;
    (**triangle, **distance) = (hit.prim.0.into(), hit.t);
    [**location, **barycentrics] = [ray.at(hit.t).to_array(), [1.0 - v - w, v, w]];
}

/// The arguments of a query of rays.
struct RayArguments<'py> {
    origins: PyReadonlyArray2<'py, f64>,
    directions: PyReadonlyArray2<'py, f64>,
    max_distance: Option<Vec<f64>>,
}

impl<'py> RayArguments<'py> {
    fn new(
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let [origins, directions] = [numbers(origins, "origins", 3)?, numbers(directions, "directions", 3)?];
        let count = chunks::<3>(&origins)?.len();
        check_rows(("directions", chunks::<3>(&directions)?.len()), ("origins", count))?;
        let max_distance = max_distance.map(|value| column(value, "max_distance", "origins", count));
        Ok(RayArguments { origins, directions, max_distance: max_distance.transpose()? })
    }

    /// The rays, checked.
    fn rays(&self, py: Python, bvh: &Bvh) -> PyResult<RayArrays<'_>> {
        let [origins, directions] = [chunks(&self.origins)?, chunks(&self.directions)?];
        let t_max = self.max_distance.as_deref();
        in_threads(py, || bvh.rays(origins, directions, t_max))?.map_err(|error| {
            let InvalidRays::Ray { index, why } = error else {
                return PyValueError::new_err(error.to_string());
            };
            let argument = match why {
                NotFinite::Direction => "directions",
                NotFinite::Distance | NotFinite::MinDistance => "max_distance",
                _ => "origins",
            };
            PyValueError::new_err(format!("{argument}: row {index}: {why}"))
        })
    }
}

/// A named tuple of `kiln._results`.
fn result<'py>(
    py: Python<'py>,
    name: &str,
    fields: impl IntoIterator<Item = Bound<'py, PyAny>, IntoIter: ExactSizeIterator>,
) -> PyResult<Bound<'py, PyAny>> {
    py.import("kiln._results")?.getattr(name)?.call1(PyTuple::new(py, fields)?)
}

/// The tier and the preset of their names.
fn named(tier: &str, preset: &str) -> PyResult<(Numerics, Preset)> {
    let unknown = |argument: &str, given: &str, known: Vec<&str>| {
        PyValueError::new_err(format!("{argument}: `{given}` is none of {}", known.join(", ")))
    };
    let numerics = Numerics::named(tier);
    let numerics =
        numerics.ok_or_else(|| unknown("tier", tier, Numerics::ALL.map(Numerics::name).to_vec()))?;
    let known = Preset::named(preset);
    let preset = known.ok_or_else(|| unknown("preset", preset, Preset::ALL.map(Preset::name).to_vec()))?;
    Ok((numerics, preset))
}

impl Mesh {
    /// A mesh of any primitives.
    pub(crate) fn of(
        py: Python,
        primitives: impl ExactSizeIterator<Item = Primitive> + Send,
        (tier, preset): (&str, &str),
    ) -> PyResult<Self> {
        let (numerics, preset) = named(tier, preset)?;
        let count = primitives.len();
        let bvh = in_threads(py, || Bvh::with(primitives, preset, numerics))?;
        let bvh = bvh.map_err(|why| PyValueError::new_err(format!("vertices: {why}")))?;
        Ok(Mesh { bvh, primitives: count })
    }

    /// Calls `query` with the points, without the GIL. Before that, warns of a surface that is not closed, where
    /// `needs_inside`.
    fn with_points<R: Send>(
        &self,
        points: &Bound<PyAny>,
        needs_inside: bool,
        query: impl FnOnce(&Bvh, &[DVec3]) -> R + Send,
    ) -> PyResult<R> {
        let py = points.py();
        let array = numbers(points, "points", 3)?;
        check_finite::<3>(chunks(&array)?, "points")?;
        if needs_inside {
            let closedness = in_threads(py, || self.bvh.closedness())?;
            if !closedness.is_closed() {
                warn(py, &NotClosed(closedness).to_string())?;
            }
        }
        let rows: &[[f64; 3]] = chunks(&array)?;
        in_threads(py, || query(&self.bvh, bytemuck::cast_slice(rows)))
    }
}

#[pymethods]
impl Mesh {
    #[new]
    #[pyo3(signature = (vertices, faces, *, tier = "watertight", preset = "balanced"))]
    fn new(vertices: &Bound<PyAny>, faces: &Bound<PyAny>, tier: &str, preset: &str) -> PyResult<Self> {
        let py = vertices.py();
        let vertices = numbers(vertices, "vertices", 3)?;
        // Before the vertices are borrowed: conversions may call Python, which may change them.
        let faces = triangles(faces, "faces", vertices.shape()[0])?;
        let vertices: &[[f64; 3]] = chunks(&vertices)?;
        check_finite(vertices, "vertices")?;
        let corners = faces.iter().map(|face| face.map(|index| vertices[index as usize]).into());
        Mesh::of(py, corners, (tier, preset))
    }

    /// The mesh itself, which does not change.
    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<PyAny>) -> Py<Self> {
        slf
    }

    /// The number of triangles.
    fn __len__(&self) -> usize {
        self.primitives
    }

    fn __repr__(&self) -> String {
        format!("<kiln.Mesh of {} triangles, tier {}>", self.primitives, self.tier())
    }

    /// The arithmetic that decides hits.
    #[getter]
    fn tier(&self) -> &'static str {
        self.bvh.accelerator().numerics().name()
    }

    /// The closest hit of every ray: Hits of n rows, with the triangle -1 and nan for a ray that hits nothing. Of hits
    /// at equal distance, the one of the lowest triangle, but in tier "fast".
    ///
    /// origins, directions: (n, 3) float64. max_distance: a number or (n,) float64 above 0, infinite by default. Hits
    /// are at 0 < distance < max_distance: a ray from a point of the surface does not hit it there.
    #[pyo3(signature = (origins, directions, max_distance = None))]
    fn first<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = origins.py();
        let arguments = RayArguments::new(origins, directions, max_distance)?;
        let rays = arguments.rays(py, &self.bvh)?;
        let mut columns = Columns::new(py, rays.len())?;
        let rows = columns.rows()?;
        in_threads(py, || {
            self.bvh.par_each_closest_hit(&rays, rows, |row, ray, hit| set(row, ray, hit.as_ref()));
        })?;
        result(py, "Hits", columns.arrays())
    }

    /// Whether each ray hits anything: (n,) bool. Arguments as for `first`.
    #[pyo3(signature = (origins, directions, max_distance = None))]
    fn any<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = origins.py();
        let arguments = RayArguments::new(origins, directions, max_distance)?;
        let rays = arguments.rays(py, &self.bvh)?;
        Ok(vector(py, in_threads(py, || self.bvh.par_are_occluded(rays))?))
    }

    /// Every hit of every ray: AllHits, sorted by ray, then distance, then triangle. A ray through an edge or a corner
    /// hits every triangle there; `crossings` counts it once. A sphere has its nearer hit alone. In tier "exact", whose
    /// `first` compares exact distances, hits whose distances round to nearly the same may be in another order.
    /// Arguments as for `first`.
    #[pyo3(signature = (origins, directions, max_distance = None))]
    fn all<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = origins.py();
        let arguments = RayArguments::new(origins, directions, max_distance)?;
        let rays = arguments.rays(py, &self.bvh)?;
        let all = in_threads(py, || self.bvh.par_all_hits(rays))?;
        let (mut index, mut columns) = (zeros(py, [all.values()])?, Columns::new(py, all.values())?);
        let (indices, rows) = (index.as_slice_mut()?.par_iter_mut(), columns.rows()?);
        in_threads(py, move || {
            all.par_each(indices.zip(rows), |(index, mut row), ray, hit| {
                *index = ray as i64;
                set(&mut row, &rays.get(ray), Some(hit));
            });
        })?;
        let [triangle, distance, location, barycentrics] = columns.arrays();
        result(py, "AllHits", [any(&index), triangle, distance, location, barycentrics])
    }

    /// Every crossing of every ray and the surface, once each, also through edges and corners: Crossings, sorted by
    /// ray, then distance. Exact: a ray through a closed surface enters and leaves it in turns. The origin is
    /// perturbed infinitesimally along +x, then +y, then +z (simulation of simplicity), which decides for rays that
    /// run in the plane of a triangle or start on it. Arguments as for `first`.
    #[pyo3(signature = (origins, directions, max_distance = None))]
    fn crossings<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = origins.py();
        let arguments = RayArguments::new(origins, directions, max_distance)?;
        let rays = arguments.rays(py, &self.bvh)?;
        let all = in_threads(py, || self.bvh.par_crossings(rays))?;
        let len = all.values();
        let [mut index, mut triangle] = [zeros(py, [len])?, zeros(py, [len])?];
        let (mut distance, mut location) = (zeros(py, [len])?, zeros(py, [len, 3])?);
        let mut entering = zeros(py, [len])?;
        let places = (
            index.as_slice_mut()?,
            triangle.as_slice_mut()?,
            distance.as_slice_mut()?,
            vectors(&mut location)?,
            entering.as_slice_mut()?,
        );
        in_threads(py, || {
            let write = |place: (&mut i64, &mut i64, &mut f64, &mut [f64; 3], &mut bool),
                         ray: usize,
                         crossing: &SignedHit| {
                let SignedHit { t, prim, side, .. } = *crossing;
                (*place.0, *place.1, *place.2) = (ray as i64, prim.0.into(), t);
                (*place.3, *place.4) = (rays.get(ray).at(t).to_array(), side == Side::Entering);
            };
            all.par_each(places.into_par_iter(), write);
        })?;
        let fields = [any(&index), any(&triangle), any(&distance), any(&location), any(&entering)];
        result(py, "Crossings", fields)
    }

    /// Whether points are inside the surface: (n,) bool, whether the winding number is not 0. Exact for a closed
    /// surface; warns of another. points: (n, 3) float64.
    ///
    /// return_margin: for any surface, without a warning. Returns a pair: (n,) bool, whether the generalised winding
    /// number exceeds 1/2, and (n,) float64, how far it is from 1/2 beyond its error: 0.5 for a closed surface, small
    /// near holes, and not above 0 where the point is not decided.
    #[pyo3(signature = (points, return_margin = false))]
    fn contains<'py>(&self, points: &Bound<'py, PyAny>, return_margin: bool) -> PyResult<Bound<'py, PyAny>> {
        let py = points.py();
        if !return_margin {
            return Ok(vector(py, self.with_points(points, true, |bvh, points| bvh.par_contains(points).0)?));
        }
        let (is_inside, margin) = self.with_points(points, false, |bvh, points| {
            let numbers = bvh.par_generalised_winding_numbers(points, 1.0);
            numbers.iter().map(|number| (number.is_inside(), number.margin())).unzip()
        })?;
        let pair: [_; 2] = [vector::<bool>(py, is_inside), vector::<f64>(py, margin)];
        Ok(PyTuple::new(py, pair)?.into_any())
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
        let numbers =
            self.with_points(points, false, |bvh, points| bvh.par_generalised_winding_numbers(points, beta))?;
        let [value, error] = [
            numbers.iter().map(|number| number.value).collect(),
            numbers.iter().map(|number| number.error).collect(),
        ]
        .map(|column: Vec<f64>| vector(py, column));
        result(py, "WindingNumbers", [value, error])
    }

    /// How often the surface winds around points: (n,) int32, 1 inside of a closed mesh and 0 outside. Warns of a
    /// surface that is not closed. points: (n, 3) float64.
    fn winding_number<'py>(&self, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        Ok(vector(points.py(), self.with_points(points, true, Bvh::par_winding_numbers)?))
    }

    /// The closest points of the surface: ClosestPoints of n rows, with the triangle -1 and nan for a mesh without
    /// triangles. points: (n, 3) float64.
    fn closest_point<'py>(&self, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let (location, distance, triangle) = self.with_points(points, false, |bvh, points| {
            let mut columns = (Vec::new(), Vec::new(), Vec::new());
            for closest in bvh.par_closest_points(points) {
                columns.0.push(closest.map_or([f64::NAN; 3], |closest| closest.point.to_array()));
                columns.1.push(closest.map_or(f64::NAN, |closest| closest.distance));
                columns.2.push(closest.map_or(-1, |closest| i64::from(closest.prim.0)));
            }
            columns
        })?;
        let py = points.py();
        let fields = [rows(py, location)?, vector(py, distance), vector(py, triangle)];
        result(py, "ClosestPoints", fields)
    }

    /// The distances of points from the surface, negative inside: (n,) float64; nan for a mesh without triangles. Warns
    /// of a surface that is not closed. points: (n, 3) float64.
    fn signed_distance<'py>(&self, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let distances = self.with_points(points, true, Bvh::par_signed_distances)?;
        Ok(vector(points.py(), distances.into_iter().map(|distance| distance.unwrap_or(f64::NAN)).collect()))
    }

    /// The edges that keep the surface from being closed: Closedness. Computed at the first call.
    fn closedness<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let closedness = in_threads(py, || self.bvh.closedness())?;
        let counts = [closedness.boundary_edges, closedness.non_manifold_edges, closedness.unbalanced_edges];
        let counts = counts.map(|count| count.into_pyobject(py).map(Bound::into_any));
        let [boundary, non_manifold, unbalanced] = counts;
        result(py, "Closedness", [boundary?, non_manifold?, unbalanced?])
    }
}
