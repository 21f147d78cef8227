//! Results of queries: arrays, and what is computed from them when it is read.

use std::sync::Arc;

use kiln::bvh::{Hit, PrimId, Ray, SlotId};
use kiln::glam::DVec3;
use numpy::{
    PyArray2, PyArrayMethods, PyReadonlyArray2, PyReadwriteArray1, PyReadwriteArray2, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use rayon::prelude::*;

use crate::arrays::{any, check_rows, chunks, in_shape, vectors, vectors_of, zeros};
use crate::state::State;
use crate::threads::in_threads;

/// A named tuple of `kiln._results`.
pub(crate) fn result<'py>(
    py: Python<'py>,
    name: &str,
    fields: impl IntoIterator<Item = Bound<'py, PyAny>, IntoIter: ExactSizeIterator>,
) -> PyResult<Bound<'py, PyAny>> {
    py.import("kiln._results")?.getattr(name)?.call1(PyTuple::new(py, fields)?)
}

/// The index of no primitive and no slot.
const NONE: u32 = u32::MAX;

/// The primitives of results, and the state that these come from.
#[pyclass(frozen, module = "kiln._kiln")]
pub(crate) struct Found {
    state: Arc<State>,
    /// The primitive of each result and, of hits, its slot, or [`NONE`].
    places: Py<PyArray2<u32>>,
    /// The shape of the results.
    shape: Vec<usize>,
}

impl Found {
    /// A named tuple whose arrays have a row for each of `places`.
    pub(crate) fn result<'py>(
        name: &str,
        fields: impl IntoIterator<Item = Bound<'py, PyAny>, IntoIter: ExactSizeIterator>,
        state: Arc<State>,
        places: &PyReadwriteArray2<'py, u32>,
        shape: Vec<usize>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = places.py();
        let fields = fields.into_iter().map(|field| in_shape(field, &shape));
        let result = result(py, name, fields.collect::<PyResult<Vec<_>>>()?)?;
        let found = Found { state, places: (***places).clone().unbind(), shape };
        result.setattr("_found", Bound::new(py, found)?)?;
        Ok(result)
    }

    /// The places of results of `primitives`, without slots.
    pub(crate) fn places(
        py: Python,
        primitives: impl ExactSizeIterator<Item = Option<PrimId>>,
    ) -> PyResult<PyReadwriteArray2<u32>> {
        let mut places = zeros(py, [primitives.len(), 1])?;
        for (place, prim) in places.as_slice_mut()?.iter_mut().zip(primitives) {
            *place = prim.map_or(NONE, |prim| prim.0);
        }
        Ok(places)
    }

    /// `value` of each primitive, -1 where there is none.
    fn indices<'py>(
        &self,
        py: Python<'py>,
        value: impl Fn(PrimId) -> i64 + Sync,
    ) -> PyResult<Bound<'py, PyAny>> {
        let places = self.places.bind(py).readonly();
        let width = places.shape()[1];
        let mut column = zeros(py, [places.shape()[0]])?;
        let (places, indices) = (places.as_slice()?, column.as_slice_mut()?);
        let of = |place: &[u32]| if place[0] == NONE { -1 } else { value(PrimId(place[0])) };
        in_threads(py, || {
            indices
                .par_iter_mut()
                .zip(places.par_chunks(width))
                .for_each(|(index, place)| *index = of(place));
        })?;
        in_shape(any(&column), &self.shape)
    }

    /// `value` of each hit: its index, primitive and slot; nan where there is none.
    fn numbers<'py, const N: usize>(
        &self,
        py: Python<'py>,
        value: impl Fn(usize, PrimId, SlotId) -> Option<[f64; N]> + Sync,
    ) -> PyResult<Bound<'py, PyAny>> {
        let places = self.places.bind(py).readonly();
        let mut column = zeros(py, [places.shape()[0], N])?;
        let (places, rows) = (places.as_slice()?.as_chunks().0, column.as_slice_mut()?.as_chunks_mut().0);
        let of = |(index, &[prim, slot]): (usize, &[u32; 2])| match prim {
            NONE => None,
            _ => value(index, PrimId(prim), SlotId::new(slot)),
        };
        in_threads(py, || {
            let places = places.par_iter().enumerate();
            let nan = [f64::NAN; N];
            rows.par_iter_mut().zip(places).for_each(|(row, place)| *row = of(place).unwrap_or(nan));
        })?;
        in_shape(any(&column), &self.shape)
    }

    /// The rows of an array of the results.
    fn rows<'py>(&self, value: &Bound<'py, PyAny>, name: &str) -> PyResult<PyReadonlyArray2<'py, f64>> {
        let rows = vectors_of(value, name)?.0;
        check_rows((name, rows.shape()[0]), ("the result", self.shape.iter().product()))?;
        Ok(rows)
    }
}

