//! Path tracing where it is numerically hard: nested indices of refraction, stacked thin walls, media, scales, and closed
//! rooms in a bright environment. `KILN_HARD_FACTOR` multiplies the samples: 10^9 in all take a factor of 1,000.

use std::fmt::Write as _;

use glam::{DMat3, DQuat, DVec3};
use kiln::film::{Window, non_finite};
use kiln::job;
use kiln::render::RenderControl;
use kiln::scene::{Numerics, PictureSettings, Samples};

use crate::common::Numbers;
use crate::common::hard::times_factor;
use crate::common::picture::parse;

/// Width and height of the pictures.
const SIZE: u32 = 64;

/// Samples a pixel: of the six scenes of materials, 2^20 samples in all.
const SAMPLES: usize = 43;

/// The beginning of a scene that is path traced: picture and camera.
fn head(position: [f64; 3], look_at: [f64; 3], fov: f64) -> String {
    format!(
        "[image]\nwidth = {SIZE}\nheight = {SIZE}\ncolour = 'linear'\ntransport = 'path'\nbackground = '#000000'\n\
         [[camera]]\nposition = {position:?}\nlook_at = {look_at:?}\nvertical_fov = {fov}\n"
    )
}

/// The pixels of a scene file, path traced.
fn pixels(toml: &str, numerics: Numerics, samples: usize) -> Vec<[f32; 3]> {
    let samples = Some(Samples::clamped(samples as u32));
    let settings = PictureSettings { numerics: Some(numerics), samples, ..Default::default() }.into();
    let job = job::prepare(parse(toml), &settings, &mut kiln::error::Warnings::default()).expect("a job");
    let (film, statistics) = job.render::<[f32; 3]>(&RenderControl::default()).expect("a picture");
    assert_eq!((statistics.non_finite.len(), statistics.discarded_samples), (0, 0));
    film.rows().collect()
}

fn assert_finite(toml: &str) {
    let pixels = pixels(toml, Numerics::default(), times_factor(SAMPLES));
    let window = Window { x: 0, y: 0, width: SIZE, height: SIZE };
    assert_eq!(non_finite(window, &pixels), []);
    assert!(pixels.iter().flatten().all(|&value| value >= 0.0));
    assert!(pixels.iter().flatten().any(|&value| value > 0.0), "the picture is black");
}

/// Spheres of 9 indices and 8 roughnesses, nested in each other, with and without a medium.
#[test]
fn nested_indices_of_refraction() {
    let mut toml = head([0.0, 8.0, 16.0], [0.0, 0.0, 0.0], 45.0) + "[environment]\nsky = true\n";
    let indices = ["0", "1", "1.0000001", "1.0001", "1.33", "1.5", "2.4", "10", "1e6"];
    let roughness = [0.0, 0.005, 0.0101, 0.02, 0.1, 0.5, 0.9, 1.0];
    for (i, index) in indices.iter().enumerate() {
        for (j, rough) in roughness.iter().enumerate() {
            for (thin, volume) in [", volume = true", ""].iter().enumerate() {
                let (x, y, z) = (i as f64 - 4.0, 0.45 + 0.85 * thin as f64, j as f64 - 3.5);
                let inner = format!("m{}_{}_0", (i + 3) % indices.len(), (j + 2) % roughness.len());
                write!(
                    toml,
                    "[material.m{i}_{j}_{thin}]\ncolour = '#f0e0ff'\nroughness = {rough}\n\
                     layers = {{ transmission = 1, ior = {index}{volume} }}\n\
                     [[sphere]]\nmaterial = 'm{i}_{j}_{thin}'\ncentre = [{x}, {y}, {z}]\nradius = 0.4\n\
                     [[sphere]]\nmaterial = '{inner}'\ncentre = [{x}, {y}, {z}]\nradius = 0.2\n"
                )
                .unwrap();
            }
        }
    }
    assert_finite(&(toml + "[[light]]\ntype = 'sphere'\nposition = [4, 6, 2]\nradius = 0.01\n"));
}

