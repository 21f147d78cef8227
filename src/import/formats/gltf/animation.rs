//! Clips: the local transforms and morph weights of nodes at a time (glTF 2.0, section 3.11).

use std::collections::HashMap;

use glam::{DMat4, DQuat, DVec3, DVec4};
use gltf::accessor::Dimensions;
use gltf::animation::{Interpolation, Property, Sampler};

use crate::import::formats::gltf::pointer::PointerChannel;
use crate::import::formats::gltf::{Loader, dvec3};
use crate::scene::Clip;

/// What a clip sets of a node; `None` for what it leaves at rest.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct NodePose {
    translation: Option<DVec3>,
    rotation: Option<DQuat>,
    scale: Option<DVec3>,
    weights: Option<Vec<f64>>,
}

/// The poses of nodes by index, or those at rest.
#[derive(Debug, Default)]
pub(super) struct Pose(Vec<NodePose>);

impl Pose {
    /// The transform from a node to its parent.
    pub(super) fn parent_from_node(&self, node: &gltf::Node) -> DMat4 {
        let pose = self.0.get(node.index()).cloned().unwrap_or_default();
        if let (
            gltf::scene::Transform::Matrix { matrix },
            NodePose { translation: None, rotation: None, scale: None, .. },
        ) = (node.transform(), &pose)
        {
            return glam::Mat4::from_cols_array_2d(&matrix).as_dmat4();
        }
        let (translation, rotation, scale) = node.transform().decomposed();
        let rotation = pose.rotation.unwrap_or_else(|| unit(rotation.map(f64::from)));
        let translation = pose.translation.unwrap_or_else(|| dvec3(translation));
        DMat4::from_scale_rotation_translation(
            pose.scale.unwrap_or_else(|| dvec3(scale)),
            rotation,
            translation,
        )
    }

    /// The weights of the morph targets of a node's mesh: those of the clip, of the node, or of the mesh.
    pub(super) fn weights(&self, node: &gltf::Node) -> Vec<f64> {
        let weights = |weights: &[f32]| weights.iter().map(|&weight| f64::from(weight)).collect();
        let of_clip = self.0.get(node.index()).and_then(|pose| pose.weights.clone());
        let of_node = || node.weights().map(weights);
        let of_mesh = || node.mesh().and_then(|mesh| mesh.weights().map(weights));
        of_clip.or_else(of_node).or_else(of_mesh).unwrap_or_default()
    }
}

/// A unit quaternion. One that is not normalised would scale.
pub(super) fn unit(xyzw: [f64; 4]) -> DQuat {
    DVec4::from(xyzw).try_normalize().map_or(DQuat::IDENTITY, DQuat::from_vec4)
}

