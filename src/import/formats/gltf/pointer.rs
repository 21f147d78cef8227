//! KHR_animation_pointer: channels that animate any property of the JSON, such as a colour or a field of view.
//!
//! A pose is imported, so an animated property is set in the JSON before the document is read.

use serde_json::{Value, json};

use crate::import::formats::gltf::Loader;
use crate::import::formats::gltf::animation::interpolated;
use crate::import::formats::gltf::document::items;

pub(super) const NAME: &str = "KHR_animation_pointer";

/// What may be animated. Properties that decide how much memory is read, as those of accessors, may not.
const ROOTS: [&str; 5] = ["cameras", "extensions", "materials", "meshes", "nodes"];

/// The greatest number of keys in a pointer: as many as properties are deep, with room.
const MOST_KEYS: usize = 12;

/// A channel that animates the property at a JSON pointer.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PointerChannel {
    /// The index of its animation.
    pub(super) animation: usize,
    /// The index of its sampler within the animation.
    pub(super) sampler: usize,
    /// The JSON pointer (RFC 6901).
    pub(super) pointer: String,
}

/// Removes the channels of the extension, which name no node, from a document.
pub(super) fn take_channels(root: &mut Value) -> Vec<PointerChannel> {
    let mut taken = Vec::new();
    for (index, animation) in items(root, "animations").enumerate() {
        let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) else { continue };
        channels.retain(|channel| {
            let pointer = channel["target"]["extensions"][NAME]["pointer"].as_str();
            let sampler = channel["sampler"].as_u64().and_then(|sampler| usize::try_from(sampler).ok());
            let (Some(pointer), Some(sampler)) = (pointer, sampler) else { return true };
            taken.push(PointerChannel { animation: index, sampler, pointer: pointer.to_owned() });
            false
        });
    }
    taken
}

impl PointerChannel {
    /// Its sampler.
    pub(super) fn sampler_of<'a>(
        &self,
        animation: &gltf::Animation<'a>,
    ) -> Option<gltf::animation::Sampler<'a>> {
        (animation.index() == self.animation).then(|| animation.samplers().nth(self.sampler)).flatten()
    }
}

impl Loader<'_> {
    /// Sets the properties that a clip animates by pointers, at a time. Returns whether any was set.
    pub(super) fn set_pointers(
        &mut self,
        root: &mut Value,
        animation: &gltf::Animation,
        pointers: &[PointerChannel],
        time: f64,
    ) -> bool {
        let mut any = false;
        for channel in pointers {
            let Some(sampler) = channel.sampler_of(animation) else { continue };
            // That of a node is a quaternion; that of a texture transform is an angle.
            let is_rotation =
                channel.pointer.starts_with("/nodes/") && channel.pointer.ends_with("/rotation");
            let value = self.times(&sampler.input()).zip(self.numbers(&sampler.output()));
            let value = value.and_then(|(times, values)| {
                interpolated(&times, &values, sampler.interpolation(), is_rotation, time)
            });
            let is_set = value.is_some_and(|value| set(root, &channel.pointer, &value));
            if !is_set {
                self.left_out(format!("the animation of {} cannot be played; left out", channel.pointer));
            }
            any |= is_set;
        }
        any
    }
}

/// Sets the property at a pointer; objects on the way are created, as properties with defaults may be missing. Returns
/// whether it could be set.
fn set(root: &mut Value, pointer: &str, value: &[f64]) -> bool {
    let Some(path) = pointer.strip_prefix('/') else { return false };
    let keys: Vec<String> = path.split('/').map(|key| key.replace("~1", "/").replace("~0", "~")).collect();
    let [first, parents @ .., last] = keys.as_slice() else { return false };
    if !ROOTS.contains(&first.as_str()) || keys.len() > MOST_KEYS {
        return false;
    }
    let Some(mut at) = root.get_mut(first) else { return false };
    for key in parents {
        at = match at {
            Value::Array(list) => match key.parse().ok().and_then(|index: usize| list.get_mut(index)) {
                Some(item) => item,
                None => return false,
            },
            Value::Object(map) => map.entry(key.clone()).or_insert_with(|| json!({})),
            _ => return false,
        };
    }
    match at {
        Value::Object(map) => {
            let is_list = value.len() > 1 || last == "weights" || map.get(last).is_some_and(Value::is_array);
            let new = match value {
                _ if is_list => json!(value),
                [one] if last == "visible" => json!(*one != 0.0),
                [one] => json!(one),
                _ => return false,
            };
            map.insert(last.clone(), new);
            true
        }
        Value::Array(list) => match (last.parse().ok().and_then(|index: usize| list.get_mut(index)), value) {
            (Some(item), [one]) => {
                *item = json!(one);
                true
            }
            _ => false,
        },
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Weights are a list, even a single one.
    #[test]
    fn weights_are_a_list() {
        let mut root = json!({ "nodes": [{}] });
        assert!(set(&mut root, "/nodes/0/weights", &[0.75]));
        assert_eq!(root, json!({ "nodes": [{ "weights": [0.75] }] }));
    }

    #[test]
    fn what_may_not_be_set() {
        let mut root = json!({ "materials": [{ "name": "a" }], "accessors": [{ "count": 3 }] });
        let before = root.clone();
        let deep = "/materials/0".to_owned() + &"/a".repeat(12);
        let bad =
            ["", "/", "materials", "/materials", "/materials/1/alphaCutoff", "/accessors/0/count", &deep];
        for pointer in bad {
            assert!(!set(&mut root, pointer, &[9.0]), "{pointer}");
        }
        assert!(!set(&mut root, "/materials/0/name/a", &[9.0]));
        assert_eq!(root, before);
    }
}
