//! Pictures with values derived by hand, and a second implementation of the assignment's formulas.

use crate::common;
use glam::DVec3;
use kiln::effects::PlanSettings;
use kiln::film::Film;
use kiln::scene::{Numerics, Scene};

/// Renders a scene file at its own size.
fn picture(toml: &str, plan_settings: PlanSettings) -> Film {
    picture_of(common::picture::parse(toml), None, None, plan_settings)
}

fn picture_of(
    mut scene: Scene,
    camera: Option<&str>,
    size: Option<[u32; 2]>,
    plan_settings: PlanSettings,
) -> Film {
    if let Some(name) = camera {
        scene.cameras.retain(|camera| camera.name == name);
    }
    let size = size.or(scene.picture.size()).expect("a size");
    common::picture::prepare(scene, size, Numerics::default()).render(plan_settings).0
}

/// Looks along -z at 64 x 64 units with as many pixels: pixel (i, j) from the top is at (i - 31.5, 31.5 - j).
const FROM_FRONT: &str = r#"
[image]
width = 64
height = 64
colour = "display"
[[camera]]
position = [0, 0, 1000]
look_at = [0, 0, 0]
projection = "orthographic"
viewing_rectangle = [64, 64]
viewpoint_distance = 1000
"#;

/// The same from above: pixel (i, j) is at x = i - 31.5, z = j - 31.5.
const FROM_ABOVE: &str = r#"
[image]
width = 64
height = 64
colour = "display"
[[camera]]
position = [0, 1000, 0]
look_at = [0, 0, 0]
projection = "orthographic"
viewing_rectangle = [64, 64]
viewpoint_distance = 1000
"#;

fn for_each_pixel(mut f: impl FnMut(u32, u32, f64, f64)) {
    for j in 0..64 {
        for i in 0..64 {
            f(i, j, f64::from(i) - 31.5, 31.5 - f64::from(j));
        }
    }
}

#[test]
fn a_spheres_silhouette_in_parallel() {
    let scene = format!(
        "{FROM_FRONT}\n[ambient]\nintensity = 1\n[material.m]\ncolour = [255, 0, 0]\n\
         [[sphere]]\ncentre = [3, -2, 5]\nradius = 20\nmaterial = \"m\"\n"
    );
    let film = picture(&scene, PlanSettings::default());
    // The pixel sees the sphere where (x - 3)^2 + (y + 2)^2 <= 400; all terms are halves, so this is exact.
    let mut inside = 0;
    for_each_pixel(|i, j, x, y| {
        let hit = (x - 3.0).powi(2) + (y + 2.0).powi(2) <= 400.0;
        assert_eq!(film.pixel(i, j), if hit { [1.0, 0.0, 0.0] } else { [0.0; 3] }, "({x}, {y})");
        inside += u32::from(hit);
    });
    // About pi 400 pixels.
    assert!((1200..1320).contains(&inside));
}

#[test]
fn a_spheres_silhouette_in_perspective() {
    let scene = format!(
        "{}\n[ambient]\nintensity = 1\n[material.m]\ncolour = [255, 0, 0]\n\
         [[sphere]]\ncentre = [3, -2, 5]\nradius = 20\nmaterial = \"m\"\n",
        FROM_FRONT
            .replace("\"orthographic\"", "\"perspective\"")
            .replace("1000]", "100]")
            .replace("= 1000", "= 100")
    );
    let film = picture(&scene, PlanSettings::default());
    // From (0, 0, 100) along d = (x, y, -100), with c = (3, -2, -95) towards the centre: the ray meets the sphere where
    // its distance from the centre, |c|^2 - (c.d)^2 / |d|^2, is at most 400.
    let c = DVec3::new(3.0, -2.0, -95.0);
    for_each_pixel(|i, j, x, y| {
        let d = DVec3::new(x, y, -100.0);
        let distance = c.length_squared() - c.dot(d).powi(2) / d.length_squared();
        assert!((distance - 400.0).abs() > 1e-3, "a pixel too near the edge to tell");
        assert_eq!(film.pixel(i, j)[0] > 0.0, distance <= 400.0, "({x}, {y})");
    });
}

