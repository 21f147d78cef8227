//! How long it takes to prepare scenes of many instances: cameras are fitted without a visit to every vertex of every
//! instance.

use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::{DMat4, DQuat, DVec3};
use kiln::error::Warnings;
use kiln::job::{RenderSettings, Session};
use kiln::scene::{Mesh, Placed, Placement, Scene, Shape};

use crate::common::Numbers;

/// 20,000 instances of a sphere of 5,000 triangles. One pass over all of their vertices takes a second; there were a
/// pass for the direction of the view, and, for each instance, a tree over its vertices.
#[test]
fn instances_are_prepared_in_good_time() {
    const LIMIT: Duration = Duration::from_secs(2);
    let (rows, columns) = (51, 50);
    let position = |i: u32| {
        let (row, column) = (f64::from(i / columns), f64::from(i % columns));
        let (latitude, longitude) = (row / 50.0 * std::f64::consts::PI, column / 25.0 * std::f64::consts::PI);
        DVec3::new(latitude.sin() * longitude.cos(), latitude.cos(), latitude.sin() * longitude.sin())
    };
    let square = |i: u32| {
        let (a, b) = (i, i / columns * columns + (i + 1) % columns);
        [[a, b, b + columns], [a, b + columns, a + columns]]
    };
    let sphere = Arc::new(Mesh {
        positions: (0..rows * columns).map(position).collect(),
        triangles: (0..(rows - 1) * columns).flat_map(square).collect(),
        ..Mesh::default()
    });
    let mut numbers = Numbers::new(1);
    let mut scene: Scene = (0..20_000)
        .map(|_| {
            let (scale, at) = (numbers.vector().abs() + 0.1, numbers.vector() * DVec3::new(50.0, 1.0, 50.0));
            let rotation = DQuat::from_axis_angle(numbers.direction(), 6.0 * numbers.unit());
            let placement = Placement::new(DMat4::from_scale_rotation_translation(scale, rotation, at));
            Shape::Placed(Placed::new(sphere.clone(), placement))
        })
        .collect();
    for has_settings in [false, true] {
        scene.has_settings = has_settings;
        let mut best = Duration::MAX;
        for _ in 0..3 {
            let (scene, start) = (scene.clone(), Instant::now());
            let session = Session::still(scene).expect("a scene");
            let resolved = session.resolve(&RenderSettings::default(), &mut Warnings::default());
            resolved.expect("it can be rendered");
            best = best.min(start.elapsed());
            if best < LIMIT {
                break;
            }
        }
        eprintln!("20,000 instances are prepared in {} ms", best.as_millis());
        assert!(best < LIMIT, "{best:?}");
    }
}