#[pymethods]
impl Found {
    /// The index of the object of each result.
    fn object<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.indices(py, |prim| self.state.objects[self.state.locate(prim).0].number.into())
    }

    /// The index of the object among the placements of the same mesh.
    fn instance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.indices(py, |prim| self.state.objects[self.state.locate(prim).0].instance.into())
    }

    /// The index of the primitive among those of all objects.
    fn primitive<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.indices(py, |prim| prim.0.into())
    }

    /// The index of the material; -1 without a scene.
    fn material<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.indices(py, |prim| self.state.material(self.state.locate(prim).0).map_or(-1, i64::from))
    }

    /// The unit normal of the front at the points `location` of hits.
    fn normal<'py>(&self, location: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let points = self.rows(location, "location")?;
        let points: &[[f64; 3]] = chunks(&points)?;
        self.numbers(location.py(), |index, prim, slot| {
            self.state
                .bvh
                .geometric_normal_at(prim, slot, points[index].into())
                .map(|normal| normal.to_array())
        })
    }

    /// The shading normal at these points, on the side of the normal.
    fn shading_normal<'py>(
        &self,
        location: &Bound<'py, PyAny>,
        barycentrics: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (points, weights) = (self.rows(location, "location")?, self.rows(barycentrics, "barycentrics")?);
        let (points, weights): (&[[f64; 3]], &[[f64; 3]]) = (chunks(&points)?, chunks(&weights)?);
        self.numbers(location.py(), |index, prim, slot| {
            let normal =
                self.state.bvh.geometric_normal_at(prim, slot, points[index].into()).unwrap_or(DVec3::NAN);
            Some(self.state.shading_normal(prim, weights[index], normal).to_array())
        })
    }

    /// The texture coordinates at hits with these weights of corners.
    fn uv<'py>(&self, barycentrics: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let weights = self.rows(barycentrics, "barycentrics")?;
        let weights: &[[f64; 3]] = chunks(&weights)?;
        let of = |index: usize, prim, _| Some(self.state.uv(prim, weights[index])?.to_array());
        self.numbers(barycentrics.py(), of)
    }
}

/// Output arrays of hits.
pub(crate) struct Columns<'py> {
    triangle: PyReadwriteArray1<'py, i64>,
    distance: PyReadwriteArray1<'py, f64>,
    location: PyReadwriteArray2<'py, f64>,
    barycentrics: PyReadwriteArray2<'py, f64>,
    place: PyReadwriteArray2<'py, u32>,
}

/// The elements of [`Columns`], or of consecutive rows.
pub(crate) struct Slices<'a> {
    triangle: &'a mut [i64],
    distance: &'a mut [f64],
    location: &'a mut [[f64; 3]],
    barycentrics: &'a mut [[f64; 3]],
    place: &'a mut [[u32; 2]],
}

impl<'a> Slices<'a> {
    /// Removes the first `count` rows, of which there must be as many, and returns them.
    pub(crate) fn split_first(&mut self, count: usize) -> Self {
        fn split<'a, T>(slice: &mut &'a mut [T], count: usize) -> &'a mut [T] {
            slice.split_off_mut(..count).unwrap_or_default()
        }
        Slices {
            triangle: split(&mut self.triangle, count),
            distance: split(&mut self.distance, count),
            location: split(&mut self.location, count),
            barycentrics: split(&mut self.barycentrics, count),
            place: split(&mut self.place, count),
        }
    }

    pub(crate) fn into_iter(self) -> impl Iterator<Item = Row<'a>> {
        let of_ray = self.triangle.iter_mut().zip(self.distance);
        let of_point = self.location.iter_mut().zip(self.barycentrics).zip(self.place);
        of_ray.zip(of_point).map(|((triangle, distance), ((location, barycentrics), place))| {
            (triangle, distance, location, barycentrics, place)
        })
    }

    pub(crate) fn into_par_iter(self) -> impl IndexedParallelIterator<Item = Row<'a>> {
        (self.triangle, self.distance, self.location, self.barycentrics, self.place).into_par_iter()
    }
}

/// The elements of a hit in [`Columns`].
pub(crate) type Row<'a> = (&'a mut i64, &'a mut f64, &'a mut [f64; 3], &'a mut [f64; 3], &'a mut [u32; 2]);

impl<'py> Columns<'py> {
    pub(crate) fn new(py: Python<'py>, len: usize) -> PyResult<Self> {
        let (triangle, distance) = (zeros(py, [len])?, zeros(py, [len])?);
        let (location, barycentrics) = (zeros(py, [len, 3])?, zeros(py, [len, 3])?);
        Ok(Columns { triangle, distance, location, barycentrics, place: zeros(py, [len, 2])? })
    }

    pub(crate) fn slices(&mut self) -> PyResult<Slices<'_>> {
        Ok(Slices {
            triangle: self.triangle.as_slice_mut()?,
            distance: self.distance.as_slice_mut()?,
            location: vectors(&mut self.location)?,
            barycentrics: vectors(&mut self.barycentrics)?,
            place: self.place.as_slice_mut()?.as_chunks_mut().0,
        })
    }

    /// The named tuple of these arrays, with the indices of rays before them in `AllHits`.
    pub(crate) fn result(
        self,
        ray: Option<Bound<'py, PyAny>>,
        state: Arc<State>,
        shape: Vec<usize>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let name = if ray.is_some() { "AllHits" } else { "Hits" };
        let own = [any(&self.triangle), any(&self.distance), any(&self.location), any(&self.barycentrics)];
        let fields: Vec<_> = ray.into_iter().chain(own).collect();
        Found::result(name, fields, state, &self.place, shape)
    }
}

/// Writes the hit of a ray, or a miss.
#[inline]
pub(crate) fn set(
    (triangle, distance, location, barycentrics, place): &mut Row,
    state: &State,
    ray: &Ray,
    hit: Option<&Hit>,
) {
    let Some(hit) = hit else {
        (**triangle, **distance) = (-1, f64::NAN);
        ([**location, **barycentrics], **place) = ([[f64::NAN; 3]; 2], [NONE; 2]);
        return;
    };
    let [v, w] = hit.barycentrics;
    (**triangle, **distance) = (state.locate(hit.prim).1.into(), hit.t);
    [**location, **barycentrics] = [ray.at(hit.t).to_array(), [1.0 - v - w, v, w]];
    **place = [hit.prim.0, hit.slot.index()];
}