#[test]
fn a_shadows_edge() {
    // A ball of radius 5 at height 10 under a lamp at height 30: its tangent cone has the tangent
    // 5 / sqrt(20^2 - 5^2), so on the floor the shadow is a circle of radius 30 * 5 / sqrt(375) = 7.746.
    let radius = 30.0 * 5.0 / 375f64.sqrt();
    let scene = format!(
        "{FROM_ABOVE}\n[ambient]\nintensity = 0.5\n\
         [[light]]\ntype = \"point\"\nposition = [0, 30, 0]\n\
         [material.floor]\ncolour = [0, 102, 0]\n[material.ball]\ncolour = [255, 0, 0]\n\
         [[triangles]]\nvertices = [[-99, 0, -99], [-99, 0, 200], [200, 0, -99]]\nmaterial = \"floor\"\n\
         [[sphere]]\ncentre = [0, 10, 0]\nradius = 5\nmaterial = \"ball\"\n"
    );
    let (with, without) = (
        picture(&scene, PlanSettings::default()),
        picture(&scene, PlanSettings { without: vec!["shadows".into()], ..PlanSettings::default() }),
    );
    for_each_pixel(|i, j, x, y| {
        let r = x.hypot(y);
        if r <= 5.0 {
            assert!(with.pixel(i, j)[0] > 0.0, "the ball is seen at ({x}, {y})");
            return;
        }
        // The floor's 102 / 255 = 0.4 keeps what it shows below 1. In the light: 0.5 + cos of the angle at the floor,
        // 30 / sqrt(30^2 + r^2).
        let lit = 0.4 * (0.5 + 30.0 / (900.0 + r * r).sqrt());
        let expected = if r < radius { 0.4 * 0.5 } else { lit };
        let close = |a: f32, b: f64| (f64::from(a) - b).abs() < 1e-6;
        assert!(close(with.pixel(i, j)[1], expected), "({x}, {y}): {} {expected}", with.pixel(i, j)[1]);
        assert!(close(without.pixel(i, j)[1], lit), "({x}, {y})");
    });
}

#[test]
fn what_lies_behind_the_light_casts_no_shadow() {
    // The lid is above the lamp, the leaf between lamp and floor, over x > 0 only.
    let scene = |lid: bool| {
        let lid = if lid {
            "[[triangles]]\nvertices = [[-99, 40, -99], [-99, 40, 200], [200, 40, -99]]\n"
        } else {
            ""
        };
        let camera = FROM_ABOVE.replace("[0, 1000, 0]", "[0, 35, 0]");
        format!(
            "{camera}\n[ambient]\nintensity = 0\n[[light]]\ntype = \"point\"\nposition = [0, 30, 0]\n\
             [[triangles]]\nvertices = [[-99, 0, -99], [-99, 0, 200], [200, 0, -99]]\n{lid}"
        )
    };
    assert_eq!(
        picture(&scene(true), PlanSettings::default()),
        picture(&scene(false), PlanSettings::default())
    );
}

