//! 3MF (3MF Consortium, Core Specification 1.3, with its Materials, Properties and Production extensions).
//!
//! Reads the objects of the build with their transforms and components, also from other parts of the package (`path`);
//! colours of `basematerials` and `colorgroup`; images of `texture2dgroup`. Coordinates become millimetres. Objects of
//! type `support`, `solidsupport` and `other`, and what slicers do not print ([`slicer`]), are left out.
//!
//! The package is read from memory ([`package`]), its XML as a stream, so that memory grows only with the scene. No
//! crate for 3MF is used: lib3mf-core and threemf 0.6 read whole documents into memory without limits.

mod model;
mod package;
mod slicer;

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DMat4, DVec2, DVec3};

use crate::error::{Error, Place, Result, Warnings};
use crate::film::ColourPipeline;
use crate::film::colour::srgb_decode;
use crate::import::images;
use crate::import::meshes::parts::split;
use crate::import::{Source, default_material};
use crate::limits::{self, Counted};
use crate::scene::{
    Attribute, ImageId, Material, MaterialId, Mesh, Object, Phong, Placed, Placement, Scene, Shape, Texture,
    TextureSampler, TextureSlot, Wrap,
};
use model::{Definition, FILAMENT, Model, Property, Reference};
use package::Package;
use slicer::{Piece, Slicer};

/// Maximum nesting depth of components; slicers write one or two levels.
const MAX_DEPTH: usize = 64;

/// Reads the build of a 3MF file.
pub(crate) fn read(source: &Source, warnings: &mut Warnings) -> Result<Scene> {
    let package = Package::open(source)?;
    let root = package.root()?;
    let slicer = Slicer::read(&package).unwrap_or_else(|e| {
        warnings.left_out(format!("{e}; settings of slicers are not used"));
        Slicer::default()
    });
    let mut reader = Reader {
        source,
        slicer,
        root: root.clone(),
        package,
        warnings,
        scene: Scene::default(),
        models: HashMap::new(),
        meshes: HashMap::new(),
        images: HashMap::new(),
        default: None,
        references: 0,
    };
    let Some(model) = reader.model(&root)? else { return Ok(reader.scene) };
    reader.scene.metadata = model.metadata.clone();
    for item in &model.items {
        if item.is_printable {
            reader.add_item(item, &root, DMat4::from_scale(DVec3::splat(model.unit)), 0, 0)?;
        } else {
            reader.note_left_out(&format!("object {}, which is not to be printed", item.object));
        }
    }
    Ok(reader.scene)
}

/// Peak bytes per placement in the scene and the prepared world, measured with 100,000 placements.
const PLACEMENT: u64 = 4200;

/// Image and wrap modes of a texture.
type WrappedImage = (ImageId, [Wrap; 2]);

/// Parts of a mesh and their materials.
type Parts = Arc<Vec<(Arc<Mesh>, MaterialId)>>;

struct Reader<'a> {
    source: &'a Source,
    slicer: Slicer,
    /// Part of the root model.
    root: String,
    package: Package<'a>,
    warnings: &'a mut Warnings,
    scene: Scene,
    /// By part of the package; `None` if it is missing.
    models: HashMap<String, Option<Arc<Model>>>,
    /// By part of the package, object id and filament.
    meshes: HashMap<(String, u32, u32), Parts>,
    /// By part of the package.
    images: HashMap<String, Option<ImageId>>,
    /// Material of meshes without properties.
    default: Option<MaterialId>,
    /// Number of items and components followed, once per placement.
    references: u64,
}

