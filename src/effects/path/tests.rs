//! Samples of rectangle and disk lights against their density.

use glam::DVec3;

use crate::bvh::Numerics;
use crate::bvh::detail::Layout;
use crate::film::{Colour, ColourPipeline};
use crate::scene::{Light, LightKind, Scene};
use crate::shading::bsdf::chi_squared::{Random, p_value};
use crate::world::World;

/// Cells of a rectangle in each direction.
const CELLS: usize = 12;

/// The chance of a false alarm in any of the tests below (Bonferroni's correction: divided by their number).
const SIGNIFICANCE: f64 = 0.01;

/// A world with a rectangle light of 2 by 1.5 around (0.3, 2, -0.2) that shines downwards, height along -z.
fn world() -> World {
    world_of(LightKind::Rectangle {
        position: DVec3::new(0.3, 2.0, -0.2),
        direction: DVec3::NEG_Y,
        up: DVec3::Y,
        size: [2.0, 1.5],
    })
}

fn world_of(kind: LightKind) -> World {
    let light = Light { name: "lamp".into(), colour: Colour::Linear(DVec3::ONE), intensity: 1.0, kind };
    let scene = Scene { lights: vec![light], ..Scene::default() };
    World::prepare(scene, ColourPipeline::Linear, Layout::default(), Numerics::Double)
}

/// The solid angle of a rectangle in a plane at the distance z, from corner coordinates relative to the foot of the
/// perpendicular: atan(xy / (z r)) at each corner, with alternating signs.
fn solid_angle([x0, x1]: [f64; 2], [y0, y1]: [f64; 2], z: f64) -> f64 {
    let corner = |x: f64, y: f64| (x * y).atan2(z * (x * x + y * y + z * z).sqrt());
    corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0)
}

/// Counts of `count` samples in the cells of the rectangle, and those that are expected of samples uniform in its solid
/// angle. The density of each sample is checked against 1 over that.
fn counts(from: DVec3, count: usize, seed: u64) -> [Vec<f64>; 2] {
    let world = world();
    let (x, y) = ([-0.7, 1.3], [-0.95, 0.55]);
    let (side, other) = ((x[1] - x[0]) / CELLS as f64, (y[1] - y[0]) / CELLS as f64);
    let of = |[x0, x1]: [f64; 2], [z0, z1]: [f64; 2]| {
        solid_angle([x0 - from.x, x1 - from.x], [z0 - from.z, z1 - from.z], 2.0 - from.y)
    };
    let whole = of(x, y);
    let cell = |i: usize| {
        let (column, row) = ((i % CELLS) as f64, (i / CELLS) as f64);
        let (left, near) = (x[0] + column * side, y[0] + row * other);
        of([left, left + side], [near, near + other]) / whole * count as f64
    };
    let expected = (0..CELLS * CELLS).map(cell).collect();
    let mut observed = vec![0.0; CELLS * CELLS];
    let mut random = Random(seed);
    for _ in 0..count {
        let numbers = [random.number(), random.number()];
        let sample = world.emitters.sample(from, random.number(), numbers).expect("a sample");
        assert!((sample.pdf * whole - 1.0).abs() < 1e-12, "{} {}", sample.pdf, 1.0 / whole);
        let point = from + sample.direction * ((2.0 - from.y) / sample.direction.y);
        assert!(point.distance(sample.point.position) < 1e-9);
        let index = |at: f64, start: f64, step: f64| (((at - start) / step) as usize).min(CELLS - 1);
        observed[index(point.z, y[0], other) * CELLS + index(point.x, x[0], side)] += 1.0;
    }
    [observed, expected]
}

/// In front of the middle, far to the side, close to a corner, a hair from the plane, far away.
const PLACES: [[f64; 3]; 6] = [
    [0.3, 0.0, -0.2],
    [-3.0, 0.5, 2.0],
    [1.25, 1.9, 0.5],
    [0.9, 1.9999, 0.1],
    [1.7, 1.95, 0.8],
    [4.0, -30.0, 9.0],
];

#[test]
fn samples_of_rectangles_are_uniform_in_the_solid_angle() {
    for (i, from) in PLACES.into_iter().enumerate() {
        let [observed, expected] = counts(from.into(), 200_000, i as u64);
        let p = p_value(&observed, &expected);
        assert!(p > SIGNIFICANCE / PLACES.len() as f64, "{from:?}: {p}");
    }
}

