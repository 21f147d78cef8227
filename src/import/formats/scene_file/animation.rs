//! Conversion of the animation of a scene file.

use glam::DVec3;

use crate::error::Result;
use crate::import::formats::scene_file::Builder;
use crate::import::formats::scene_file::animation_sections::{AnimationSection, LookAtSection, TrackSection};
use crate::import::formats::scene_file::sections::ScaleValue;
use crate::scene::animation::{Animation, Goal, Key, Motion, Property, Target, Timeline, Track, Value};
use toml::Spanned;

impl Builder<'_> {
    pub(super) fn animation(&self, section: &Spanned<AnimationSection>) -> Result<Animation> {
        let (start, s) = (section.span().start, section.get_ref());
        let (fps, duration) = (s.fps.unwrap_or(30.0), s.duration.unwrap_or(10.0));
        Timeline::new(fps, duration, s.repeat).map_err(|hint| {
            self.error(start, format!("an animation of {duration} s at {fps} frames a second"), &hint)
        })?;
        let tracks = s.track.iter().map(|track| self.track(track)).collect::<Result<_>>()?;
        Ok(Animation { fps, duration, repeat: s.repeat, tracks, clips: Vec::new() })
    }

    fn track(&self, section: &Spanned<TrackSection>) -> Result<Track> {
        let (start, s) = (section.span().start, section.get_ref());
        let target = match (&s.camera, &s.object, &s.light) {
            (Some(name), None, None) => Target::Camera(name.clone()),
            (None, Some(name), None) => Target::Object(name.clone()),
            (None, None, Some(name)) => Target::Light(name.clone()),
            _ => {
                let hint = "give one of `camera`, `object` and `light`, with the name of what moves";
                return Err(self.error(start, "a track needs one thing that moves", hint));
            }
        };
        let property = s.property.unwrap_or_default();
        let motion = match (&s.lerp, &s.keyframes, &s.orbit, &s.look_at) {
            (Some(lerp), None, None, None) => Motion::Lerp {
                property,
                from: lerp.from.map(|from| self.value(start, property, from)).transpose()?,
                to: self.value(start, property, lerp.to)?,
                easing: lerp.easing,
            },
            (None, Some(keys), None, None) => {
                let mut all = Vec::new();
                for key in keys {
                    self.finite(start, "time", &[key.time])?;
                    let value = self.value(start, property, key.value)?;
                    all.push(Key { time: key.time, value, easing: key.easing });
                }
                if all.is_empty() || all.windows(2).any(|w| w[0].time >= w[1].time) {
                    let hint = "give at least one, each with a later `time` than the one before";
                    return Err(self.error(start, "`keyframes` are not in order", hint));
                }
                Motion::Keys { property, keys: all }
            }
            (None, None, Some(orbit), None) => {
                self.finite(start, "around", &orbit.around)?;
                let (axis, turns) = (orbit.axis.unwrap_or([0.0, 1.0, 0.0]), orbit.turns.unwrap_or(1.0));
                self.finite(start, "axis", &axis)?;
                self.finite(start, "turns", &[turns])?;
                let axis = DVec3::from(axis);
                let axis = (axis / axis.abs().max_element()).try_normalize();
                let axis = axis.ok_or_else(|| {
                    self.error(start, "the axis of an orbit has no length", "give a direction other than 0")
                })?;
                if !matches!(property, Property::Position | Property::LookAt) {
                    let hint = "leave `property` out, or give `look_at` for what a camera looks at";
                    return Err(self.error(start, format!("`{}` cannot orbit", property.name()), hint));
                }
                Motion::Orbit { property, around: orbit.around.into(), axis, turns }
            }
            (None, None, None, Some(look_at)) => self.look_at(start, &target, look_at)?,
            _ => {
                let hint = "give one of `lerp`, `keyframes`, `orbit` and `look_at`";
                return Err(self.error(start, "a track needs one motion", hint));
            }
        };
        if s.property.is_some() && matches!(motion, Motion::LookAt { .. }) {
            let hint = "leave it out; what is looked at is all that changes";
            return Err(self.error(start, "`property` beside `look_at`", hint));
        }
        Ok(Track { target, motion, place: self.location(start) })
    }

    fn look_at(&self, start: usize, target: &Target, s: &LookAtSection) -> Result<Motion> {
        if !matches!(target, Target::Camera(_)) {
            return Err(self.error(start, "only cameras look at things", "give `look_at` to a camera"));
        }
        let goal = match (&s.object, s.point) {
            (Some(name), None) => Goal::Object(name.clone()),
            (None, Some(point)) => {
                self.finite(start, "point", &point)?;
                Goal::Point(point.into())
            }
            _ => {
                return Err(self.error(start, "`look_at` needs one goal", "give `object` or `point`"));
            }
        };
        let offset = s.offset.unwrap_or_default();
        self.finite(start, "offset", &offset)?;
        Ok(Motion::LookAt { goal, offset: offset.into() })
    }

    fn value(&self, start: usize, property: Property, value: ScaleValue) -> Result<Value> {
        let one = matches!(property, Property::Radius | Property::Intensity | Property::FocusDistance);
        let (value, fits) = match value {
            ScaleValue::Uniform(number) => (DVec3::splat(number), one || property == Property::Scale),
            ScaleValue::PerAxis(numbers) => (DVec3::from(numbers), !one),
        };
        self.finite(start, property.name(), &value.to_array())?;
        if !fits {
            let form = if one { "one number" } else { "three numbers, [x, y, z]" };
            let what = format!("`{}` takes {form}", property.name());
            return Err(self.error(start, what, "correct the values of the track"));
        }
        Ok(value)
    }
}
