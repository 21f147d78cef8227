//! `kiln explain --pixel`: the numbers of a pixel against the assignment's formulas and against rendered pictures.

use crate::common::picture::parse;
use crate::common::repository;
use assert_cmd::Command;
use glam::DVec3;
use kiln::error::Warnings;
use kiln::film::FilterShape;
use kiln::job::{RenderControl, RenderSettings, prepare};
use kiln::scene::{Clamp, PictureSettings, Samples, Scene, Transport};
use serde_json::Value;

/// Runs the command in the repository, with words separated by white space.
fn kiln(arguments: &str) -> assert_cmd::assert::Assert {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("kiln"));
    command.current_dir(repository(".")).args(arguments.split_whitespace()).assert()
}

fn output(arguments: &str) -> String {
    String::from_utf8_lossy(&kiln(arguments).success().get_output().stdout).into_owned()
}

fn json(scene: &str, [x, y]: [u32; 2]) -> Value {
    serde_json::from_str(&output(&format!("explain {scene} --pixel {x},{y} --json"))).expect("it is JSON")
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is a number"))
}

fn vector(value: &Value) -> DVec3 {
    DVec3::new(number(&value[0]), number(&value[1]), number(&value[2]))
}

fn bytes(value: &Value) -> [u8; 3] {
    [0, 1, 2].map(|channel| u8::try_from(value[channel].as_u64().expect("8 bits")).expect("8 bits"))
}

/// The assignment, from the numbers of its report: an arithmetic of its own in f64.
mod report {
    use super::DVec3;

    pub(crate) const LAMP: DVec3 = DVec3::new(-400.0, 100.0, 850.0);
    const AMBIENT: f64 = 1.1;
    const TP: DVec3 = DVec3::new(-100.0, -200.0, 1216.0);
    const BP: [DVec3; 3] = [
        DVec3::new(0.0, -600.0, 1250.0),
        DVec3::new(-100.0, -600.0, 1150.0),
        DVec3::new(-200.0, -600.0, 1250.0),
    ];

    pub(crate) struct Object {
        pub(crate) name: &'static str,
        pub(crate) colour: [f64; 3],
        k: [f64; 3],
    }

    pub(crate) const OBJECTS: [Object; 4] = [
        Object { name: "left sphere", colour: [124.0, 10.0, 2.0], k: [1.0, 1.0, 4.0] },
        Object { name: "right sphere", colour: [25.0, 25.0, 112.0], k: [1.0, 1.0, 3.0] },
        Object { name: "plane", colour: [156.0, 181.0, 203.0], k: [1.0, 0.2, 0.2] },
        Object { name: "tetrahedron", colour: [128.0, 0.0, 128.0], k: [1.0, 1.0, 2.0] },
    ];

    enum Shape {
        Sphere(DVec3, f64),
        Triangle([DVec3; 3]),
    }

    /// Each primitive with the index of its object.
    fn primitives() -> Vec<(Shape, usize)> {
        let [a, b, c] = BP;
        let plane = [[-10000.0, -10000.0], [-10000.0, 100_000.0], [10000.0, -10000.0]];
        let mut all = vec![
            (Shape::Sphere(DVec3::new(-300.0, -425.0, 1200.0), 75.0), 0),
            (Shape::Sphere(DVec3::new(100.0, -400.0, 1350.0), 100.0), 1),
            (Shape::Triangle(plane.map(|[x, z]| DVec3::new(x, -500.0, z))), 2),
        ];
        let faces = [[a, b, c], [a, b, TP], [b, c, TP], [a, c, TP]];
        all.extend(faces.map(|face| (Shape::Triangle(face), 3)));
        all
    }

