//! Rendering of scenes to arrays.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use kiln::cli::picture::{self, Options, by_name};
use kiln::error::{Result, Warnings};
use kiln::film::Window;
use kiln::film::write::{Channel, Format, OutputImage};
use kiln::job::RenderControl;
use kiln::render::aov;
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
    /// The AOVs by name: (height, width) float32, int32 for indices and counts, or (height, width, 3) float32; read-only.
    #[pyo3(get)]
    aovs: Py<PyDict>,
    /// What made the picture: names and values, as in the metadata of files.
    #[pyo3(get)]
    metadata: Py<PyDict>,
    /// What was decided automatically, such as an added light.
    #[pyo3(get)]
    notes: Vec<String>,
}

/// The format that has pixels of a type of numpy.
fn format_of(dtype: &str) -> PyResult<Format> {
    match dtype {
        "uint8" => Ok(Format::Png),
        "float32" => Ok(Format::Exr),
        _ => Err(PyValueError::new_err(format!("dtype: `{dtype}` is neither uint8 nor float32"))),
    }
}

/// Renders in a thread of its own, and reports the progress. Also returns the notes.
fn rendered<T: Send + 'static>(
    py: Python,
    progress: Option<&Bound<PyAny>>,
    work: impl FnOnce(&RenderControl, &mut Warnings) -> Result<T> + Send + 'static,
) -> PyResult<(T, Vec<String>)> {
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
        (work(&control, &mut warnings), warnings)
    })?;
    warn_all(py, &warnings)?;
    let rendered = rendered.map_err(|e| raised(&e))?;
    Ok((rendered, warnings.notes().iter().map(|note| by_name(note)).collect()))
}

/// An error if options say otherwise how the files of a scene are read.
fn check_import(scene: &kiln::scene::Scene, options: &Options) -> PyResult<()> {
    if options.has_import() && scene.import_options != options.import() {
        let what = "options of how files are read are for Scene(), which has read them";
        return Err(PyValueError::new_err(what));
    }
    Ok(())
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
    let format = format_of(dtype)?;
    let options = parse_options(options)?;
    let scene = scene.get().now();
    check_import(&scene, &options)?;
    let (picture, notes) = rendered(py, progress, move |control, warnings| {
        picture::render(Arc::unwrap_or_clone(scene), &options, format, &aovs, control, warnings)
    })?;
    Picture::new(py, picture, notes)
}

/// A scene prepared for pictures by many cameras.
#[pyclass(frozen, module = "kiln._kiln")]
pub(crate) struct Prepared {
    scene: Arc<picture::PreparedScene>,
}

#[pymethods]
impl Prepared {
    #[new]
    fn new(py: Python, scene: &Bound<Scene>, options: NamedOptions) -> PyResult<Self> {
        let (scene, options) = (scene.get().now(), parse_options(options)?);
        check_import(&scene, &options)?;
        let scene = py.detach(|| picture::PreparedScene::new(scene)).map_err(|e| raised(&e))?;
        Ok(Prepared { scene: Arc::new(scene) })
    }

    /// Renders a picture.
    fn render(
        &self,
        py: Python,
        options: NamedOptions,
        dtype: &str,
        aovs: Vec<String>,
        progress: Option<&Bound<PyAny>>,
    ) -> PyResult<Picture> {
        let (format, options, scene) = (format_of(dtype)?, parse_options(options)?, Arc::clone(&self.scene));
        check_import(scene.scene(), &options)?;
        let (picture, notes) = rendered(py, progress, move |control, warnings| {
            scene.render(&options, format, &aovs, control, warnings)
        })?;
        Picture::new(py, picture, notes)
    }

    /// Computes the AOVs of a picture alone.
    fn aovs(&self, py: Python, options: NamedOptions, aovs: Vec<String>) -> PyResult<Aovs> {
        let (options, scene) = (parse_options(options)?, Arc::clone(&self.scene));
        check_import(scene.scene(), &options)?;
        let (computed, notes) =
            rendered(py, None, move |control, warnings| scene.aovs(&options, &aovs, control, warnings))?;
        Ok(Aovs { aovs: arrays(py, computed.window, computed.by_name())?.unbind(), notes })
    }
}

/// The AOVs of a picture without its colours.
#[pyclass(frozen, module = "kiln")]
pub(crate) struct Aovs {
    /// The AOVs by name, as those of a Picture.
    #[pyo3(get)]
    aovs: Py<PyDict>,
    /// What was decided automatically.
    #[pyo3(get)]
    notes: Vec<String>,
}

/// Read-only arrays of AOVs, by name.
fn arrays<'py>(
    py: Python<'py>,
    window: Window,
    aovs: Vec<(&str, Vec<&Channel>)>,
) -> PyResult<Bound<'py, PyDict>> {
    let arrays = PyDict::new(py);
    for (name, channels) in aovs {
        let shape = shape(window, channels.len());
        let array = match channels[..] {
            [channel] if aov::has_integers(name) => {
                let values = channel.values.iter().map(|&value| value as i32).collect();
                shaped::<i32>(py, values, &shape[..2])?
            }
            [channel] => shaped::<f32>(py, channel.values.clone(), &shape[..2])?,
            _ => {
                let of_pixel = |i| channels.iter().map(move |channel| channel.values[i]);
                shaped::<f32>(py, (0..window.area()).flat_map(of_pixel).collect(), &shape)?
            }
        };
        arrays.set_item(name, read_only(array)?)?;
    }
    Ok(arrays)
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
        let (aovs, metadata) = (arrays(py, window, picture.aovs())?, PyDict::new(py));
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
