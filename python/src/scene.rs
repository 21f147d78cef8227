//! Scenes from files, memory and arrays.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use kiln::error::{Error, Result, Warnings};
use kiln::film::{Colour, ColourPipeline};
use kiln::glam::{DVec2, DVec3};
use kiln::import;
use kiln::job::PictureOptions;
use kiln::scene::{
    Attribute, GivenValue, Material, MaterialId, Mesh, Object, Phong, Placed, Placement, Shape,
};
use kiln_cli::picture;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyString;

use crate::arrays::{SEVERAL, check_finite, check_rows, chunks, matrices, numbers, triangles};
use crate::state::{State, named};
use crate::{interruptible, raised, warn_all};

/// The value of an option; of these types, the first that fits.
#[derive(FromPyObject)]
pub(crate) enum OptionValue {
    Switch(bool),
    Texts(Vec<String>),
}

/// Options by name; `None` for those left at their default.
pub(crate) type NamedOptions = Vec<(String, Option<OptionValue>)>;

pub(crate) fn parse_options(options: NamedOptions) -> PyResult<PictureOptions> {
    let value = |value| match value {
        OptionValue::Switch(is_on) => GivenValue::Switch(is_on),
        OptionValue::Texts(texts) => GivenValue::Texts(texts),
    };
    let options = options.into_iter().map(|(name, given)| (name, given.map(value))).collect();
    picture::parse_options(options).map_err(|e| raised(&e))
}

/// A scene, shared with the pictures that are being rendered of it, for any number of threads.
#[pyclass(frozen, module = "kiln._kiln")]
#[derive(Default)]
pub(crate) struct Scene {
    /// Nothing of Python is called while it is locked.
    scene: Mutex<Arc<kiln::scene::Scene>>,
}

/// Reads a scene in a thread of its own. Without `with_picture`, options of the picture are an error.
fn read(
    py: Python,
    options: NamedOptions,
    with_picture: bool,
    work: impl FnOnce(&PictureOptions, &mut Warnings) -> Result<kiln::scene::Scene> + Send + 'static,
) -> PyResult<Scene> {
    let options = parse_options(options)?;
    if !with_picture && options.has_picture() {
        let what = "options of the picture are for render(), those of a scene say how files are read";
        return Err(PyValueError::new_err(what));
    }
    let (scene, warnings) = interruptible(
        py,
        &Arc::default(),
        |_| Ok(()),
        move || {
            let mut warnings = Warnings::default();
            (work(&options, &mut warnings), warnings)
        },
    )?;
    warn_all(py, &warnings)?;
    Ok(Scene { scene: Mutex::new(Arc::new(scene.map_err(|e| raised(&e))?)) })
}

#[pymethods]
impl Scene {
    /// A scene without anything, or a copy.
    #[new]
    #[pyo3(signature = (other = None))]
    fn new(other: Option<&Bound<Scene>>) -> Self {
        Scene { scene: Mutex::new(other.map(|other| other.get().now()).unwrap_or_default()) }
    }

    /// Reads files.
    #[staticmethod]
    fn load(py: Python, files: Vec<PathBuf>, options: NamedOptions, with_picture: bool) -> PyResult<Self> {
        read(py, options, with_picture, move |options, warnings| {
            import::load_with(&files, &options.reading(), warnings)
        })
    }

    /// Reads the contents of a file.
    #[staticmethod]
    fn parse(py: Python, contents: Vec<u8>, options: NamedOptions, with_picture: bool) -> PyResult<Self> {
        read(py, options, with_picture, move |options, warnings| {
            import::load_bytes(contents, &options.reading(), warnings)
        })
    }

    /// Adds all of another scene.
    fn append(&self, other: &Bound<Scene>) {
        let other = Arc::unwrap_or_clone(other.get().now());
        Arc::make_mut(&mut self.lock()).append(other);
    }