impl Reader<'_> {
    fn error(&self, item: String, what: impl Into<String>) -> Error {
        Error::input(Place::item(&self.source.file, item), what, "export the file again")
    }

    fn note_left_out(&mut self, what: &str) {
        self.warnings.note_left_out(format!("{}: left out {what}", self.source.file.display()));
    }

    /// What slicers say of a component or a triangle of an object. They name objects of the root model.
    fn piece(&self, part: &str, object: u32, is_component: bool, index: u32) -> Piece {
        if part == self.root { self.slicer.piece(object, is_component, index) } else { Piece::default() }
    }

    /// Model of a part of the package, cached; `None` with a warning if there is no such part.
    fn model(&mut self, part: &str) -> Result<Option<Arc<Model>>> {
        if let Some(model) = self.models.get(part) {
            return Ok(model.clone());
        }
        let model = Model::read(&self.package, part, self.source)?.map(Arc::new);
        let file = self.source.file.display();
        match &model {
            None => self.warnings.left_out_file(format!("{file}: {part}: left out: not in the file")),
            Some(model) => {
                let mut what: Vec<&str> = model.left_out.iter().copied().collect();
                what.extend(
                    (model.is_painted && self.slicer.colour(0).is_none()).then_some("painted colours"),
                );
                if !what.is_empty() {
                    self.warnings.left_out(format!("{file}: left out: {}", what.join(", ")));
                }
            }
        }
        self.models.insert(part.to_owned(), model.clone());
        Ok(model)
    }

    /// Adds an object and its components. `part` is the part of the package of the reference, `filament` that of the
    /// object that has it as a component.
    fn add_item(
        &mut self,
        reference: &Reference,
        part: &str,
        outer: DMat4,
        depth: usize,
        mut filament: u32,
    ) -> Result<()> {
        let part = reference.path.as_deref().unwrap_or(part);
        let Some(model) = self.model(part)? else { return Ok(()) };
        let place = format!("{part}, object {}", reference.object);
        self.references += 1;
        Counted::Nodes.check(self.references, &self.source.options.limits, self.source.file.as_path())?;
        // Nested components multiply: the file size does not bound their number.
        if self.references.is_power_of_two() {
            limits::check(limits::product(&[self.references, PLACEMENT])).map_err(|excess| {
                let what = format!("{} placements: twice as many {excess}", self.references);
                Error::input(self.source.file.as_path(), what, excess.remedy())
            })?;
        }
        let Some(object) = model.objects.get(&reference.object) else {
            return Err(self.error(place, "does not exist"));
        };
        if depth > MAX_DEPTH {
            return Err(self.error(place, format!("components that are nested more than {MAX_DEPTH} times")));
        }
        if let Some(kind) = object.other_type {
            self.note_left_out(&format!("object {} of the type `{kind}`", reference.object));
            return Ok(());
        }
        if part == self.root && filament == 0 {
            filament = self.slicer.filament(reference.object);
        }
        let placement = outer * reference.transform;
        if object.triangles.is_empty() {
            return object.components.iter().try_for_each(|component| {
                let piece = self.piece(part, reference.object, true, component.object);
                if let Some(role) = piece.role {
                    self.note_left_out(&format!("object {}, a {role}", component.object));
                    return Ok(());
                }
                let filament = if piece.filament > 0 { piece.filament } else { filament };
                self.add_item(component, part, placement, depth + 1, filament)
            });
        }
        for (mesh, material) in self.mesh(part, &model, reference.object, filament)?.iter() {
            let name = object.name.clone().unwrap_or_else(|| format!("object {}", reference.object));
            let placed = Placed { mesh: Arc::clone(mesh), placement: Placement::new(placement) };
            let shape = Shape::Placed(placed);
            self.scene.objects.push(Object { name, input: 0, material: *material, shape });
        }
        Ok(())
    }

    /// Mesh of an object, split by image, with materials. Triangles without a colour have that of the filament.
    fn mesh(&mut self, part: &str, model: &Model, id: u32, filament: u32) -> Result<Parts> {
        let key = (part.to_owned(), id, filament);
        if let Some(parts) = self.meshes.get(&key) {
            return Ok(Arc::clone(parts));
        }
        let Some(Definition { positions, triangles, properties, .. }) = model.objects.get(&id) else {
            return Ok(Parts::default());
        };
        // Copies of positions and triangles, attributes of triangles, and the parts split from them.
        let per_triangle = size_of::<[u32; 3]>() * 3 + size_of::<(Option<&str>, Option<WrappedImage>)>();
        let bytes = 2 * (size_of_val(&positions[..]) + triangles.len() * per_triangle);
        limits::check(bytes as u64).map_err(|excess| {
            let place = Place::item(&self.source.file, format!("{part}, object {id}"));
            excess.at(place, format!("{} triangles: reading them", triangles.len()))
        })?;
        let mut attributes = CornerAttributes::default();
        let mut groups = Vec::with_capacity(triangles.len());
        for (index, property) in properties.iter().enumerate() {
            let piece = self.piece(part, id, false, index as u32);
            let own = (FILAMENT, [if piece.filament > 0 { piece.filament } else { filament }; 3]);
            let property = property.as_ref().unwrap_or(&own);
            groups.push((piece.role, self.add_triangle_attributes(model, property, &mut attributes)?));
        }
        let mesh = attributes.into_mesh(positions.clone(), triangles.clone());
        let mut parts = Vec::new();
        for ((role, image), mut mesh) in split(mesh, &groups) {
            if let Some(role) = role {
                let count = mesh.triangles.len();
                self.note_left_out(&format!("{count} triangle(s) of object {id}, a {role}"));
                continue;
            }
            if image.is_some() {
                mesh.colours = None;
            } else {
                mesh.uvs.clear();
            }
            let material = self.material(&mesh, image);
            parts.push((Arc::new(mesh), material));
        }
        let parts = Arc::new(parts);
        self.meshes.insert(key, Arc::clone(&parts));
        Ok(parts)
    }

    /// Adds the material of a mesh to the scene.
    fn material(&mut self, mesh: &Mesh, image: Option<WrappedImage>) -> MaterialId {
        let mut material = default_material(mesh);
        if let Some((image, [wrap_u, wrap_v])) = image {
            material.colour = crate::film::Colour::Linear(DVec3::ONE);
            let sampler = TextureSampler { wrap_u, wrap_v, ..TextureSampler::default() };
            material.textures[TextureSlot::BaseColour] = Some(Texture { image, sampler, coordinates: 0 });
        } else if mesh.colours.is_none() {
            let scene = &mut self.scene;
            return *self.default.get_or_insert_with(|| scene.add_material(Material::Phong(material)));
        }
        self.scene.add_material(Material::Phong(material))
    }

    /// Adds the colours or texture coordinates of a triangle to `attributes`; returns its image.
    fn add_triangle_attributes(
        &mut self,
        model: &Model,
        &(group, corners): &(u32, [u32; 3]),
        attributes: &mut CornerAttributes,
    ) -> Result<Option<WrappedImage>> {
        if group == FILAMENT {
            let colour = self.slicer.colour(corners[0]);
            attributes.push(colour.map(|colour| Corners::Colours([colour; 3])).as_ref());
            return Ok(None);
        }
        match model.properties.get(&group) {
            Some(Property::Colours(colours)) => {
                let corner = |index: u32| colours.get(index as usize).copied();
                let [Some(a), Some(b), Some(c)] = corners.map(corner) else {
                    let what = "colour index out of range";
                    return Err(self.error(format!("resource {group}"), what));
                };
                attributes.push(Some(&Corners::Colours([a, b, c])));
                Ok(None)
            }
            Some(Property::Coordinates { texture, uvs }) => {
                let corner = |index: u32| uvs.get(index as usize).copied();
                let [Some(a), Some(b), Some(c)] = corners.map(corner) else {
                    let what = "texture coordinate index out of range";
                    return Err(self.error(format!("resource {group}"), what));
                };
                let corners = Corners::Uvs([a, b, c]);
                let image = match model.textures.get(texture) {
                    Some(texture) => self.image(&texture.path)?.map(|image| (image, texture.wrap)),
                    None => None,
                };
                attributes.push(image.map(|_| &corners));
                Ok(image)
            }
            None => {
                attributes.push(None);
                Ok(None)
            }
        }
    }

    /// Image of a part of the package, cached; `None` with a warning if it cannot be used.
    fn image(&mut self, part: &str) -> Result<Option<ImageId>> {
        if let Some(&known) = self.images.get(part) {
            return Ok(known);
        }
        let place = Place::item(&self.source.file, part);
        let image = match self.package.bytes(part)? {
            Some(bytes) => images::of_bytes(&mut self.scene, self.source, place, &bytes, self.warnings)?,
            None => {
                self.warnings.left_out(format!("{place}: texture left out: not in the file"));
                None
            }
        };
        self.images.insert(part.to_owned(), image);
        Ok(image)
    }
}

