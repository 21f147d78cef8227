//! Settings of slicers for the objects of a 3MF file, beside the model: PrusaSlicer and its forks in
//! `Slic3r_PE_model.config` and `Slic3r_PE.config`, Bambu Studio and OrcaSlicer in `model_settings.config` and
//! `project_settings.config`.

use std::collections::{BTreeMap, HashMap};

use crate::error::Result;
use crate::import::formats::threemf::model::{Attributes, colour};
use crate::import::formats::threemf::package::Package;

/// Parts of objects and colours of filaments, which count from 1; 0 is none.
#[derive(Default)]
pub(super) struct Slicer {
    /// Filament of objects.
    objects: HashMap<u32, u32>,
    /// Parts by object, whether they are a component, and the index of that, or of their first triangle.
    pieces: BTreeMap<(u32, bool, u32), Piece>,
    filaments: Vec<Option<[u8; 4]>>,
}

/// Triangles of an object, or a component.
#[derive(Clone, Copy, Default)]
pub(super) struct Piece {
    last: u32,
    /// What the part is if it is not printed as such.
    pub role: Option<&'static str>,
    pub filament: u32,
}

/// The role of a part by its type or subtype, or of an object by the name of a setting of Cura.
pub(super) fn role(name: &str) -> Option<&'static str> {
    match name {
        "ParameterModifier" | "modifier_part" | "cura:infill_mesh" | "cura:cutting_mesh" => Some("modifier"),
        "NegativeVolume" | "negative_part" => Some("negative volume"),
        "SupportBlocker" | "support_blocker" | "cura:anti_overhang_mesh" => Some("support blocker"),
        "SupportEnforcer" | "support_enforcer" => Some("support enforcer"),
        "cura:support_mesh" => Some("support"),
        _ => None,
    }
}

/// The most filaments that are read, since a mesh is copied for each.
const MOST_FILAMENTS: usize = 64;

/// The contents of a file of settings.
fn settings(package: &Package, name: &str) -> Result<Option<Vec<u8>>> {
    let part = format!("Metadata/{name}.config");
    // A list of strings takes 16 times its text.
    package.check(&part, 16)?;
    package.bytes(&part)
}

impl Slicer {
    /// Reads the settings of a package. Colours that cannot be read are not used.
    pub(super) fn read(package: &Package) -> Result<Self> {
        let mut slicer = Slicer::default();
        let lists = match settings(package, "project_settings")? {
            Some(json) => {
                #[derive(serde::Deserialize)]
                struct Project {
                    filament_colour: Vec<String>,
                }
                let project = serde_json::from_slice(&json);
                vec![project.map_or(Vec::new(), |project: Project| project.filament_colour)]
            }
            None => {
                let text = settings(package, "Slic3r_PE")?.unwrap_or_default();
                let text = String::from_utf8_lossy(&text);
                let list = |key: &str| {
                    let mut pairs =
                        text.lines().filter_map(|line| line.trim_start_matches([';', ' ']).split_once('='));
                    let list = pairs.find(|(name, _)| name.trim() == key).map_or("", |(_, list)| list);
                    list.split(';').take(MOST_FILAMENTS).map(str::to_owned).collect()
                };
                ["extruder_colour", "filament_colour"].map(list).into()
            }
        };
        let count = lists.iter().map(Vec::len).max().unwrap_or(0);
        let parsed = |index: usize| {
            lists.iter().find_map(|list| colour(list.get(index)?.trim_matches(['"', ' ', '\r'])))
        };
        slicer.filaments = (0..count.min(MOST_FILAMENTS)).map(parsed).collect();
        for name in ["Slic3r_PE_model", "model_settings"] {
            slicer.read_parts(package, &format!("Metadata/{name}.config"))?;
        }
        Ok(slicer)
    }

    fn read_parts(&mut self, package: &Package, file: &str) -> Result<()> {
        let (mut object, mut open) = (0, None);
        package.for_each_element(file, |e| {
            let attributes = Attributes(e);
            let index = |name: &str| attributes.index(name).unwrap_or(0);
            let text = |name: &str| attributes.text(name).unwrap_or_default();
            match e.local_name().as_ref() {
                b"object" => (object, open) = (index("id"), None),
                b"volume" => {
                    let piece = Piece { last: index("lastid"), ..Piece::default() };
                    self.pieces.insert(*open.insert((object, false, index("firstid"))), piece);
                }
                b"part" => {
                    let piece = Piece { last: index("id"), role: role(&text("subtype")), filament: 0 };
                    self.pieces.insert(*open.insert((object, true, index("id"))), piece);
                }
                b"metadata" => {
                    let filament = index("value");
                    let filament = if filament as usize > self.filaments.len() { 0 } else { filament };
                    match (text("key").as_str(), open.and_then(|key| self.pieces.get_mut(&key))) {
                        ("extruder", Some(piece)) => piece.filament = filament,
                        ("extruder", None) => drop(self.objects.insert(object, filament)),
                        ("volume_type", Some(piece)) => piece.role = role(&text("value")),
                        ("modifier", Some(piece)) if text("value") == "1" => {
                            piece.role = piece.role.or(Some("modifier"));
                        }
                        _ => {}
                    }
                }
                _ => {}
            }
        })
    }

    /// The part of an object that has a triangle or is a component.
    pub(super) fn piece(&self, object: u32, is_component: bool, index: u32) -> Piece {
        let before = self.pieces.range((object, is_component, 0)..=(object, is_component, index)).next_back();
        before.filter(|(_, piece)| index <= piece.last).map_or(Piece::default(), |(_, piece)| *piece)
    }

    /// The filament of an object.
    pub(super) fn filament(&self, object: u32) -> u32 {
        self.objects.get(&object).copied().unwrap_or(0)
    }

    /// The colour of a filament; that of the first for none.
    pub(super) fn colour(&self, filament: u32) -> Option<[u8; 4]> {
        *self.filaments.get(filament.saturating_sub(1) as usize)?
    }
}
