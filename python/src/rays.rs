//! Arguments of queries of rays.

use std::sync::Arc;

use kiln::bvh::detail::RayBuffer;
use kiln::bvh::{Bvh, Hit, InvalidRays, Lists, NotFinite, Ray, RayArrays, RayList};
use kiln::scene::Scene;
use kiln::shading::SceneOpacity;
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::{check_shape, chunks, converted, named_rows, per_ray, vectors_of};
use crate::state::{ObjectPart, State};
use crate::threads::{RAYS, in_ranges, in_threads};

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
        let rays = in_threads(py, || bvh.rays(origins, directions, t_max))?.map_err(|error| match error {
            InvalidRays::Ray { index, why } => self.invalid(bvh, index, why),
            other => PyValueError::new_err(other.to_string()),
        })?;
        Ok(self.width().map_or(rays, |width| rays.in_rows(width)))
    }

    /// The width of the picture that the rays are of: that of an array of 64 to 4,096 columns.
    fn width(&self) -> Option<usize> {
        let (width, rest) = self.shape.split_last()?;
        (!rest.is_empty() && (64..=1 << 12).contains(width)).then_some(*width)
    }

    /// The number of rays, and of those that are traced together: of pictures whole rows of tiles.
    pub(crate) fn ranges(&self) -> (usize, usize) {
        let task = |width: usize| 8 * width * (RAYS / (8 * width)).max(1);
        (self.shape.iter().product(), self.width().map_or(RAYS, task))
    }

    /// The exception of invalid rays, of which the first is at `index`.
    fn invalid(&self, bvh: &Bvh, index: usize, why: NotFinite) -> PyErr {
        let argument = match why {
            NotFinite::Direction => "directions",
            NotFinite::Distance | NotFinite::MinDistance => "max_distance",
            _ => "origins",
        };
        let rows = || -> PyResult<String> {
            let [origins, directions] = [self.origins.get()?, self.directions.get()?];
            let is_same = |row: &usize| {
                bvh.ray_within(origins[*row], directions[*row], self.t_max(*row)).err() == Some(why)
            };
            Ok(named_rows((index..origins.len()).filter(is_same)).0)
        };
        match rows() {
            Ok(rows) => PyValueError::new_err(format!("{argument}: {rows}: {why}")),
            Err(error) => error,
        }
    }

    fn t_max(&self, row: usize) -> f64 {
        match self.max_distance.as_deref() {
            None => f64::INFINITY,
            Some(&[one]) => one,
            Some(each) => each[row],
        }
    }

    /// The rays, checked, if they are so few that starting threads would take longer than tracing them.
    pub(crate) fn few(&self, bvh: &Bvh) -> PyResult<Option<RayBuffer>> {
        let [origins, directions] = [self.origins.get()?, self.directions.get()?];
        if origins.len() > FEW {
            return Ok(None);
        }
        let mut rays = RayBuffer::default();
        for (row, (&origin, &direction)) in origins.iter().zip(directions).enumerate() {
            let ray = bvh.ray_within(origin, direction, self.t_max(row));
            rays.push(&ray.map_err(|why| self.invalid(bvh, row, why))?);
        }
        Ok(Some(rays))
    }
}

/// The most rays or points of a query by the calling thread.
pub(crate) const FEW: usize = 64;

/// Lists of results of consecutive ranges of rays, each with the index of its first ray.
pub(crate) type RangeLists<T> = Vec<(usize, Lists<T>)>;

/// The lists of `query` for all rays, and the number of their values.
pub(crate) fn lists_of<'a, T: Send>(
    py: Python,
    rays: &RayArrays<'a>,
    query: impl Fn(RayArrays<'a>) -> Lists<T> + Sync,
) -> PyResult<(RangeLists<T>, usize)> {
    let mut lists = Vec::new();
    in_ranges(py, (rays.len(), RAYS), |range| lists.push((range.start, query(rays.slice(range)))))?;
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
        let objects = objects.map(|value| selected(value, &state.objects)).transpose()?;
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

/// A flag for each object, of their flags or numbers.
fn selected(value: &Bound<PyAny>, objects: &[ObjectPart]) -> PyResult<Vec<bool>> {
    let (array, count) = (value.py().import("numpy")?.call_method1("atleast_1d", (value,))?, objects.len());
    if let Ok(flags) = array.extract::<PyReadonlyArray1<bool>>() {
        let flags: Vec<bool> = flags.as_array().iter().copied().collect();
        if flags.len() != count {
            let what = format!("objects: {} flags, and there are {count} objects", flags.len());
            return Err(PyValueError::new_err(what));
        }
        return Ok(flags);
    }
    let numbers = converted(&array, "objects", ("iu", "int64"))?.call_method1("reshape", (-1,))?;
    let mut flags = vec![false; count];
    for &number in numbers.extract::<PyReadonlyArray1<i64>>()?.as_slice()? {
        match objects.binary_search_by_key(&number, |object| object.number.into()) {
            Ok(index) => flags[index] = true,
            Err(_) => {
                let what = format!("objects: there is no object {number} among {count}");
                return Err(PyValueError::new_err(what));
            }
        }
    }
    Ok(flags)
}
