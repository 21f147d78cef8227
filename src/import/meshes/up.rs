//! Which way is up in a file: a guess from resting poses and the symmetry of its meshes. Measurements:
//! docs/decisions.md.

use glam::{DVec2, DVec3, Vec3Swizzles};

use crate::scene::{Scene, UpAxis};

/// The least share of its area by which a surface faces an axis, for a height field above it.
const HEIGHT_FIELD: f64 = 0.7;

/// How far a base's corners are from the lowest point, in sizes of the bounds.
const THICKNESS: f64 = 0.01;

/// Directions in which the polygon of a base has its corners.
const CORNERS: usize = 16;

/// The share of the bounds' cross-section that a base with legs or wheels touches at most, and how much more than a base
/// without the area between them counts.
const LEGS_TOUCH: f64 = 0.15;
const LEGS_COUNT: f64 = 4.0;

/// The least score of an axis; that of the only axis along which the mesh is not symmetric; the share of the largest
/// asymmetry below which it is symmetric; and how many times the score of both directions of y another axis has.
const LEAST: f64 = 0.05;
const LEAST_OF_ONLY: f64 = 0.002;
const SYMMETRIC: f64 = 0.3;
const MARGIN: f64 = 3.0;

/// Points of the surface that are compared with those of its mirror images.
const POINTS: usize = 512;

/// The axes that files stand upright in.
const CANDIDATES: [UpAxis; 4] = [UpAxis::X, UpAxis::Y, UpAxis::Z, UpAxis::MinusZ];

/// The axis that a mesh seems to stand upright in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Guess {
    pub up: UpAxis,
    /// Whether it rests on a surface. Terrain and the scan of a face from one side are height fields; feet may be points,
    /// and the rim of an open surface may be its back.
    pub is_sure: bool,
}

/// The axis that a mesh seems to stand upright in: it rests stably on its lower end in that axis, preferably on legs or
/// wheels, and is not its own mirror image along it; or it is a height field above it. `None` where that is not clear.
pub(crate) fn guess(scene: &Scene) -> Option<Guess> {
    let (min, max) = scene.bounds()?;
    let (size, middle) = (max - min, min / 2.0 + max / 2.0);
    if size.min_element() <= 0.0 {
        return None;
    }
    let axes = CANDIDATES.map(UpAxis::vector);
    let mut bases: Vec<Base> = axes.iter().chain([&DVec3::NEG_Y]).map(|&up| Base::new(up, size)).collect();
    let (mut sum, mut area, mut moment) = (DVec3::ZERO, 0.0, DVec3::ZERO);
    scene.for_each_triangle(|corners| {
        let [a, b, c] = corners.map(|corner| corner - middle);
        let twice = (b - a).cross(c - a);
        sum += twice;
        area += twice.length();
        moment += twice.length() * (a + b + c) / 3.0;
        bases.iter_mut().for_each(|base| base.add([a, b, c], twice));
    });
    let is_height_field = |up: &UpAxis| sum.dot(up.vector()) > HEIGHT_FIELD * area;
    if let Some(up) = CANDIDATES.into_iter().find(is_height_field) {
        return Some(Guess { up, is_sure: false });
    }
    let asymmetry = asymmetry(scene, middle, area);
    let asymmetry = asymmetry / asymmetry.max_element().max(f64::MIN_POSITIVE);
    let scores: Vec<f64> =
        bases.iter().map(|base| asymmetry.dot(base.up.abs()) * base.score(size, moment / area)).collect();
    let best = (0..axes.len()).max_by(|&a, &b| scores[a].total_cmp(&scores[b]))?;
    let others = asymmetry * (DVec3::ONE - axes[best].abs());
    let least = if others.max_element() < SYMMETRIC { LEAST_OF_ONLY } else { LEAST };
    // Files have y up where nothing speaks against it, so another axis has to beat y alone.
    let is_rival = |k: usize| axes[best] == DVec3::Y || bases[k].up.y != 0.0;
    let is_clear = (0..bases.len()).all(|k| k == best || !is_rival(k) || scores[best] >= MARGIN * scores[k]);
    let guess = Guess { up: CANDIDATES[best], is_sure: bases[best].contact > 0.0 };
    (scores[best] >= least && is_clear).then_some(guess)
}

