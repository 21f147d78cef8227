//! `kiln.Mesh`: ray and point queries of triangles.

use kiln::bvh::{Bvh, Crossing, Lists, NotClosed, NotFinite, Preset, Primitive, RayArrays, RayList};
use kiln::geometry::{Hit, Numerics, Ray, Side};
use kiln::glam::DVec3;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::arrays::{check_finite, check_rows, chunks, column, numbers, rows, triangles, vector};
use crate::warn;

/// Triangles for ray and point queries, immutable, for any number of threads.
///
/// Mesh(vertices, faces, *, tier="watertight", preset="balanced")
///
/// vertices: (n, 3) float64, finite in f32. faces: (m, 3) integers below n, counterclockwise seen from the front.
/// tier: the arithmetic that decides hits: "fast" (f32, rays may leak through edges), "watertight" (vertices rounded to
/// f32), "double" (vertices in f64) or "exact". preset: "fast-build", "balanced" or "best-trace".
///
/// Distances are in the units of the vertices; directions need not have length 1. Queries release the GIL and use all
/// threads (RAYON_NUM_THREADS). Raises ValueError for arguments of another shape or type and for numbers that are not
/// finite.
#[pyclass(frozen, module = "kiln")]
pub(crate) struct Mesh {
    bvh: Bvh,
    primitives: usize,
}

/// Hits of rays in the arrays of the results.
struct Columns {
    triangle: Vec<i64>,
    distance: Vec<f64>,
    location: Vec<[f64; 3]>,
    barycentrics: Vec<[f64; 3]>,
}

impl Columns {
    /// Misses.
    fn new(len: usize) -> Self {
        Columns {
            triangle: vec![-1; len],
            distance: vec![f64::NAN; len],
            location: vec![[f64::NAN; 3]; len],
            barycentrics: vec![[f64::NAN; 3]; len],
        }
    }

    #[inline]
    fn set(&mut self, index: usize, ray: &Ray, hit: &Hit) {
        let [v, w] = hit.barycentrics;
        self.triangle[index] = hit.prim.0.into();
        self.distance[index] = hit.t;
        self.location[index] = ray.at(hit.t).to_array();
        self.barycentrics[index] = [1.0 - v - w, v, w];
    }

    fn arrays<'py>(self, py: Python<'py>) -> PyResult<[Bound<'py, PyAny>; 4]> {
        let Columns { triangle, distance, location, barycentrics } = self;
        Ok([vector(py, triangle), vector(py, distance), rows(py, location)?, rows(py, barycentrics)?])
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

/// For each value, the index of its list.
fn index_of_values<T>(lists: &Lists<T>) -> Vec<i64> {
    let mut index = Vec::with_capacity(lists.values().len());
    for (number, list) in (0..).zip(lists.iter()) {
        index.extend(std::iter::repeat_n(number, list.len()));
    }
    index
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
        let bvh = py.detach(|| Bvh::with(primitives, preset, numerics));
        let bvh = bvh.map_err(|why| PyValueError::new_err(format!("vertices: {why}")))?;
        Ok(Mesh { bvh, primitives: count })
    }

    /// Calls `query` with the rays, without the GIL.
    fn with_rays<R: Send>(
        &self,
        origins: &Bound<PyAny>,
        directions: &Bound<PyAny>,
        max_distance: Option<&Bound<PyAny>>,
        query: impl FnOnce(&Bvh, RayArrays) -> R + Send,
    ) -> PyResult<R> {
        let py = origins.py();
        let [origins, directions] = [numbers(origins, "origins", 3)?, numbers(directions, "directions", 3)?];
        let [origins, directions] = [chunks(&origins)?, chunks(&directions)?];
        check_rows(("directions", directions.len()), ("origins", origins.len()))?;
        let max_distance = max_distance.map(|value| column(value, "max_distance", "origins", origins.len()));
        let max_distance = max_distance.transpose()?;
        let t_max = max_distance.as_deref();
        py.detach(|| self.bvh.rays(origins, directions, t_max).map(|rays| query(&self.bvh, rays))).map_err(
            |(row, why)| {
                let argument = match why {
                    NotFinite::Direction => "directions",
                    NotFinite::Distance => "max_distance",
                    NotFinite::Origin | NotFinite::Primitive(_) => "origins",
                };
                PyValueError::new_err(format!("{argument}: row {row}: {why}"))
            },
        )
    }

    /// Calls `query` with the points, without the GIL.
    fn with_points<R: Send>(
        &self,
        points: &Bound<PyAny>,
        query: impl FnOnce(&Bvh, &[DVec3]) -> R + Send,
    ) -> PyResult<R> {
        let array = numbers(points, "points", 3)?;
        let rows = chunks(&array)?;
        check_finite(rows, "points")?;
        let points: Vec<DVec3> = rows.iter().map(|&row| row.into()).collect();
        array.py().detach(|| Ok(query(&self.bvh, &points)))
    }

    /// Warns where inside and outside have no meaning.
    fn warn_if_open(&self, py: Python) -> PyResult<()> {
        let closedness = py.detach(|| self.bvh.closedness());
        if closedness.is_closed() { Ok(()) } else { warn(py, &NotClosed(closedness).to_string()) }
    }
}

