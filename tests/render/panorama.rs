//! Panoramic cameras: pictures, their parts and AOVs.

use std::sync::Arc;

use crate::common::picture::parse;
use glam::DVec3;
use kiln::error::Warnings;
use kiln::film::{Film, Window};
use kiln::job::{RenderControl, RenderJob, RenderSettings, prepare};
use kiln::render::aov::{self, AovSelection};
use kiln::scene::{
    Environment, EnvironmentImage, EnvironmentSource, OptionValue, PictureSettings, Projection, Scene,
    Transport,
};

/// A camera at the origin that looks along +x, and a ball of radius 1 below it, in no direction of a pixel of 16 x 8: the
/// lowest ones are 11.25 degrees off the vertical, and the ball is seen under asin(1 / 100) = 0.57 degrees.
const SCENE: &str = "[[camera]]\nposition = [0, 0, 0]\nlook_at = [1, 0, 0]\nprojection = 'panoramic'\n\
    [[sphere]]\ncentre = [0, -100, 0]\nradius = 1\n";

fn job(scene: Scene, settings: &RenderSettings) -> RenderJob {
    prepare(scene, settings, &mut Warnings::default()).expect("a job")
}

/// The picture of an environment is its image: both have +x in the middle, +z to the right of it and +y at the top.
#[test]
fn the_panorama_of_an_environment_is_its_image() {
    let pixels: Vec<[f32; 3]> =
        (0..128u8).map(|i| [f32::from(i), f32::from(i / 16), f32::from(i % 16)]).collect();
    let image = EnvironmentImage { name: "map".into(), width: 16, height: 8, pixels: pixels.clone() };
    let source = EnvironmentSource::Image(Arc::new(image));
    let environment = Some(Environment { source, rotation: 0.0, intensity: 1.0, is_hidden: false });
    let scene = Scene { environment, ..parse(SCENE) };
    let picture = PictureSettings { transport: Some(Transport::Path), ..PictureSettings::of_size([16, 8]) };
    let whole = job(scene.clone(), &picture.into());
    let (film, _): (Film, _) = whole.render(&RenderControl::default()).expect("a picture");
    for (index, (seen, texel)) in film.rows().zip(&pixels).enumerate() {
        let [seen, texel] = [seen, *texel].map(|pixel: [f32; 3]| DVec3::from(pixel.map(f64::from)));
        assert!((seen - texel).abs().max_element() < 1e-3, "pixel {index}: {seen} {texel}");
    }
    // A crop is that part of the whole.
    let crop = Some(Window::parse("9,2,5,4").expect("a window"));
    let part = job(scene, &RenderSettings { crop, ..picture.into() });
    let (part, _): (Film, _) = part.render(&RenderControl::default()).expect("a picture");
    let expected: Vec<[f32; 3]> =
        (2..6).flat_map(|y| (9..14).map(move |x| (x, y))).map(|(x, y)| film.pixel(x, y)).collect();
    assert_eq!(part.rows().collect::<Vec<_>>(), expected);
}

/// Within a ball of radius 2, every pixel has the depth 2. Without a size of its own, a panorama is twice as wide as high.
#[test]
fn all_directions_have_a_depth() {
    let inside = SCENE.replace("[0, -100, 0]\nradius = 1", "[0, 0, 0]\nradius = 2");
    let inside = job(parse(&inside), &PictureSettings::of_size([32, 16]).into());
    let selection = AovSelection::new(&["depth".into()]).expect("a name");
    let depth =
        aov::channels(&inside.aov_source(None), &selection, &RenderControl::default()).expect("depths");
    assert_eq!(depth[0].values.len(), 512);
    assert!(depth[0].values.iter().all(|depth| (depth - 2.0).abs() < 1e-6));
    for (scene, projection) in [
        (parse(SCENE), None),
        (parse(&SCENE.replace("panoramic", "perspective")), Some(Projection::Panoramic)),
    ] {
        let settings = RenderSettings { projection, ..RenderSettings::default() };
        assert_eq!(job(scene, &settings).view.size(), [1024, 512]);
    }
}