/// The lower end of a mesh in an axis, relative to the centre of the bounds.
struct Base {
    up: DVec3,
    /// Height up to which the corners of triangles belong to the base.
    top: f64,
    /// The farthest corners in [`CORNERS`] directions, counterclockwise about `up`, with their distances.
    farthest: [(f64, DVec3); CORNERS],
    /// Area of the triangles that lie in the base, seen from below.
    contact: f64,
}

impl Base {
    fn new(up: DVec3, size: DVec3) -> Self {
        let top = (THICKNESS - 0.5) * size.dot(up.abs());
        Base { up, top, farthest: [(f64::NEG_INFINITY, DVec3::ZERO); CORNERS], contact: 0.0 }
    }

    /// Adds a triangle with twice its area vector.
    fn add(&mut self, corners: [DVec3; 3], twice: DVec3) {
        let low = corners.map(|corner| corner.dot(self.up) <= self.top);
        if low == [true; 3] {
            self.contact += 0.5 * twice.dot(self.up).abs();
        }
        // The other two axes, right-handed with `up`.
        let u = self.up.zxy();
        let v = self.up.cross(u);
        for (corner, _) in corners.into_iter().zip(low).filter(|(_, is_low)| *is_low) {
            let at = DVec2::new(corner.dot(u), corner.dot(v));
            for (i, farthest) in self.farthest.iter_mut().enumerate() {
                let distance = at.dot(DVec2::from_angle(std::f64::consts::TAU * i as f64 / CORNERS as f64));
                if distance > farthest.0 {
                    *farthest = (distance, corner);
                }
            }
        }
    }

    /// The area of the polygon that the mesh rests on, as a share of the cross-section of the bounds; that between legs or
    /// wheels counts more. 0 where the centre of the surface is not above it, so that the mesh would fall over.
    fn score(&self, size: DVec3, centre: DVec3) -> f64 {
        let across = |a: DVec3, b: DVec3| a.cross(b).dot(self.up);
        let edges = || (0..CORNERS).map(|i| (self.farthest[i].1, self.farthest[(i + 1) % CORNERS].1));
        if edges().any(|(a, b)| across(b - a, centre - a) < 0.0) {
            return 0.0;
        }
        let sides = size * (DVec3::ONE - self.up.abs());
        let section = sides.x * sides.y + sides.y * sides.z + sides.z * sides.x;
        let area = edges().map(|(a, b)| across(a, b)).sum::<f64>() / 2.0 / section;
        let contact = self.contact / section;
        let between_legs = if contact < LEGS_TOUCH { (area - contact).max(0.0) } else { 0.0 };
        area + LEGS_COUNT * between_legs
    }
}

/// By how much the surface differs from its mirror images at the centre of the bounds along x, y and z: the mean distance
/// from points of it to the nearest of an image, less that to the nearest other.
fn asymmetry(scene: &Scene, middle: DVec3, twice_area: f64) -> DVec3 {
    let mut points: Vec<DVec3> = Vec::with_capacity(POINTS);
    let mut passed = 0.0;
    scene.for_each_triangle(|[a, b, c]| {
        passed += (b - a).cross(c - a).length();
        while points.len() < POINTS && (points.len() as f64 + 0.5) * twice_area <= passed * POINTS as f64 {
            // The R2 sequence (M. Roberts, 2018), folded into the triangle.
            let [s, t] =
                [0.754_877_666_246_692_7, 0.569_840_290_998_053_2].map(|x| (x * points.len() as f64).fract());
            let [s, t] = if s + t > 1.0 { [1.0 - s, 1.0 - t] } else { [s, t] };
            points.push(a - middle + s * (b - a) + t * (c - a));
        }
    });
    let mean = |mirror: DVec3, others: bool| {
        let nearest = |(i, &point): (usize, &DVec3)| {
            let distances = points.iter().enumerate().filter(|&(k, _)| !others || k != i);
            distances
                .map(|(_, other)| (point * mirror).distance_squared(*other))
                .fold(f64::INFINITY, f64::min)
                .sqrt()
        };
        points.iter().enumerate().map(nearest).sum::<f64>() / points.len().max(1) as f64
    };
    let own = mean(DVec3::ONE, true);
    DVec3::AXES
        .map(|axis| (mean(DVec3::ONE - 2.0 * axis, false) - own).max(0.0))
        .into_iter()
        .zip(DVec3::AXES)
        .map(|(distance, axis)| distance * axis)
        .sum()
}

#[cfg(test)]
mod tests;
