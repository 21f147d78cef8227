//! Scene file importer: converts a [`SceneFile`] and the meshes that it references to a [`Scene`].

use std::collections::{BTreeMap, HashMap, HashSet};

use glam::DVec3;
use toml::Spanned;

mod animation;
mod animation_sections;
mod camera;
mod fault;
mod light;
mod material;
mod meshes;
mod metallic_roughness;
mod sections;
mod spelling;
mod toml_error;

pub use camera::inline_camera;
pub(crate) use camera::lens;
pub(crate) use material::{inline_change, inline_material};
pub(crate) use sections::LensSection;
pub use sections::SceneFile;

use crate::error::{Error, Place, Result, Warnings, nearest_name};
use crate::film::Colour;
use crate::import;
use crate::import::Source;
use crate::scene::{
    AnalyticShape, Camera, Disk, Environment, EnvironmentSource, Material, MaterialId, Mesh, Object, Phong,
    PictureSettings, Scene, Shape, Sphere,
};
use fault::{Fault, not_negative};
use meshes::Meshes;
use sections::{
    CameraSection, DiskSection, EnvironmentSection, MeshSection, SphereSection, TrianglesSection,
};

/// Reads a scene file and the meshes that it references.
pub(crate) fn read(source: &Source, warnings: &mut Warnings) -> Result<Scene> {
    let text = source.text();
    let file = SceneFile::parse(&text, &source.file)?;
    let mut builder = Builder {
        source,
        text: &text,
        line_ends: text.bytes().enumerate().filter(|(_, b)| *b == b'\n').map(|(at, _)| at).collect(),
        scene: Scene::default(),
        materials: BTreeMap::new(),
        plain: None,
        meshes: Meshes::of(&file),
    };
    for &start in &file.dark_colours {
        let place = builder.location(start);
        warnings.note(format!(
            "{place}: a colour in numbers from 0 to 1 is nearly black: white is [255, 255, 255]"
        ));
    }
    builder.picture(&file, warnings)?;
    for (name, section) in &file.material {
        let material = material::material(name, section.get_ref());
        let material = material.map_err(|fault| builder.at(section.span().start, fault))?;
        let id = builder.scene.add_material(material);
        builder.materials.insert(name.clone(), id);
    }
    builder.objects(&file, warnings)?;
    builder.scene.animation =
        file.animation.as_ref().map(|section| builder.animation(section)).transpose()?;
    Ok(builder.scene)
}