/// Stacks of thin walls with coats, sheen, opacity and tints, pairs of which lie in one plane or nearly.
#[test]
fn sunglasses() {
    let mut toml = head([0.0, 0.5, 6.0], [0.0, 0.0, 0.0], 40.0) + "[environment]\nsky = true\n";
    for k in 0..24 {
        let z = [0.5, 0.5 + 1e-7, 0.5 + 1e-5][k % 3] - 0.2 * (k / 3) as f64;
        write!(
            toml,
            "[material.s{k}]\ncolour = '{}'\nroughness = {}\nopacity = {}\n\
             layers = {{ transmission = {}, ior = {}, clearcoat = {}, sheen_colour = '#ff8080', sheen_roughness = 0.001 }}\n\
             [[triangles]]\nmaterial = 's{k}'\nvertices = [[-2, -1, {z}], [2, -1, {z}], [2, 1, {z}], [-2, 1, {z}]]\n\
             indices = [[0, 1, 2], [0, 2, 3]]\n",
            ["#101010", "#20ff20", "#ffffff", "#000000"][k % 4],
            [0.0, 0.05, 0.4, 1.0][k % 4],
            [1.0, 0.7, 0.01][k % 3],
            [1.0, 0.5][k % 2],
            [1.5, 1.0, 3.0][k % 3],
            k % 2,
        )
        .unwrap();
    }
    toml += "[material.b]\ncolour = '#c08040'\nmetallic = 1\nroughness = 0.02\n\
             [[sphere]]\nmaterial = 'b'\ncentre = [0, 0, -3]\nradius = 1\n\
             [[light]]\ntype = 'rectangle'\nposition = [0, 2, 2]\nlook_at = [0, 0, 0]\nsize = [1, 0.5]\n";
    assert_finite(&toml);
}

/// Overlapping media that absorb within 1e-30 units, or hardly at all, in scenes of 1e-9 and 1e12 units.
#[test]
fn media_at_any_scale() {
    for scale in [1e-9, 1.0, 1e12] {
        let mut toml = head([0.0, 2.0 * scale, 6.0 * scale], [0.0; 3], 40.0) + "[environment]\nsky = true\n";
        for k in 0..8 {
            write!(
                toml,
                "[material.v{k}]\ncolour = '#ffffff'\nroughness = {}\nlayers = {{ transmission = 1, ior = {}, volume = true, \
                 attenuation_distance = {:e}, attenuation_colour = '{}' }}\n\
                 [[sphere]]\nmaterial = 'v{k}'\ncentre = [{:e}, 0, {:e}]\nradius = {:e}\n",
                [0.0, 0.2][k % 2],
                [1.3, 1.5, 2.0][k % 3],
                [1e-30, scale * 1e-3, scale, 1e30][k % 4],
                ["#000000", "#ff0000", "#fefefe"][k % 3],
                (k as f64 - 3.5) * scale * 0.6,
                (k % 3) as f64 * scale * 0.5 - 0.5 * scale,
                0.5 * scale,
            )
            .unwrap();
        }
        let (far, low) = (9.0 * scale, -scale);
        write!(
            toml,
            "[[triangles]]\nvertices = [[{0:e}, {1:e}, {0:e}], [{2:e}, {1:e}, {0:e}], [{2:e}, {1:e}, {2:e}]]\n\
             indices = [[0, 1, 2]]\n[[light]]\ntype = 'sphere'\nposition = [0, {3:e}, 0]\nradius = {4:e}\n",
            -far,
            low,
            far,
            3.0 * scale,
            scale * 1e-3
        )
        .unwrap();
        assert_finite(&toml);
    }
}

/// Emission of 1e-30 and 1e30, roughness at the limit of delta lobes, coats on metal, a light of radius 1e-12.
#[test]
fn extreme_emission_and_roughness() {
    let mut toml = head([0.0, 2.0, 6.0], [0.0; 3], 40.0) + "[environment]\nsky = true\n";
    for k in 0..12 {
        let (emission, intensity) =
            if k % 5 == 0 { ("#ffffff", ["1e-30", "1e30", "1"][k % 3]) } else { ("#000000", "1") };
        write!(
            toml,
            "[material.e{k}]\ncolour = '#ffffff'\nmetallic = {}\nroughness = {}\nemission = '{emission}'\n\
             emission_intensity = {intensity}\nlayers = {{ specular = {}, clearcoat = 1, clearcoat_roughness = {} }}\n\
             [[sphere]]\nmaterial = 'e{k}'\ncentre = [{}, {}, 0]\nradius = 0.55\n",
            [0.0, 1.0, 0.5][k % 3],
            [0.0, 1e-6, 0.0101, 1.0][k % 4],
            k % 2,
            k % 2,
            (k % 4) as f64 * 1.2 - 1.8,
            (k / 4) as f64 * 1.2 - 1.2,
        )
        .unwrap();
    }
    assert_finite(&(toml + "[[light]]\ntype = 'sphere'\nposition = [0, 3, 0]\nradius = 1e-12\n"));
}

