//! The default look: what calls for path tracing, and the exposure of lamps.

use crate::common::picture::parse;
use kiln::animation::{AnimationJob, FrameList, FrameRequest};
use kiln::effects::id;
use kiln::error::Warnings;
use kiln::film::tone::Exposure;
use kiln::film::{ColourPipeline, Film, Window};
use kiln::job::{RenderControl, RenderJob, RenderSettings, prepare};
use kiln::scene::{Look, PictureSettings, Transport};

const GLASS: &str = "[material.glass]\ncolour = '#ffffff'\nlayers = { transmission = 1, volume = true }\nroughness = 0\n\
    [[sphere]]\ncentre = [0, 1, 0]\nradius = 1\nmaterial = 'glass'\n";

/// A closed room of side 2 with a lamp of emission 100 under its ceiling, 0.3 wide, seen from inside.
const ROOM: &str = "[[camera]]\nposition = [0, 0, 0.9]\nlook_at = [0, -0.2, -1]\nvertical_fov = 70\n\
    [material.wall]\ncolour = '#c0b0a0'\n[material.lamp]\ncolour = '#ffffff'\nemission = '#ffffff'\nemission_intensity = 100\n\
    [[triangles]]\nmaterial = 'wall'\nvertices = [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], \
    [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]]\nindices = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7], \
    [0, 4, 7], [0, 7, 3], [1, 5, 6], [1, 6, 2], [0, 1, 5], [0, 5, 4], [3, 2, 6], [3, 6, 7]]\n\
    [[triangles]]\nmaterial = 'lamp'\nvertices = [[-0.15, 0.99, -0.15], [0.15, 0.99, -0.15], [0.15, 0.99, 0.15], \
    [-0.15, 0.99, 0.15]]\nindices = [[0, 1, 2], [0, 2, 3]]\n";

fn job(image: &str, scene: &str, settings: &RenderSettings) -> RenderJob {
    let scene = parse(&format!("[image]\nwidth = 48\nheight = 48\n{image}\n{scene}"));
    prepare(scene, settings, &mut Warnings::default()).expect("a job")
}

/// Whether paths are traced, and why or why not.
fn paths(image: &str, scene: &str, settings: &RenderSettings) -> (bool, String) {
    let decisions = job(image, scene, settings).plan.decisions;
    let decision = decisions.into_iter().find(|decision| decision.effect == id::PATH).expect("an effect");
    (decision.on, decision.why)
}

#[test]
fn glass_and_lamps_call_for_paths_in_the_look() {
    let (studio, none) = ("look = 'studio'", RenderSettings::default());
    let calls = [(GLASS, "transmission of material `glass`"), (ROOM, "emission of material `lamp`")];
    for (scene, call) in calls {
        let (is_on, why) = paths(studio, scene, &none);
        assert!(is_on && why.starts_with(call), "{why}");
    }
    let dim = ROOM.replace("emission_intensity = 100", "emission_intensity = 1");
    let draft = PictureSettings { look: Some(Look::Draft), ..PictureSettings::default() }.into();
    let whitted =
        PictureSettings { transport: Some(Transport::Whitted), ..PictureSettings::default() }.into();
    let without = RenderSettings { without: vec!["path".into()], ..RenderSettings::default() };
    for (image, scene, settings) in [
        ("", GLASS, &none),
        ("", ROOM, &none),
        (studio, &dim, &none),
        (studio, GLASS, &draft),
        (studio, ROOM, &whitted),
        (studio, GLASS, &without),
    ] {
        let (is_on, why) = paths(image, scene, settings);
        assert!(!is_on, "{image}: {why}");
    }
}

/// From inside a closed room, lit by a lamp or dark, the picture is neither black nor clipped.
#[test]
fn rooms_are_exposed() {
    let dark = ROOM.replace("emission_intensity = 100", "emission_intensity = 0");
    for scene in [ROOM, &dark] {
        let job = job("look = 'studio'", scene, &RenderSettings::default());
        let Some(Exposure::Ev(_)) = job.settings.picture.exposure else { panic!("an exposure") };
        let (film, _): (Film<[u8; 3]>, _) = job.render(&RenderControl::default()).expect("a picture");
        let values: Vec<f64> = film.bytes().iter().map(|&value| f64::from(value) / 255.0).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let white =
            film.rows().filter(|pixel| *pixel == [255; 3]).count() as f64 / film.rows().count() as f64;
        assert!((0.2..=0.6).contains(&mean) && white < 0.05, "{mean} {white}");
        assert_eq!(job.pipeline(), ColourPipeline::Linear);
    }
    // An exposure that is chosen is kept.
    let chosen = job("look = 'studio'\nexposure = 0", ROOM, &RenderSettings::default());
    assert_eq!(chosen.settings.picture.exposure, Some(Exposure::Ev(0.0)));
}

/// A part of an animation has the exposure of the whole, which is that of a picture of frame 0.
#[test]
fn animations_are_exposed_by_frame_0() {
    let exposure = |crop: Option<Window>| {
        let scene = parse(&format!("[image]\nwidth = 48\nheight = 48\nlook = 'studio'\n{ROOM}"));
        let settings = RenderSettings { crop, ..RenderSettings::default() };
        let list = FrameList::range(0, 1);
        let request = FrameRequest::all(None, None, Some(&list));
        let animation = AnimationJob::prepare(scene, &settings, &request, &mut Warnings::default(), |_| ())
            .expect("frames");
        animation.frame(1).expect("a frame").settings.picture.exposure
    };
    let still = job("look = 'studio'", ROOM, &RenderSettings::default()).settings.picture.exposure;
    let whole = exposure(None);
    assert!(still.is_some());
    assert_eq!(whole, still);
    assert_eq!(exposure(Some(Window { x: 3, y: 5, width: 9, height: 7 })), whole);
}
