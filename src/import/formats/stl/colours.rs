//! Colours of binary STL files, in the two attribute bytes of each facet: five bits for each channel. There are two
//! conventions:
//!
//! - Materialise Magics: the header has `COLOR=` and four bytes, red, green, blue and alpha, the colour of the whole
//!   part, or `MATERIAL=` and three such colours, of which the first is diffuse. Bits 0 to 4 of a facet are red, 10 to
//!   14 blue; if bit 15 is set, it has the colour of the part.
//! - VisCAM and SolidView: bits 0 to 4 are blue, 10 to 14 red; if bit 15 is clear, the facet has no colour.
//!
//! Source: Wikipedia, "STL (file format)", section "Color in binary STL".

use std::collections::HashMap;

use glam::DVec3;

use crate::film::colour::srgb_decode;
use crate::film::{Colour, ColourPipeline};
use crate::import::default_material;
use crate::scene::{Attribute, Material, MaterialId, Mesh, Opacity, Phong, Scene};

/// Bit 15 of the attribute bytes.
const FLAG: u16 = 1 << 15;

/// Facet colours without duplicates.
pub(super) struct FacetColours {
    /// Colour of the part in display values of 0 to 1, in Magics' convention.
    part: Option<[f64; 4]>,
    /// Index of each facet's colour in `values`.
    facets: Vec<u32>,
    values: Vec<DVec3>,
    known: HashMap<u16, u32>,
    /// Whether any facet has its own colour.
    has_own: bool,
}

impl FacetColours {
    /// Reads the part colour from the header.
    pub(super) fn of_header(header: &[u8]) -> Self {
        let after = |key: &[u8], length: usize| {
            let at = header.windows(key.len()).position(|word| word == key)? + key.len();
            header.get(at..at + length)
        };
        // Some programs write 0 or a separator in place of alpha; both are read as opaque.
        let colour = |bytes: &[u8]| {
            let alpha = if matches!(bytes[3], 0 | b' ' | b',') { 255 } else { bytes[3] };
            [bytes[0], bytes[1], bytes[2], alpha].map(|value| f64::from(value) / 255.0)
        };
        // A material of spaces or zeros is header padding.
        let is_padding = |bytes: &[u8]| bytes.iter().all(|&b| b == bytes[0] && matches!(b, 0 | b' '));
        let material = after(b"MATERIAL=", 12).filter(|bytes| !is_padding(bytes));
        let of_part = after(b"COLOR=", 4);
        let part = of_part.map(|of_part| colour(material.unwrap_or(of_part)));
        FacetColours { part, facets: Vec::new(), values: Vec::new(), known: HashMap::new(), has_own: false }
    }

    /// Adds the attribute bytes of the next facet.
    pub(super) fn push(&mut self, bits: u16) {
        let has_own = (bits & FLAG == 0) == self.part.is_some();
        // Facets without a colour get the part colour or the default grey.
        let key = if has_own { bits & !FLAG } else { FLAG };
        self.has_own |= has_own;
        let FacetColours { part, values, known, .. } = self;
        let index = *known.entry(key).or_insert_with(|| {
            let channel = |shift: u16| f64::from(bits >> shift & 31) / 31.0;
            let linear = |rgb: [f64; 3]| DVec3::from(rgb.map(srgb_decode));
            values.push(match (has_own, &part) {
                (true, Some(_)) => linear([0, 5, 10].map(channel)),
                (true, None) => linear([10, 5, 0].map(channel)),
                (false, Some([r, g, b, _])) => linear([*r, *g, *b]),
                (false, None) => Phong::default().colour.to_pipeline(ColourPipeline::Linear),
            });
            (values.len() - 1) as u32
        });
        self.facets.push(index);
    }

    /// Sets the facet colours of a mesh, and adds its material to a scene.
    pub(super) fn add_to(self, scene: &mut Scene, mesh: &mut Mesh) -> MaterialId {
        // Programs that do not colour facets write 0 throughout.
        let is_unused = self.part.is_some() && self.known.len() == 1 && self.known.contains_key(&0);
        let has_own = self.has_own && !is_unused;
        if has_own {
            let triangles = Some(self.facets.into_iter().map(|index| [index; 3]).collect());
            mesh.colours = Some(Attribute { values: self.values, triangles });
        }
        let mut material = default_material(mesh);
        if let Some([r, g, b, alpha]) = self.part {
            if !has_own {
                material.colour = Colour::Display(DVec3::new(r, g, b));
            }
            material.opacity = (alpha < 1.0).then_some(Opacity { factor: alpha, cutoff: None });
        }
        scene.add_material(Material::Phong(material))
    }
}