/// A spot over a floor, 40 units high: at a distance r from its axis the cosine to the axis and to the normal is 40 /
/// sqrt(r^2 + 40^2), and the intensity is ((cosine - cos outer) / (cos inner - cos outer))^2 between the angles
/// (KHR_lights_punctual).
#[test]
fn a_spots_cone() {
    let scene = |way: &str, inner: f64, outer: f64| {
        format!(
            "{FROM_ABOVE}\n[ambient]\nintensity = 0\n[[light]]\ntype = \"spot\"\nposition = [3, 40, -2]\n{way}\n\
             inner_cone_angle = {inner}\nouter_cone_angle = {outer}\ncolour = [255, 102, 0]\n\
             [material.m]\ncolour = [255, 255, 255]\n\
             [[triangles]]\nvertices = [[-99, 0, -99], [-99, 0, 200], [200, 0, -99]]\nmaterial = \"m\"\n"
        )
    };
    // The second has a sharp edge: no pixel's centre is nearer to its cone than rounding.
    for (inner, outer) in [(10.0, 30.0), (25.0, 25.0), (0.0, 35.0)] {
        let film = picture(&scene("direction = [0, -2, 0]", inner, outer), PlanSettings::default());
        let (from, to) = (f64::cos(f64::to_radians(outer)), f64::cos(f64::to_radians(inner)));
        let mut regions = [0; 3];
        for_each_pixel(|i, j, x, minus_z| {
            let cosine = 40.0 / ((x - 3.0).powi(2) + (minus_z - 2.0).powi(2) + 1600.0).sqrt();
            let (cone, region) = match cosine {
                c if c <= from => (0.0, 0),
                c if c >= to => (1.0, 1),
                c => (((c - from) / (to - from)).powi(2), 2),
            };
            regions[region] += 1;
            for (found, colour) in film.pixel(i, j).into_iter().zip([1.0, 0.4, 0.0]) {
                let expected = colour * cone * cosine;
                assert!(
                    (f64::from(found) - expected).abs() < 1e-6,
                    "({x}, {minus_z}): {found}, not {expected}"
                );
            }
        });
        // The circle of the outer angle has the area pi (40 tan outer)^2, cut by no side of the picture up to 35
        // degrees.
        let area = std::f64::consts::PI * (40.0 * f64::to_radians(outer).tan()).powi(2);
        let lit = f64::from(regions[1] + regions[2]);
        assert!((lit - area).abs() < 0.02 * area, "{lit} pixels, not {area}");
        let aimed = picture(&scene("look_at = [3, 7, -2]", inner, outer), PlanSettings::default());
        assert_eq!(aimed, film);
    }
}

#[test]
fn the_highlight_is_where_the_mirror_says() {
    // Lit along -l and seen along -z, a sphere's highlight is where the normal is halfway between l and z.
    let l = DVec3::new(1.0, 2.0, 2.0) / 3.0;
    let half = (l + DVec3::Z).normalize();
    let scene = format!(
        "{FROM_FRONT}\n[ambient]\nintensity = 0\n\
         [[light]]\ntype = \"directional\"\ndirection = [-1, -2, -2]\n\
         [material.m]\ncolour = [255, 255, 255]\ndiffuse = 0\nspecular = 1\nshininess = 64\n\
         [[sphere]]\ncentre = [0, 0, 0]\nradius = 30\nmaterial = \"m\"\n"
    );
    let film = picture(&scene, PlanSettings::default());
    let mut brightest = (0.0, 0.0, 0.0);
    for_each_pixel(|i, j, x, y| {
        let value = film.pixel(i, j)[0];
        if value > brightest.0 {
            brightest = (value, x, y);
        }
        // Everywhere: (R.V)^64 with R = 2 N (N.L) - L, on the side of the light.
        if x * x + y * y < 899.0 {
            let n = DVec3::new(x, y, (900.0 - x * x - y * y).sqrt()) / 30.0;
            let cosine = n.dot(l);
            let expected = if cosine > 0.0 { (2.0 * n.z * cosine - l.z).max(0.0).powi(64) } else { 0.0 };
            assert!((f64::from(value) - expected).abs() < 1e-5, "({x}, {y}): {value} {expected}");
        }
    });
    let (value, x, y) = brightest;
    // The nearest pixel's centre is at most 0.71 units off, its normal 0.71 / 30 / 0.91 = 0.026, the mirrored ray twice
    // that: 1 - 64 * 0.052^2 / 2 = 0.913.
    assert!(value > 0.91, "{value}");
    assert!((x - 30.0 * half.x).abs() <= 0.5 && (y - 30.0 * half.y).abs() <= 0.5, "({x}, {y})");
}

