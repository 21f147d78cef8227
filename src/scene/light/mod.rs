//! Lights: what differs by their kind.

pub(crate) mod environment;
pub(crate) mod fill;

use glam::{DMat4, DVec3};

use super::{AnalyticShape, Disk, Sphere};
use crate::film::Colour;

/// A light.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Light {
    /// Name from the file, or one derived from its position there.
    pub name: String,
    /// Its colour, multiplied by the intensity.
    pub colour: Colour,
    /// Intensity: a white, fully diffuse surface that faces a light of intensity 1 shows its own colour, if the light
    /// has no falloff or is 1 away.
    pub intensity: f64,
    /// Position or direction, size and falloff.
    pub kind: LightKind,
}

/// The kinds of light.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub enum LightKind {
    /// A point light, in all directions.
    Point {
        /// Position.
        position: DVec3,
        /// Falloff with distance.
        falloff: Falloff,
    },
    /// A light at infinite distance.
    Directional {
        /// Direction in which the light travels, of length 1.
        direction: DVec3,
        /// Apparent diameter in radians, 0 to pi. The irradiance of a facing surface does not depend on it.
        angle: f64,
    },
    /// A point light restricted to a cone.
    Spot {
        /// Position.
        position: DVec3,
        /// Axis of the cone, of length 1.
        direction: DVec3,
        /// Falloff with distance.
        falloff: Falloff,
        /// Half angle of the inner cone, inside which the intensity is full, in radians.
        inner_angle: f64,
        /// Half angle of the outer cone, outside which the intensity is zero, in radians.
        outer_angle: f64,
    },
    /// A sphere of uniform radiance: intensity / radius^2, so that from far away it is a point light of its intensity
    /// with inverse-square falloff.
    Sphere {
        /// Centre.
        position: DVec3,
        /// Radius, above 0.
        radius: f64,
    },
    /// A rectangle of uniform radiance on its front: pi * intensity / area, so that from far in front it is a point
    /// light of its intensity with inverse-square falloff.
    Rectangle {
        /// Centre.
        position: DVec3,
        /// Normal of the front, of length 1.
        direction: DVec3,
        /// Up vector, not necessarily perpendicular to the direction: the height lies in the plane of both.
        up: DVec3,
        /// Width and height, above 0.
        size: [f64; 2],
    },
    /// A disk of uniform radiance on its front: intensity / radius^2, so that from far in front it is a point light of
    /// its intensity with inverse-square falloff.
    Disk {
        /// Centre.
        position: DVec3,
        /// Normal of the front, of length 1.
        direction: DVec3,
        /// Radius, above 0.
        radius: f64,
    },
}

