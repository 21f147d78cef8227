//! Arrays of numpy: checked input in the layout that the library reads, and output without copies.

use kiln::glam::DMat4;
use numpy::ndarray::{Dim, Dimension};
use numpy::{
    Element, PyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
    PyReadwriteArray, PyReadwriteArray2, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyFloat};

/// Numpy's kinds of element types that are converted to f64, and the name of that type.
pub(crate) const FLOATS: (&str, &str) = ("fiu", "float64");

/// The array of an argument with elements of the kinds `kinds` (numpy's letters), converted to `dtype` in C order. Only
/// an array that has this type and order is not copied.
pub(crate) fn converted<'py>(
    value: &Bound<'py, PyAny>,
    name: &str,
    (kinds, dtype): (&str, &str),
) -> PyResult<Bound<'py, PyAny>> {
    let py = value.py();
    let numpy = py.import("numpy")?;
    let array = numpy.call_method1("asarray", (value,)).map_err(|e| {
        let is_value = e.is_instance_of::<PyValueError>(py) || e.is_instance_of::<PyTypeError>(py);
        if is_value { PyValueError::new_err(format!("{name}: not an array: {}", e.value(py))) } else { e }
    })?;
    check_unmasked(value, name)?;
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    // An empty list has the type f64.
    let is_empty = array.getattr("size")?.extract::<usize>()? == 0;
    if !(kinds.contains(&kind) || is_empty && kind == "f") {
        let what = if kinds.contains('f') { "numbers" } else { "integers" };
        let given = array.getattr("dtype")?;
        return Err(PyValueError::new_err(format!("{name}: expected {what}, not the dtype {given}")));
    }
    let options = PyDict::new(py);
    options.set_item("dtype", dtype)?;
    options.set_item("requirements", "CA")?;
    // Values beyond the type become infinite, which is checked where they are used.
    let ignored = PyDict::new(py);
    ignored.set_item("over", "ignore")?;
    ignored.set_item("invalid", "ignore")?;
    let state = numpy.call_method("errstate", (), Some(&ignored))?;
    state.call_method0("__enter__")?;
    let array = numpy.call_method("require", (array,), Some(&options));
    state.call_method1("__exit__", (py.None(), py.None(), py.None()))?;
    array
}

/// An error if a masked array has masked entries.
fn check_unmasked(value: &Bound<PyAny>, name: &str) -> PyResult<()> {
    if !value.hasattr("mask")? {
        return Ok(());
    }
    let masked = value.py().import("numpy.ma")?;
    if !masked.call_method1("is_masked", (value,))?.is_truthy()? {
        return Ok(());
    }
    // A masked scalar has no row.
    let rows = masked.call_method1("getmaskarray", (value,))?.call_method0("nonzero");
    let row = rows.and_then(|rows| rows.get_item(0)?.get_item(0)?.extract::<usize>()).unwrap_or(0);
    Err(PyValueError::new_err(format!("{name}: row {row} has masked entries")))
}

/// The array without a copy or a call of numpy, if its type, shape and order are those that the library reads.
fn as_given<'py, T: Element>(value: &Bound<'py, PyAny>, width: usize) -> Option<PyReadonlyArray2<'py, T>> {
    let array = value.cast_exact::<PyArray2<T>>().ok()?;
    let is_read = array.is_c_contiguous() && array.is_aligned() && array.shape()[1] == width;
    is_read.then(|| array.try_readonly().ok())?
}

fn checked_rows<'py, T: Element>(
    value: &Bound<'py, PyAny>,
    name: &str,
    width: usize,
    (kinds, dtype): (&str, &str),
) -> PyResult<PyReadonlyArray2<'py, T>> {
    if let Some(array) = as_given(value, width) {
        return Ok(array);
    }
    let array = converted(value, name, (kinds, dtype))?;
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    if !(shape.len() == 2 && shape[1] == width || shape == [0]) {
        let shape = array.getattr("shape")?;
        return Err(PyValueError::new_err(format!("{name}: expected the shape (n, {width}), not {shape}")));
    }
    let array = array.call_method1("reshape", (-1, width))?;
    array.extract()
}

/// A row of numbers an element.
pub(crate) fn numbers<'py>(
    value: &Bound<'py, PyAny>,
    name: &str,
    width: usize,
) -> PyResult<PyReadonlyArray2<'py, f64>> {
    checked_rows(value, name, width, FLOATS)
}