impl Loader<'_> {
    /// The clips of the document: names, or the index of an unnamed one, and durations.
    pub(super) fn clips(&self, pointers: &[PointerChannel]) -> Vec<Clip> {
        let clip = |animation: gltf::Animation| {
            let channels = channels(&animation, pointers);
            let ends =
                channels.iter().filter_map(|(_, sampler)| self.times(&sampler.input())?.last().copied());
            Clip {
                name: animation.name().map_or_else(|| animation.index().to_string(), str::to_owned),
                index: animation.index(),
                duration: ends.fold(0.0, f64::max),
                channels: channels.len(),
                digest: self.digest(&channels),
                file: 0,
            }
        };
        self.document.animations().map(clip).collect()
    }

    /// A hash of the keyframes of a clip and of what they animate.
    fn digest(&self, channels: &[(String, Sampler)]) -> String {
        let mut hasher = blake3::Hasher::new();
        for (target, sampler) in channels {
            hasher.update(format!("{target} {:?}", sampler.interpolation()).as_bytes());
            let numbers = [self.times(&sampler.input()), self.numbers(&sampler.output())];
            for number in numbers.iter().flatten().flatten() {
                hasher.update(&number.to_le_bytes());
            }
        }
        hasher.finalize().to_string()
    }

    /// Index and time of each clip that poses the scene; empty at rest. Adds a note if two of them animate the same
    /// property.
    pub(super) fn posing_clips(&mut self, pointers: &[PointerChannel]) -> Vec<(usize, f64)> {
        let Some(asked) = self.source.options.pose() else { return Vec::new() };
        let clips = asked.clip.find(&self.scene.clips);
        let mut last = HashMap::new();
        let mut shared = None;
        for clip in clips.iter().filter(|_| clips.len() > 1) {
            let Some(animation) = self.document.animations().nth(clip.index) else { continue };
            for (target, _) in channels(&animation, pointers) {
                let before = last.insert(target, clip).filter(|before| before.index != clip.index);
                // The clip of the last pair overrides all before it.
                shared = before.map(|before| (before.name.clone(), clip.name.clone())).or(shared);
            }
        }
        let posing = clips.iter().map(|clip| (clip.index, asked.time)).collect();
        if let Some((before, after)) = shared {
            let file = self.source.file.display();
            self.warnings.note(format!(
                "{file}: clips `{before}` and `{after}` animate the same property; that of `{after}` is used"
            ));
        }
        posing
    }

    /// Node poses by clips at their times; later clips override earlier ones.
    pub(super) fn pose_of_nodes(&mut self, clips: &[(usize, f64)]) -> Pose {
        if clips.is_empty() {
            return Pose::default();
        }
        let mut poses = vec![NodePose::default(); self.document.nodes().len()];
        for &(clip, time) in clips {
            let Some(animation) = self.document.animations().nth(clip) else { continue };
            for (number, channel) in animation.channels().enumerate() {
                let node = channel.target().node().index();
                match self.value(&channel, time) {
                    Some(value) => set(&mut poses[node], channel.target().property(), value),
                    None => self.left_out(format!(
                        "clip `{}`, channel {number}: its keyframes cannot be read; left out",
                        self.scene.clips[clip].name
                    )),
                }
            }
        }
        Pose(poses)
    }

    /// The times of keyframes in seconds, ascending; `None` if they are not. Of keys at equal times, which the
    /// specification forbids, the last holds from there on.
    pub(super) fn times(&self, input: &gltf::Accessor) -> Option<Vec<f64>> {
        let times = self.vectors::<1>(input)?.into_flattened();
        let is_usable = times.is_sorted() && times.iter().all(|time| time.is_finite());
        is_usable.then_some(times)
    }

    /// The value of a channel at a time; `None` if its keyframes cannot be used.
    fn value(&self, channel: &gltf::animation::Channel, time: f64) -> Option<Vec<f64>> {
        let (property, sampler) = (channel.target().property(), channel.sampler());
        let shape = match property {
            Property::Translation | Property::Scale => Dimensions::Vec3,
            Property::Rotation => Dimensions::Vec4,
            Property::MorphTargetWeights => Dimensions::Scalar,
        };
        let values = self.numbers(&sampler.output()).filter(|_| sampler.output().dimensions() == shape)?;
        let is_rotation = property == Property::Rotation;
        interpolated(&self.times(&sampler.input())?, &values, sampler.interpolation(), is_rotation, time)
    }
}

/// Channels of an animation: target as text, and sampler.
fn channels<'a>(animation: &gltf::Animation<'a>, pointers: &[PointerChannel]) -> Vec<(String, Sampler<'a>)> {
    let of_nodes = animation.channels().map(|channel| {
        let target = channel.target();
        (format!("{:?}", (target.node().index(), target.property())), channel.sampler())
    });
    let of_pointers =
        pointers.iter().filter_map(|channel| Some((channel.pointer.clone(), channel.sampler_of(animation)?)));
    of_nodes.chain(of_pointers).collect()
}

fn set(pose: &mut NodePose, property: Property, value: Vec<f64>) {
    match (property, value.as_slice()) {
        (Property::Translation, &[x, y, z]) => pose.translation = Some(DVec3::new(x, y, z)),
        (Property::Scale, &[x, y, z]) => pose.scale = Some(DVec3::new(x, y, z)),
        (Property::Rotation, &[x, y, z, w]) => pose.rotation = Some(unit([x, y, z, w])),
        (Property::MorphTargetWeights, _) => pose.weights = Some(value),
        _ => {}
    }
}