    /// The nearest hit of a ray that leaves the primitive `from`, to which it cannot return, since all are flat or convex:
    /// t, primitive, object and the normal on the side of the ray.
    fn hit(e: DVec3, d: DVec3, from: Option<usize>) -> Option<(f64, usize, usize, DVec3)> {
        let mut nearest: Option<(f64, usize, usize, DVec3)> = None;
        for (index, (shape, object)) in primitives().into_iter().enumerate() {
            if from == Some(index) {
                continue;
            }
            let found = match shape {
                Shape::Sphere(centre, radius) => {
                    let x = e - centre;
                    let discriminant = d.dot(x).powi(2) - (x.dot(x) - radius * radius);
                    let t = -d.dot(x) - discriminant.sqrt();
                    (discriminant >= 0.0 && t > 0.0).then(|| (t, (x + d * t) / radius))
                }
                Shape::Triangle([a, b, c]) => {
                    let n = (b - a).cross(c - a).normalize();
                    let t = -(n.dot(e) - n.dot(a)) / n.dot(d);
                    let p = e + d * t;
                    let sides = [(a, b), (b, c), (c, a)].map(|(a, b)| n.dot((b - a).cross(p - a)));
                    let is_inside = sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0);
                    (t >= 0.0 && is_inside).then_some((t, n))
                }
            };
            if let Some((t, n)) = found.filter(|(t, _)| nearest.is_none_or(|nearest| *t < nearest.0)) {
                nearest = Some((t, index, object, if n.dot(d) > 0.0 { -n } else { n }));
            }
        }
        nearest
    }

    /// A shaded point.
    pub(crate) struct Point {
        pub(crate) t: f64,
        pub(crate) object: usize,
        primitive: usize,
        pub(crate) position: DVec3,
        pub(crate) normal: DVec3,
        pub(crate) ambient: f64,
        pub(crate) diffuse: f64,
        pub(crate) specular: f64,
        /// The object in the light's way.
        pub(crate) blocked: Option<usize>,
        /// Whether the light is above the horizon.
        pub(crate) is_lit: bool,
    }

    impl Point {
        pub(crate) fn light(&self) -> f64 {
            self.ambient + self.diffuse + self.specular
        }

        /// C (L_a + L_d + L_s), clamped to 0..255.
        pub(crate) fn colour(&self) -> [f64; 3] {
            OBJECTS[self.object].colour.map(|c| (c * self.light()).min(255.0))
        }
    }

    fn shade(e: DVec3, d: DVec3, from: Option<usize>) -> Option<Point> {
        let (t, primitive, object, normal) = hit(e, d, from)?;
        let position = e + d * t;
        let [ka, kd, ks] = OBJECTS[object].k;
        let to_lamp = (LAMP - position).normalize();
        let cosine = normal.dot(to_lamp);
        let in_way = hit(position, to_lamp, Some(primitive)).filter(|_| cosine > 0.0);
        let in_way = in_way.filter(|(t, ..)| *t < LAMP.distance(position)).map(|(_, _, object, _)| object);
        let (mut diffuse, mut specular) = (0.0, 0.0);
        if cosine > 0.0 && in_way.is_none() {
            let reflected = 2.0 * normal * cosine - to_lamp;
            diffuse = kd * cosine;
            specular = ks * reflected.dot((e - position).normalize()).max(0.0).powi(16);
        }
        let (ambient, is_lit) = (ka * AMBIENT, cosine > 0.0);
        Some(Point {
            t,
            object,
            primitive,
            position,
            normal,
            ambient,
            diffuse,
            specular,
            blocked: in_way,
            is_lit,
        })
    }

    /// The point that a pixel of view 2 shows, and the one that is mirrored in it.
    pub(crate) fn pixel([x, y]: [u32; 2]) -> (Point, Option<Point>) {
        let (eye, target) = (DVec3::new(0.0, -200.0, 500.0), TP - DVec3::new(0.0, 100.0, 0.0));
        let w = (eye - target).normalize();
        let u = DVec3::Y.cross(w).normalize();
        let v = w.cross(u);
        // j counts from the bottom row.
        let (i, j) = (f64::from(x), f64::from(1023 - y));
        let d = ((i + 0.5 - 512.0) * u + (j + 0.5 - 512.0) * v - 1000.0 * w).normalize();
        let point = shade(eye, d, None).expect("the pixel shows something");
        let mirrored = d - 2.0 * point.normal * d.dot(point.normal);
        let found = shade(point.position, mirrored, Some(point.primitive));
        (point, found)
    }
}

