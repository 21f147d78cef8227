//! Rendering of scenes to arrays.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use kiln::error::{Result, Warnings};
use kiln::film::Window;
use kiln::film::write::{Channel, Format, OutputImage};
use kiln::job::{PictureOptions, RenderControl};
use kiln::render::aov;
use kiln::scene::ImportOptions;
use kiln_cli::picture::{self, by_name};
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
    /// uint8 display values, uint16 with bits=16, whose colours are not multiplied by alpha, or float32 values in the scene's colour space,
    /// multiplied by alpha. Read-only, as what `save` writes does not change: `numpy.array(picture)` is a copy.
    #[pyo3(get)]
    pixels: Py<PyAny>,
    /// The AOVs by name: (height, width) float32, int32 for indices and counts, or (height, width, 3) float32;
    /// read-only.
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
fn check_import(scene: &kiln::scene::Scene, options: &PictureOptions) -> PyResult<()> {
    if options.import != ImportOptions::default() && scene.import_options != options.reading() {
        let what = "options of how files are read are for Scene(), which has read them";
        return Err(PyValueError::new_err(what));
    }
    Ok(())
}

/// Options of pictures.
#[pyclass(frozen, module = "kiln._kiln")]
pub(crate) struct Options(Arc<PictureOptions>);

#[pymethods]
impl Options {
    #[new]
    fn new(options: NamedOptions) -> PyResult<Self> {
        Ok(Options(Arc::new(parse_options(options)?)))
    }

    /// The options with this camera.
    fn with_camera(&self, camera: String) -> Self {
        Options(Arc::new(PictureOptions { camera: Some(camera), ..PictureOptions::clone(&self.0) }))
    }
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
    fn new(py: Python, scene: &Bound<Scene>, options: &Bound<Options>) -> PyResult<Self> {
        let scene = scene.get().now();
        check_import(&scene, &options.get().0)?;
        let scene = py.detach(|| picture::PreparedScene::new(scene)).map_err(|e| raised(&e))?;
        Ok(Prepared { scene: Arc::new(scene) })
    }

    /// Renders a picture.
    fn render(
        &self,
        py: Python,
        options: &Bound<Options>,
        dtype: &str,
        aovs: Vec<String>,
        progress: Option<&Bound<PyAny>>,
    ) -> PyResult<Picture> {
        let format = format_of(dtype)?;
        let (options, scene) = (Arc::clone(&options.get().0), Arc::clone(&self.scene));
        check_import(scene.scene(), &options)?;
        let (picture, notes) = rendered(py, progress, move |control, warnings| {
            scene.render(&options, format, &aovs, control, warnings)
        })?;
        Picture::new(py, picture, notes)
    }

    /// The AOVs of a picture by name, without its colours.
    fn aovs<'py>(
        &self,
        py: Python<'py>,
        options: &Bound<'py, Options>,
        aovs: Vec<String>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let (options, scene) = (Arc::clone(&options.get().0), Arc::clone(&self.scene));
        check_import(scene.scene(), &options)?;
        let (computed, _) =
            rendered(py, None, move |control, warnings| scene.aovs(&options, &aovs, control, warnings))?;
        let window = computed.window;
        let aovs = computed.by_name().into_iter();
        let values = |channels: Vec<Channel>| channels.into_iter().map(|channel| channel.values).collect();
        arrays(py, window, aovs.map(|(name, channels)| (name, values(channels))))
    }
}

/// The names of AOVs after `start`; nothing if there are none.
fn named(py: Python, start: &str, aovs: &Py<PyDict>) -> PyResult<String> {
    let names: Vec<String> = aovs.bind(py).keys().extract()?;
    Ok(if names.is_empty() { String::new() } else { format!("{start}{}", names.join(", ")) })
}

