//! PLY (Turk, "The PLY Polygon File Format", 1994): ASCII and binary in either byte order.
//!
//! Reads the position, normal (`nx ny nz`), texture coordinates (`u v`, `s t`, `texture_u texture_v` or `tx ty`) and
//! colour (`red green blue` or `r g b`, with `alpha` or `a`) of vertices; the polygon (`vertex_indices` or
//! `vertex_index`), colour, and texture coordinates of corners (`texcoord`, `texnumber`) of faces; triangle strips
//! (`tristrips`), in which a negative index begins a new strip; and the images after `comment TextureFile`. All other
//! elements and properties are skipped. Colours are display values, as in OBJ files: integers are divided by 255 (16
//! bits by 65535) and decoded from sRGB. As in OBJ files, v points up in the image.
//!
//! No crate is used: ply-rs-bw 3.0.3, the maintained one, rejects files with `nan`, `.5` or `1.` in a vertex, property
//! names with a bracket (as CloudCompare writes) and headers that are not UTF-8, and its errors have no byte offset for
//! binary data.

mod body;
mod faces;
mod header;

use std::hash::Hash;

use glam::{DVec2, DVec3};

use crate::error::{Error, Place, Result, Warnings};
use crate::film::Colour;
use crate::import::images::{Channels, ImageLoader};
use crate::import::meshes::colours::{Colours, note_textured};
use crate::import::meshes::parts::split;
use crate::import::text::lines::{Lines, warn_of_comma};
use crate::import::text::values::Encoding;
use crate::import::{Source, default_material};
use crate::scene::{Attribute, ImageId, Material, Mesh, Scene, Texture, TextureSampler, TextureSlot};
use body::{Body, skip_property};
use faces::Faces;
use header::{Element, Header, Property};

/// Whether the first line of a text is that of PLY files, in any case.
pub(crate) fn is_start(text: &[u8]) -> bool {
    Lines::new(text, 0).next().is_some_and(|(_, line)| line.trim_ascii_end().eq_ignore_ascii_case(b"ply"))
}

/// Reads a PLY file as one mesh, or as one for each of its textures. ASCII data that cannot be read with a
/// line for each element is read by words.
pub(crate) fn read(source: &Source, warnings: &mut Warnings) -> Result<Scene> {
    let header = Header::parse(source)?;
    if let Some((count, first)) = header.unknown {
        if header.encoding != Encoding::Ascii {
            // It may have been a property, without which all that follows is shifted.
            let place = Place::line(&source.file, first);
            return Err(Error::input(
                place,
                "not a statement of PLY headers",
                "correct the line, or remove it",
            ));
        }
        let what = "line(s) that are no statements of PLY headers are skipped; the first is line";
        warnings.left_out(format!("{}: {count} {what} {first}", source.file.display()));
    }
    let mut contents = Contents::read(source, &header, false);
    if !contents.as_ref().is_ok_and(|contents| contents.body.is_whole())
        && let Ok(by_words) = Contents::read(source, &header, true)
        && by_words.body.is_whole()
    {
        contents = Ok(by_words);
    }
    let Contents { body, mut mesh, colours, mut faces } = contents?;
    warn_of_comma(body.values.comma, &source.file, warnings);
    warn_of_length(&body, warnings);
    let file = source.file.display();
    let points = mesh.positions.len();
    if mesh.triangles.is_empty() && points > 0 {
        warnings.left_out(format!("{file}: {points} vertices without faces; points are not drawn"));
    }
    faces.polygons.warn(&source.file, warnings);
    let is_of_triangles = |colours: &Colours| {
        colours.triangles.as_ref().is_none_or(|triangles| triangles.len() == mesh.triangles.len())
    };
    match (colours, faces.colours.take()) {
        (Some(colours), of_faces) => {
            if of_faces.is_some() {
                let what = "colours of faces beside those of vertices are left out";
                warnings.left_out(format!("{file}: {what}"));
            }
            colours.set(&mut mesh, &source.file, warnings);
        }
        (None, Some(colours)) if is_of_triangles(&colours) => colours.set(&mut mesh, &source.file, warnings),
        (None, Some(_)) => {
            let what = "colours of faces are left out, because triangle strips have none";
            warnings.left_out(format!("{file}: {what}"));
        }
        (None, None) => {}
    }
    textured(source, &header, mesh, faces, warnings)
}

/// The values of a file.
struct Contents<'a> {
    /// The end of the values.
    body: Body<'a>,
    mesh: Mesh,
    colours: Option<Colours>,
    faces: Faces,
}