/// Three pixels of view 2, and the one beside the last: the plane in the shadow of the left sphere, which is mirrored
/// in it; the right sphere with its highlight and the mirrored tetrahedron; both sides of the tetrahedron's front edge.
const PIXELS: [[u32; 2]; 4] = [[790, 780], [320, 604], [519, 700], [518, 700]];

/// Rays of the default tier are rounded to f32: 2^-24 of t of some 800 is 5e-5 of lengths of 1 to 100 across them.
const TOLERANCE: f64 = 1e-4;

fn near(found: f64, expected: f64, what: &str) {
    assert!(
        (found - expected).abs() <= TOLERANCE * expected.abs().max(0.01),
        "{what}: {found}, expected {expected}"
    );
}

/// Compares a ray and its shading with the report's.
fn compare(ray: &Value, expected: &report::Point, what: &str) {
    let object = &report::OBJECTS[expected.object];
    let (hit, local) = (&ray["hit"], &ray["local"]);
    assert_eq!(hit["object"], object.name, "{what}");
    near(number(&hit["t"]), expected.t, "t");
    let moved = vector(&hit["position"]).distance(expected.position);
    assert!(moved < TOLERANCE * expected.t, "{what}: {moved}");
    assert!(vector(&hit["shading_normal"]).distance(expected.normal) < TOLERANCE, "{what}");
    let term = |name: &str| {
        let term = local["terms"].as_array().expect("terms").iter().find(|term| term["name"] == name);
        term.map_or(0.0, |term| number(&term["value"][0]))
    };
    near(term("L_a"), expected.ambient, "L_a");
    near(term("L_d"), expected.diffuse, "L_d");
    near(term("L_s"), expected.specular, "L_s");
    near(number(&local["light"][0]), expected.light(), "L");
    let shadow = ray["shadow_rays"].as_array().expect("shadow rays");
    assert_eq!(shadow.len(), usize::from(expected.is_lit), "{what}: a shadow ray above the horizon");
    if let Some(shadow) = shadow.first() {
        assert_eq!(shadow["light"], "lamp");
        assert_eq!(shadow["is_occluded"], expected.blocked.is_some(), "{what}");
        let occluder = expected.blocked.map(|object| report::OBJECTS[object].name);
        assert_eq!(shadow["occluder"]["object"].as_str(), occluder, "{what}");
    }
}