/// Values at the corners of a triangle.
enum Corners {
    /// Red, green, blue and alpha, display values.
    Colours([[u8; 4]; 3]),
    Uvs([DVec2; 3]),
}

/// Values at the corners of triangles; colours without duplicates.
#[derive(Default)]
struct CornerAttributes {
    colours: Vec<DVec3>,
    alphas: Vec<f64>,
    known: HashMap<Option<[u8; 4]>, u32>,
    colour_triangles: Vec<[u32; 3]>,
    uvs: Vec<DVec2>,
    uv_triangles: Vec<[u32; 3]>,
    has_colours: bool,
}

impl CornerAttributes {
    /// Adds a triangle. Without colours it gets the default grey.
    fn push(&mut self, corners: Option<&Corners>) {
        let CornerAttributes { colours, alphas, known, .. } = self;
        let mut index = |colour: Option<[u8; 4]>| {
            *known.entry(colour).or_insert_with(|| {
                let [r, g, b, a] = colour.unwrap_or([255; 4]).map(|c| f64::from(c) / 255.0);
                colours.push(match colour {
                    Some(_) => DVec3::new(srgb_decode(r), srgb_decode(g), srgb_decode(b)),
                    None => Phong::default().colour.to_pipeline(ColourPipeline::Linear),
                });
                alphas.push(a);
                (colours.len() - 1) as u32
            })
        };
        let (colour, uv) = match corners {
            Some(Corners::Colours(corners)) => {
                self.has_colours = true;
                (corners.map(|corner| index(Some(corner))), [0; 3])
            }
            Some(Corners::Uvs(corners)) => {
                let first = self.uvs.len() as u32;
                self.uvs.extend(corners);
                ([index(None); 3], [first, first + 1, first + 2])
            }
            None => ([index(None); 3], [0; 3]),
        };
        self.colour_triangles.push(colour);
        self.uv_triangles.push(uv);
    }

    fn into_mesh(self, positions: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Mesh {
        let mut mesh = Mesh { positions, triangles, ..Mesh::default() };
        if self.has_colours {
            // Some programs write an alpha of 0 throughout; it is read as opaque.
            if self.alphas.iter().any(|&a| a != 1.0) && self.alphas.iter().any(|&a| a > 0.0) {
                let triangles = Some(self.colour_triangles.clone());
                mesh.alphas = Some(Attribute { values: self.alphas, triangles });
            }
            mesh.colours = Some(Attribute { values: self.colours, triangles: Some(self.colour_triangles) });
        }
        if !self.uvs.is_empty() {
            mesh.uvs = vec![Attribute { values: self.uvs, triangles: Some(self.uv_triangles) }];
        }
        mesh
    }
}

#[cfg(test)]
mod tests;