impl<'a> Contents<'a> {
    fn read(source: &'a Source, header: &Header, is_by_words: bool) -> Result<Self> {
        let mut body = Body::new(source, header, is_by_words);
        let (mut mesh, mut colours, mut faces) = (Mesh::default(), None, Faces::default());
        let mut before_vertices = Vec::new();
        let vertices = header.elements.iter().rposition(|element| element.name == "vertex");
        for (index, element) in header.elements.iter().enumerate() {
            let name = element.name.as_str();
            let is_before = !before_vertices.is_empty() || vertices.is_some_and(|last| index < last);
            match name {
                "vertex" if mesh != Mesh::default() => {
                    return Err(body.fault_of(element, "a second element `vertex`"));
                }
                "vertex" => colours = read_vertices(&mut body, element, &mut mesh)?,
                "face" | "tristrips" if is_before => {
                    before_vertices.push((element, body.clone()));
                    body.skip(element)?;
                }
                "face" if element.count > 0 => faces.read(&mut body, element, &mut mesh)?,
                "tristrips" => faces::read_strips(&mut body, element, &mut mesh)?,
                _ => body.skip(element)?,
            }
            if body.truncation.is_some() {
                return Ok(Contents { body, mesh, colours, faces });
            }
        }
        for (element, start) in before_vertices {
            let mut at = Body { surplus_lines: body.surplus_lines, ..start };
            match element.name.as_str() {
                "face" => faces.read(&mut at, element, &mut mesh)?,
                _ => faces::read_strips(&mut at, element, &mut mesh)?,
            }
            body.surplus_lines = at.surplus_lines;
            body.truncation = body.truncation.take().or(at.truncation.take());
        }
        Ok(Contents { body, mesh, colours, faces })
    }
}

/// Warns of data that is missing or that the header does not declare.
fn warn_of_length(body: &Body, warnings: &mut Warnings) {
    let file = body.values.source.file.display();
    if let Some((name, there, declared)) = &body.truncation {
        let what =
            format!("ends after {there} of {declared} elements ({name}); the complete elements are drawn");
        warnings.left_out(format!("{file}: {what}"));
    }
    if body.surplus_lines > 0 {
        let what = "line(s) have surplus values, which are left out";
        warnings.left_out(format!("{file}: {} {what}", body.surplus_lines));
    }
    if let (None, rest @ 1..) = (&body.truncation, body.values.bytes_left()) {
        warnings.left_out(format!("{file}: left out {rest} byte(s) after the last element"));
    }
}

/// Channel of a colour property by name: 0 red, 1 green, 2 blue, 3 alpha.
fn colour_slot(name: &str) -> Option<usize> {
    Some(match name.to_ascii_lowercase().as_str() {
        "red" | "r" | "diffuse_red" => 0,
        "green" | "g" | "diffuse_green" => 1,
        "blue" | "b" | "diffuse_blue" => 2,
        "alpha" | "a" | "diffuse_alpha" => 3,
        _ => return None,
    })
}

/// Slot of each property; `None` for unused properties and for duplicates.
fn first_of_each<S: Copy + Eq + Hash>(
    element: &Element,
    slot: impl Fn(&Property) -> Option<S>,
) -> Vec<Option<S>> {
    let mut known = std::collections::HashSet::new();
    element.properties.iter().map(|property| slot(property).filter(|slot| known.insert(*slot))).collect()
}

/// Value of white per channel; 1 for floating-point numbers.
fn whites<S: PartialEq>(element: &Element, slots: &[Option<S>], channel: impl Fn(usize) -> S) -> [f64; 4] {
    [0, 1, 2, 3].map(|index| {
        let property = slots.iter().position(|slot| slot.as_ref() == Some(&channel(index)));
        property.map_or(1.0, |property| element.properties[property].scalar.white())
    })
}

/// Slots of vertex values: position from 0, then normal, texture coordinates and colour.
const NORMAL: usize = 3;
const UV: usize = 6;
const COLOUR: usize = 8;
const SLOTS: usize = 12;

