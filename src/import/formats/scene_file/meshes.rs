//! Meshes referenced by a scene file. Each file is read once for all its placements.

use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;

use glam::{DMat4, DQuat, DVec3};
use toml::Spanned;

use crate::error::{Error, Result, Warnings};
use crate::import::formats::scene_file::Builder;
use crate::import::formats::scene_file::sections::{MeshSection, PlacementValue, ScaleValue, SceneFile};
use crate::import::meshes::tangents::make_tangents;
use crate::import::{self, Source};
use crate::scene::{Look, MaterialId, Object, Placed, Placement, Scene, Shape, UpChoice};

/// Cache of mesh files.
pub(super) struct Meshes {
    /// Number of remaining placements of each file.
    places: HashMap<String, usize>,
    /// Objects of the files that have remaining placements, by file and own crease angle.
    read: HashMap<(String, Option<u64>), Rc<Vec<Object>>>,
}

impl Meshes {
    /// Counts the placements of each file.
    pub(super) fn of(file: &SceneFile) -> Self {
        let mut places = HashMap::new();
        for section in &file.mesh {
            let section = section.get_ref();
            *places.entry(section.file.clone()).or_default() +=
                section.placements.as_ref().map_or(1, Vec::len);
        }
        Meshes { places, read: HashMap::new() }
    }
}

