//! What is asked of the files of a scene when they are read.

use crate::error::nearest_name;
use crate::limits::Limits;
use crate::scene::option::group;
use crate::scene::option::{OptionValue, options, ranged};
use crate::scene::{ClipChoice, ClipTime, UpChoice};

options! {
    /// Choices that importers take.
    #[derive(Debug, Clone, Default, PartialEq)]
    pub struct ImportOptions {
        /// Time in seconds at which glTF animations are evaluated [default: the rest pose]
        [of(group::INPUT).hyphens().value_name("SECONDS")] time: Option<Seconds>,
        /// Material variant of glTF files (KHR_materials_variants), by name [default: the file's materials]
        [of(group::INPUT).value_name("NAME")] variant: Option<String>,
        /// Up axis of mesh files; `auto`: y in glTF, z in 3MF; of other formats, z for a file that seems to stand upright in it, else y
        /// [default: y]
        [of(group::INPUT).order(0).hyphens().value_name("AXIS").ignores_case()] up: Option<UpChoice>,
        /// Smooth normals for mesh files without normals, up to this crease angle in degrees, 0 to 180; 0 is flat shading [default
        /// without a number: 30] [default: 30, but glTF files are flat]
        [of(group::INPUT).order(1).value_name("DEG").bare("30")] smooth: Option<Degrees>,
        /// Animation clip of a glTF file, by name or index from 0, or `all`; several play together, of those that animate
        /// the same property the last [default: the first]
        [of(group::INPUT).value_name("NAME|INDEX|all")] clips as clip: Vec<ClipChoice>,
        /// Material for all objects, with the keys of `[material]` in scene files.
        [of(group::LOOK).value_name("WORD|{...}|NAME={...}|NAME+={...}").help(material_help())] materials as material: Vec<MaterialChoice>,
        /// Leave objects of this name and their parts (OBJECT/...) out of the picture; may be repeated. The camera that frames the
        /// scene frames the others
        [of(group::INPUT).value_name("OBJECT")] hide: Vec<String>,
        /// Leave all objects but those of this name and their parts out of the picture; may be repeated
        [of(group::INPUT).value_name("OBJECT")] isolate: Vec<String>,
        /// Read glTF files that require unsupported extensions; what depends on these is missing or wrong
        [of(group::INPUT)] ignore_required_extensions: bool,
        /// Follow references of mesh files outside their folder, such as a texture ../wood.png; only for trusted files
        [of(group::INPUT)] allow_outside_references: bool,
        /// Whether meshes without normals get smooth ones at an angle of [`ImportOptions::CREASE`] if `smooth` is not given, as in the
        /// default look; not those of glTF, which are flat by its specification.
        [skip] smooths_meshes: bool,
        /// The most that the files may hold: `--limit`, an option of all commands.
        [skip] limits: Limits,
    }
}

/// Materials by a word, each with its keys. Colours of metals are those of <https://physicallybased.info>, encoded as sRGB.
pub(crate) const NAMED_MATERIALS: &[(&str, &str)] = &[
    ("aluminium", "{ colour = \"#f5f5f6\", metallic = 1, roughness = 0.3 }"),
    ("brass", "{ colour = \"#f4e4ae\", metallic = 1, roughness = 0.2 }"),
    ("chrome", "{ colour = \"#c4c5c5\", metallic = 1, roughness = 0.05 }"),
    ("copper", "{ colour = \"#fad1c2\", metallic = 1, roughness = 0.2 }"),
    ("gold", "{ colour = \"#ffe397\", metallic = 1, roughness = 0.2 }"),
    ("iron", "{ colour = \"#c1bdba\", metallic = 1, roughness = 0.4 }"),
    ("silver", "{ colour = \"#fcfbf5\", metallic = 1, roughness = 0.15 }"),
    ("clay", "{ colour = \"#b98b6e\", metallic = 0, roughness = 0.9 }"),
    (
        "glass",
        "{ colour = \"#ffffff\", roughness = 0, layers = { transmission = 1, ior = 1.5, volume = true } }",
    ),
    ("plastic", "{ colour = \"#d8d8d4\", metallic = 0, roughness = 0.3 }"),
    ("porcelain", "{ colour = \"#f2f0ea\", metallic = 0, roughness = 0.15 }"),
    ("rubber", "{ colour = \"#2a2a2a\", metallic = 0, roughness = 0.8 }"),
];

