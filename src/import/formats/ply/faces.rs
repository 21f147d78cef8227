//! Faces of PLY files: polygons and triangle strips.

use glam::DVec2;

use crate::error::Result;
use crate::import::formats::ply::body::{Body, read_length, read_list, skip_property};
use crate::import::formats::ply::header::{Element, Property};
use crate::import::formats::ply::{colour_slot, first_of_each, whites};
use crate::import::meshes::colours::Colours;
use crate::import::meshes::polygon::Polygons;
use crate::import::text::values::{Read, Scalar, Values};
use crate::scene::Mesh;

/// Attributes of faces, and counts of unusual faces.
#[derive(Default)]
pub(super) struct Faces {
    /// White of the colours, whether there are texture coordinates, and numbers of textures; `None` before the first
    /// element.
    kind: Option<(Option<[f64; 4]>, bool, bool)>,
    pub polygons: Polygons,
    pub colours: Option<Colours>,
    /// Texture coordinates of corners.
    pub uvs: Vec<DVec2>,
    /// Texture coordinate indices per triangle; `None` for faces without texture coordinates.
    pub uv_triangles: Vec<Option<[u32; 3]>>,
    /// Whether faces have the property `texcoord`.
    pub has_uvs: bool,
    /// `texnumber` of each triangle.
    pub textures: Option<Vec<i64>>,
}

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Slot {
    Polygon,
    TextureCoordinates,
    TextureNumber,
    Colour(usize),
}

fn is_polygon(property: &Property) -> bool {
    property.length.is_some() && matches!(property.name.as_str(), "vertex_indices" | "vertex_index")
}

fn slot(property: &Property) -> Option<Slot> {
    match (property.name.as_str(), property.length.is_some()) {
        _ if is_polygon(property) => Some(Slot::Polygon),
        ("texcoord", true) => Some(Slot::TextureCoordinates),
        ("texnumber", false) => Some(Slot::TextureNumber),
        (name, false) => colour_slot(name).map(Slot::Colour),
        _ => None,
    }
}

impl Faces {
    /// Reads polygons.
    pub(super) fn read(&mut self, body: &mut Body, element: &Element, mesh: &mut Mesh) -> Result<()> {
        let slots = first_of_each(element, slot);
        let has = |slot: Slot| slots.contains(&Some(slot));
        if !has(Slot::Polygon) {
            return Err(body.fault_of(element, "its faces have no `vertex_indices`"));
        }
        let has_colours = (0..3).all(|channel| has(Slot::Colour(channel)));
        let white = whites(element, &slots, Slot::Colour);
        let (has_uvs, has_number) = (has(Slot::TextureCoordinates), has(Slot::TextureNumber));
        let kind = (has_colours.then_some(white), has_uvs, has_number);
        if *self.kind.get_or_insert(kind) != kind {
            let what = "a second element `face` with other colours or texture coordinates";
            return Err(body.fault_of(element, what));
        }
        self.has_uvs = has_uvs;
        if has_number {
            self.textures.get_or_insert_default();
        }
        if has_colours {
            self.colours.get_or_insert(Colours::of_faces(white));
        }
        let colour_bytes = if has_colours { size_of::<[f64; 4]>() + size_of::<u32>() } else { 0 };
        let count = body.count(element, size_of::<[u32; 3]>() + colour_bytes)?;
        mesh.triangles.reserve(count);
        let (mut list, mut uvs, mut polygon) = (Vec::new(), Vec::new(), Vec::new());
        body.each(element, |values| {
            let mut colour = white;
            let mut number = -1.0;
            for (property, slot) in element.properties.iter().zip(&slots) {
                match (slot, property.length) {
                    (Some(Slot::Polygon), Some(length)) => {
                        read_list(values, length, property.scalar, &mut list)?;
                        polygon.clear();
                        for &index in &list {
                            polygon.push(values.index(index, mesh.positions.len(), BEFORE)?);
                        }
                    }
                    (Some(Slot::TextureCoordinates), Some(length)) => {
                        read_list(values, length, property.scalar, &mut uvs)?;
                    }
                    (Some(Slot::TextureNumber), _) => number = values.next(property.scalar)?,
                    (Some(Slot::Colour(channel)), _) => {
                        colour[*channel] = property.scalar.unsigned(values.next(property.scalar)?);
                    }
                    _ => skip_property(values, property)?,
                }
            }
            let first_uv = (self.has_uvs && uvs.len() == 2 * polygon.len()).then_some(self.uvs.len() as u32);
            let made = self.polygons.add(mesh, &polygon, |t| {
                if self.has_uvs {
                    self.uv_triangles.push(first_uv.map(|first| t.map(|i| first + i as u32)));
                }
            });
            if first_uv.is_some() {
                self.uvs.extend(uvs.as_chunks().0.iter().map(|&[u, v]| DVec2::new(u, 1.0 - v)));
            }
            if let Some(textures) = &mut self.textures {
                textures.extend(std::iter::repeat_n(number as i64, made));
            }
            if let Some(colours) = &mut self.colours {
                colours.push_face(colour, made);
            }
            Ok(())
        })
    }
}

/// What messages about vertices of faces say of their number.
const BEFORE: &str = " before the faces";

/// Reads triangle strips. Every second triangle has reversed winding.
pub(super) fn read_strips(body: &mut Body, element: &Element, mesh: &mut Mesh) -> Result<()> {
    body.each(element, |values| {
        let mut triangles = Vec::new();
        for property in &element.properties {
            match property.length.filter(|_| is_polygon(property)) {
                Some(length) => strip(values, property.scalar, length, mesh.positions.len(), &mut triangles)?,
                None => skip_property(values, property)?,
            }
        }
        mesh.triangles.append(&mut triangles);
        Ok(())
    })
}

/// Reads one strip; vertex indices must be below `count`.
fn strip(
    values: &mut Values,
    scalar: Scalar,
    length: Scalar,
    count: usize,
    triangles: &mut Vec<[u32; 3]>,
) -> Read<()> {
    let mut strip = Vec::new();
    for _ in 0..read_length(values, length)? {
        let index = values.next(scalar)?;
        if index < 0.0 {
            strip.clear();
            continue;
        }
        strip.push(values.index(index, count, BEFORE)?);
        if let &[.., a, b, c] = strip.as_slice() {
            triangles.push(if strip.len() % 2 == 1 { [a, b, c] } else { [b, a, c] });
        }
    }
    Ok(())
}