#[test]
fn pixels_of_the_assignment_are_those_of_its_formulas() {
    // Pixels that show what they are meant to.
    let (floor, mirrored) = report::pixel(PIXELS[0]);
    assert_eq!((floor.object, floor.blocked, mirrored.map(|m| m.object)), (2, Some(0), Some(0)));
    // Only L_a: 1.1 x (156, 181, 203), and of the sphere's dark side 1.1 x (124, 10, 2).
    assert_eq!(floor.light(), 1.1);
    let (sphere, mirrored) = report::pixel(PIXELS[1]);
    assert!(sphere.object == 1 && sphere.specular > 0.1 && mirrored.is_some_and(|m| m.object == 3));
    let normals = [PIXELS[2], PIXELS[3]].map(|pixel| report::pixel(pixel).0.normal);
    assert!(normals[0].dot(normals[1]) < 0.9, "two faces meet between the pixels");
    for pixel in PIXELS {
        let (point, mirrored) = report::pixel(pixel);
        let what = format!("{pixel:?}");
        let found = json("scenes/assignment.toml", pixel);
        let rays = found["samples"][0]["rays"].as_array().expect("rays");
        assert_eq!(
            (rays[0]["kind"].as_str(), rays[1]["kind"].as_str()),
            (Some("primary"), Some("glaze")),
            "{what}"
        );
        compare(&rays[0], &point, &what);
        let (own, local) = (point.colour(), &rays[0]["local"]);
        let shown = match &mirrored {
            Some(mirrored) => {
                compare(&rays[1], mirrored, &what);
                // weighted_combine(C_P, C_I, 0.75, 0.25)
                let blend = |channel: usize| 0.75 * own[channel] + 0.25 * mirrored.colour()[channel];
                (0..3).for_each(|c| {
                    near(number(&local["glaze"]["mirrored"][c]) * 255.0, mirrored.colour()[c], "C_I");
                });
                [0, 1, 2].map(blend)
            }
            None => {
                assert!(local["glaze"].is_null() && rays[1]["hit"].is_null(), "{what}: nothing is mirrored");
                own
            }
        };
        (0..3).for_each(|c| near(number(&local["colour"][c]) * 255.0, own[c], "C_P"));
        // The pipeline rounds once, halves up.
        assert_eq!(bytes(&found["displayed"]), shown.map(|c| (c + 0.5).floor() as u8), "{what}");

        // In 8 bits, each step is rounded, those of the mirrored colour, too.
        let found = json("scenes/assignment.toml --colour u8", pixel);
        let steps = &found["samples"][0]["rays"][0]["local"]["steps_8_bit"];
        let round = |c: [f64; 3]| c.map(|c| (c + 0.5).floor());
        let own = round(own);
        let shown = mirrored.as_ref().map_or(own, |mirrored| {
            let mirrored = round(mirrored.colour());
            assert_eq!(bytes(&steps["mirrored"]), mirrored.map(|c| c as u8), "{what}");
            round([0, 1, 2].map(|c| 0.75 * own[c] + 0.25 * mirrored[c]))
        });
        assert_eq!(bytes(&steps["own"]), report::OBJECTS[point.object].colour.map(|c| c as u8), "{what}");
        assert_eq!(bytes(&steps["colour"]), own.map(|c| c as u8), "{what}");
        assert_eq!(bytes(&found["displayed"]), shown.map(|c| c as u8), "{what}");
    }
}

/// `displayed` is the pixel of the file that `kiln render` writes.
#[test]
fn displayed_values_are_those_of_the_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let glass = folder.path().join("glass.toml");
    std::fs::write(&glass, GLASS).expect("a scene");
    let glass = glass.display().to_string();
    let cases: &[(&str, [[u32; 2]; 3])] = &[
        ("scenes/assignment.toml --size 96x96", [[74, 73], [30, 57], [48, 66]]),
        ("scenes/assignment.toml --size 96x96 --colour u8", [[74, 73], [30, 57], [48, 66]]),
        ("scenes/assignment.toml --size 96x96 --colour linear --samples 4", [[74, 73], [30, 57], [48, 40]]),
        (
            "scenes/assignment.toml --projection orthographic --crop 400,500,64,48",
            [[400, 500], [463, 547], [430, 520]],
        ),
        (&format!("{glass} --samples 8"), [[20, 20], [31, 24], [5, 40]]),
        ("scenes/effects/textures.toml --size 64x48", [[20, 30], [33, 20], [50, 40]]),
        ("assets/import/square.gltf --size 48x48 --samples 4", [[24, 24], [30, 20], [0, 0]]),
        ("assets/import/tetrahedron.stl --size 48x48 --background transparent", [[24, 24], [17, 29], [0, 0]]),
        ("scenes/effects/alpha.toml --size 64x48", [[30, 20], [40, 30], [18, 26]]),
        ("scenes/effects/alpha.toml --size 64x48 --samples 4", [[30, 20], [40, 30], [18, 26]]),
        ("scenes/effects/depth-of-field.toml --size 48x32 --samples 80", [[20, 16], [30, 20], [8, 25]]),
        ("scenes/effects/adaptive.toml --size 72x48 --samples 32", [[20, 30], [36, 30], [10, 44]]),
        (
            "scenes/effects/path.toml --size 40x40 --samples 70 --tone-map agx --exposure 1",
            [[20, 20], [10, 35], [30, 8]],
        ),
        (
            "scenes/assignment.toml --size 40x40 --environment sky --samples 5 --filter mitchell",
            [[20, 33], [9, 2], [13, 24]],
        ),
        ("scenes/effects/soft-shadows.toml --size 40x40", [[20, 33], [9, 2], [13, 24]]),
        ("scenes/effects/ambient-occlusion.toml --size 40x40", [[20, 33], [9, 2], [13, 24]]),
        ("scenes/effects/normal-maps.toml --size 40x30", [[20, 23], [9, 12], [13, 14]]),
    ];
    for (scene, pixels) in cases {
        let file = folder.path().join("picture.png");
        output(&format!("render {scene} -o {}", file.display()));
        let picture = image::open(&file).expect("a picture").into_rgba8();
        // Pixels count from the corner of the whole picture, those of the file from that of the crop.
        let crop = if scene.contains("--crop") { [400, 500] } else { [0, 0] };
        for &[x, y] in pixels {
            let found = json(scene, [x, y]);
            let [r, g, b, alpha] = picture.get_pixel(x - crop[0], y - crop[1]).0;
            assert_eq!(bytes(&found["displayed"]), [r, g, b], "{scene}: {x}, {y}");
            assert_eq!(found["alpha"].as_u64().unwrap_or(255), u64::from(alpha), "{scene}: {x}, {y}");
        }
    }
}