/// The help of `--material`.
fn material_help() -> String {
    let words: Vec<&str> = NAMED_MATERIALS.iter().map(|(word, _)| *word).collect();
    format!(
        "Material for all objects: {}, or the keys of `[material]` in scene files: '{{ colour = \"#c33\", metallic = 1, \
         roughness = 0.2 }}'; without a colour, theirs stays; NAME=...: for the objects of this name or whose material has it; NAME+={{...}}: change colour, \
         metallic or roughness of their own material, whose textures stay; may be repeated, the last counts",
        words.join(", ")
    )
}

/// A material in place of those of the files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MaterialChoice {
    /// Name of the objects, or of their materials; all if `None`.
    pub name: Option<String>,
    /// Whether it changes values of the files' materials ([`MaterialChange`](crate::scene::MaterialChange)) instead of replacing
    /// them.
    pub changes: bool,
    /// Inline table with the keys of `[material]`, or of the change.
    pub table: String,
}

impl OptionValue for MaterialChoice {
    fn parse(text: &str) -> Result<Self, String> {
        let text = text.trim();
        let begins = |&at: &usize| at == 0 || text[..at].trim_end().ends_with('=');
        let Some(at) = text.match_indices('{').map(|(at, _)| at).find(begins) else {
            let (name, word) = text.rsplit_once('=').map_or((None, text), |(name, word)| (Some(name), word));
            let word = word.trim().to_ascii_lowercase();
            let named = NAMED_MATERIALS.iter().find(|(name, _)| *name == word);
            if name.is_some_and(|name| name.ends_with('+')) {
                return Err(
                    "NAME+= takes values, such as { roughness = 0.2 }; NAME=gold takes a word".to_owned()
                );
            }
            let Some((_, table)) = named else {
                let words: Vec<&str> = NAMED_MATERIALS.iter().map(|(word, _)| *word).collect();
                let near = nearest_name(&word, &words);
                return Err(format!(
                    "{near}; or give keys, such as '{{ colour = \"#c33\" }}', or NAME={{ ... }}"
                ));
            };
            let name = name.map(|name| name.trim().to_owned());
            return Ok(MaterialChoice { name, changes: false, table: (*table).to_owned() });
        };
        let (before, table) = text.split_at(at);
        let name = before.trim_end().strip_suffix('=').map(str::trim);
        let (name, changes) = match name.and_then(|name| name.strip_suffix('+')) {
            Some(name) => (Some(name.trim_end()).filter(|name| !name.is_empty()), true),
            None => (name, false),
        };
        Ok(MaterialChoice { name: name.map(str::to_owned), changes, table: table.to_owned() })
    }

    fn text(&self) -> String {
        let MaterialChoice { name, changes, table } = self;
        match (name, changes) {
            (None, false) => table.clone(),
            (name, _) => {
                let equals = if *changes { "+=" } else { "=" };
                format!("{}{equals}{table}", name.as_deref().unwrap_or_default())
            }
        }
    }
}

ranged! {
    /// A time in seconds.
    Seconds(f64, "f64") in f64::MIN..=f64::MAX, "give seconds, such as 1.5", unit "s";
    /// An angle between triangles in degrees.
    Degrees(f64, "f64") in 0.0..=180.0, "give degrees from 0 to 180", bare ImportOptions::CREASE;
}

impl OptionValue for ClipChoice {
    fn parse(text: &str) -> Result<Self, String> {
        Ok(ClipChoice::Named(text.to_owned()))
    }

    fn text(&self) -> String {
        match self {
            ClipChoice::First => "0".to_owned(),
            ClipChoice::Named(name) => name.clone(),
            ClipChoice::Index(index) => index.to_string(),
            ClipChoice::Several(choices) => {
                choices.iter().map(OptionValue::text).collect::<Vec<_>>().join(", ")
            }
        }
    }
}

impl ImportOptions {
    /// The angle in degrees above which edges stay sharp by default.
    pub const CREASE: f64 = 30.0;

    /// Options that pose the scene.
    pub fn posed(mut self, ClipTime { clip, time }: ClipTime) -> Self {
        self.clips = clip.choices().to_vec();
        self.time = Some(Seconds::clamped(time));
        self
    }

    /// The moment of a clip at which the scene is posed; at rest if `None`.
    pub fn pose(&self) -> Option<ClipTime> {
        let time = self.time.map(Seconds::get);
        (time.is_some() || !self.clips.is_empty())
            .then(|| ClipTime { clip: self.clip(), time: time.unwrap_or(0.0) })
    }

    /// The chosen clips, the first by default.
    pub fn clip(&self) -> ClipChoice {
        ClipChoice::together(self.clips.clone()).unwrap_or_default()
    }
}
