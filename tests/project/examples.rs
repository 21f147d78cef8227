//! The files of `examples` run, each with its own check, and `docs/library.md` links them.

#[allow(dead_code)]
#[path = "../../examples/build_scene.rs"]
mod build_scene;
#[allow(dead_code)]
#[path = "../../examples/compare_bvh.rs"]
mod compare_bvh;
#[allow(dead_code)]
#[path = "../../examples/hard_cases.rs"]
mod hard_cases;
#[allow(dead_code)]
#[path = "../../crates/bvh/examples/mesh_queries.rs"]
mod mesh_queries;
#[allow(dead_code)]
#[path = "../../examples/query_rays.rs"]
mod query_rays;
#[allow(dead_code)]
#[path = "../../examples/render_file.rs"]
mod render_file;
#[allow(dead_code)]
#[path = "../../crates/bvh/examples/torus/main.rs"]
mod torus;

use std::path::Path;

use kiln::job::RenderSettings;
use kiln_lab::bench::generate::Family;

use crate::common::repository;

fn small() -> RenderSettings {
    kiln::scene::PictureSettings::of_size([64, 48]).into()
}

/// The colour of a pixel of a file of 64 by 48 pixels.
fn pixel(file: &Path, x: u32, y: u32) -> [u8; 3] {
    let image = image::open(file).expect("the example wrote a picture").to_rgb8();
    assert_eq!(image.dimensions(), (64, 48));
    image.get_pixel(x, y).0
}

/// Each example says at its start how it is run, is a module of this file, and is linked.
#[test]
fn every_example_is_tested_and_linked() {
    let page = std::fs::read_to_string(repository("docs/library.md")).expect("the page");
    let own = std::fs::read_to_string(repository("tests/project/examples.rs")).expect("this file");
    let entries = std::fs::read_dir(repository("examples")).expect("the folder");
    let names = entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned());
    let mut count = 0;
    for name in names {
        let text = std::fs::read_to_string(repository("examples").join(&name)).expect("an example");
        let command = format!("//! cargo run --release --example {}", name.trim_end_matches(".rs"));
        assert!(text.starts_with("//! ") && text.contains(&command), "{name} has no `{command}`");
        assert!(own.contains(&format!("#[path = \"../../examples/{name}\"]")), "{name} is not run");
        assert!(page.contains(&format!("](../examples/{name})")), "docs/library.md does not link {name}");
        count += 1;
    }
    assert!(count >= 5);
}

#[test]
fn render_file_renders_a_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("out.png");
    render_file::render_file(&repository("scenes/assignment.toml"), &file, &small()).expect("it renders");
    // The scene's background, at the upper left, is another colour than its middle.
    assert_ne!(pixel(&file, 0, 0), pixel(&file, 32, 24));
}

#[test]
fn build_scene_renders_a_red_ball_on_a_grey_floor() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("out.png");
    build_scene::render(build_scene::build_scene(), &file, &small()).expect("it renders");
    // The camera looks at a point 0.2 below the centre of the ball.
    let [red, green, blue] = pixel(&file, 32, 22);
    assert!(red > 2 * green && red > 2 * blue, "{red} {green} {blue}");
    // Below the ball, in front of it, is the floor.
    let [red, green, blue] = pixel(&file, 32, 44);
    assert!(red > 0 && red == green && green == blue, "{red} {green} {blue}");
}