/// A ball of glass and a matt one between a lamp and a floor, in a dim environment.
const GLASS: &str = "[image]\nwidth = 48\nheight = 48\ntransport = 'path'\n\
    [environment]\ncolour = '#405060'\n\
    [[camera]]\nposition = [0, 1.2, 4]\nlook_at = [0, 0.5, 0]\nvertical_fov = 40\n\
    [[light]]\ntype = 'rectangle'\nposition = [0, 3, 0]\nsize = [1, 1]\ndirection = [0, -1, 0]\nintensity = 6\n\
    [material.glass]\ncolour = '#ffffff'\nmetallic = 0\nroughness = 0\n\
    layers = { transmission = 1, volume = true, ior = 1.5 }\n\
    [material.matt]\ncolour = '#c08040'\n\
    [[sphere]]\ncentre = [-0.5, 0.5, 0]\nradius = 0.5\nmaterial = 'glass'\n\
    [[sphere]]\ncentre = [0.7, 0.4, -0.2]\nradius = 0.4\nmaterial = 'matt'\n\
    [[disk]]\ncentre = [0, 0, 0]\nnormal = [0, 1, 0]\nradius = 4\nmaterial = 'matt'\n";

/// What the paths of a sample add, in the order in which the renderer sums it.
fn sum_of_path(sample: &Value) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for ray in sample["rays"].as_array().expect("rays") {
        let path = &ray["path"];
        if !path["emission"].is_null() {
            sum += vector(&path["emission"]["adds"]);
        }
        for light in path["light_samples"].as_array().expect("light samples") {
            sum += vector(&light["adds"]);
        }
    }
    sum
}

/// A path's products are those of its factors, up to rounding.
fn check_factors(sample: &Value, clamps: bool) {
    let close = |a: DVec3, b: DVec3, what: &str| {
        let error = (a - b).abs().max_element();
        assert!(error <= 1e-12 * b.abs().max_element(), "{what}: {a} {b}");
    };
    let rays = sample["rays"].as_array().expect("rays");
    for ray in rays.iter().filter(|ray| !ray["hit"].is_null()) {
        let path = &ray["path"];
        let throughput = vector(&path["throughput"]);
        for light in path["light_samples"].as_array().expect("light samples").iter().filter(|_| !clamps) {
            let product =
                throughput * vector(&light["bsdf"]) * vector(&light["radiance"]) * number(&light["weight"]);
            // Lights without size have no density, and no transmittance is in the way here.
            let expected = light["pdf"].as_f64().map_or(product, |pdf| product / pdf);
            close(vector(&light["if_visible"]), expected, "light sample");
            // Nothing before the lights transmits a part.
            let is_occluded = light["shadow_ray"]["is_occluded"].as_bool().expect("whether it is occluded");
            let adds = if is_occluded { DVec3::ZERO } else { vector(&light["if_visible"]) };
            assert_eq!(vector(&light["adds"]), adds);
        }
        let bsdf = &path["bsdf_sample"];
        if let (Some(_), false) = (bsdf["throughput"].as_array(), bsdf["sample"].is_null()) {
            let survival = bsdf["roulette"]["probability"].as_f64().unwrap_or(1.0);
            close(
                vector(&bsdf["throughput"]),
                throughput * vector(&bsdf["sample"]["weight"]) / survival,
                "BSDF",
            );
        }
    }
}