/// A closed room of a material, 1 to 900 units from the origin, with glass inside and all kinds of light outside.
fn closed_room(numbers: &mut Numbers, case: usize) -> String {
    let turn = if case % 8 < 4 {
        DMat3::IDENTITY
    } else {
        DMat3::from_quat(DQuat::from_axis_angle(numbers.direction(), 6.0 * numbers.unit()))
    };
    let half = DVec3::new(numbers.unit(), numbers.unit(), numbers.unit()) * 3.0 + 1.0;
    let offset = [0.0, 30.0, 300.0, 900.0][case % 4];
    let centre = DVec3::new(offset + numbers.unit(), 3.0 * numbers.unit(), offset + numbers.unit());
    let inside = |p: [f64; 3]| (turn * (DVec3::from(p) * half) + centre).to_array();
    // The camera within the room, or near an edge: farther than the walls are moved where they are stored in f32.
    let near = if offset == 0.0 { 10f64.powi(-2 - (numbers.below(4) as i32)) } else { 1e-3 };
    let (position, look_at) = if case % 2 == 1 {
        (inside([0.6, 0.5, 0.7]), inside([-1.0, -1.0, -0.4]))
    } else {
        (inside([-1.0 + near, -1.0 + 0.8 * near, 0.05]), inside([-1.0, -1.0, 0.05 - 0.3 * near]))
    };
    let corners: Vec<[f64; 3]> =
        (0..8).map(|i| inside([0, 1, 2].map(|axis| if i >> axis & 1 == 1 { 1.0 } else { -1.0 }))).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles: Vec<[usize; 3]> =
        quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    let material = [
        "specular = 0",
        "metallic = 1\nroughness = 0.4",
        "metallic = 1\nroughness = 0",
        "metallic = 0\nroughness = 0.5\nlayers = { clearcoat = 1 }",
    ][case / 2 % 4];
    head(position, look_at, 90.0)
        + &format!(
            "[environment]\ncolour = '#ffffff'\n\
             [[light]]\ntype = 'sphere'\nposition = {:?}\nradius = 0.3\n\
             [[light]]\ntype = 'rectangle'\nposition = {:?}\nlook_at = {:?}\nsize = [1, 1]\n\
             [[light]]\ntype = 'directional'\ndirection = [0.3, -1, 0.2]\nangle = 5\n\
             [[light]]\ntype = 'point'\nposition = {:?}\n\
             [material.walls]\ncolour = '#ffffff'\n{material}\n\
             [[triangles]]\nmaterial = 'walls'\nvertices = {corners:?}\nindices = {triangles:?}\n\
             [material.glass]\ncolour = '#ffffff'\nroughness = {}\n\
             layers = {{ transmission = 1, ior = {}, volume = true }}\n\
             [[sphere]]\nmaterial = 'glass'\ncentre = {:?}\nradius = {}\n",
            inside([3.0, 3.0, 3.0]),
            inside([0.0, 4.0, 0.0]),
            centre.to_array(),
            inside([-1.5, -2.0, 0.4]),
            [0.0, 0.3][case % 2],
            [1.5, 1.0001, 2.4][case % 3],
            inside([0.3, -0.5, 0.3]),
            half.min_element() * 0.2,
        )
}

/// No light enters: neither camera rays, nor scattered and refracted ones, nor shadow rays to any kind of light.
#[test]
fn closed_rooms_stay_dark() {
    let mut numbers = Numbers::new(7);
    for case in 0..16 {
        let toml = closed_room(&mut numbers, case);
        for numerics in [Numerics::Watertight, Numerics::Double, Numerics::Exact] {
            let pixels = pixels(&toml, numerics, times_factor(2));
            let lit = pixels.iter().filter(|pixel| **pixel != [0.0; 3]).count();
            assert_eq!(lit, 0, "case {case}, {numerics:?}");
        }
    }
}

/// The test above sees light: a room without its last wall is lit.
#[test]
fn an_open_room_is_lit() {
    let toml = closed_room(&mut Numbers::new(7), 1);
    let end = toml.find("]]\n[material.glass]").expect("the list of triangles");
    let last = toml[..end].rfind(", [").expect("a last triangle");
    let pixels = pixels(&format!("{}{}", &toml[..last], &toml[end + 1..]), Numerics::Watertight, 8);
    assert!(pixels.iter().any(|pixel| *pixel != [0.0; 3]));
}