/// A mirror at 45 degrees under the camera shows the wall beside it: 0.75 * 100 + 0.25 * 200 = 125. The upper half of
/// the mirror looks over the wall: there the colour stays 100.
#[test]
fn the_blend() {
    let scene = |glaze: &str| {
        format!(
            "{FROM_ABOVE}\n[ambient]\nintensity = 1\n\
             [material.mirror]\ncolour = [100, 100, 100]\n{glaze}\n[material.wall]\ncolour = [200, 0, 40]\n\
             [[triangles]]\nvertices = [[-32, -32, -32], [32, 32, -32], [32, 32, 32], [-32, -32, 32]]\n\
             indices = [[0, 1, 2], [0, 2, 3]]\nmaterial = \"mirror\"\n\
             [[triangles]]\nvertices = [[-500, -500, -500], [-500, 0, -500], [-500, 0, 500], [-500, -500, 500]]\n\
             indices = [[0, 1, 2], [0, 2, 3]]\nmaterial = \"wall\"\n"
        )
    };
    let film =
        picture(&scene("glaze = { weight = 0.25, own_weight = 0.75, bounces = 1 }"), PlanSettings::default());
    let other =
        picture(&scene("glaze = { weight = 0.5, own_weight = 0.25, bounces = 1 }"), PlanSettings::default());
    let none = picture(&scene(""), PlanSettings::default());
    let close = |pixel: [f32; 3], expected: [f64; 3]| {
        pixel.iter().zip(expected).all(|(&c, e)| (f64::from(c) * 255.0 - e).abs() < 1e-4)
    };
    // Going down (0, -1, 0) the ray is mirrored by the normal (-1, 1, 0) / sqrt 2 to (-1, 0, 0), at height x.
    for_each_pixel(|i, j, x, _| {
        let (blend, half) =
            if x < 0.0 { ([125.0, 75.0, 85.0], [125.0, 25.0, 45.0]) } else { ([100.0; 3], [100.0; 3]) };
        assert!(close(film.pixel(i, j), blend), "{x}: {:?}", film.pixel(i, j));
        assert!(close(other.pixel(i, j), half), "{x}: {:?}", other.pixel(i, j));
        assert!(close(none.pixel(i, j), [100.0; 3]));
    });
}

/// `mix_light` clamps to 255 before the blend. Ambient light of 2 makes the wall (400, 200, 80), held to (255, 200,
/// 80), and the mirror 200: 0.75 * 200 + 0.25 * 255 = 213.75, then 200 and 170. Without the clamp red would be 250.
#[test]
fn what_is_brighter_than_white_is_mirrored_as_white() {
    let scene = |colour: &str| {
        format!(
            "{FROM_ABOVE}\n[ambient]\nintensity = 2\n\
             [material.mirror]\ncolour = [100, 100, 100]\nglaze = {{ weight = 0.25, own_weight = 0.75 }}\n\
             [material.wall]\ncolour = [200, 100, 40]\n\
             [[triangles]]\nvertices = [[-32, -32, -32], [32, 32, -32], [32, 32, 32], [-32, -32, 32]]\n\
             indices = [[0, 1, 2], [0, 2, 3]]\nmaterial = \"mirror\"\n\
             [[triangles]]\nvertices = [[-500, -500, -500], [-500, 0, -500], [-500, 0, 500], [-500, -500, 500]]\n\
             indices = [[0, 1, 2], [0, 2, 3]]\nmaterial = \"wall\"\n"
        )
        .replace("\"display\"", colour)
    };
    for (colour, expected) in [("\"display\"", [213.75, 200.0, 170.0]), ("\"u8\"", [214.0, 200.0, 170.0])] {
        let film = picture(&scene(colour), PlanSettings::default());
        let found = film.pixel(8, 32).map(|c| f64::from(c) * 255.0);
        let differs = found.iter().zip(expected).any(|(f, e)| (f - e).abs() > 1e-4);
        assert!(!differs, "{colour}: {found:?}, not {expected:?}");
    }
}

