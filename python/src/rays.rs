//! Arguments of queries of rays.

use std::sync::Arc;

use kiln::bvh::detail::RayBuffer;
use kiln::bvh::{Bvh, Hit, InvalidRays, Lists, NotFinite, Ray, RayArrays, RayList};
use kiln::scene::Scene;
use kiln::shading::SceneOpacity;
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::{check_shape, chunks, converted, per_ray, vectors_of};
use crate::state::State;
use crate::threads::{in_ranges, in_threads};

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
pub(crate) struct RayArguments<'py> {
    origins: Rows<'py>,
    directions: Rows<'py>,
    max_distance: Option<Vec<f64>>,
    /// The shape of the arrays of rays, without the dimension of vectors.
    pub shape: Vec<usize>,
}

impl<'py> RayArguments<'py> {
    /// Arrays of the same shape (..., 3). One vector (3,) goes with each of the other argument.
    pub(crate) fn new(
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
    pub(crate) fn rays(&self, py: Python, bvh: &Bvh) -> PyResult<RayArrays<'_>> {
        let [origins, directions] = [self.origins.get()?, self.directions.get()?];
        let t_max = self.max_distance.as_deref();
        in_threads(py, || bvh.rays(origins, directions, t_max))?.map_err(|error| match error {
            InvalidRays::Ray { index, why } => invalid(index, why),
            other => PyValueError::new_err(other.to_string()),
        })
    }

    /// The rays, checked, if they are so few that starting threads would take longer than tracing them.
    pub(crate) fn few(&self, bvh: &Bvh) -> PyResult<Option<RayBuffer>> {
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
pub(crate) type RangeLists<T> = Vec<(usize, Lists<T>)>;

/// The lists of `query` for all rays, and the number of their values.
pub(crate) fn lists_of<'a, T: Send>(
    py: Python,
    rays: &RayArrays<'a>,
    query: impl Fn(RayArrays<'a>) -> Lists<T> + Sync,
) -> PyResult<(RangeLists<T>, usize)> {
    let mut lists = Vec::new();
    in_ranges(py, rays.len(), |range| lists.push((range.start, query(rays.slice(range)))))?;
    let count = lists.iter().map(|(_, lists)| lists.values()).sum();
    Ok((lists, count))
}

/// The hits that a query is restricted to.
pub(crate) struct Filter {
    /// Whether each object is hit; `None` where all are.
    objects: Option<Vec<bool>>,
    culls_back_faces: bool,
    /// Opacities of the scene, where rays pass what its pictures do not show.
    opacity: Option<(Arc<Scene>, SceneOpacity)>,
}

impl Filter {
    /// The filter of arguments; `None` where all hits are accepted.
    pub(crate) fn new(
        state: &State,
        objects: Option<&Bound<PyAny>>,
        culls_back_faces: bool,
        passes_transparent: bool,
    ) -> PyResult<Option<Self>> {
        let objects = objects.map(|value| selected(value, state.objects.len())).transpose()?;
        let scene = state.scene.as_ref().filter(|_| passes_transparent);
        let opacity = scene.map(|scene| (Arc::clone(scene), SceneOpacity::new(scene)));
        let is_any = objects.is_some() || culls_back_faces || opacity.is_some();
        Ok(is_any.then_some(Filter { objects, culls_back_faces, opacity }))
    }

    /// Whether a hit is accepted.
    #[inline]
    pub(crate) fn accepts(&self, state: &State, ray: &Ray, hit: &Hit) -> bool {
        let ((object, primitive), [v, w]) = (state.locate(hit.prim), hit.barycentrics);
        let is_visible = |(scene, opacity): &(Arc<Scene>, SceneOpacity)| {
            opacity.is_visible(scene, object, primitive, [1.0 - v - w, v, w])
        };
        self.objects.as_ref().is_none_or(|objects| objects[object])
            && !(self.culls_back_faces && state.is_back(ray, hit))
            && self.opacity.as_ref().is_none_or(is_visible)
    }
}

/// A flag for each of `count` objects, of their flags or indices.
fn selected(value: &Bound<PyAny>, count: usize) -> PyResult<Vec<bool>> {
    let array = value.py().import("numpy")?.call_method1("atleast_1d", (value,))?;
    if let Ok(flags) = array.extract::<PyReadonlyArray1<bool>>() {
        let flags: Vec<bool> = flags.as_array().iter().copied().collect();
        if flags.len() != count {
            let what = format!("objects: {} flags, and there are {count} objects", flags.len());
            return Err(PyValueError::new_err(what));
        }
        return Ok(flags);
    }
    let indices = converted(&array, "objects", ("iu", "int64"))?.call_method1("reshape", (-1,))?;
    let mut flags = vec![false; count];
    for &index in indices.extract::<PyReadonlyArray1<i64>>()?.as_slice()? {
        match usize::try_from(index).ok().and_then(|index| flags.get_mut(index)) {
            Some(flag) => *flag = true,
            None => {
                let what = format!("objects: there is no object {index} among {count}");
                return Err(PyValueError::new_err(what));
            }
        }
    }
    Ok(flags)
}