/// Read-only arrays of AOVs, by name, from the values of their channels.
fn arrays(
    py: Python,
    window: Window,
    aovs: impl Iterator<Item = (String, Vec<Vec<f32>>)>,
) -> PyResult<Bound<PyDict>> {
    let arrays = PyDict::new(py);
    for (name, mut channels) in aovs {
        let shape = shape(window, channels.len());
        let array = match (&channels[..], aov::has_integers(&name)) {
            ([values], true) => {
                shaped::<i32>(py, values.iter().map(|&value| value as i32).collect(), &shape[..2])?
            }
            ([_], false) => shaped::<f32>(py, channels.swap_remove(0), &shape[..2])?,
            ([x, y, z], _) => {
                let pixels: Vec<[f32; 3]> = x.iter().zip(y).zip(z).map(|((&x, &y), &z)| [x, y, z]).collect();
                shaped::<f32>(py, pixels.into_flattened(), &shape)?
            }
            (channels, _) => {
                let of_pixel = |pixel: usize| channels.iter().map(move |channel| channel[pixel]);
                let pixels = (0..shape[0] * shape[1]).flat_map(of_pixel).collect();
                shaped::<f32>(py, pixels, &shape)?
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
            OutputImage::Rgb16(film, _) => {
                (film.window(), shaped(py, film.bytes(), &shape(film.window(), 3))?)
            }
            OutputImage::Rgba8(film, alpha, _) => {
                (film.window(), shaped(py, with_alpha(film.rows(), alpha), &shape(film.window(), 4))?)
            }
            OutputImage::Rgba16(film, alpha, _) => {
                (film.window(), shaped(py, with_alpha(film.rows(), alpha), &shape(film.window(), 4))?)
            }
            OutputImage::Float(film, ..) => match picture.alpha() {
                Some(Channel { values, .. }) => {
                    (film.window(), shaped(py, with_alpha(film.rows(), values), &shape(film.window(), 4))?)
                }
                None => {
                    let pixels = film.rows().flatten().collect();
                    (film.window(), shaped::<f32>(py, pixels, &shape(film.window(), 3))?)
                }
            },
        };
        let values =
            |channels: Vec<&Channel>| channels.iter().map(|channel| channel.values.clone()).collect();
        let aovs = picture.aovs().into_iter().map(|(name, channels)| (name, values(channels)));
        let (aovs, metadata) = (arrays(py, window, aovs)?, PyDict::new(py));
        for (name, value) in picture.metadata() {
            metadata.set_item(name, value)?;
        }
        let (pixels, aovs, metadata) = (read_only(pixels)?.unbind(), aovs.unbind(), metadata.unbind());
        Ok(Picture { picture, pixels, aovs, metadata, notes })
    }
}

/// Red, green, blue and alpha of each pixel.
fn with_alpha<T: Copy>(colours: impl Iterator<Item = [T; 3]>, alpha: &[T]) -> Vec<T> {
    colours.zip(alpha).flat_map(|([r, g, b], &a)| [r, g, b, a]).collect()
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
    /// Writes the picture to a .png, .jpg or .exr file, with its metadata, or to an object with a method write(), such
    /// as io.BytesIO. Only float32 pictures are written as .exr, with their AOVs.
    ///
    /// format: "png", "jpg" or "exr"; that of the file's name if it is not given. An object needs one.
    #[pyo3(signature = (file, *, format = None))]
    fn save(&self, py: Python, file: &Bound<PyAny>, format: Option<&str>) -> PyResult<()> {
        let known = |name: &str| {
            let what = || PyValueError::new_err(format!("format: `{name}` is not png, jpg or exr"));
            Format::from_ending(name).ok_or_else(what)
        };
        let format = format.map(known).transpose()?;
        let path = file.extract::<PathBuf>();
        if path.is_err() && file.hasattr("write")? {
            let what = "format: give \"png\", \"jpg\" or \"exr\" for an object that has no name of a file";
            let format = format.ok_or_else(|| PyValueError::new_err(what))?;
            let bytes = py.detach(|| self.picture.encoded(format)).map_err(|e| raised(&e))?;
            return file.call_method1("write", (PyBytes::new(py, &bytes),)).map(|_| ());
        }
        let path = path?;
        py.detach(move || self.picture.write(&path, format)).map_err(|e| raised(&e))
    }

    fn __repr__(&self, py: Python) -> PyResult<String> {
        let (window, dtype) = match self.picture.image() {
            OutputImage::Rgb8(film, _) | OutputImage::Rgba8(film, ..) => (film.window(), "uint8"),
            OutputImage::Rgb16(film, _) | OutputImage::Rgba16(film, ..) => (film.window(), "uint16"),
            OutputImage::Float(film, ..) => (film.window(), "float32"),
        };
        let aovs = named(py, ", AOVs ", &self.aovs)?;
        Ok(format!("<kiln.Picture {} x {}, {dtype}{aovs}>", window.width, window.height))
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = py.detach(|| self.picture.encoded(Format::Png)).map_err(|e| raised(&e))?;
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