fn job_of(scene: Scene, change: impl FnOnce(&mut PictureSettings)) -> kiln::job::RenderJob {
    let mut picture = PictureSettings::default();
    change(&mut picture);
    prepare(scene, &RenderSettings::from(picture), &mut Warnings::default()).expect("a job")
}

/// The pixel is the mean of its samples, each of them the sum of what its path adds, to the bit.
#[test]
fn a_pixel_of_paths_is_the_sum_of_what_its_report_lists() {
    let mut bounces = 0;
    for (filter, clamp) in [(FilterShape::Box, None), (FilterShape::Mitchell, Some(0.5))] {
        let job = job_of(parse(GLASS), |picture| {
            picture.samples = Some(Samples::clamped(24));
            picture.filter = Some(filter);
            picture.clamp = clamp.map(Clamp::clamped);
            picture.transport = Some(Transport::Path);
        });
        let control = RenderControl::default();
        let (film, _) = job.render::<[f32; 3]>(&control).expect("a picture");
        for pixel in [[14, 26], [31, 24], [17, 30], [24, 40], [33, 12]] {
            let report = job.explain_pixel(pixel, 0, &control).expect("a report");
            let report = serde_json::to_value(&report).expect("JSON");
            let samples = report["samples"].as_array().expect("samples");
            assert_eq!((samples.len(), report["samples_left_out"].as_u64()), (24, Some(0)));
            let (mut sum, mut negative, mut signs) = (DVec3::ZERO, DVec3::ZERO, 0.0);
            for sample in samples {
                let radiance = sum_of_path(sample).as_vec3();
                assert_eq!(
                    radiance.as_dvec3(),
                    vector(&sample["colour"]),
                    "{pixel:?}: sample {}",
                    sample["index"]
                );
                check_factors(sample, clamp.is_some());
                let weight = number(&sample["weight"]);
                sum += radiance.as_dvec3();
                if weight < 0.0 {
                    negative += radiance.as_dvec3();
                }
                signs += weight;
                bounces = bounces.max(sample["rays"].as_array().expect("rays").len());
            }
            // Samples are distributed as the filter: their mean, plus what the signs of negative lobes add.
            let (count, mean) = (samples.len() as f64, sum / samples.len() as f64);
            let value = match filter {
                FilterShape::Box => mean,
                _ => {
                    let mean_sign = number(&report["filter"]["mean_sign"]);
                    mean + (sum - 2.0 * negative - mean * signs) / (count * mean_sign)
                }
            };
            let shown: [f32; 3] = film.pixel(pixel[0], pixel[1]);
            assert_eq!(value.as_vec3().to_array(), shown, "{pixel:?}");
            assert_eq!(vector(&report["colour"]["film"]), DVec3::from(shown.map(f64::from)));
        }
    }
    assert!(bounces > 3, "paths through glass have several vertices, not {bounces}");
}

/// What a light sample adds is attenuated by the transparent surfaces before the light.
#[test]
fn light_samples_behind_transparent_surfaces_add_what_passes() {
    let scene = kiln::import::load(&[repository("scenes/effects/alpha.toml")], &mut Warnings::default());
    let job = job_of(scene.expect("a scene"), |picture| {
        *picture = PictureSettings {
            transport: Some(Transport::Path),
            samples: Some(Samples::clamped(16)),
            ..PictureSettings::of_size([64, 48])
        };
    });
    let mut attenuated = 0;
    for pixel in [[30, 40], [20, 38], [36, 36], [44, 40], [26, 44]] {
        let report = job.explain_pixel(pixel, 0, &RenderControl::default()).expect("a report");
        for sample in serde_json::to_value(&report).expect("JSON")["samples"].as_array().expect("samples") {
            let radiance = sum_of_path(sample).as_vec3().as_dvec3();
            assert_eq!(radiance, vector(&sample["colour"]), "{pixel:?}: sample {}", sample["index"]);
        }
        let rays = report.samples.iter().flat_map(|sample| &sample.rays).filter_map(|ray| ray.path.as_ref());
        let lights = rays.flat_map(|path| &path.light_samples);
        attenuated += lights.filter(|l| l.adds != DVec3::ZERO && l.adds != l.if_visible).count();
    }
    assert!(attenuated > 10, "{attenuated} light samples behind transparent surfaces");
}

