//! Wavefront OBJ (Wavefront, "Object Files", Advanced Visualizer manual, appendix B1) and its MTL materials.
//!
//! The text is parsed in one pass: windows are read, cut into parts of whole lines ([`text`]), parsed in parallel
//! ([`chunk`], by [`scanner`]) and appended in order ([`assembly`]). Then polygons are triangulated and meshes made
//! ([`mesh`]). MTL files are read by `tobj` ([`mtl`]) and converted ([`material`], [`pbr`]).
//!
//! OBJ itself is not read by tobj 4.0.5: it reads on one thread by a line at a time, panics on some indices, does not
//! continue lines, rejects files with colours on some vertices, and its errors have no line. `oracle` compares with it.

mod assembly;
mod chunk;
mod exporters;
mod faces;
mod material;
mod mesh;
mod mtl;
mod oddities;
#[cfg(test)]
mod oracle;
mod pbr;
mod scanner;
#[cfg(test)]
mod tests;
mod text;

use std::collections::{BTreeSet, HashMap};

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::error::{Result, Warnings};
use crate::import::files::references::unquoted;
use crate::import::images::ImageLoader;
use crate::import::meshes::colours::{note_textured, white_of_floats};
use crate::import::meshes::tangents::make_tangents;
use crate::import::meshes::untextured;
use crate::import::{DefaultMaterials, Source};
use crate::scene::{MaterialId, Mesh, Object, Scene, Shape, TextureSlot};
use assembly::{Assembly, Sizes};
use material::Converter;

/// Reads an OBJ file, its materials and their textures.
pub(crate) fn read(source: &Source, warnings: &mut Warnings) -> Result<Scene> {
    let mut assembly = assembly::parse(source, Sizes::default(), warnings)?;
    scale_colours(&mut assembly.colours, source, warnings);
    let mut scene = Scene::default();
    let materials = read_materials(source, &assembly, &mut scene, warnings)?;
    let (meshes, cuts) = mesh::meshes(&mut assembly);
    cuts.warn(&source.file, warnings);
    let mut default_materials = DefaultMaterials::default();
    let (mut unknown, mut has_colours_left_out) = (BTreeSet::new(), false);
    for (run, mut mesh) in assembly.runs.into_iter().zip(meshes) {
        let find = |name: &String| materials.get(name).or_else(|| materials.get(without_comment(name)));
        let known = run.material.as_ref().and_then(find);
        if let (Some(name), None) = (run.material, known) {
            unknown.insert(name);
        }
        let material = match known {
            Some(&(material, transform)) => {
                transform_uvs(&mut mesh, transform);
                material
            }
            None => default_materials.of(&mesh, &mut scene),
        };
        let definition = &scene.materials[material.0 as usize];
        let without_uvs = match definition.is_textured() {
            true => untextured::split_off(&mut mesh),
            false => {
                untextured::fill(&mut mesh);
                None
            }
        };
        if definition.textures()[TextureSlot::BaseColour].is_some() && !mesh.uvs.is_empty() {
            has_colours_left_out |= mesh.colours.take().is_some();
        }
        if let Some(coordinates) = definition.tangent_coordinates() {
            make_tangents(&mut mesh, coordinates);
        }
        for mesh in [Some(mesh), without_uvs].into_iter().flatten() {
            scene.objects.push(Object {
                name: run.name.clone(),
                input: 0,
                material,
                shape: Shape::Mesh(mesh),
            });
        }
    }
    if has_colours_left_out {
        note_textured(&source.file, warnings);
    }
    warn_of_unknown_materials(&unknown, source, warnings);
    Ok(scene)
}

/// Divides colours by their white ([`white_of_floats`]).
fn scale_colours(colours: &mut [DVec3], source: &Source, warnings: &mut Warnings) {
    let given = || colours.par_iter().filter(|colour| colour.is_finite());
    let largest = given().map(|colour| colour.max_element()).reduce(|| 0.0, f64::max);
    let are_whole = || given().all(|colour| colour.fract() == DVec3::ZERO);
    let what = format!("{}: colours", source.file.display());
    let white = white_of_floats(largest, are_whole, what, warnings);
    if white != 1.0 {
        colours.par_iter_mut().for_each(|colour| *colour /= white);
    }
}

fn warn_of_unknown_materials(names: &BTreeSet<String>, source: &Source, warnings: &mut Warnings) {
    const MOST: usize = 20;
    let file = source.file.display();
    for name in names.iter().take(MOST) {
        warnings.push(format!("{file}: material `{name}` is not defined; drawn in grey"));
    }
    if let Some(more @ 1..) = names.len().checked_sub(MOST) {
        warnings.push(format!("{file}: {more} more materials are not defined; drawn in grey"));
    }
}

/// Material name without a trailing comment. Names may contain `#`, so the full name is looked up first.
fn without_comment(name: &str) -> &str {
    unquoted(name.split(" #").next().unwrap_or(name))
}

/// Factor and offset of texture coordinates, (0, 0) at the lower left corner of the image.
type Transform = Option<(DVec2, DVec2)>;

/// Adds the materials of all MTL files to the scene. Of equal names, that of the first file counts, as the OBJ text
/// says of the files of a `mtllib`; in a file, the last.
fn read_materials(
    source: &Source,
    assembly: &Assembly,
    scene: &mut Scene,
    warnings: &mut Warnings,
) -> Result<HashMap<String, (MaterialId, Transform)>> {
    let mut converter = Converter { source, scene, images: ImageLoader::new(source), warnings };
    let mut materials: HashMap<String, _> = HashMap::new();
    for line in &assembly.libraries {
        for library in mtl::read(source, line, converter.warnings) {
            let mut own = HashMap::new();
            for definition in library {
                let material = converter.convert(&definition)?;
                let transform = definition.transform(&source.file, converter.warnings);
                let id = converter.scene.add_material(material);
                own.insert(without_comment(&definition.material.name).to_owned(), (id, transform));
                own.insert(definition.material.name, (id, transform));
            }
            own.into_iter().for_each(|(name, material)| _ = materials.entry(name).or_insert(material));
        }
    }
    Ok(materials)
}

/// Applies a transform to the texture coordinates of a mesh, in which v points down.
fn transform_uvs(mesh: &mut Mesh, transform: Transform) {
    if let Some((scale, offset)) = transform {
        for uv in mesh.uvs.iter_mut().flat_map(|uvs| &mut uvs.values) {
            let up = DVec2::new(uv.x, 1.0 - uv.y) * scale + offset;
            *uv = DVec2::new(up.x, 1.0 - up.y);
        }
    }
}
