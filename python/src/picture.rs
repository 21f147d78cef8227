//! Rendering of scenes to arrays.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use kiln::cli::picture::{self, by_name};
use kiln::error::Warnings;
use kiln::film::Window;
use kiln::film::write::{Channel, Format, OutputImage};
use kiln::job::RenderControl;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::arrays::shaped;
use crate::scene::{NamedOptions, Scene, parse_options};
use crate::{interruptible, raised, warn_all};

/// A rendered picture.
#[pyclass(frozen, module = "kiln")]
pub(crate) struct Picture {
    picture: picture::Picture,
    /// The pixels, row by row from the top: (height, width, 3), or (height, width, 4) with a transparent background;
    /// uint8 display values whose colours are not multiplied by alpha, or float32 values in the scene's colour space,
    /// multiplied by alpha. Read-only, as what `save` writes does not change: `numpy.array(picture)` is a copy.
    #[pyo3(get)]
    pixels: Py<PyAny>,
    /// The AOVs by name: (height, width) float32, or (height, width, 3); read-only.
    #[pyo3(get)]
    aovs: Py<PyDict>,
    /// What made the picture: names and values, as in the metadata of files.
    #[pyo3(get)]
    metadata: Py<PyDict>,
    /// What was decided automatically, such as an added light.
    #[pyo3(get)]
    notes: Vec<String>,
}

/// Renders a scene.
#[pyfunction]
pub(crate) fn render(
    py: Python,
    scene: &Bound<Scene>,
    options: NamedOptions,
    dtype: &str,
    aovs: Vec<String>,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Picture> {
    let format = match dtype {
        "uint8" => Format::Png,
        "float32" => Format::Exr,
        _ => return Err(PyValueError::new_err(format!("dtype: `{dtype}` is neither uint8 nor float32"))),
    };
    let options = parse_options(options)?;
    let scene = scene.get().now();
    if options.has_import() && scene.import_options != options.import() {
        let what = "options of how files are read are for Scene(), which has read them";
        return Err(PyValueError::new_err(what));
    }
    let cancel = Arc::new(AtomicBool::new(false));
    let tiles = Arc::new([AtomicUsize::new(0), AtomicUsize::new(0)]);
    let mut reported = 0;
    let report = |_: Python| {
        let [done, total] = [0, 1].map(|k| tiles[k].load(Ordering::Relaxed));
        if let Some(progress) = progress.filter(|_| done > reported) {
            reported = done;
            progress.call1((done, total))?;
        }
        Ok(())
    };
    let (cancelled, counted) = (Arc::clone(&cancel), Arc::clone(&tiles));
    let (rendered, warnings) = interruptible(py, &cancel, report, move || {
        let mut warnings = Warnings::default();
        let control = RenderControl {
            cancel: &cancelled,
            progress: &|done, total| {
                counted[1].store(total, Ordering::Relaxed);
                counted[0].fetch_max(done, Ordering::Relaxed);
            },
            time_stages: false,
        };
        let scene = Arc::unwrap_or_clone(scene);
        (picture::render(scene, &options, format, &aovs, &control, &mut warnings), warnings)
    })?;
    warn_all(py, &warnings)?;
    let rendered = rendered.map_err(|e| raised(&e))?;
    Picture::new(py, rendered, warnings.notes().iter().map(|note| by_name(note)).collect())
}

impl Picture {
    fn new(py: Python, picture: picture::Picture, notes: Vec<String>) -> PyResult<Self> {
        let (window, pixels) = match picture.image() {
            OutputImage::Rgb8(film, _) => {
                (film.window(), shaped(py, film.bytes(), &shape(film.window(), 3))?)
            }
            OutputImage::Rgba8(film, alpha, _) => {
                let pixels = film.rows().zip(alpha).flat_map(|([r, g, b], &a)| [r, g, b, a]).collect();
                (film.window(), shaped(py, pixels, &shape(film.window(), 4))?)
            }
            OutputImage::Float(film, _) => match picture.alpha() {
                Some(Channel { values, .. }) => {
                    let pixels = film.rows().zip(values).flat_map(|([r, g, b], &a)| [r, g, b, a]).collect();
                    (film.window(), shaped::<f32>(py, pixels, &shape(film.window(), 4))?)
                }
                None => {
                    let pixels = film.rows().flatten().collect();
                    (film.window(), shaped::<f32>(py, pixels, &shape(film.window(), 3))?)
                }
            },
        };
        let (aovs, metadata) = (PyDict::new(py), PyDict::new(py));
        for (name, channels) in picture.aovs() {
            let count = channels.len();
            let values =
                (0..window.area()).flat_map(|i| channels.iter().map(move |channel| channel.values[i]));
            let shape = shape(window, count);
            let shape = if count == 1 { &shape[..2] } else { &shape[..] };
            aovs.set_item(name, read_only(shaped::<f32>(py, values.collect(), shape)?)?)?;
        }
        for (name, value) in picture.metadata() {
            metadata.set_item(name, value)?;
        }
        let (pixels, aovs, metadata) = (read_only(pixels)?.unbind(), aovs.unbind(), metadata.unbind());
        Ok(Picture { picture, pixels, aovs, metadata, notes })
    }
}

fn read_only(array: Bound<PyAny>) -> PyResult<Bound<PyAny>> {
    array.call_method1("setflags", (false,))?;
    Ok(array)
}

fn shape(window: Window, channels: usize) -> [usize; 3] {
    [window.height as usize, window.width as usize, channels]
}

#[pymethods]
impl Picture {
    /// Writes the picture to a .png, .jpg or .exr file, with its metadata. Only float32 pictures are written to .exr,
    /// with their AOVs.
    fn save(&self, py: Python, file: PathBuf) -> PyResult<()> {
        py.detach(move || self.picture.write(&file)).map_err(|e| raised(&e))
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = py.detach(|| self.picture.png()).map_err(|e| raised(&e))?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// The pixels: read-only, or a copy.
    #[pyo3(signature = (dtype = None, copy = None))]
    fn __array__<'py>(
        &self,
        py: Python<'py>,
        dtype: Option<&Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let options = PyDict::new(py);
        options.set_item("dtype", dtype)?;
        // Before numpy 2, `copy` is a boolean.
        let function = if copy == Some(true) { "array" } else { "asarray" };
        let array = py.import("numpy")?.call_method(function, (&self.pixels,), Some(&options))?;
        if copy == Some(false) && !array.is(&self.pixels) {
            let dtype = array.getattr("dtype")?;
            return Err(PyValueError::new_err(format!("pixels cannot become {dtype} without a copy")));
        }
        Ok(array)
    }
}