/// An entry that defines objects. Objects are created in file order, whatever their kinds, because that order numbers
/// the primitives.
enum Entry<'a> {
    Sphere(&'a SphereSection),
    Disk(&'a DiskSection),
    Triangles(&'a Spanned<TrianglesSection>),
    Mesh(&'a Spanned<MeshSection>),
}

struct Builder<'a> {
    source: &'a Source,
    text: &'a str,
    /// Byte offsets of line breaks.
    line_ends: Vec<usize>,
    scene: Scene,
    materials: BTreeMap<String, MaterialId>,
    plain: Option<MaterialId>,
    meshes: Meshes,
}

impl Builder<'_> {
    /// An error in the section that starts at byte offset `start`.
    fn error(&self, start: usize, what: impl Into<String>, hint: &str) -> Error {
        Error::input(self.location(start), what, hint)
    }

    fn location(&self, start: usize) -> Place {
        Place::line(&self.source.file, self.line(start))
    }

    /// Line number, counted from 1, of the byte at `start`.
    fn line(&self, start: usize) -> usize {
        1 + self.line_ends.partition_point(|&end| end < start)
    }

    /// Warns once of each name that is given more than once: tracks of an animation move all that have the name.
    fn warn_of_equal_names<'b>(
        &self,
        noun: &str,
        named: impl Iterator<Item = (Option<&'b str>, usize)>,
        warnings: &mut Warnings,
    ) {
        let mut known: HashMap<&str, (usize, usize)> = HashMap::new();
        for (name, start) in named.filter_map(|(name, start)| Some((name?, start))) {
            let (first, count) = known.entry(name).or_insert((start, 0));
            *count += 1;
            if *count == 2 {
                let line = self.line(*first);
                let what = format!("a second {noun} named `{name}`, like that of line {line}");
                let hint = "tracks move both; give each its own name";
                warnings.push(format!("{}: {what}; {hint}", self.location(start)));
            }
        }
    }

    fn finite(&self, start: usize, key: &str, values: &[f64]) -> Result<()> {
        match values.iter().find(|v| !v.is_finite()) {
            Some(v) => Err(self.error(start, format!("`{key}` holds {v}"), "give a finite number")),
            None => Ok(()),
        }
    }

    /// The vector of length 1; `None` if it has none.
    fn unit(&self, start: usize, key: &str, vector: DVec3) -> Result<Option<DVec3>> {
        self.finite(start, key, &vector.to_array())?;
        // Scaling first prevents overflow and underflow of squares.
        Ok((vector / vector.abs().max_element()).try_normalize())
    }

    fn not_negative(&self, start: usize, key: &str, value: f64) -> Result<f64> {
        not_negative(key, value).map_err(|fault| self.at(start, fault))
    }

    /// A fault of the section that starts at byte offset `start`.
    fn at(&self, start: usize, fault: Fault) -> Error {
        self.error(start, fault.what, &fault.hint)
    }

    /// Converts the settings of the whole picture, the cameras and the lights.
    fn picture(&mut self, file: &SceneFile, warnings: &mut Warnings) -> Result<()> {
        if let Some(section) = &file.image {
            self.check_image(section)?;
            self.scene.picture = *section.get_ref();
        }
        self.scene.background = Some(Colour::from_u8([0; 3]));
        self.scene.has_settings = true;
        if let Some(section) = &file.ambient
            && let Some(intensity) = section.get_ref().intensity
        {
            self.scene.ambient = Some(self.not_negative(section.span().start, "intensity", intensity)?);
        }
        if let Some(section) = &file.environment {
            self.scene.environment = Some(self.environment(section, warnings)?);
        }
        for (name, value) in &file.effects {
            let place = self.location(value.span().start);
            self.scene.effects.set(name, value.get_ref().clone(), Some(place));
        }
        let mut names = HashSet::new();
        for (index, section) in file.camera.iter().enumerate() {
            let camera = self.camera(index, section)?;
            if !names.insert(camera.name.clone()) {
                let what = format!("a second camera named `{}`", camera.name);
                return Err(self.error(section.span().start, what, "give each its own name"));
            }
            self.scene.cameras.push(camera);
        }
        let named = file.light.iter().map(|s| (s.get_ref().name.as_deref(), s.span().start));
        self.warn_of_equal_names("light", named, warnings);
        for (index, section) in file.light.iter().enumerate() {
            let light = self.light(index, section)?;
            self.scene.lights.push(light);
        }
        Ok(())
    }

    /// Checks keys of `[image]` that belong together.
    fn check_image(&self, section: &Spanned<PictureSettings>) -> Result<()> {
        let (start, image) = (section.span().start, section.get_ref());
        if image.width.is_some() != image.height.is_some() {
            return Err(self.error(start, "`width` or `height` is missing", "give both or neither"));
        }
        let PictureSettings { samples: Some(most), min_samples: Some(least), .. } = image else {
            return Ok(());
        };
        if least > most {
            let place = self.image_key("min_samples").unwrap_or(start);
            let what = format!("`min_samples` is {}, and `samples` {}", least.get(), most.get());
            return Err(self.error(place, what, "give `min_samples` at most as many as `samples`"));
        }
        Ok(())
    }

    /// Byte offset of a value of `[image]` by key.
    fn image_key(&self, key: &str) -> Option<usize> {
        #[derive(serde::Deserialize)]
        struct Sections {
            image: std::collections::BTreeMap<String, Spanned<serde::de::IgnoredAny>>,
        }
        let Sections { image } = toml::from_str(self.text).ok()?;
        image.get(key).map(|value| value.span().start)
    }

    fn camera(&self, index: usize, section: &Spanned<CameraSection>) -> Result<Camera> {
        camera::camera(section.get_ref(), &format!("camera {index}"), self.scene.picture.size())
            .map_err(|fault| self.at(section.span().start, fault))
    }

    fn environment(
        &self,
        section: &Spanned<EnvironmentSection>,
        warnings: &mut Warnings,
    ) -> Result<Environment> {
        let (start, s) = (section.span().start, section.get_ref());
        let source = match (&s.file, s.sky, s.colour) {
            (Some(file), false, None) => {
                let file = self.source.resolve_scene_reference(file);
                import::images::environment::image(&self.source.files, &file, warnings)?
            }
            (None, true, None) => EnvironmentSource::Sky,
            (None, false, Some(colour)) => EnvironmentSource::Colour(Colour::from_u8(colour.0)),
            _ => {
                let hint = "give one of `file`, `sky = true` and `colour`";
                return Err(self.error(start, "an environment without one source", hint));
            }
        };
        let rotation = s.rotation.unwrap_or(0.0);
        self.finite(start, "rotation", &[rotation])?;
        let intensity = self.not_negative(start, "intensity", s.intensity.unwrap_or(1.0))?;
        Ok(Environment { source, rotation: rotation.to_radians(), intensity, is_hidden: s.hide })
    }

    fn objects<'a>(&mut self, file: &'a SceneFile, warnings: &mut Warnings) -> Result<()> {
        let mut entries: Vec<((Option<&str>, usize), Entry)> = Vec::new();
        let named = |name: &'a Option<String>, start| (name.as_deref(), start);
        let spheres = file.sphere.iter().map(|s| (s.span().start, s.get_ref()));
        entries.extend(spheres.map(|(start, s)| (named(&s.name, start), Entry::Sphere(s))));
        let disks = file.disk.iter().map(|s| (s.span().start, s.get_ref()));
        entries.extend(disks.map(|(start, s)| (named(&s.name, start), Entry::Disk(s))));
        let triangles = file.triangles.iter();
        entries.extend(triangles.map(|s| (named(&s.get_ref().name, s.span().start), Entry::Triangles(s))));
        entries.extend(file.mesh.iter().map(|s| (named(&s.get_ref().name, s.span().start), Entry::Mesh(s))));
        entries.sort_by_key(|((_, start), _)| *start);
        self.warn_of_equal_names("object", entries.iter().map(|(named, _)| *named), warnings);
        for (named, entry) in entries {
            match entry {
                Entry::Sphere(s) => self.analytic(named, s.material.as_deref(), self.sphere(named.1, s)?)?,
                Entry::Disk(s) => self.analytic(named, s.material.as_deref(), self.disk(named.1, s)?)?,
                Entry::Triangles(section) => self.triangles(section)?,
                Entry::Mesh(section) => self.mesh(section, warnings)?,
            }
        }
        Ok(())
    }

    fn material_named(&mut self, start: usize, name: Option<&str>) -> Result<MaterialId> {
        let Some(name) = name else {
            let scene = &mut self.scene;
            return Ok(*self
                .plain
                .get_or_insert_with(|| scene.add_material(Material::Phong(Phong::default()))));
        };
        self.materials.get(name).copied().ok_or_else(|| {
            let known: Vec<&str> = self.materials.keys().map(String::as_str).collect();
            let hint =
                if known.is_empty() { format!("add [material.{name}]") } else { nearest_name(name, &known) };
            self.error(start, format!("there is no material `{name}`"), &hint)
        })
    }

    fn push(&mut self, name: Option<&str>, kind: &str, material: MaterialId, shape: Shape) {
        let name = name.map_or_else(|| format!("{kind} {}", self.scene.objects.len()), str::to_owned);
        self.scene.objects.push(Object { name, input: 0, material, shape });
    }

    fn sphere(&self, start: usize, s: &SphereSection) -> Result<AnalyticShape> {
        self.finite(start, "centre", &s.centre)?;
        Ok(Sphere { centre: s.centre.into(), radius: s.radius }.into())
    }

    fn disk(&self, start: usize, s: &DiskSection) -> Result<AnalyticShape> {
        self.finite(start, "centre", &s.centre)?;
        let normal = self.unit(start, "normal", s.normal.into())?;
        let normal = normal
            .ok_or_else(|| self.error(start, "`normal` has no length", "give the direction of the front"))?;
        Ok(Disk { centre: s.centre.into(), normal, radius: s.radius }.into())
    }

    fn analytic(
        &mut self,
        (name, start): (Option<&str>, usize),
        material: Option<&str>,
        mut shape: AnalyticShape,
    ) -> Result<()> {
        let (kind, radius) = (shape.name(), *shape.radius_mut());
        if !(radius > 0.0 && radius.is_finite()) {
            return Err(self.error(start, format!("a {kind} of radius {radius}"), "give a radius above 0"));
        }
        let material = self.material_named(start, material)?;
        self.push(name, kind, material, Shape::Analytic(shape));
        Ok(())
    }

    fn triangles(&mut self, section: &Spanned<TrianglesSection>) -> Result<()> {
        let (start, s) = (section.span().start, section.get_ref());
        for vertex in &s.vertices {
            self.finite(start, "vertices", vertex)?;
        }
        let count = s.vertices.len();
        let triangles = match &s.indices {
            Some(indices) => indices.clone(),
            None if count.is_multiple_of(3) => {
                (0..count as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect()
            }
            None => {
                let what = format!("{count} vertices without indices do not make whole triangles");
                return Err(self.error(start, what, "give `indices`, or three vertices for each triangle"));
            }
        };
        if let Some(&bad) = triangles.iter().flatten().find(|&&i| i as usize >= count) {
            let what = format!("index {bad} is out of range: there are {count} vertices, counted from 0");
            return Err(self.error(start, what, "correct `indices`"));
        }
        let material = self.material_named(start, s.material.as_deref())?;
        let positions = s.vertices.iter().map(|&p| p.into()).collect();
        let shape = Shape::Mesh(Mesh { positions, triangles, ..Mesh::default() });
        self.push(s.name.as_deref(), "triangles", material, shape);
        Ok(())
    }
}