impl LightKind {
    /// Its name, as in scene files.
    pub fn name(&self) -> &'static str {
        match self {
            LightKind::Point { .. } => "point",
            LightKind::Directional { .. } => "directional",
            LightKind::Spot { .. } => "spot",
            LightKind::Sphere { .. } => "sphere",
            LightKind::Rectangle { .. } => "rectangle",
            LightKind::Disk { .. } => "disk",
        }
    }

    /// Its name in a sentence, with an article.
    pub(crate) fn noun(&self) -> String {
        match self {
            LightKind::Spot { .. } => "a spot".into(),
            _ => format!("a {} light", self.name()),
        }
    }

    /// Whether its irradiance falls off with distance.
    pub fn falls_off(&self) -> bool {
        match self {
            LightKind::Directional { .. } => false,
            LightKind::Point { falloff, .. } | LightKind::Spot { falloff, .. } => *falloff != Falloff::None,
            LightKind::Sphere { .. } | LightKind::Rectangle { .. } | LightKind::Disk { .. } => true,
        }
    }

    /// Whether it is seen under a solid angle above 0, so that directions of BSDFs find it.
    pub fn has_extent(&self) -> bool {
        self.is_area() || matches!(self, LightKind::Directional { angle, .. } if *angle > 0.0)
    }

    /// Whether the light is a surface in the scene, which rays hit.
    pub fn is_area(&self) -> bool {
        self.surface().is_some()
    }

    /// The surface that emits, and its radiance for an intensity of 1; `None` for a light without one. A point light of
    /// intensity I with inverse-square falloff gives a facing surface at a distance d the irradiance pi I / d^2; far away,
    /// a sphere of radiance L gives pi L radius^2 / d^2 and a flat surface L area / d^2.
    pub fn surface(&self) -> Option<(LightSurface, f64)> {
        match *self {
            LightKind::Sphere { position, radius } => {
                let shape = Sphere { centre: position, radius }.into();
                Some((LightSurface::Analytic { shape, is_one_sided: false }, 1.0 / (radius * radius)))
            }
            LightKind::Rectangle { position, direction, up, size } => {
                let surface = LightSurface::Rectangle { centre: position, normal: direction, up, size };
                Some((surface, std::f64::consts::PI / (size[0] * size[1])))
            }
            LightKind::Disk { position, direction, radius } => {
                let shape = Disk { centre: position, normal: direction, radius }.into();
                Some((LightSurface::Analytic { shape, is_one_sided: true }, 1.0 / (radius * radius)))
            }
            LightKind::Point { .. } | LightKind::Directional { .. } | LightKind::Spot { .. } => None,
        }
    }

    /// The vector from a point to a light that is no surface, and the part of the light's radiance that arrives there.
    #[inline(always)]
    pub fn incident(&self, point: DVec3) -> (DVec3, f64) {
        match self {
            LightKind::Directional { direction, .. } => (-*direction, 1.0),
            LightKind::Point { position, falloff } => {
                let to_light = *position - point;
                (to_light, falloff.at(to_light.length_squared()))
            }
            LightKind::Spot { position, direction, falloff, inner_angle, outer_angle } => {
                let to_light = *position - point;
                let cosine = -to_light.dot(*direction) / to_light.length();
                let cone = cone_attenuation(cosine, *inner_angle, *outer_angle);
                (to_light, cone * falloff.at(to_light.length_squared()))
            }
            // Lights in path tracing alone.
            LightKind::Sphere { .. } | LightKind::Rectangle { .. } | LightKind::Disk { .. } => {
                (DVec3::ZERO, 0.0)
            }
        }
    }

    /// The position; `None` for a light at infinite distance.
    #[inline(always)]
    pub fn position(&self) -> Option<DVec3> {
        match *self {
            LightKind::Point { position, .. }
            | LightKind::Spot { position, .. }
            | LightKind::Sphere { position, .. }
            | LightKind::Rectangle { position, .. }
            | LightKind::Disk { position, .. } => Some(position),
            LightKind::Directional { .. } => None,
        }
    }

    /// [`LightKind::position`], to be changed.
    pub fn position_mut(&mut self) -> Option<&mut DVec3> {
        match self {
            LightKind::Point { position, .. }
            | LightKind::Spot { position, .. }
            | LightKind::Sphere { position, .. }
            | LightKind::Rectangle { position, .. }
            | LightKind::Disk { position, .. } => Some(position),
            LightKind::Directional { .. } => None,
        }
    }

    /// The direction; `None` for a light that shines in all.
    pub fn direction_mut(&mut self) -> Option<&mut DVec3> {
        match self {
            LightKind::Directional { direction, .. }
            | LightKind::Spot { direction, .. }
            | LightKind::Rectangle { direction, .. }
            | LightKind::Disk { direction, .. } => Some(direction),
            LightKind::Point { .. } | LightKind::Sphere { .. } => None,
        }
    }

    /// Rotates it about the origin.
    pub(crate) fn rotate(&mut self, rotation: &DMat4) {
        let rotate = |v: &mut DVec3| *v = rotation.transform_vector3(*v);
        self.position_mut().into_iter().for_each(rotate);
        self.direction_mut().into_iter().for_each(rotate);
        if let LightKind::Rectangle { up, .. } = self {
            rotate(up);
        }
    }
}