/// Local shading and layers: samples are the blended colours of their camera rays, to the bit, and layers add up.
#[test]
fn a_shaded_pixel_is_the_sum_of_its_layers() {
    let scene = kiln::import::load(&[repository("scenes/effects/alpha.toml")], &mut Warnings::default());
    let job = job_of(scene.expect("a scene"), |picture| *picture = PictureSettings::of_size([64, 48]));
    let control = RenderControl::default();
    let (film, _) = job.render::<[f32; 3]>(&control).expect("a picture");
    let mut most = 0;
    for pixel in [[30, 20], [32, 24], [40, 30], [18, 26], [25, 28]] {
        let report =
            serde_json::to_value(job.explain_pixel(pixel, 0, &control).expect("a report")).expect("JSON");
        let layers = report["samples"].as_array().expect("layers");
        let mut sum = DVec3::ZERO;
        for layer in layers {
            let weight = number(&layer["layer"]["transmittance"]) * number(&layer["layer"]["opacity"]);
            sum += weight * vector(&layer["colour"]);
            let local = &layer["rays"][0]["local"];
            if !local.is_null() {
                assert_eq!(vector(&layer["colour"]), vector(&local["colour"]).as_vec3().as_dvec3());
            }
        }
        assert_eq!(sum.as_vec3().to_array(), film.pixel(pixel[0], pixel[1]), "{pixel:?}");
        most = most.max(layers.len());
    }
    assert!(most > 2, "several layers, not {most}");
}

/// Of many samples the first 64 are listed, or those from `--sample` on, and the report says how many are not.
#[test]
fn long_lists_of_samples_are_cut_off() {
    let scene = "scenes/effects/path.toml --size 16x16 --samples 100";
    for (option, first, listed) in [("", 0, 64), ("--sample 90", 90, 10)] {
        let found = json(&format!("{scene} {option}"), [8, 8]);
        let samples = found["samples"].as_array().expect("samples");
        assert_eq!((samples.len(), samples[0]["index"].as_u64()), (listed, Some(first)));
        assert_eq!((&found["samples_taken"], &found["schema"]), (&100.into(), &2.into()));
        assert_eq!(found["samples_left_out"], 100 - listed);
    }
    let text = output(&format!("explain {scene} --pixel 8,8 --sample 90"));
    assert!(
        text.contains("sample 90 of 100") && text.lines().all(|line| line.chars().count() <= 100),
        "{text}"
    );
}

/// Text of the assignment's pixels: short lines, with the terms by their names.
#[test]
fn text_names_the_terms() {
    for pixel in PIXELS {
        let [x, y] = pixel;
        let text = output(&format!("explain scenes/assignment.toml --pixel {x},{y}"));
        assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
        let shown =
            bytes(&json("scenes/assignment.toml", pixel)["displayed"]).map(|c| c.to_string()).join(" ");
        assert!(
            text.starts_with(&format!("pixel {x},{y} of 1024 x 1024, from the top left: {shown}\n")),
            "{text}"
        );
        for label in [
            "  L_a  ",
            "  C_P = C L  ",
            "  distance t  ",
            "  normal N  ",
            "glaze ray, bounce 1",
            "  displayed  ",
        ] {
            assert!(text.contains(label), "{label:?} is not in\n{text}");
        }
    }
    // A path on a smooth mesh: the test of the lifted point, then the shadow ray to a light infinitely far away.
    let text = output("explain scenes/effects/terminator.toml --transport path --pixel 140,100");
    let ray = |label| text.lines().find_map(|line| line.trim_start().strip_prefix(label)).map(str::trim);
    assert_eq!(ray("shadow ray"), Some("unoccluded"));
    assert!(ray("terminator ray").is_some_and(|result| result.starts_with("unoccluded over ")), "{text}");
}

