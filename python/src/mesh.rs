//! `kiln.Mesh`: ray and point queries of triangles.

use kiln::bvh::{
    Bvh, CoarseRounding, InvalidRays, Lists, NotClosed, NotFinite, Preset, Primitive, RayArrays, RayList,
    SignedHit, Traversal,
};
use kiln::geometry::{Hit, Numerics, PrimId, Ray, RayBuffer, Side};
use kiln::glam::DVec3;
use numpy::{PyReadonlyArray2, PyReadwriteArray1, PyReadwriteArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use rayon::prelude::*;

use crate::arrays::{
    any, check_finite, check_shape, chunks, in_shape, numbers, per_ray, rows, triangles, vector, vectors,
    vectors_of, zeros,
};
use crate::threads::{in_ranges, in_threads};
use crate::warn;

/// Triangles for ray and point queries, immutable, for any number of threads.
///
/// Mesh(vertices, faces, *, tier="double", preset="balanced")
///
/// vertices: (n, 3) float64, finite in f32. faces: (m, 3) integers below n, counterclockwise seen from the front.
/// tier: the arithmetic that decides hits: "fast" (f32, rays may miss what they hit), "watertight" (vertices rounded to
/// f32), "double" (vertices in f64) or "exact" (for the ray with its direction normalised, which rounds). "fast" and
/// "watertight" warn where rounding moves a vertex by more than the shortest edge of its triangle. preset: "fast-build",
/// "balanced" or "best-trace".
///
/// Distances are in the units of the vertices; directions need not have length 1. Queries release the GIL and use all
/// threads (RAYON_NUM_THREADS). Raises ValueError for arguments of another shape or type and for numbers that are not
/// finite. Where (n, 3) is said, any shape (..., 3) is taken, results have its leading dimensions, and one vector (3,) of
/// origins or directions goes with all rays.
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

/// The elements of [`Columns`], or of consecutive rows.
struct Slices<'a> {
    triangle: &'a mut [i64],
    distance: &'a mut [f64],
    location: &'a mut [[f64; 3]],
    barycentrics: &'a mut [[f64; 3]],
}

impl<'a> Slices<'a> {
    /// Removes the first `count` rows, of which there must be as many, and returns them.
    fn split_first(&mut self, count: usize) -> Self {
        fn split<'a, T>(slice: &mut &'a mut [T], count: usize) -> &'a mut [T] {
            slice.split_off_mut(..count).unwrap_or_default()
        }
        Slices {
            triangle: split(&mut self.triangle, count),
            distance: split(&mut self.distance, count),
            location: split(&mut self.location, count),
            barycentrics: split(&mut self.barycentrics, count),
        }
    }

    fn into_iter(self) -> impl Iterator<Item = Row<'a>> {
        let of_ray = self.triangle.iter_mut().zip(self.distance);
        let of_place = self.location.iter_mut().zip(self.barycentrics);
        of_ray.zip(of_place).map(|((triangle, distance), (location, barycentrics))| {
            (triangle, distance, location, barycentrics)
        })
    }

    fn into_par_iter(self) -> impl IndexedParallelIterator<Item = Row<'a>> {
        (self.triangle, self.distance, self.location, self.barycentrics).into_par_iter()
    }
}

/// The elements of a hit in [`Columns`].
type Row<'a> = (&'a mut i64, &'a mut f64, &'a mut [f64; 3], &'a mut [f64; 3]);

impl<'py> Columns<'py> {
    fn new(py: Python<'py>, len: usize) -> PyResult<Self> {
        let (triangle, distance) = (zeros(py, [len])?, zeros(py, [len])?);
        Ok(Columns { triangle, distance, location: zeros(py, [len, 3])?, barycentrics: zeros(py, [len, 3])? })
    }

    fn slices(&mut self) -> PyResult<Slices<'_>> {
        Ok(Slices {
            triangle: self.triangle.as_slice_mut()?,
            distance: self.distance.as_slice_mut()?,
            location: vectors(&mut self.location)?,
            barycentrics: vectors(&mut self.barycentrics)?,
        })
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

/// Vectors of an argument: a row for each ray, or one vector for all of them.
enum Rows<'py> {
    Each(PyReadonlyArray2<'py, f64>),
    Same(Vec<[f64; 3]>),
}

impl Rows<'_> {
    fn get(&self) -> PyResult<&[[f64; 3]]> {
        match self {
            Rows::Each(array) => chunks(array),
            Rows::Same(rows) => Ok(rows),
        }
    }
}