/// The surface of a light.
pub enum LightSurface {
    /// An analytic shape.
    Analytic {
        /// The shape.
        shape: AnalyticShape,
        /// Whether only its front emits, on the side of its normal.
        is_one_sided: bool,
    },
    /// A rectangle, of which only the front emits: the fields of [`LightKind::Rectangle`].
    Rectangle {
        /// Centre.
        centre: DVec3,
        /// Normal of the front.
        normal: DVec3,
        /// Up vector.
        up: DVec3,
        /// Width and height.
        size: [f64; 2],
    },
}

impl Light {
    /// Scales a light about the origin: surfaces scaled with it look the same.
    pub fn scale(&mut self, factor: f64) {
        self.kind.position_mut().into_iter().for_each(|position| *position *= factor);
        match &mut self.kind {
            LightKind::Point { falloff: Falloff::InverseSquare { range }, .. }
            | LightKind::Spot { falloff: Falloff::InverseSquare { range }, .. } => {
                *range = range.map(|range| range * factor);
            }
            LightKind::Sphere { radius, .. } | LightKind::Disk { radius, .. } => *radius *= factor,
            LightKind::Rectangle { size, .. } => *size = size.map(|side| side * factor),
            LightKind::Directional { .. } | LightKind::Point { .. } | LightKind::Spot { .. } => return,
        }
        self.intensity *= factor * factor;
    }
}

/// Falloff of a light's intensity with distance.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub enum Falloff {
    /// None: the assignment's light.
    None,
    /// Inverse square; with a `range`, windowed smoothly to zero at it (glTF, KHR_lights_punctual).
    InverseSquare {
        /// Distance at which the intensity reaches zero.
        range: Option<f64>,
    },
}

impl Falloff {
    /// The part of the light that arrives over a squared distance. That of KHR_lights_punctual: 1 / d^2, times
    /// max(min(1 - (d / range)^4, 1), 0) for a light with a range.
    #[inline(always)]
    fn at(self, distance_squared: f64) -> f64 {
        match self {
            Falloff::None => 1.0,
            Falloff::InverseSquare { range: None } => 1.0 / distance_squared,
            Falloff::InverseSquare { range: Some(range) } => {
                let ratio = distance_squared / (range * range);
                (1.0 - ratio * ratio).clamp(0.0, 1.0) / distance_squared
            }
        }
    }
}

/// The angular attenuation of KHR_lights_punctual: the square of a linear ramp in the cosine from the outer to the
/// inner angle.
fn cone_attenuation(cosine: f64, inner_angle: f64, outer_angle: f64) -> f64 {
    let (inner, outer) = (inner_angle.cos(), outer_angle.cos());
    if cosine <= outer {
        return 0.0;
    }
    let ramp = ((cosine - outer) / (inner - outer)).clamp(0.0, 1.0);
    // Equal angles give a sharp edge: 0 / 0 inside the cone counts as 1.
    if ramp.is_nan() { 1.0 } else { ramp * ramp }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn falloff_by_hand() {
        assert_eq!(Falloff::None.at(100.0), 1.0);
        assert_eq!(Falloff::InverseSquare { range: None }.at(4.0), 0.25);
        // d = 1, range = 2: 1 - (1/2)^4 = 15/16.
        assert_eq!(Falloff::InverseSquare { range: Some(2.0) }.at(1.0), 15.0 / 16.0);
        assert_eq!(Falloff::InverseSquare { range: Some(2.0) }.at(9.0), 0.0);
    }

    /// Elsewhere the profile is that of KHR_lights_punctual, as pictures of spots show.
    #[test]
    fn cones_of_equal_angles_have_a_sharp_edge() {
        let angle = 60f64.to_radians();
        assert_eq!([0.4, 0.9].map(|cosine| cone_attenuation(cosine, angle, angle)), [0.0, 1.0]);
    }
}