    /// Adds triangles, once for each of `transforms`. `material` is the name of a material of the scene, or a scene
    /// whose only material is added. Nothing is added by a call that raises.
    #[pyo3(signature = (vertices, faces, name, material, normals, uvs, colours, transforms))]
    #[allow(clippy::too_many_arguments)]
    fn add(
        &self,
        vertices: &Bound<PyAny>,
        faces: &Bound<PyAny>,
        name: &str,
        material: Option<&Bound<PyAny>>,
        normals: Option<&Bound<PyAny>>,
        uvs: Option<&Bound<PyAny>>,
        colours: Option<&Bound<PyAny>>,
        transforms: Option<&Bound<PyAny>>,
    ) -> PyResult<()> {
        let py = vertices.py();
        let vertices = numbers(vertices, "vertices", 3)?;
        let rows: &[[f64; 3]] = chunks(&vertices)?;
        check_finite(rows, "vertices")?;
        // Copied before other arguments are converted, which may call Python.
        let positions: Vec<DVec3> = rows.iter().map(|&row| row.into()).collect();
        let per_vertex = |value: Option<&Bound<PyAny>>, argument| {
            value.map(|value| attribute(value, argument, positions.len())).transpose()
        };
        let mesh = Mesh {
            triangles: triangles(faces, "faces", positions.len())?,
            normals: per_vertex(normals, "normals")?,
            colours: colours.map(|value| linear_colours(value, positions.len())).transpose()?,
            uvs: uvs.map(|value| coordinates(value, positions.len())).transpose()?.into_iter().collect(),
            positions,
            ..Mesh::default()
        };
        let shapes = match transforms {
            None => vec![Shape::Mesh(mesh)],
            Some(transforms) => placed(mesh, transforms)?,
        };
        let material = self.material(material)?;
        let object = |shape| Object { name: name.to_owned(), input: 0, material: MaterialId(0), shape };
        let mut added =
            kiln::scene::Scene { objects: shapes.into_iter().map(object).collect(), ..Default::default() };
        let mut warnings = Warnings::default();
        import::sanitise(&mut added, name, &mut warnings);
        // Warnings may be errors.
        warn_all(py, &warnings)?;
        let mut scene = self.lock();
        let scene = Arc::make_mut(&mut scene);
        let material = match material {
            ChosenMaterial::Known(id) => id,
            ChosenMaterial::Default => scene.add_material(Material::Phong(Phong::default())),
            ChosenMaterial::Given(given) => {
                let id = MaterialId(scene.materials.len() as u32);
                let kiln::scene::Scene { materials, images, .. } = Arc::unwrap_or_clone(given);
                scene.append(kiln::scene::Scene { materials, images, ..Default::default() });
                id
            }
        };
        scene.has_left_out |= added.has_left_out;
        scene.objects.extend(added.objects.into_iter().map(|object| Object { material, ..object }));
        Ok(())
    }

    /// The triangles and analytic shapes for queries.
    fn mesh(&self, py: Python, tier: &str, preset: &str) -> PyResult<crate::mesh::Mesh> {
        Ok(crate::mesh::Mesh::of(State::of_scene(py, self.now(), named(tier, preset)?)?, None))
    }

    /// The number of triangles and analytic shapes.
    fn __len__(&self) -> usize {
        self.lock().primitive_count()
    }

    /// The least and the greatest corner of the bounding box; `None` for a scene without objects.
    fn bounds(&self) -> Option<[[f64; 3]; 2]> {
        self.lock().bounds().map(|(min, max)| [min.to_array(), max.to_array()])
    }

    /// The names of the cameras, the materials and the objects.
    fn names(&self) -> (Vec<String>, Vec<String>, Vec<String>) {
        let scene = self.lock();
        (
            scene.cameras.iter().map(|camera| camera.name.clone()).collect(),
            scene.materials.iter().map(|material| material.name().to_owned()).collect(),
            scene.objects.iter().map(|object| object.name.clone()).collect(),
        )
    }
}