/// The arguments of a query of rays.
struct RayArguments<'py> {
    origins: Rows<'py>,
    directions: Rows<'py>,
    max_distance: Option<Vec<f64>>,
    /// The shape of the arrays of rays, without the dimension of vectors.
    shape: Vec<usize>,
}

impl<'py> RayArguments<'py> {
    /// Arrays of the same shape (..., 3). One vector (3,) goes with each of the other argument.
    fn new(
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let ((origins, of_origins), (directions, of_directions)) =
            (vectors_of(origins, "origins")?, vectors_of(directions, "directions")?);
        let shape = if of_origins.is_empty() { of_directions.clone() } else { of_origins.clone() };
        let count = shape.iter().product();
        let rows = |array: PyReadonlyArray2<'py, f64>, own: &[usize]| match own.is_empty() {
            true => chunks(&array).map(|one| Rows::Same(vec![one[0]; count])),
            false => Ok(Rows::Each(array)),
        };
        if !of_directions.is_empty() {
            check_shape(("directions", &of_directions), ("origins", &shape))?;
        }
        let (origins, directions) = (rows(origins, &of_origins)?, rows(directions, &of_directions)?);
        let max_distance = max_distance.map(|value| per_ray(value, "max_distance", "origins", &shape));
        Ok(RayArguments { origins, directions, max_distance: max_distance.transpose()?, shape })
    }

    /// The rays, checked.
    fn rays(&self, py: Python, bvh: &Bvh) -> PyResult<RayArrays<'_>> {
        let [origins, directions] = [self.origins.get()?, self.directions.get()?];
        let t_max = self.max_distance.as_deref();
        in_threads(py, || bvh.rays(origins, directions, t_max))?.map_err(|error| match error {
            InvalidRays::Ray { index, why } => invalid(index, why),
            other => PyValueError::new_err(other.to_string()),
        })
    }

    /// The rays, checked, if they are so few that starting threads would take longer than tracing them.
    fn few(&self, bvh: &Bvh) -> PyResult<Option<RayBuffer>> {
        let [origins, directions] = [self.origins.get()?, self.directions.get()?];
        if origins.len() > FEW {
            return Ok(None);
        }
        let mut rays = RayBuffer::default();
        for (row, (&origin, &direction)) in origins.iter().zip(directions).enumerate() {
            let t_max = match self.max_distance.as_deref() {
                None => f64::INFINITY,
                Some(&[one]) => one,
                Some(each) => each[row],
            };
            rays.push(&bvh.ray_within(origin, direction, t_max).map_err(|why| invalid(row, why))?);
        }
        Ok(Some(rays))
    }
}

/// The most rays that are traced by the calling thread.
const FEW: usize = 64;

/// The exception of an invalid ray.
fn invalid(row: usize, why: NotFinite) -> PyErr {
    let argument = match why {
        NotFinite::Direction => "directions",
        NotFinite::Distance | NotFinite::MinDistance => "max_distance",
        _ => "origins",
    };
    PyValueError::new_err(format!("{argument}: row {row}: {why}"))
}

/// Lists of results of consecutive ranges of rays, each with the index of its first ray.
type RangeLists<T> = Vec<(usize, Lists<T>)>;