/// Between two facing mirrors each bounce adds one more term: with weights 1/2 and colours 1 and 0 alternating along
/// the path, n bounces see 1/2 (1 + 1/4 + ...), cut off at the last.
#[test]
fn more_bounces_see_further() {
    let scene = |bounces: u32| {
        format!(
            "{FROM_ABOVE}\n[ambient]\nintensity = 1\n\
             [material.floor]\ncolour = [255, 255, 255]\nglaze = {{ weight = 0.5, bounces = {bounces} }}\n\
             [material.lid]\ncolour = [0, 0, 0]\nglaze = {{ weight = 0.5, bounces = {bounces} }}\n\
             [[triangles]]\nvertices = [[-99, 0, -99], [-99, 0, 200], [200, 0, -99]]\nmaterial = \"floor\"\n\
             [[triangles]]\nvertices = [[-99, 40, -99], [-99, 40, 200], [200, 40, -99]]\nmaterial = \"lid\"\n"
        )
        .replace("[0, 1000, 0]", "[0, 35, 0]")
    };
    // C0 = 1; C1 = (1 + 0) / 2; C2 = (1 + (0 + 1) / 2) / 2; C3 = (1 + (0 + (1 + 0) / 2) / 2) / 2.
    for (bounces, expected) in [(0, 1.0), (1, 0.5), (2, 0.75), (3, 0.625)] {
        let film = picture(&scene(bounces), PlanSettings::default());
        assert_eq!(film.pixel(32, 32), [expected; 3], "{bounces} bounces");
    }
}

/// The assignment's formulas, written down a second time from the report, textbook forms and all, sharing nothing with
/// the renderer.
mod report {
    use glam::DVec3;

    #[derive(Clone, Copy)]
    pub struct Thing {
        pub shape: Shape,
        pub colour: [f64; 3],
        pub k: [f64; 3],
    }

    #[derive(Clone, Copy)]
    pub enum Shape {
        Sphere(DVec3, f64),
        Triangle([DVec3; 3]),
    }

    pub const LIGHT: DVec3 = DVec3::new(-400.0, 100.0, 850.0);
    const AMBIENT: f64 = 1.1;

    pub fn things() -> Vec<Thing> {
        let p = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
        let (red, blue) = ([124.0, 10.0, 2.0], [25.0, 25.0, 112.0]);
        let (sky, purple) = ([156.0, 181.0, 203.0], [128.0, 0.0, 128.0]);
        let [tp, b1, b2, b3] =
            [p(-100., -200., 1216.), p(0., -600., 1250.), p(-100., -600., 1150.), p(-200., -600., 1250.)];
        let plane = [p(-10000., -500., -10000.), p(-10000., -500., 100000.), p(10000., -500., -10000.)];
        let mut things = vec![
            Thing { shape: Shape::Sphere(p(-300., -425., 1200.), 75.0), colour: red, k: [1.0, 1.0, 4.0] },
            Thing { shape: Shape::Sphere(p(100., -400., 1350.), 100.0), colour: blue, k: [1.0, 1.0, 3.0] },
            Thing { shape: Shape::Triangle(plane), colour: sky, k: [1.0, 0.2, 0.2] },
        ];
        for face in [[b1, b2, b3], [b1, b2, tp], [b2, b3, tp], [b1, b3, tp]] {
            things.push(Thing { shape: Shape::Triangle(face), colour: purple, k: [1.0, 1.0, 2.0] });
        }
        things
    }

    fn hit(shape: &Shape, e: DVec3, d: DVec3, least: f64) -> Option<(f64, DVec3)> {
        match *shape {
            Shape::Sphere(x, r) => {
                let ex = e - x;
                let discriminant = d.dot(ex).powi(2) - d.dot(d) * (ex.dot(ex) - r * r);
                if discriminant < 0.0 {
                    return None;
                }
                let roots = [-1.0, 1.0].map(|sign| (-d.dot(ex) + sign * discriminant.sqrt()) / d.dot(d));
                let t = roots.into_iter().find(|&t| t > least)?;
                Some((t, (e + t * d - x) / r))
            }
            Shape::Triangle([a, b, c]) => {
                let n = (b - a).cross(c - a);
                if n.dot(d) == 0.0 {
                    return None;
                }
                let t = -(n.dot(e) - n.dot(a)) / n.dot(d);
                let p = e + t * d;
                let sides = [(a, b), (b, c), (c, a)].map(|(q, r)| n.dot((r - q).cross(p - q)) >= 0.0);
                (t > least && sides[0] == sides[1] && sides[1] == sides[2]).then(|| (t, n.normalize()))
            }
        }
    }

