//! Casts rays at a mesh file without rendering: closest hit, any hit and all hits.
//!
//! ```sh
//! cargo run --release --example query_rays -- assets/import/materials.obj
//! ```

use std::error::Error;
use std::fmt::Write;
use std::path::Path;

use kiln::bvh::Traversal;
use kiln::error::Warnings;

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args().nth(1).ok_or("an argument is needed: query_rays MESH.obj")?;
    print!("{}", query(file.as_ref())?);
    Ok(())
}

/// Casts a ray from above and beside the mesh through the middle of its bounds, and describes what it hits.
pub fn query(file: &Path) -> Result<String, Box<dyn Error>> {
    let scene = kiln::import::load(&[file.to_owned()], &mut Warnings::default())?;
    let (min, max) = scene.bounds().ok_or("there is nothing in it to hit")?;
    let (middle, size) = ((min + max) / 2.0, (max - min).length());
    let bvh = scene.bvh()?;
    // One for each thread; its memory is reused from ray to ray.
    let mut traversal = Traversal::default();
    let mut text = String::new();

    let eye = middle + size * kiln::glam::DVec3::new(0.5, 0.6, 0.7);
    let ray = bvh.ray(eye, middle - eye)?;
    if let Some(hit) = bvh.closest_hit(&ray, &mut traversal) {
        let (object, triangle) = scene.object_of(hit.prim).ok_or("a primitive of the scene")?;
        let name = &scene.objects[object].name;
        writeln!(text, "closest hit: triangle {triangle} of {name} at distance {}", hit.t)?;
        writeln!(text, "  point {}", ray.at(hit.t))?;
        if let Some(normal) = bvh.geometric_normal(&ray, &hit) {
            writeln!(text, "  geometric normal {normal}")?;
        }
    }
    // Any hit: as for a shadow ray, without what is behind the middle.
    let is_hidden = bvh.occluded(&bvh.ray_within(eye, middle - eye, eye.distance(middle))?, &mut traversal);
    writeln!(text, "any hit: the middle is {}", if is_hidden { "hidden" } else { "visible" })?;
    let hits = bvh.all_hits(&ray, &mut traversal);
    let distances: Vec<f64> = hits.iter().map(|hit| hit.t).collect();
    writeln!(text, "all hits: {} at distances {distances:?}", hits.len())?;
    Ok(text)
}