/// The lists of `query` for all rays, and the number of their values.
fn lists_of<'a, T: Send>(
    py: Python,
    rays: &RayArrays<'a>,
    query: impl Fn(RayArrays<'a>) -> Lists<T> + Sync,
) -> PyResult<(RangeLists<T>, usize)> {
    let mut lists = Vec::new();
    in_ranges(py, rays.len(), |range| lists.push((range.start, query(rays.slice(range)))))?;
    let count = lists.iter().map(|(_, lists)| lists.values()).sum();
    Ok((lists, count))
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
        let mut rounding = CoarseRounding::new(numerics);
        let ids = (0..).map(PrimId);
        let seen = primitives.zip(ids).map(|(primitive, id)| {
            rounding.add(id, &primitive);
            primitive
        });
        let bvh = in_threads(py, || Bvh::with(seen, preset, numerics))?;
        let bvh = bvh.map_err(|why| PyValueError::new_err(format!("vertices: {why}")))?;
        if rounding.triangles > 0 {
            warn(py, &rounding.to_string())?;
        }
        Ok(Mesh { bvh, primitives: count })
    }

    /// The results of `query` for the points, and the shape of these without the dimension of vectors. Before that, warns of
    /// a surface that is not closed, where `needs_inside`.
    fn with_points<R: Send>(
        &self,
        points: &Bound<PyAny>,
        needs_inside: bool,
        query: impl Fn(&Bvh, &[DVec3]) -> Vec<R> + Sync,
    ) -> PyResult<(Vec<R>, Vec<usize>)> {
        let py = points.py();
        let (array, shape) = vectors_of(points, "points")?;
        let rows: &[[f64; 3]] = chunks(&array)?;
        check_finite(rows, "points")?;
        if needs_inside {
            let closedness = in_threads(py, || self.bvh.closedness())?;
            if !closedness.is_closed() {
                warn(py, &NotClosed(closedness).to_string())?;
            }
        }
        let points: &[DVec3] = bytemuck::cast_slice(rows);
        let mut results = Vec::with_capacity(points.len());
        in_ranges(py, points.len(), |range| results.extend(query(&self.bvh, &points[range])))?;
        Ok((results, shape))
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
        let mut columns = Columns::new(py, arguments.shape.iter().product())?;
        if let Some(rays) = arguments.few(&self.bvh)? {
            let rays = rays.rays();
            let hits = py.detach(|| self.bvh.closest_hits(rays, &mut Traversal::default()));
            for ((mut row, ray), hit) in columns.slices()?.into_iter().zip(rays.iter()).zip(hits.iter()) {
                set(&mut row, &ray, hit.as_ref());
            }
        } else {
            let rays = arguments.rays(py, &self.bvh)?;
            let mut rows = columns.slices()?;
            in_ranges(py, rays.len(), |range| {
                let places = rows.split_first(range.len()).into_par_iter();
                let rays = rays.slice(range);
                self.bvh.par_each_closest_hit(&rays, places, |row, ray, hit| set(row, ray, hit.as_ref()));
            })?;
        }
        let arrays = columns.arrays().map(|array| in_shape(array, &arguments.shape));
        let [triangle, distance, location, barycentrics] = arrays;
        result(py, "Hits", [triangle?, distance?, location?, barycentrics?])
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
        let mut occluded = Vec::new();
        if let Some(rays) = arguments.few(&self.bvh)? {
            occluded = py.detach(|| self.bvh.are_occluded(rays.rays(), &mut Traversal::default()));
        } else {
            let rays = arguments.rays(py, &self.bvh)?;
            occluded.reserve_exact(rays.len());
            in_ranges(py, rays.len(), |range| {
                occluded.extend(self.bvh.par_are_occluded(rays.slice(range)));
            })?;
        }
        in_shape(vector(py, occluded), &arguments.shape)
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
        let (lists, count) = lists_of(py, &rays, |rays| self.bvh.par_all_hits(rays))?;
        let (mut index, mut columns) = (zeros(py, [count])?, Columns::new(py, count)?);
        let (mut indices, mut rows) = (index.as_slice_mut()?, columns.slices()?);
        in_threads(py, || {
            for (start, all) in lists {
                let own = indices.split_off_mut(..all.values()).unwrap_or_default();
                let places = own.par_iter_mut().zip(rows.split_first(all.values()).into_par_iter());
                all.par_each(places, |(index, mut row), ray, hit| {
                    *index = (start + ray) as i64;
                    set(&mut row, &rays.get(start + ray), Some(hit));
                });
            }
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
        let (lists, len) = lists_of(py, &rays, |rays| self.bvh.par_crossings(rays))?;
        let [mut index, mut triangle] = [zeros(py, [len])?, zeros(py, [len])?];
        let (mut distance, mut location) = (zeros(py, [len])?, zeros(py, [len, 3])?);
        let mut entering = zeros(py, [len])?;
        let (indices, triangles, distances) =
            (index.as_slice_mut()?, triangle.as_slice_mut()?, distance.as_slice_mut()?);
        let (locations, sides) = (vectors(&mut location)?, entering.as_slice_mut()?);
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
                    &mut sides[own],
                );
                let write = |place: (&mut i64, &mut i64, &mut f64, &mut [f64; 3], &mut bool),
                             ray: usize,
                             crossing: &SignedHit| {
                    let (SignedHit { t, prim, side, .. }, ray) = (*crossing, start + ray);
                    (*place.0, *place.1, *place.2) = (ray as i64, prim.0.into(), t);
                    (*place.3, *place.4) = (rays.get(ray).at(t).to_array(), side == Side::Entering);
                };
                all.par_each(places.into_par_iter(), write);
            }
        })?;
        let fields = [any(&index), any(&triangle), any(&distance), any(&location), any(&entering)];
        result(py, "Crossings", fields)
    }

    /// Whether points are inside the surface: (n,) bool, whether the winding number is not 0. Exact for a closed
    /// surface; warns of another. points: (n, 3) float64.
    ///
    /// return_margin: for any surface, without a warning. Returns a pair: (n,) bool, whether the generalised winding
    /// number exceeds 1/2, and (n,) float64, how far it is from 1/2 beyond its error: 0.5 or more for a closed surface, small
    /// near holes, and not above 0 where the point is not decided.
    #[pyo3(signature = (points, return_margin = false))]
    fn contains<'py>(&self, points: &Bound<'py, PyAny>, return_margin: bool) -> PyResult<Bound<'py, PyAny>> {
        let py = points.py();
        if !return_margin {
            let (inside, shape) = self.with_points(points, true, |bvh, points| bvh.par_contains(points).0)?;
            return in_shape(vector(py, inside), &shape);
        }
        let (numbers, shape) =
            self.with_points(points, false, |bvh, points| bvh.par_generalised_winding_numbers(points, 1.0))?;
        let (is_inside, margin) = numbers.iter().map(|number| (number.is_inside(), number.margin())).unzip();
        let [is_inside, margin] = [vector::<bool>(py, is_inside), vector::<f64>(py, margin)];
        Ok(PyTuple::new(py, [in_shape(is_inside, &shape)?, in_shape(margin, &shape)?])?.into_any())
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
        let (numbers, shape) =
            self.with_points(points, false, |bvh, points| bvh.par_generalised_winding_numbers(points, beta))?;
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
        let (numbers, shape) = self.with_points(points, true, Bvh::par_winding_numbers)?;
        in_shape(vector(points.py(), numbers), &shape)
    }

    /// The closest points of the surface: ClosestPoints of n rows, with the triangle -1 and nan for a mesh without
    /// triangles. points: (n, 3) float64.
    fn closest_point<'py>(&self, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let (found, shape) = self.with_points(points, false, Bvh::par_closest_points)?;
        let py = points.py();
        let location =
            found.iter().map(|closest| closest.map_or([f64::NAN; 3], |closest| closest.point.to_array()));
        let distance = found.iter().map(|closest| closest.map_or(f64::NAN, |closest| closest.distance));
        let triangle = found.iter().map(|closest| closest.map_or(-1, |closest| i64::from(closest.prim.0)));
        let (location, distance) = (rows(py, location.collect())?, vector(py, distance.collect()));
        let fields = [location, distance, vector(py, triangle.collect::<Vec<i64>>())];
        let [location, distance, triangle] = fields.map(|array| in_shape(array, &shape));
        result(py, "ClosestPoints", [location?, distance?, triangle?])
    }

    /// The distances of points from the surface, negative inside: (n,) float64; nan for a mesh without triangles. Warns
    /// of a surface that is not closed. points: (n, 3) float64.
    fn signed_distance<'py>(&self, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let (distances, shape) = self.with_points(points, true, Bvh::par_signed_distances)?;
        let distances: Vec<f64> =
            distances.into_iter().map(|distance| distance.unwrap_or(f64::NAN)).collect();
        in_shape(vector(points.py(), distances), &shape)
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