/// A cube from 0 to 1 of six squares. The ray goes from (1, 1.2, 1.4) sqrt(3) / 2 beside the middle, (1/2, 1/2, 1/2),
/// towards it, so that it enters by the face z = 1 and leaves by z = 0: 1/2 / (0.7 / |(0.5, 0.6, 0.7)|) before and
/// behind the middle.
#[test]
fn query_rays_finds_both_sides_of_a_cube() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("cube.obj");
    let corners: String = (0..8).map(|i| format!("v {} {} {}\n", i & 1, i >> 1 & 1, i >> 2)).collect();
    let faces = "f 1 5 7 3\nf 2 4 8 6\nf 1 2 6 5\nf 3 7 8 4\nf 1 3 4 2\nf 5 6 8 7\n";
    std::fs::write(&file, format!("o cube\n{corners}{faces}")).expect("it can be written");
    let said = query_rays::query(&file).expect("the cube is hit");
    let length = (0.25f64 + 0.36 + 0.49).sqrt();
    let [near, far] = [-1.0, 1.0].map(|side| 3f64.sqrt() * length + side * 0.5 * length / 0.7);
    for (line, start) in
        [(0, "closest hit: triangle "), (3, "any hit: the middle is hidden"), (4, "all hits: 2 ")]
    {
        assert!(said.lines().nth(line).is_some_and(|line| line.starts_with(start)), "{said}");
    }
    assert!(said.contains(" of cube at distance ") && said.contains("geometric normal [0, 0, 1]"), "{said}");
    let numbers = said.lines().nth(4).and_then(|line| line.split('[').nth(1)).expect("a list");
    let numbers: Vec<f64> =
        numbers.trim_end_matches(']').split(", ").map(|number| number.parse().expect("a number")).collect();
    assert!(
        (numbers[0] - near).abs() < 1e-12 && (numbers[1] - far).abs() < 1e-12,
        "{numbers:?}, {near} {far}"
    );
}

/// The ray starts 3 below the bottom, whose triangles are the last two; the point below its middle, on their common
/// edge, is a quarter from both.
#[test]
fn mesh_queries_describes_an_open_cube() {
    let text = mesh_queries::describe().expect("results");
    let expected = "hit at 3; inside: true, by a margin of 0.333; the nearest triangles: 8 and 9 at 0.25; ";
    assert!(text.starts_with(expected), "{text}");
    assert!(!text.ends_with(" 0 triangles meet"), "{text}");
}

/// Along x: the torus from -2.5 to -1.5 and from 1.5 to 2.5, the ball between -0.75 and 0.75; from -5 on. The torus is
/// the fourth primitive; (2, 0, 1.5) is above the middle of the tube, whose radius is 0.5.
#[test]
fn torus_draws_one_and_lists_its_crossings() {
    let text = torus::describe().expect("results");
    let expected = "along x: Entering 3 at 2.5, Leaving 3 at 3.5, Entering 0 at 4.25, Leaving 0 at 5.75, \
                    Entering 3 at 6.5, Leaving 3 at 7.5\nin the tube: winding number 1\n\
                    closest to (2, 0, 1.5): 3 at a distance of 1\n";
    assert!(text.ends_with(expected), "{text}");
    // In the middle row of the picture there is a tube, a hole, the ball, a hole and a tube; shadows are dots.
    assert!(text.lines().take(26).any(|line| line.contains('@') && line.contains('.')), "{text}");
}

#[test]
fn compare_bvh_has_a_row_of_its_own_beside_kiln() {
    let rows = compare_bvh::compare(&Family::Sphere.mesh(2000), 32, 1).expect("rows");
    let own = rows.iter().find(|row| row.label.engine == "mine").expect("its row");
    assert!(rows.iter().any(|row| row.label.engine == "kiln"));
    // As of every engine in f32: rays on edges. A tree that is wrong misses more.
    let rays: usize = own.rays.iter().sum();
    assert!(own.all_wrong().expect("compared") * 100 < rays as u64, "{own:?}");
    let table = compare_bvh::table(&rows);
    assert!(table.lines().any(|line| line.starts_with("mine median split ")), "{table}");
    assert_eq!(table.lines().count(), rows.len() + 1);
}

/// The cases are answered in rational arithmetic, so `exact` is right in all of them; no tier but that of f32 loses a
/// ray.
#[test]
fn hard_cases_are_answered_by_every_tier_but_that_of_f32() {
    let cases = hard_cases::read_cases(&repository("benches/hard-cases")).expect("the cases");
    assert_eq!(cases.len(), 11);
    let mut lost_in_f32 = 0;
    for engine in kiln_lab::bench::speed::engines(1).0 {
        for case in &cases {
            let wrong = hard_cases::score(&engine, case).expect("a structure");
            let tier = (engine.label.engine == "kiln").then_some(engine.label.tier).flatten();
            match tier {
                Some("exact") => assert_eq!(wrong, [0; 3], "{:?} {}", engine.label, case.name),
                Some("watertight" | "double") => assert_eq!(wrong[0], 0, "{:?} {}", engine.label, case.name),
                Some(_) => lost_in_f32 += wrong[0],
                None => {}
            }
        }
    }
    assert!(lost_in_f32 > 0);
}