impl Builder<'_> {
    pub(super) fn mesh(&mut self, section: &Spanned<MeshSection>, warnings: &mut Warnings) -> Result<()> {
        let (start, s) = (section.span().start, section.get_ref());
        let material = match &s.material {
            Some(name) => Some(self.material_named(start, Some(name))?),
            None => None,
        };
        let placements = self.placements(start, s)?;
        // A file without placements is read too, so that a wrong name is reported.
        let key = (s.file.clone(), s.smooth.map(|degrees| degrees.get().to_bits()));
        let objects = match self.meshes.read.get(&key) {
            Some(objects) => objects.clone(),
            None => Rc::new(self.read_mesh(start, s, warnings)?),
        };
        let remaining = self.meshes.places.entry(s.file.clone()).or_default();
        *remaining = remaining.saturating_sub(placements.len());
        if *remaining > 0 {
            self.meshes.read.insert(key, objects.clone());
        } else {
            self.meshes.read.retain(|(file, _), _| *file != s.file);
        }
        // The last placement takes ownership of the objects; the others clone them, without copying shared meshes.
        let first = self.scene.objects.len();
        let mut objects = Some(objects);
        let up = self.source.options.up.and_then(UpChoice::axis).or(s.up);
        let y_from_file = up.unwrap_or_default().world_from_file();
        for (index, world_from_mesh) in placements.iter().enumerate() {
            let own = if index + 1 == placements.len() {
                objects.take().map(Rc::unwrap_or_clone)
            } else {
                objects.as_deref().cloned()
            };
            let world_from_file = *world_from_mesh * y_from_file;
            self.scene.objects.extend(own.into_iter().flatten().map(|mut object| {
                object.shape.transform(&world_from_file);
                object
            }));
        }
        self.stand(start, s, first)?;
        if let Some(name) = &s.name {
            let named = &mut self.scene.objects[first..];
            let is_one = named.len() == 1;
            for object in named {
                object.name = if is_one { name.clone() } else { format!("{name}/{}", object.name) };
            }
        }
        if let Some(material) = material {
            let coordinates = self.scene.materials[material.0 as usize].tangent_coordinates();
            for object in &mut self.scene.objects[first..] {
                object.material = material;
                if let (Some(coordinates), Shape::Mesh(mesh)) = (coordinates, &mut object.shape) {
                    make_tangents(mesh, coordinates);
                }
            }
        }
        Ok(())
    }

    /// Reads the objects of a mesh file, untransformed, and adds its materials and images to the scene. Cameras, lights
    /// and settings of the mesh file are ignored.
    fn read_mesh(&mut self, start: usize, s: &MeshSection, warnings: &mut Warnings) -> Result<Vec<Object>> {
        let smooths = self.source.options.smooths_meshes && self.scene.picture.look == Some(Look::Studio);
        let (file, path) = (&s.file, self.source.resolve_scene_reference(&s.file));
        let none = || {
            let hint = format!("name a mesh: {}", import::mesh_endings());
            self.error(start, format!("`{file}` is not a mesh"), &hint)
        };
        if file == "-" {
            return Err(none());
        }
        let opened = Source::open(&path, &self.source.files, &self.source.options)
            .map_err(|e| if path.extension().is_some_and(|ending| ending == "toml") { none() } else { e });
        let read = opened.and_then(|source| {
            if source.importer.is_scene_file {
                return Err(none());
            }
            let mut part = import::read_one(&source, warnings)?;
            if let Some(crease) = import::options::crease(&source, s.smooth, smooths) {
                import::smooth::smooth(&mut part, crease);
            }
            Ok(part)
        });
        let part = read.map_err(|e| match e {
            Error::Input { place, what, hint } if place.file == path && place.line.is_none() => {
                let what = format!("mesh {place}: {what}");
                Error::input(self.location(start), what, hint)
            }
            other => other,
        })?;
        if part.objects.iter().all(|object| object.shape.primitive_count() == 0) {
            warnings.push(format!("{}: {}", path.display(), import::NO_TRIANGLES));
        }
        let is_shared = self.meshes.places.get(file).is_some_and(|&places| places > 1);
        let first_material = self.scene.materials.len() as u32;
        let Scene { objects, materials, images, clips, variants, metadata, .. } = part;
        self.scene.append(Scene { materials, images, clips, variants, metadata, ..Scene::default() });
        Ok(objects
            .into_iter()
            .map(|object| Object {
                material: MaterialId(object.material.0 + first_material),
                shape: if is_shared { share(object.shape) } else { object.shape },
                ..object
            })
            .collect())
    }

    /// Moves the objects from `first` on so that they stand on `at`, with the size `fit`, where the section has one of
    /// these keys.
    fn stand(&mut self, start: usize, s: &MeshSection, first: usize) -> Result<()> {
        if s.at.is_none() && s.fit.is_none() {
            return Ok(());
        }
        let other = [("translate", s.translate.is_some()), ("placements", s.placements.is_some())];
        if let Some((key, _)) = other.into_iter().find(|(_, given)| *given) {
            let what = format!("`{key}` beside `at` or `fit`");
            return Err(self.error(start, what, "`at` is where the mesh stands; leave the other key out"));
        }
        let at = DVec3::from(s.at.unwrap_or_default());
        self.finite(start, "at", &at.to_array())?;
        let objects = self.scene.objects.split_off(first);
        let mut part = Scene { objects, ..Scene::default() };
        if let Some((min, max)) = part.bounds() {
            let factor = match (s.fit, (max - min).max_element()) {
                (None, _) => 1.0,
                (Some(size), longest) if size > 0.0 && (size / longest).is_normal() => size / longest,
                (Some(_), _) => {
                    return Err(self.error(
                        start,
                        "`fit` is no size of this mesh",
                        "give a size above 0, such as 2",
                    ));
                }
            };
            let foot = DVec3::new(min.x / 2.0 + max.x / 2.0, min.y, min.z / 2.0 + max.z / 2.0);
            let world_from_part = DMat4::from_translation(at)
                * DMat4::from_scale(DVec3::splat(factor))
                * DMat4::from_translation(-foot);
            part.objects.iter_mut().for_each(|object| object.shape.transform(&world_from_part));
        }
        self.scene.objects.append(&mut part.objects);
        Ok(())
    }

    /// The placements of a mesh: the list `placements`, or the one given by its own keys.
    fn placements(&self, start: usize, s: &MeshSection) -> Result<Vec<DMat4>> {
        let own = PlacementValue { translate: s.translate, rotate: s.rotate, scale: s.scale };
        let Some(placements) = &s.placements else { return Ok(vec![self.placement(start, &own)?]) };
        let keys = [
            ("translate", own.translate.is_some()),
            ("rotate", own.rotate.is_some()),
            ("scale", own.scale.is_some()),
        ];
        if let Some((key, _)) = keys.into_iter().find(|(_, given)| *given) {
            let what = format!("`{key}` beside `placements`");
            return Err(self.error(start, what, "give it in every placement, or give no `placements`"));
        }
        placements.iter().map(|place| self.placement(place.span().start, place.get_ref())).collect()
    }

    /// The transform of a placement: scale, then rotation about x, y and z, then translation.
    fn placement(&self, start: usize, s: &PlacementValue) -> Result<DMat4> {
        let translate = s.translate.unwrap_or([0.0; 3]);
        let rotate = s.rotate.unwrap_or([0.0; 3]);
        let scale = match s.scale {
            None => [1.0; 3],
            Some(ScaleValue::Uniform(factor)) => [factor; 3],
            Some(ScaleValue::PerAxis(factors)) => factors,
        };
        self.finite(start, "translate", &translate)?;
        self.finite(start, "rotate", &rotate)?;
        self.finite(start, "scale", &scale)?;
        if scale.contains(&0.0) {
            return Err(self.error(
                start,
                "`scale` is 0",
                "a mesh without size cannot be seen; give other factors",
            ));
        }
        let [x, y, z] = rotate.map(f64::to_radians);
        let rotation = DQuat::from_rotation_z(z) * DQuat::from_rotation_y(y) * DQuat::from_rotation_x(x);
        Ok(DMat4::from_scale_rotation_translation(scale.into(), rotation, translate.into()))
    }
}

/// Converts a mesh to an instance with the identity placement.
fn share(shape: Shape) -> Shape {
    match shape {
        Shape::Mesh(mesh) => Shape::Placed(Placed::new(Arc::new(mesh), Placement::default())),
        other => other,
    }
}