/// The rows of an array of the shape (..., 3), and its shape without the last dimension.
pub(crate) fn vectors_of<'py>(
    value: &Bound<'py, PyAny>,
    name: &str,
) -> PyResult<(PyReadonlyArray2<'py, f64>, Vec<usize>)> {
    if let Some(array) = as_given(value, 3) {
        let shape = vec![array.shape()[0]];
        return Ok((array, shape));
    }
    let array = converted(value, name, FLOATS)?;
    let mut shape: Vec<usize> = array.getattr("shape")?.extract()?;
    if shape != [0] && shape.pop() != Some(3) {
        let shape = array.getattr("shape")?;
        return Err(PyValueError::new_err(format!("{name}: expected the shape (..., 3), not {shape}")));
    }
    let rows = array.call_method1("reshape", (-1, 3))?.extract()?;
    Ok((rows, shape))
}

/// A number for each ray of the shape `shape`: one for all, or an array of this shape.
pub(crate) fn per_ray(value: &Bound<PyAny>, name: &str, other: &str, rays: &[usize]) -> PyResult<Vec<f64>> {
    if let Ok(number) = value.cast_exact::<PyFloat>() {
        return Ok(vec![number.value()]);
    }
    let array = converted(value, name, FLOATS)?;
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    if shape.is_empty() {
        return Ok(vec![array.extract()?]);
    }
    check_shape((name, &shape), (other, rays))?;
    let array: PyReadonlyArray1<f64> = array.call_method1("reshape", (-1,))?.extract()?;
    Ok(array.as_slice()?.to_vec())
}

/// The shape of one matrix.
pub(crate) const ONE: &str = "(4, 4)";

/// The shape of several matrices.
pub(crate) const SEVERAL: &str = "(k, 4, 4)";

/// Affine maps, in numpy's order of rows, of one of the shapes [`ONE`] and [`SEVERAL`].
pub(crate) fn matrices(value: &Bound<PyAny>, name: &str, shapes: &[&str]) -> PyResult<Vec<DMat4>> {
    let array = converted(value, name, FLOATS)?;
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    let is_expected = match shape.as_slice() {
        [4, 4] => shapes.contains(&ONE),
        [_, 4, 4] => shapes.contains(&SEVERAL),
        _ => false,
    };
    if !is_expected {
        let (expected, shape) = (shapes.join(" or "), array.getattr("shape")?);
        return Err(PyValueError::new_err(format!("{name}: expected the shape {expected}, not {shape}")));
    }
    let count: usize = shape[..shape.len() - 2].iter().product();
    let rows = numbers(&array.call_method1("reshape", (count, 16))?, name, 16)?;
    let matrix = |(index, matrix): (usize, &[f64; 16])| {
        let matrix = DMat4::from_cols_array(matrix).transpose();
        let mistake = |what| PyValueError::new_err(format!("{name}: matrix {index}{what}"));
        if !matrix.is_finite() {
            return Err(mistake(" is not finite"));
        }
        if matrix.row(3).to_array() != [0.0, 0.0, 0.0, 1.0] {
            return Err(mistake(": the last row must be 0, 0, 0, 1"));
        }
        Ok(matrix)
    };
    chunks(&rows)?.iter().enumerate().map(matrix).collect()
}

/// Vertex indices of triangles, each below `count`.
pub(crate) fn triangles(value: &Bound<PyAny>, name: &str, count: usize) -> PyResult<Vec<[u32; 3]>> {
    let array: PyReadonlyArray2<i64> = checked_rows(value, name, 3, ("iu", "int64"))?;
    // Indices from 2^63 are negative in i64.
    let is_unsigned = value.getattr_opt("dtype")?.is_some_and(|dtype| dtype.eq("uint64").unwrap_or(false));
    let faces = array.as_slice()?.as_chunks().0.iter().enumerate();
    let triangle = |(row, face): (usize, &[i64; 3])| {
        let is_vertex = |index: &i64| usize::try_from(*index).is_ok_and(|index| index < count);
        match face.iter().find(|index| !is_vertex(index)) {
            None => Ok(face.map(|index| index as u32)),
            Some(index) => Err(PyValueError::new_err(format!(
                "{name}: row {row} has the vertex {}, and there are {count} vertices",
                if is_unsigned { i128::from(*index as u64) } else { i128::from(*index) }
            ))),
        }
    };
    faces.map(triangle).collect()
}

/// The rows of an array of [`numbers`] with as many columns as `N`.
pub(crate) fn chunks<'a, const N: usize>(array: &'a PyReadonlyArray2<f64>) -> PyResult<&'a [[f64; N]]> {
    Ok(array.as_slice()?.as_chunks().0)
}