/// The test rejects a density that is 1 % too high in half of the cells and 1 % too low in the others: with 4 million
/// samples the statistic grows by 1e-4 * 4e6 = 400; its standard deviation is sqrt(2 * 143) = 17. It rejects the
/// uniform density per area, too.
#[test]
fn a_density_of_rectangles_off_by_one_percent_is_rejected() {
    let [observed, expected] = counts(DVec3::from(PLACES[1]), 4_000_000, 7);
    assert!(p_value(&observed, &expected) > SIGNIFICANCE);
    let off: Vec<f64> = (0..).zip(&expected).map(|(i, e)| e * if i % 2 == 0 { 1.01 } else { 0.99 }).collect();
    let scale = expected.iter().sum::<f64>() / off.iter().sum::<f64>();
    let off: Vec<f64> = off.iter().map(|e| e * scale).collect();
    assert!(p_value(&observed, &off) < SIGNIFICANCE);
    let by_area = vec![4_000_000.0 / (CELLS * CELLS) as f64; CELLS * CELLS];
    assert!(p_value(&observed, &by_area) < SIGNIFICANCE);
}

/// From behind and from the plane of a rectangle nothing is sampled, and its back is dark.
#[test]
fn rectangles_shine_from_the_front_alone() {
    let world = world();
    for from in [[0.0, 2.5, 0.0], [5.0, 2.0, 0.0], [0.3, 2.0, -0.2], [0.3, f64::INFINITY, 0.0]] {
        assert!(world.emitters.sample(from.into(), 0.5, [0.3, 0.6]).is_none(), "{from:?}");
    }
}

/// A disk light of radius 1.2 around (0.3, 2, -0.2) that shines downwards.
fn disk_world() -> World {
    let (position, direction) = (DVec3::new(0.3, 2.0, -0.2), DVec3::NEG_Y);
    world_of(LightKind::Disk { position, direction, radius: 1.2 })
}

/// Counts of samples in cells of equal area of the disk, 12 rings of 20 parts. The density of each is checked: 1 over
/// the area times the squared distance over the cosine.
fn disk_counts(from: DVec3, count: usize, seed: u64) -> Vec<f64> {
    let (world, radius_squared) = (disk_world(), 1.44);
    let mut random = Random(seed);
    let mut observed = vec![0.0; 240];
    for _ in 0..count {
        let numbers = [random.number(), random.number()];
        let sample = world.emitters.sample(from, random.number(), numbers).expect("a sample");
        let distance = (2.0 - from.y) / sample.direction.y;
        let density = distance * distance / (std::f64::consts::PI * radius_squared * sample.direction.y);
        assert!((sample.pdf / density - 1.0).abs() < 1e-9, "{} {density}", sample.pdf);
        let place = from + sample.direction * distance - DVec3::new(0.3, 2.0, -0.2);
        assert!((place + DVec3::new(0.3, 2.0, -0.2)).distance(sample.point.position) < 1e-9);
        let index = |share: f64, count: usize| ((share * count as f64) as usize).min(count - 1);
        let ring = index((place.x * place.x + place.z * place.z) / radius_squared, 12);
        let turn = place.z.atan2(place.x) / (2.0 * std::f64::consts::PI) + 0.5;
        observed[ring * 20 + index(turn, 20)] += 1.0;
    }
    observed
}

#[test]
fn samples_of_disks_are_uniform_in_their_area() {
    let (count, expected) = (200_000, vec![200_000.0 / 240.0; 240]);
    for (i, from) in PLACES.into_iter().enumerate() {
        let p = p_value(&disk_counts(from.into(), count, i as u64), &expected);
        assert!(p > SIGNIFICANCE / PLACES.len() as f64, "{from:?}: {p}");
    }
    // 1 % more in every other part is rejected, with 4 million samples: see above.
    let observed = disk_counts(PLACES[1].into(), 4_000_000, 7);
    let off: Vec<f64> = (0..240).map(|i| if i % 2 == 0 { 1.01 } else { 0.99 } * 4e6 / 240.0).collect();
    assert!(p_value(&observed, &off) < SIGNIFICANCE);
    assert!(p_value(&observed, &[4e6 / 240.0; 240]) > SIGNIFICANCE);
    // The back is dark.
    for from in [[0.0, 2.5, 0.0], [0.3, f64::INFINITY, 0.0]] {
        assert!(disk_world().emitters.sample(from.into(), 0.5, [0.3, 0.6]).is_none(), "{from:?}");
    }
}