    fn nearest(things: &[Thing], e: DVec3, d: DVec3, least: f64) -> Option<(f64, DVec3, Thing)> {
        let hits =
            things.iter().filter_map(|thing| hit(&thing.shape, e, d, least).map(|(t, n)| (t, n, *thing)));
        hits.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// A start far enough off the surface for these sizes, and far too near to be seen.
    const OFF: f64 = 1e-7;

    pub fn colour(things: &[Thing], e: DVec3, d: DVec3, bounces: u32) -> Option<[f64; 3]> {
        let (t, n, thing) = nearest(things, e, d, 0.0)?;
        let p = e + t * d;
        let n = if n.dot(d) > 0.0 { -n } else { n };
        let to_light = LIGHT - p;
        let l = to_light.normalize();
        let start = p + OFF * n;
        let mut light = thing.k[0] * AMBIENT;
        let blocked = nearest(things, start, l, 0.0).is_some_and(|(t, ..)| t < to_light.length());
        if n.dot(l) > 0.0 && !blocked {
            let r = 2.0 * n * n.dot(l) - l;
            light += thing.k[1] * n.dot(l) + thing.k[2] * r.dot((e - p).normalize()).max(0.0).powi(16);
        }
        let own = thing.colour.map(|c| (c * light).clamp(0.0, 255.0));
        if bounces == 0 {
            return Some(own);
        }
        let mirrored = d - 2.0 * n * d.dot(n);
        Some(match colour(things, start, mirrored, bounces - 1) {
            Some(seen) => std::array::from_fn(|k| 0.75 * own[k] + 0.25 * seen[k]),
            None => own,
        })
    }
}

#[test]
fn the_assignment_twice() {
    let size = 160;
    let things = report::things();
    for (name, position) in [
        ("view1", DVec3::new(0.0, 0.0, 200.0)),
        ("view2", DVec3::new(0.0, -200.0, 500.0)),
        ("view3", DVec3::new(-300.0, 200.0, 500.0)),
        ("origin", DVec3::ZERO),
    ] {
        let file = common::repository("scenes/assignment.toml");
        let film =
            picture_of(common::picture::load(&file), Some(name), Some([size, size]), PlanSettings::default());
        let w = (position - DVec3::new(-100.0, -300.0, 1216.0)).normalize();
        let u = DVec3::Y.cross(w).normalize();
        let v = w.cross(u);
        let mut off = 0;
        for row in 0..size {
            for column in 0..size {
                let place = |i: u32| (f64::from(i) + 0.5) / f64::from(size) * 1024.0 - 512.0;
                let (x, y) = (place(column), place(size - 1 - row));
                let d = (x * u + y * v - 1000.0 * w).normalize();
                let expected = report::colour(&things, position, d, 1).unwrap_or([0.0; 3]);
                let found = film.pixel(column, row).map(|c| f64::from(c) * 255.0);
                // A ray's direction is rounded to f32, 6e-8 of the distance: on the highlight's slope, steep but a
                // hundred units wide, that stays under 0.01 of 255.
                let differs = found.iter().zip(expected).any(|(f, e)| (f - e).abs() > 0.01);
                off += u32::from(differs);
            }
        }
        // Edges of objects and shadows may fall on either side of a pixel's centre within 1e-4 units: one pixel in
        // 25,600 would be bad luck.
        assert!(off <= 1, "{name}: {off} pixels differ");
    }
}