#[pymethods]
impl Mesh {
    #[new]
    #[pyo3(signature = (vertices, faces, *, tier = "watertight", preset = "balanced"))]
    fn new(vertices: &Bound<PyAny>, faces: &Bound<PyAny>, tier: &str, preset: &str) -> PyResult<Self> {
        let py = vertices.py();
        let vertices = numbers(vertices, "vertices", 3)?;
        let vertices: &[[f64; 3]] = chunks(&vertices)?;
        let faces = triangles(faces, "faces", vertices.len())?;
        let corners = faces.iter().map(|face| face.map(|index| vertices[index as usize]).into());
        Mesh::of(py, corners, (tier, preset))
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
    /// at equal distance, the one of the lowest triangle.
    ///
    /// origins, directions: (n, 3) float64. max_distance: a number or (n,) float64 above 0; hits are nearer.
    #[pyo3(signature = (origins, directions, max_distance = None))]
    fn first<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let columns = self.with_rays(origins, directions, max_distance, |bvh, rays| {
            let mut columns = Columns::new(rays.len());
            bvh.par_each_closest_hit(&rays, |index, ray, hit| {
                hit.iter().for_each(|hit| columns.set(index, ray, hit));
            });
            columns
        })?;
        let py = origins.py();
        result(py, "Hits", columns.arrays(py)?)
    }

    /// Whether each ray hits anything: (n,) bool. Arguments as for `first`.
    #[pyo3(signature = (origins, directions, max_distance = None))]
    fn any<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let query = |bvh: &Bvh, rays: RayArrays| bvh.par_are_occluded(rays);
        Ok(vector(origins.py(), self.with_rays(origins, directions, max_distance, query)?))
    }

    /// Every hit of every ray: AllHits, sorted by ray, then distance, then triangle. A ray through an edge or a corner
    /// hits every triangle there; `crossings` counts it once. Arguments as for `first`.
    #[pyo3(signature = (origins, directions, max_distance = None))]
    fn all<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (index, columns) = self.with_rays(origins, directions, max_distance, |bvh, rays| {
            let all = bvh.par_all_hits(rays);
            let (index, mut columns) = (index_of_values(&all), Columns::new(all.values().len()));
            for (place, (&ray, hit)) in index.iter().zip(all.values()).enumerate() {
                columns.set(place, &rays.get(ray as usize), hit);
            }
            (index, columns)
        })?;
        let py = origins.py();
        let [triangle, distance, location, barycentrics] = columns.arrays(py)?;
        result(py, "AllHits", [vector(py, index), triangle, distance, location, barycentrics])
    }

    /// Every passage of every ray through the surface, once each, also through edges and corners: Crossings, sorted by
    /// ray, then distance. Exact: a ray through a closed surface enters and leaves it in turns. A ray that runs in the
    /// plane of a triangle or starts on it is taken as infinitesimally farther along +x, then +y, then +z.
    /// Arguments as for `first`.
    #[pyo3(signature = (origins, directions, max_distance = None))]
    fn crossings<'py>(
        &self,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (index, triangle, distance, location, entering) =
            self.with_rays(origins, directions, max_distance, |bvh, rays| {
                let all = bvh.par_crossings(rays);
                let (index, values) = (index_of_values(&all), all.values());
                let at =
                    |(&ray, crossing): (&i64, &Crossing)| rays.get(ray as usize).at(crossing.t).to_array();
                let location: Vec<[f64; 3]> = index.iter().zip(values).map(at).collect();
                let triangle: Vec<i64> = values.iter().map(|crossing| crossing.prim.0.into()).collect();
                let distance: Vec<f64> = values.iter().map(|crossing| crossing.t).collect();
                let entering: Vec<bool> =
                    values.iter().map(|crossing| crossing.side == Side::Entering).collect();
                (index, triangle, distance, location, entering)
            })?;
        let py = origins.py();
        let [index, triangle] = [index, triangle].map(|column| vector(py, column));
        let fields = [index, triangle, vector(py, distance), rows(py, location)?, vector(py, entering)];
        result(py, "Crossings", fields)
    }

    /// Whether points are inside the surface: (n,) bool, whether the winding number is not 0. Exact for a closed
    /// surface; warns of another. points: (n, 3) float64.
    fn contains<'py>(&self, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        self.warn_if_open(points.py())?;
        Ok(vector(points.py(), self.with_points(points, |bvh, points| bvh.par_contains(points).0)?))
    }

    /// How often the surface winds around points: (n,) int32, 1 inside of a closed mesh and 0 outside. Warns of a
    /// surface that is not closed. points: (n, 3) float64.
    fn winding_number<'py>(&self, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        self.warn_if_open(points.py())?;
        Ok(vector(points.py(), self.with_points(points, Bvh::par_winding_numbers)?))
    }

    /// The closest points of the surface: ClosestPoints of n rows, with the triangle -1 and nan for a mesh without
    /// triangles. points: (n, 3) float64.
    fn closest_point<'py>(&self, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let (location, distance, triangle) = self.with_points(points, |bvh, points| {
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
        self.warn_if_open(points.py())?;
        let distances = self.with_points(points, Bvh::par_signed_distances)?;
        Ok(vector(points.py(), distances.into_iter().map(|distance| distance.unwrap_or(f64::NAN)).collect()))
    }

    /// The edges that keep the surface from being closed: Closedness. Computed at the first call.
    fn closedness<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let closedness = py.detach(|| self.bvh.closedness());
        let counts = [closedness.boundary_edges, closedness.non_manifold_edges, closedness.unbalanced_edges];
        let counts = counts.map(|count| count.into_pyobject(py).map(Bound::into_any));
        let [boundary, non_manifold, unbalanced] = counts;
        result(py, "Closedness", [boundary?, non_manifold?, unbalanced?])
    }
}