/// The material of added triangles.
enum ChosenMaterial {
    /// Of files without materials.
    Default,
    /// Of the scene.
    Known(MaterialId),
    /// The only one of another scene, with its images.
    Given(Arc<kiln::scene::Scene>),
}

impl Scene {
    fn lock(&self) -> MutexGuard<'_, Arc<kiln::scene::Scene>> {
        self.scene.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The scene as it is now. Later changes are made to a copy.
    pub(crate) fn now(&self) -> Arc<kiln::scene::Scene> {
        Arc::clone(&self.lock())
    }

    /// The last material of a name, or that of a [`Scene`].
    fn material(&self, given: Option<&Bound<PyAny>>) -> PyResult<ChosenMaterial> {
        let Some(given) = given else { return Ok(ChosenMaterial::Default) };
        if let Ok(given) = given.cast::<Scene>() {
            return Ok(ChosenMaterial::Given(given.get().now()));
        }
        let Ok(name) = given.cast::<PyString>() else {
            let what = format!("material: expected a name or a dict, not {}", given.get_type().name()?);
            return Err(PyTypeError::new_err(what));
        };
        let name: String = name.extract()?;
        let scene = self.now();
        let known = &scene.materials;
        let found = known.iter().rposition(|material| material.name() == name);
        found.map(|index| ChosenMaterial::Known(MaterialId(index as u32))).ok_or_else(|| {
            let names: Vec<&str> = known.iter().map(Material::name).collect();
            let hint =
                if names.is_empty() { String::new() } else { kiln::error::nearest_name(&name, &names) };
            raised(&Error::usage(format!("material: the scene has none of the name `{name}`"), hint))
        })
    }
}

/// Vectors that go with the vertices.
fn attribute(value: &Bound<PyAny>, name: &str, count: usize) -> PyResult<Attribute<DVec3>> {
    let array = numbers(value, name, 3)?;
    let rows = chunks(&array)?;
    check_rows((name, rows.len()), ("vertices", count))?;
    check_finite(rows, name)?;
    Ok(Attribute::per_position(rows.iter().map(|&row| row.into()).collect()))
}

/// Colours that go with the vertices; bytes are sRGB.
fn linear_colours(value: &Bound<PyAny>, count: usize) -> PyResult<Attribute<DVec3>> {
    let is_srgb = value.getattr_opt("dtype")?.is_some_and(|dtype| dtype.eq("uint8").unwrap_or(false));
    let mut colours = attribute(value, "colours", count)?;
    if is_srgb {
        for colour in &mut colours.values {
            *colour = Colour::from_u8(colour.to_array().map(|c| c as u8)).to_pipeline(ColourPipeline::Linear);
        }
    }
    match colours.values.iter().position(|colour| colour.min_element() < 0.0 || colour.max_element() > 1.0) {
        None => Ok(colours),
        Some(row) => Err(PyValueError::new_err(format!(
            "colours: row {row} is not from 0 to 1; give linear light, or sRGB as uint8"
        ))),
    }
}

/// Texture coordinates that go with the vertices.
fn coordinates(value: &Bound<PyAny>, count: usize) -> PyResult<Attribute<DVec2>> {
    let array = numbers(value, "uvs", 2)?;
    let rows: &[[f64; 2]] = chunks(&array)?;
    check_rows(("uvs", rows.len()), ("vertices", count))?;
    check_finite(rows, "uvs")?;
    Ok(Attribute::per_position(rows.iter().map(|&row| row.into()).collect()))
}

/// A mesh with each of the transforms, (k, 4, 4).
fn placed(mesh: Mesh, transforms: &Bound<PyAny>) -> PyResult<Vec<Shape>> {
    let mesh = Arc::new(mesh);
    let place = |matrix| Shape::Placed(Placed::new(Arc::clone(&mesh), Placement::new(matrix)));
    Ok(matrices(transforms, "transforms", &[SEVERAL])?.into_iter().map(place).collect())
}