/// Reads vertices and their colours.
fn read_vertices(body: &mut Body, element: &Element, mesh: &mut Mesh) -> Result<Option<Colours>> {
    let slots = first_of_each(element, |property| {
        let slot = match property.name.as_str() {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            "nx" => NORMAL,
            "ny" => NORMAL + 1,
            "nz" => NORMAL + 2,
            "u" | "s" | "texture_u" | "tx" => UV,
            "v" | "t" | "texture_v" | "ty" => UV + 1,
            name => COLOUR + colour_slot(name)?,
        };
        Some(slot).filter(|_| property.length.is_none())
    });
    let has = |first: usize, count: usize| (first..first + count).all(|slot| slots.contains(&Some(slot)));
    if !has(0, 3) {
        return Err(body.fault_of(element, "its vertices have no `x`, `y` and `z`"));
    }
    let (has_normals, has_uvs, has_colours) = (has(NORMAL, 3), has(UV, 2), has(COLOUR, 3));
    let white = whites(element, &slots, |channel| COLOUR + channel);
    let sizes = [
        (true, size_of::<DVec3>()),
        (has_normals, size_of::<DVec3>()),
        (has_uvs, size_of::<DVec2>()),
        // Undecoded, decoded, and opacities.
        (has_colours, size_of::<[f64; 4]>() + size_of::<DVec3>() + size_of::<f64>()),
    ];
    let count =
        body.count(element, sizes.iter().filter(|(is_there, _)| *is_there).map(|(_, size)| size).sum())?;
    let capacity = |is_there: bool| if is_there { count } else { 0 };
    let mut positions = Vec::with_capacity(count);
    let mut normals = Vec::with_capacity(capacity(has_normals));
    let mut uvs = Vec::with_capacity(capacity(has_uvs));
    let mut colours = Vec::with_capacity(capacity(has_colours));
    body.each(element, |values| {
        let mut own = [0.0; SLOTS];
        own[COLOUR..].copy_from_slice(&white);
        for (property, slot) in element.properties.iter().zip(&slots) {
            match *slot {
                Some(slot @ COLOUR..) => own[slot] = property.scalar.unsigned(values.next(property.scalar)?),
                Some(slot) => own[slot] = values.next(property.scalar)?,
                None => skip_property(values, property)?,
            }
        }
        let [x, y, z, nx, ny, nz, u, v, colour @ ..] = own;
        positions.push(DVec3::new(x, y, z));
        if has_normals {
            normals.push(DVec3::new(nx, ny, nz));
        }
        if has_uvs {
            uvs.push(DVec2::new(u, 1.0 - v));
        }
        if has_colours {
            colours.push(colour);
        }
        Ok(())
    })?;
    mesh.positions = positions;
    mesh.normals = has_normals.then(|| Attribute::per_position(normals));
    mesh.uvs.extend(has_uvs.then(|| Attribute::per_position(uvs)));
    Ok(has_colours.then_some(Colours { values: colours, white, triangles: None }))
}

/// Scene of a mesh: split by the images of its faces, or with the first image on all faces.
fn textured(
    source: &Source,
    header: &Header,
    mut mesh: Mesh,
    faces: Faces,
    warnings: &mut Warnings,
) -> Result<Scene> {
    let Faces { uvs, uv_triangles, textures, has_uvs, .. } = faces;
    let file = source.file.display();
    let count = mesh.triangles.len();
    let has_corners = has_uvs && uv_triangles.len() == count && !uvs.is_empty();
    if header.texture_files.is_empty() && has_uvs {
        warnings.left_out(format!(
            "{file}: texture coordinates of faces (`texcoord`) are left out; no `comment TextureFile` names an image"
        ));
    }
    if header.texture_files.is_empty() || (!has_corners && mesh.uvs.is_empty()) {
        if !header.texture_files.is_empty() && count > 0 {
            warnings
                .left_out(format!("{file}: has a TextureFile, but no texture coordinates; drawn without it"));
        }
        return Ok(source.scene_of(vec![(None, mesh)]));
    }
    let mut scene = Scene::default();
    let mut loader = ImageLoader::new(source);
    let mut images: Vec<Option<ImageId>> = Vec::new();
    for name in &header.texture_files {
        let path = source.resolve_image(name, warnings);
        images.push(match path {
            Some(path) => loader.of_file(&mut scene, &path, Channels::Colour, warnings)?,
            None => None,
        });
    }
    let numbers = textures.filter(|numbers| numbers.len() == count);
    let image_of = |triangle: usize| {
        let number = numbers.as_ref().map_or(0, |numbers| numbers[triangle]);
        let is_mapped = !has_corners || uv_triangles[triangle].is_some();
        let image = usize::try_from(number).ok().and_then(|number| *images.get(number)?);
        image.filter(|_| is_mapped).map(|image| image.0)
    };
    let keys: Vec<Option<u32>> = (0..count).map(image_of).collect();
    if has_corners {
        let triangles = uv_triangles.iter().map(|corners| corners.unwrap_or_default()).collect();
        mesh.uvs = vec![Attribute { values: uvs, triangles: Some(triangles) }];
    }
    if mesh.colours.is_some() && keys.iter().any(Option::is_some) {
        note_textured(&source.file, warnings);
    }
    for (image, mut part) in split(mesh, &keys) {
        let mut material = default_material(&part);
        if let Some(image) = image {
            part.colours = None;
            material.colour = Colour::Linear(DVec3::ONE);
            let sampler = TextureSampler::default();
            material.textures[TextureSlot::BaseColour] =
                Some(Texture { image: ImageId(image), sampler, coordinates: 0 });
        }
        let material = scene.add_material(Material::Phong(material));
        source.add_object(&mut scene, None, part, material);
    }
    Ok(scene)
}

#[cfg(test)]
mod tests;