/// Lines stay short with coloured lights and long names.
#[test]
fn lines_are_short() {
    for (scene, [x, y]) in [
        ("scenes/sunflower.toml --size 64x48", [32, 24]),
        ("scenes/effects/adaptive.toml --filter mitchell --size 72x48", [20, 30]),
        ("scenes/effects/soft-shadows.toml --size 40x40", [20, 33]),
        ("assets/import/tetrahedron.stl --size 48x48 --background transparent", [24, 24]),
    ] {
        let text = output(&format!("explain {scene} --pixel {x},{y}"));
        assert!(text.lines().all(|line| line.chars().count() <= 100), "{scene}: {text}");
    }
}

/// The text on the page is that of the command.
#[test]
fn the_page_shows_what_the_command_prints() {
    let page = std::fs::read_to_string(repository("docs/assignment.md")).expect("the page");
    let section = page.split("## One pixel").nth(1).expect("a section");
    let command = section.split("`kiln ").nth(1).and_then(|rest| rest.split('`').next()).expect("a command");
    let text =
        section.split("```text\n").nth(1).and_then(|rest| rest.split("```").next()).expect("its output");
    assert_eq!(output(command), text);
}

/// Positions and lengths are in scene coordinates, also where the scene was moved for precision.
#[test]
fn a_recentred_scene_is_told_in_its_own_coordinates() {
    let scene = parse(
        "[image]\nwidth = 5\nheight = 5\n[[camera]]\nposition = [1e6, 0, 1000010]\nlook_at = [1e6, 0, 1e6]\n\
         vertical_fov = 10\n[[light]]\ntype = 'point'\nposition = [1e6, 0, 1000009]\n[[sphere]]\ncentre = [1e6, 0, 1e6]\n\
         radius = 2\n",
    );
    let job = job_of(scene, |_| ());
    assert!(job.recentering.is_some());
    let report = job.explain_pixel([2, 2], 0, &RenderControl::default()).expect("a report");
    let ray = &report.samples[0].rays[0];
    let hit = ray.hit.as_ref().expect("a hit");
    // From 10 in front of the centre to the sphere of radius 2.
    assert!((hit.t - 8.0).abs() < 1e-6 && (ray.origin - DVec3::new(1e6, 0.0, 1_000_010.0)).length() < 1e-6);
    assert!((hit.position - DVec3::new(1e6, 0.0, 1_000_002.0)).length() < 1e-6, "{}", hit.position);
    // The light is 7 before the surface.
    assert!((ray.shadow_rays[0].length - 7.0).abs() < 1e-4, "{}", ray.shadow_rays[0].length);
}

#[test]
fn mistakes_are_told_in_a_line() {
    for (arguments, expected) in [
        (
            "--size 64x48 --pixel 64,3",
            "--pixel 64,3: outside the picture, which has columns 0 to 63 and rows 0 to 47",
        ),
        ("--size 64x48 --pixel 3,48", "outside the picture"),
        ("--crop 10,20,30,40 --pixel 9,20", "which has columns 10 to 39 and rows 20 to 59"),
        ("--pixel 4", "give column and row, from 0, as X,Y, such as 400,300"),
        ("--pixel -1,4", "give column and row"),
        ("--pixel 1,2,3", "give column and row"),
        ("--pixel 1,2 --measure", "--measure"),
        ("--pixel 1,2 --sample 1", "--sample 1: the pixel has 1 sample(s)"),
        ("--sample 1", "--pixel"),
        ("--pixel 1,2 --frames 3", "--frames"),
    ] {
        let run = kiln(&format!("explain scenes/assignment.toml {arguments}")).code(2);
        let said = String::from_utf8_lossy(&run.get_output().stderr).into_owned();
        assert!(said.contains(expected), "{arguments}: {said}");
        assert!(run.get_output().stdout.is_empty() && said.lines().count() <= 3, "{arguments}: {said}");
    }
}
