//! User geometry: a torus beside a sphere and a floor of triangles, seen from above, with every hit as a character; and
//! the results of other queries.
//!
//! cargo run --release -p kiln-bvh --example torus

mod shape;

use std::error::Error;
use std::fmt::Write;
use std::sync::Arc;

use kiln_bvh::glam::DVec3;
use kiln_bvh::{Bvh, Primitive, Traversal, UserGeometry};
use shape::Torus;

/// Characters of a picture.
const SIZE: [u32; 2] = [64, 26];

/// From the darkest to the brightest.
const SHADES: &[u8] = b".:-=+*#%@";

/// The picture and the results, as text.
pub fn describe() -> Result<String, Box<dyn Error>> {
    let ball = Primitive::from(([0.0; 3], 0.75));
    let corners = [[-4.0, -4.0], [4.0, -4.0], [4.0, 4.0], [-4.0, 4.0]].map(|[x, y]| [x, y, -0.75]);
    let floor = [[0, 1, 2], [0, 2, 3]].map(|triangle| Primitive::from(triangle.map(|i: usize| corners[i])));
    let torus = Torus { centre: DVec3::ZERO, major: 2.0, minor: 0.5 };
    let mut bvh = Bvh::new([ball].into_iter().chain(floor))?;
    bvh.set_user_geometry([Arc::new(torus) as Arc<dyn UserGeometry>])?;

    let (mut text, mut traversal) = (String::new(), Traversal::default());
    let eye = DVec3::new(0.0, -9.0, 6.0);
    let light = DVec3::new(-1.0, -2.0, 3.0).normalize();
    for row in 0..SIZE[1] {
        for column in 0..SIZE[0] {
            let on_floor = [(column, SIZE[0], 7.0), (row, SIZE[1], -8.0)].map(|(place, size, extent)| {
                (f64::from(place) + 0.5) / f64::from(size) * extent - extent / 2.0
            });
            let ray = bvh.ray(eye, DVec3::new(on_floor[0], on_floor[1], 0.0) - eye)?;
            let hit = bvh.closest_hit(&ray, &mut traversal);
            let shade = hit.and_then(|hit| {
                let normal = bvh.geometric_normal(&ray, &hit)?;
                let from = ray.at(hit.t) + normal * 1e-6;
                let is_lit = !bvh.occluded(&bvh.ray(from, light).ok()?, &mut traversal);
                let brightness = if is_lit { normal.dot(light).max(0.0) } else { 0.0 };
                Some(SHADES[(brightness * (SHADES.len() - 1) as f64).round() as usize])
            });
            text.push(char::from(shade.unwrap_or(b' ')));
        }
        text.truncate(text.trim_end().len());
        text.push('\n');
    }

    let ray = bvh.ray([-5.0, 0.0, 0.0], [1.0, 0.0, 0.0])?;
    let crossings = bvh.crossings(&ray, &mut traversal);
    let crossings: Vec<String> =
        crossings.iter().map(|c| format!("{:?} {} at {}", c.side, c.prim.0, c.t)).collect();
    writeln!(text, "along x: {}", crossings.join(", "))?;
    let centre = [2.0, 0.0, 0.0];
    let winding_number = bvh.winding_number(centre, &mut traversal);
    let closest = bvh.closest_point([2.0, 0.0, 1.5], &mut traversal).ok_or("a primitive")?;
    writeln!(text, "in the tube: winding number {winding_number}")?;
    writeln!(text, "closest to (2, 0, 1.5): {} at a distance of {}", closest.prim.0, closest.distance)?;
    Ok(text)
}

fn main() -> Result<(), Box<dyn Error>> {
    print!("{}", describe()?);
    Ok(())
}