/// The value of keyframes at a time (glTF 2.0, section 3.11 and appendix C): of the first before it, of the last after it.
/// `values` has as many numbers for each key, and for cubic splines an in-tangent, a value and an out-tangent each. `None` if
/// that does not come out even, or a number is not finite.
pub(super) fn interpolated(
    times: &[f64],
    values: &[f64],
    interpolation: Interpolation,
    is_rotation: bool,
    time: f64,
) -> Option<Vec<f64>> {
    let parts = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
    let keys = parts * times.len();
    if times.is_empty()
        || values.is_empty()
        || !values.len().is_multiple_of(keys)
        || !values.iter().all(|v| v.is_finite())
    {
        return None;
    }
    let width = values.len() / keys;
    let part = |key: usize, part: usize| &values[(key * parts + part) * width..][..width];
    let value = |key: usize| part(key, parts / 2);
    let next = times.partition_point(|&key| key <= time);
    if next == 0 || next == times.len() {
        return Some(value(next.saturating_sub(1)).to_vec());
    }
    let last = next - 1;
    let step = times[next] - times[last];
    let t = (time - times[last]) / step;
    let (from, to) = (value(last), value(next));
    Some(match interpolation {
        Interpolation::Step => from.to_vec(),
        Interpolation::Linear if is_rotation => {
            let rotation = |v: &[f64]| <[f64; 4]>::try_from(v).map(unit).ok();
            // Along the shorter arc (section 3.11 and appendix C.4).
            rotation(from)?.slerp(rotation(to)?, t).to_array().to_vec()
        }
        Interpolation::Linear => from.iter().zip(to).map(|(a, b)| a + (b - a) * t).collect(),
        Interpolation::CubicSpline => {
            let (leaving, entering) = (part(last, 2), part(next, 0));
            let (t2, t3) = (t * t, t * t * t);
            let weights = [
                2.0 * t3 - 3.0 * t2 + 1.0,
                step * (t3 - 2.0 * t2 + t),
                3.0 * t2 - 2.0 * t3,
                step * (t3 - t2),
            ];
            (0..width)
                .map(|i| {
                    weights[0] * from[i]
                        + weights[1] * leaving[i]
                        + weights[2] * to[i]
                        + weights[3] * entering[i]
                })
                .collect()
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In the middle, appendix C gives (v0 + v1) / 2 + step (b0 - a1) / 8: (1 + 5) / 2 + 2 (3 - 7) / 8 = 2. The first and
    /// last value hold outside.
    #[test]
    fn cubic_splines() {
        let values = [0.0, 1.0, 3.0, 7.0, 5.0, 0.0];
        let at = |time| interpolated(&[1.0, 3.0], &values, Interpolation::CubicSpline, false, time);
        assert_eq!(
            [2.0, 0.0, 1.0, 3.0, 9.0].map(|time| at(time).expect("a value")[0]),
            [2.0, 1.0, 1.0, 5.0, 5.0]
        );
    }

    /// Exporters write a jump as two keys at one time.
    #[test]
    fn of_keys_at_one_time_the_last_holds() {
        let at = |time| {
            interpolated(&[0.0, 2.0, 2.0, 4.0], &[0.0, 4.0, 10.0, 12.0], Interpolation::Linear, false, time)
        };
        assert_eq!([1.0, 2.0, 3.0].map(at), [Some(vec![2.0]), Some(vec![10.0]), Some(vec![11.0])]);
    }

    /// A quarter of a turn of 90 degrees about z is 22.5 degrees, also where the second quaternion is that of the longer way.
    #[test]
    fn rotations_take_the_shorter_way() {
        let (half, eighth) = (std::f64::consts::FRAC_PI_4, std::f64::consts::PI / 16.0);
        for sign in [1.0, -1.0] {
            let values = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, sign * half.sin(), sign * half.cos()];
            let q = interpolated(&[0.0, 4.0], &values, Interpolation::Linear, true, 1.0).expect("a rotation");
            let found = DQuat::from_slice(&q);
            assert!(found.dot(DQuat::from_rotation_z(2.0 * eighth)).abs() > 1.0 - 1e-12, "{found}");
        }
    }

    #[test]
    fn keyframes_that_do_not_come_out_even_have_no_value() {
        let none = |times: &[f64], values: &[f64], interpolation| {
            interpolated(times, values, interpolation, false, 0.0)
        };
        assert_eq!(none(&[], &[], Interpolation::Linear), None);
        assert_eq!(none(&[0.0, 1.0], &[1.0, 2.0, 3.0], Interpolation::Linear), None);
        assert_eq!(none(&[0.0, 1.0], &[1.0, 2.0], Interpolation::CubicSpline), None);
        assert_eq!(none(&[0.0], &[f64::NAN], Interpolation::Step), None);
    }
}
