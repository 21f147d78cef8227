//! What options change of a scene that is read: materials of objects, and which objects are visible.

use std::collections::HashMap;

use crate::error::{Error, Result, Warnings, nearest_name};
use crate::film::Colour;
use crate::import::formats::scene_file;
use crate::scene::{
    ImportOptions, Material, MaterialChange, MaterialChoice, MaterialId, Object, Scene, TextureSlot,
};

/// A parsed [`MaterialChoice`].
pub(super) enum MaterialEdit {
    /// A material in place of the files', and whether it has a colour of its own. If not, it takes theirs, with its texture.
    Replace(Box<Material>, bool),
    /// Values in place of the files'.
    Change(MaterialChange),
}

/// Parses [`ImportOptions::materials`].
///
/// # Errors
/// [`Error::Usage`] for one that is not valid.
pub(super) fn parse(options: &ImportOptions) -> Result<Vec<MaterialEdit>> {
    let parse = |MaterialChoice { changes, table, .. }: &MaterialChoice| {
        Ok(match changes {
            true => MaterialEdit::Change(scene_file::inline_change(table)?),
            false => {
                let (material, has_colour) = scene_file::inline_material(table)?;
                MaterialEdit::Replace(material.into(), has_colour)
            }
        })
    };
    options.materials.iter().map(parse).collect()
}

/// Applies the options of a scene as the files have it.
///
/// # Errors
/// [`Error::Usage`] for names that neither an object nor a material of one has, and if no object is visible.
pub(super) fn apply(scene: &mut Scene, edits: Vec<MaterialEdit>, warnings: &mut Warnings) -> Result<()> {
    let ImportOptions { materials, isolate, hide, .. } = scene.import_options.clone();
    if !materials.is_empty() {
        replace_materials(scene, &materials, edits, warnings)?;
    }
    scene.set_visible(&isolate, &hide)
}

/// Gives objects the materials of the choices; of several for an object, the last, or the changes of all after it.
fn replace_materials(
    scene: &mut Scene,
    choices: &[MaterialChoice],
    edits: Vec<MaterialEdit>,
    warnings: &mut Warnings,
) -> Result<()> {
    let of_object = |object: &Object| scene.materials[object.material.0 as usize].name().to_owned();
    let of_objects: Vec<String> = scene.objects.iter().map(of_object).collect();
    let mut replaced = Vec::new();
    for (choice, edit) in choices.iter().zip(edits) {
        let has_name = |i: usize, name: &str| of_objects[i] == name || scene.objects[i].is_named(name);
        let is_meant = |&i: &usize| choice.name.as_deref().is_none_or(|name| has_name(i, name));
        let meant: Vec<usize> = (0..of_objects.len()).filter(is_meant).collect();
        if let (Some(name), []) = (&choice.name, meant.as_slice()) {
            let names = scene.objects.iter().map(|object| &object.name).chain(&of_objects);
            let known: Vec<&str> = names.map(String::as_str).collect();
            let hint = nearest_name(name, &known);
            return Err(Error::usage(format!("--material: no object or material is named `{name}`"), hint));
        }
        match edit {
            MaterialEdit::Replace(material, true) => {
                // [1, 0, 1] of 255.
                if matches!(material.colour(), Colour::Display(c) if c.max_element() == 1.0 / 255.0) {
                    warnings.note(
                        "--material: a colour in numbers from 0 to 1 is nearly black: white is [255, 255, 255]",
                    );
                }
                let id = scene.add_material(*material);
                replaced.push(id);
                meant.iter().for_each(|&i| scene.objects[i].material = id);
            }
            MaterialEdit::Replace(material, false) => {
                let made = change_each(scene, meant, |before| with_colour_of((*material).clone(), before));
                replaced.extend(made);
            }
            MaterialEdit::Change(change) => {
                change_each(scene, meant, |before| change.of(before.clone()));
            }
        }
    }
    let has_colours = |object: &&Object| object.shape.mesh().is_some_and(|mesh| mesh.colours.is_some());
    let mut coloured = scene.objects.iter().filter(|object| replaced.contains(&object.material));
    if let Some(object) = coloured.find(has_colours) {
        let name = &object.name;
        warnings.note(format!("the colours of the vertices of `{name}` multiply that of --material"));
    }
    Ok(())
}

/// Gives objects materials made from their own; those that share one still do. Returns the new ones.
fn change_each(
    scene: &mut Scene,
    objects: Vec<usize>,
    change: impl Fn(&Material) -> Material,
) -> Vec<MaterialId> {
    let mut changed = HashMap::<u32, MaterialId>::new();
    for i in objects {
        let MaterialId(before) = scene.objects[i].material;
        let id = *changed
            .entry(before)
            .or_insert_with(|| scene.add_material(change(&scene.materials[before as usize])));
        scene.objects[i].material = id;
    }
    changed.into_values().collect()
}

/// A material with the colour of another, and the texture of that.
fn with_colour_of(mut material: Material, other: &Material) -> Material {
    match &mut material {
        Material::Phong(phong) => phong.colour = *other.colour(),
        Material::MetallicRoughness(layered) => layered.base_colour = *other.colour(),
    }
    material.textures_mut()[TextureSlot::BaseColour] = other.textures()[TextureSlot::BaseColour];
    material
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Sphere;
    use crate::scene::option::import_options::NAMED_MATERIALS;
    use crate::scene::{OptionValue, Phong, Shape};
    use glam::DVec3;

    #[test]
    fn materials_have_words() {
        for (word, table) in NAMED_MATERIALS {
            let choice =
                MaterialChoice::parse(&format!("the lid = {}", word.to_uppercase())).expect("a word");
            assert_eq!(
                (choice.name.as_deref(), choice.changes, &*choice.table),
                (Some("the lid"), false, *table)
            );
            assert_eq!(MaterialChoice::parse(word).map(|choice| choice.text()), Ok((*table).to_owned()));
            let options = ImportOptions { materials: vec![choice], ..ImportOptions::default() };
            let edits = parse(&options).unwrap_or_else(|e| panic!("{word}: {e}"));
            let [MaterialEdit::Replace(material, true)] = &edits[..] else { panic!("{word}") };
            assert!(matches!(**material, Material::MetallicRoughness(_)), "{word}");
        }
        // Without a colour, that of the files stays.
        for (table, colour) in [("{ metallic = 1 }", 0.25), ("{ colour = '#ffffff', metallic = 1 }", 1.0)] {
            let own = Phong { colour: Colour::Linear(DVec3::splat(0.25)), ..Phong::default() };
            let mut scene = Scene::default();
            let material = scene.add_material(Material::Phong(own));
            let shape = Shape::Analytic(Sphere { centre: DVec3::ZERO, radius: 1.0 }.into());
            scene.objects.push(Object { name: "ball".into(), input: 0, material, shape });
            let materials = vec![MaterialChoice::parse(table).expect("keys")];
            scene.import_options = ImportOptions { materials, ..ImportOptions::default() };
            let edits = parse(&scene.import_options).expect("edits");
            apply(&mut scene, edits, &mut Warnings::default()).expect("a scene");
            let Material::MetallicRoughness(made) = &scene.materials[scene.objects[0].material.0 as usize]
            else {
                panic!("{table}")
            };
            let found = made.base_colour.to_pipeline(crate::film::ColourPipeline::Linear);
            assert!((found.x - colour).abs() < 1e-12 && made.metallic == 1.0, "{table}: {found}");
        }
        for text in ["golden", "lid=", "lid+=gold", ""] {
            assert!(MaterialChoice::parse(text).is_err(), "{text}");
        }
    }
}
