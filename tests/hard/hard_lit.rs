//! Lighting and shadows against the closed form (E1, H2, H3), at all scales and positions: no shadow acne, no light
//! leaks.

use crate::common::picture::{parse, placed, prepare};
use glam::DVec3;
use kiln::effects::PlanSettings;
use kiln::scene::{Numerics, Scene};

/// A floor of two triangles, three spheres (one touches the floor, one is above it, one intersects it), and a light.
const BALLS: [(DVec3, f64); 3] = [
    (DVec3::new(-30.0, 12.0, 0.0), 12.0),
    (DVec3::new(20.0, 25.0, 10.0), 10.0),
    (DVec3::new(0.0, 3.0, -40.0), 8.0),
];
const LAMP: DVec3 = DVec3::new(15.0, 90.0, -30.0);

fn balls_on_a_floor() -> Scene {
    let mut toml = format!(
        "[image]\nwidth = 200\nheight = 200\ncolour = \"display\"\n[[camera]]\nposition = [10, 60, 130]\nlook_at = [0, 0, 0]\n\
         vertical_fov = 50\n[ambient]\nintensity = 0\n[material.m]\ncolour = [255, 255, 255]\nambient = 0\ndiffuse = 1\n\
         specular = 0\n[[light]]\ntype = \"point\"\nposition = [{}, {}, {}]\n[[triangles]]\nmaterial = \"m\"\n\
         vertices = [[-100, 0, -100], [-100, 0, 100], [100, 0, 100], [100, 0, -100]]\nindices = [[0, 1, 2], [0, 2, 3]]\n",
        LAMP.x, LAMP.y, LAMP.z
    );
    for (c, r) in BALLS {
        toml +=
            &format!("[[sphere]]\ncentre = [{}, {}, {}]\nradius = {r}\nmaterial = \"m\"\n", c.x, c.y, c.z);
    }
    parse(&toml)
}

/// The visibility of the light from the point that a pixel shows, in closed form.
#[derive(Debug, PartialEq)]
enum Light {
    Lit,
    Dark,
    /// Too near to a boundary: rounded data may give either result.
    Edge,
}

/// The point that a ray hits, in the scene's own coordinates, and whether the light is visible from it. Results within
/// a margin `m`, relative to the size of the scene, are left undecided.
fn closed_form(origin: DVec3, direction: DVec3, m: f64) -> Option<Light> {
    let margin = m * 300.0;
    let sphere = |o: DVec3, d: DVec3, (c, r): (DVec3, f64)| {
        let b = (c - o).dot(d);
        let aside = (c - o - b * d).length();
        (b, r, aside)
    };
    let mut nearest: Option<(f64, Option<usize>)> = None;
    let mut edge = false;
    let floor = -origin.y / direction.y;
    let p = origin + floor * direction;
    if floor > 0.0 && p.x.abs() < 100.0 - margin && p.z.abs() < 100.0 - margin {
        nearest = Some((floor, None));
    } else if floor > 0.0 && p.x.abs() < 100.0 + margin && p.z.abs() < 100.0 + margin {
        edge = true;
    }
    for (i, ball) in BALLS.into_iter().enumerate() {
        let (b, r, aside) = sphere(origin, direction, ball);
        edge |= (aside - r).abs() < margin;
        if aside < r {
            let t = b - (r * r - aside * aside).sqrt();
            if nearest.is_some_and(|(n, _)| (n - t).abs() < margin) {
                edge = true;
            }
            if nearest.is_none_or(|(n, _)| t < n) {
                nearest = Some((t, Some(i)));
            }
        }
    }
    if edge {
        return Some(Light::Edge);
    }
    let (t, on) = nearest?;
    let p = origin + t * direction;
    let normal = on.map_or(DVec3::Y, |i| (p - BALLS[i].0).normalize());
    let to_lamp = (LAMP - p).normalize();
    let cosine = normal.dot(to_lamp);
    // The error of the point grows with the angle of incidence: points near the intersection of two surfaces are left
    // out.
    let beside = |(c, r): (DVec3, f64), i| on != Some(i) && ((p - c).length() - r).abs() < 20.0 * margin;
    let at_floor = on.is_some() && p.y < 20.0 * margin;
    if cosine.abs() < 1e-3 || at_floor || BALLS.into_iter().enumerate().any(|(i, ball)| beside(ball, i)) {
        return Some(Light::Edge);
    }
    if cosine < 0.0 || (on.is_some() && p.y < 0.0) {
        return Some(Light::Dark);
    }
    for (i, ball) in BALLS.into_iter().enumerate() {
        if on == Some(i) {
            continue;
        }
        let (b, r, aside) = sphere(p, to_lamp, ball);
        if b > 0.0 && (aside - r).abs() < 4.0 * margin {
            return Some(Light::Edge);
        }
        if b > 0.0 && aside < r {
            return Some(Light::Dark);
        }
    }
    Some(Light::Lit)
}

/// E1, H2, H3: the floor and spheres at every decimal scale, and moved by up to a million. In every tier no pixel is
/// dark where the closed form is lit (acne), and none is lit where it is dark (a leak).
#[test]
fn e1_lit_balls_on_a_floor_at_every_scale_and_place() {
    let scene = balls_on_a_floor();
    let scales = (-6..=6).map(|k| (10f64.powi(k), DVec3::ZERO));
    let mut faults: Vec<String> = Vec::new();
    let places = [1.0, 1e3, 1e6].map(|d| (1.0, d * DVec3::new(1.0, -0.3, 0.7)));
    for (scale, offset) in scales.chain(places) {
        for numerics in Numerics::ALL {
            let prepared = prepare(placed(scene.clone(), scale, offset), [200, 200], numerics);
            let film = prepared.render(PlanSettings::default()).0;
            // The rays in the coordinates before recentering.
            let original = prepare(scene.clone(), [200, 200], Numerics::Double);
            let (mut acne, mut leaks, mut lit, mut dark, mut edges) = (0, 0, 0, 0, 0);
            for (ray, at) in original.rays().iter().zip(0u32..) {
                let bright = film.pixel(at % 200, at / 200)[0] > 0.0;
                // An f32 step at this offset, relative to the size of the scene.
                let moved = offset.abs().max_element() / scale;
                let near = if moved > 16.0 * 200.0 { 0.0 } else { moved };
                let m = f64::from(f32::EPSILON) * 8.0 * (1.0 + near / 300.0);
                match closed_form(ray.origin(), ray.direction(), m) {
                    Some(Light::Lit) => (lit, acne) = (lit + 1, acne + u32::from(!bright)),
                    Some(Light::Dark) => (dark, leaks) = (dark + 1, leaks + u32::from(bright)),
                    Some(Light::Edge) => edges += 1,
                    None => assert!(!bright),
                }
            }
            assert!(lit > 10_000 && dark > 1000 && edges < 400, "{lit} lit, {dark} dark, {edges} edges");
            if (acne, leaks) != (0, 0) {
                faults
                    .push(format!("{acne} acne, {leaks} leaks at {scale}, {offset} in {}", numerics.name()));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
