//! Adaptive effort: a pixel whose value is certain enough is sampled no further ([`super::effort`]).

use super::effort::Adaptive;
use super::{Effect, Outline};
use crate::world::World;

/// In the registry.
pub const EFFECT: Effect = Effect {
    name: "adaptive",
    summary: "pixels that are certain enough take fewer samples than others",
    needs_lights: false,
    rays: &[],
    value: None,
    called_for: |world: &World| {
        let Some(level) = world.sampling.noise else {
            return Err("no level of noise is given; --noise does".into());
        };
        let (floor, most) = (Adaptive::new(&world.sampling).floor, world.sampling.most_samples());
        if floor == most {
            return Err(format!("every pixel takes {most} sample(s) anyway"));
        }
        Ok(format!("noise {level}, {floor} to {most} samples a pixel"))
    },
    outline: |_, outline: &mut Outline| outline.adaptive = true,
    stages: |_, _| Vec::new(),
    // What it needs is kept with the samples.
    bytes: |_| 0,
};