/// An error unless two arguments have as many rows.
pub(crate) fn check_rows((name, count): (&str, usize), (other, expected): (&str, usize)) -> PyResult<()> {
    if count == expected {
        return Ok(());
    }
    let what = format!("{name}: {count} rows, and {other} has {expected}");
    Err(PyValueError::new_err(what))
}

/// An error unless two arguments have the same shape, without the dimension of vectors.
pub(crate) fn check_shape(
    (name, shape): (&str, &[usize]),
    (other, expected): (&str, &[usize]),
) -> PyResult<()> {
    match (shape, expected) {
        _ if shape == expected => Ok(()),
        (&[count], &[expected]) => check_rows((name, count), (other, expected)),
        _ => {
            let what = format!("{name}: the shape is {shape:?}, and that of {other} {expected:?}");
            Err(PyValueError::new_err(what))
        }
    }
}

/// An array of (n,) or (n, k) elements in the shape of the queries.
pub(crate) fn in_shape<'py>(array: Bound<'py, PyAny>, shape: &[usize]) -> PyResult<Bound<'py, PyAny>> {
    if shape.len() == 1 {
        return Ok(array);
    }
    let width: Vec<usize> = array.getattr("shape")?.extract()?;
    array.call_method1("reshape", ([shape, &width[1..]].concat(),))
}

/// Checks that rows are finite in f32, which bounds are in.
pub(crate) fn check_finite<const N: usize>(rows: &[[f64; N]], name: &str) -> PyResult<()> {
    let is_finite = |row: &[f64; N]| row.iter().all(|&x| (x as f32).is_finite());
    if rows.iter().all(is_finite) {
        return Ok(());
    }
    let wrong = rows.iter().enumerate().filter(|(_, row)| !is_finite(row)).map(|(index, _)| index);
    let (rows, count) = named_rows(wrong);
    let is = if count > 1 { "are" } else { "is" };
    Err(PyValueError::new_err(format!("{name}: {rows} {is} not finite, or too large for f32")))
}

/// The first of these rows, with the number of others, for messages; and the number of all.
pub(crate) fn named_rows(rows: impl Iterator<Item = usize>) -> (String, usize) {
    const NAMED: usize = 8;
    let rows: Vec<usize> = rows.collect();
    let named: Vec<String> = rows.iter().take(NAMED).map(usize::to_string).collect();
    let others = match rows.len().saturating_sub(NAMED) {
        0 => String::new(),
        others => format!(" and {others} others"),
    };
    (format!("{} {}{others}", if rows.len() > 1 { "rows" } else { "row" }, named.join(", ")), rows.len())
}

/// An array with the elements of a vector, whose memory it takes over.
pub(crate) fn vector<'py, T: Element>(py: Python<'py>, values: Vec<T>) -> Bound<'py, PyAny> {
    PyArray1::from_vec(py, values).into_any()
}

/// An array with a row of three an element of a vector, whose memory it takes over.
pub(crate) fn rows(py: Python, values: Vec<[f64; 3]>) -> PyResult<Bound<PyAny>> {
    let shape = [values.len(), 3];
    shaped(py, values.into_flattened(), &shape)
}

/// An array of this shape with the elements of a vector, whose memory it takes over.
pub(crate) fn shaped<'py, T: Element>(
    py: Python<'py>,
    values: Vec<T>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyAny>> {
    Ok(PyArray1::from_vec(py, values).reshape(shape)?.into_any())
}

/// An array of this shape, of zeros whose memory is not touched yet. Without memory for it, a `MemoryError`.
pub(crate) fn zeros<'py, T: Element, const N: usize>(
    py: Python<'py>,
    shape: [usize; N],
) -> PyResult<PyReadwriteArray<'py, T, Dim<[usize; N]>>>
where
    Dim<[usize; N]>: Dimension,
{
    let array = py.import("numpy")?.call_method1("zeros", (shape.to_vec(), T::get_dtype(py)))?;
    Ok(array.cast_into::<PyArray<T, Dim<[usize; N]>>>()?.try_readwrite()?)
}

/// The rows of an array of [`zeros`] with three columns.
pub(crate) fn vectors<'a>(array: &'a mut PyReadwriteArray2<f64>) -> PyResult<&'a mut [[f64; 3]]> {
    Ok(array.as_slice_mut()?.as_chunks_mut().0)
}

/// An array of [`zeros`] as an object.
pub(crate) fn any<'py, T: Element, D: Dimension>(array: &PyReadwriteArray<'py, T, D>) -> Bound<'py, PyAny> {
    array.as_any().clone()
}
