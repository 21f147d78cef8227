//! Effects: each computed where the scene calls for it, and nowhere else. Walks the registry: an effect without a scene
//! that calls for it, or without one that does not, fails.
//!
//! `scenes/effects/NAME.toml` calls for the effect, `scenes/effects/no-NAME.toml` does not.

use crate::common::picture::{Prepared, bits, load, parse, prepare};
use crate::common::repository;
use kiln::effects::whitted::{glaze, shadows};
use kiln::effects::{EFFECTS, Effect, Plan, PlanSettings, RayKind, TRANSPORTS, id};
use kiln::film::{ColourPipeline, Film};
use kiln::render::{EffectCost, StageTime, Statistics};
use kiln::scene::Numerics;

const SIZE: [u32; 2] = [80, 60];

fn scene(name: &str) -> Prepared {
    let file = repository("scenes/effects").join(format!("{name}.toml"));
    assert!(file.is_file(), "{} is missing", file.display());
    prepare(load(&file), SIZE, Numerics::Watertight)
}

fn bill<'a>(statistics: &'a Statistics, effect: &Effect) -> &'a EffectCost {
    statistics.effect_costs.iter().find(|cost| cost.effect == effect.id).expect("each effect has a bill")
}

fn with(effect: &Effect) -> PlanSettings {
    PlanSettings { with: vec![effect.name().into()], force_stages: true, ..PlanSettings::default() }
}

fn without(names: &[&str]) -> PlanSettings {
    PlanSettings { without: names.iter().map(|&name| name.into()).collect(), ..PlanSettings::default() }
}

#[test]
fn the_scene_of_an_effect_calls_for_it() {
    for effect in EFFECTS {
        let prepared = scene(effect.name());
        let (film, statistics) = prepared.render(PlanSettings::default());
        let bill = bill(&statistics, effect);
        let name = effect.name();
        assert!(bill.stages > 0 && bill.bytes > 0, "{name}: {bill:?}");
        assert!(effect.rays.is_empty() || bill.rays > 0, "{name}: {bill:?}");
        let decisions = Plan::new(&prepared.world, &prepared.plan_settings(PlanSettings::default()))
            .expect("a plan")
            .decisions;
        let why = &decisions.iter().find(|d| d.effect.name() == name).expect("one of each").why;
        assert!(why.contains('`'), "{name}: `{why}` names nothing that calls for it");
        let (other, statistics) = prepared.render(without(&[name]));
        assert_ne!(bits(&film, SIZE), bits(&other, SIZE), "{name} changes nothing in its own scene");
        nothing_for(effect, &statistics);
    }
}

fn nothing_for(effect: &Effect, statistics: &Statistics) {
    let bill = bill(statistics, effect);
    assert_eq!((bill.stages, bill.rays, bill.bytes), (0, 0, 0), "{}", effect.name());
    assert!(bill.time.is_some_and(|time| time.is_zero()), "{}", effect.name());
    for &kind in effect.rays {
        assert_eq!(statistics.rays(kind).cast, 0, "{}", effect.name());
    }
}

#[test]
fn a_scene_that_does_not_call_for_an_effect_is_not_billed_for_it() {
    for effect in EFFECTS {
        let prepared = scene(&format!("no-{}", effect.name()));
        let (film, statistics) = prepared.render(PlanSettings::default());
        nothing_for(effect, &statistics);
        // Asking for another transport or approximation is asking for another picture.
        let is_transport = TRANSPORTS.iter().any(|entry| entry.switch == Some(effect.id));
        if is_transport || effect.id == id::AMBIENT_OCCLUSION {
            continue;
        }
        // With its stages there all the same, it has nothing to do.
        let (forced, forced_statistics) = prepared.render(with(effect));
        let decisions =
            Plan::new(&prepared.world, &prepared.plan_settings(with(effect))).expect("a plan").decisions;
        assert!(decisions.iter().any(|d| d.effect == effect.id && d.on), "{} is not forced", effect.name());
        assert_eq!(
            bits(&film, SIZE),
            bits(&forced, SIZE),
            "{} changes a scene that it is not for",
            effect.name()
        );
        assert_eq!(bill(&forced_statistics, effect).rays, 0, "{} casts rays for nothing", effect.name());
        // What `--with` does, which lets an effect without work stay off.
        let asked = PlanSettings { force_stages: false, ..with(effect) };
        let (asked, statistics) = prepared.render(asked);
        assert_eq!(bits(&film, SIZE), bits(&asked, SIZE));
        nothing_for(effect, &statistics);
    }
}

/// The stage of camera rays casts those of pixels and those behind transparent surfaces; alpha has the share of its time that
/// the second are of both.
#[test]
fn alpha_is_billed_for_its_rays_in_stages_of_others() {
    let alpha = EFFECTS.iter().find(|effect| effect.id == id::ALPHA).expect("alpha");
    let (_, statistics) = scene("alpha").render(PlanSettings::default());
    let of_hits = |effect| {
        let is_it = |stage: &&StageTime| (stage.name, stage.effect) == ("primary hits", effect);
        statistics.stages.iter().find(is_it).expect("its time").time.as_secs_f64()
    };
    let (own, others) = (of_hits(Some(alpha.id)), of_hits(None));
    let rays = |kind| statistics.rays(kind).cast as f64;
    let share = rays(alpha.rays[0]) / (rays(alpha.rays[0]) + rays(RayKind::PRIMARY));
    // Times are whole nanoseconds.
    assert!(share > 0.1 && (own / (own + others) - share).abs() < 1e-3, "{own} {others} {share}");
    let all = statistics.stages.iter().filter(|stage| stage.effect == Some(alpha.id));
    assert_eq!(bill(&statistics, alpha).time, Some(all.map(|stage| stage.time).sum()));
}

#[test]
fn bytes_and_rays_of_the_base_are_those_without_any_effect() {
    let names: Vec<&str> = EFFECTS.iter().map(Effect::name).collect();
    for effect in EFFECTS {
        let (_, statistics) = scene(effect.name()).render(without(&names));
        assert_eq!(statistics.bytes(), statistics.base_bytes);
        let pixels = u64::from(SIZE[0] * SIZE[1]);
        let cast: Vec<u64> = statistics.rays.iter().map(|(_, count)| count.cast).collect();
        assert_eq!((statistics.rays[0].0, cast[0]), (RayKind::PRIMARY, pixels));
        assert!(cast[1..].iter().all(|&rays| rays == 0), "{cast:?}");
    }
}

/// A floor seen from above with a ball on it, and whatever else is given.
fn floor(more: &str, material: &str) -> Prepared {
    let text = format!(
        "[image]\nwidth = 32\nheight = 32\n[[camera]]\nposition = [0, 9, 0.5]\nlook_at = [0, 0, 0]\n\
         [material.m]\ncolour = '#808080'\n{material}\n\
         [material.plain]\ncolour = '#808080'\n\
         [[triangles]]\nmaterial = 'm'\nvertices = [[-90, 0, -90], [90, 0, -90], [0, 0, 180]]\n\
         [[sphere]]\ncentre = [0, 1, 0]\nradius = 1\nmaterial = 'plain'\n{more}"
    );
    prepare(parse(&text), [32, 32], Numerics::Watertight)
}

fn shadow_rays(prepared: &Prepared) -> u64 {
    prepared.render(PlanSettings::default()).1.rays(shadows::RAYS).cast
}

#[test]
fn lights_that_cannot_reach_cast_no_shadow_rays() {
    let light = |y: f64, more: &str| format!("[[light]]\ntype = 'point'\nposition = [0, {y}, 0]\n{more}");
    let pixels = 32 * 32;
    // Straight above, it is over the horizon of the floor; of the ball nobody sees the lower half.
    assert_eq!(shadow_rays(&floor(&light(20.0, ""), "")), pixels);
    // Below the floor N.L < 0 everywhere: also on the ball, of which the upper part is seen.
    assert_eq!(shadow_rays(&floor(&light(-20.0, ""), "")), 0);
    for dark in ["intensity = 0", "colour = '#000000'"] {
        let prepared = floor(&light(20.0, dark), "");
        assert_eq!(shadow_rays(&prepared), 0);
        let plan =
            Plan::new(&prepared.world, &prepared.plan_settings(PlanSettings::default())).expect("a plan");
        assert!(plan.effects_on().next().is_none(), "{dark} calls for an effect");
        assert!(!plan.stages().iter().any(|stage| stage.stage.name == "lights"), "{dark} is looked at");
    }
    // Two lights, one of them dark: as many as with one.
    let two = format!("{}{}", light(20.0, ""), light(10.0, "intensity = 0"));
    assert_eq!(shadow_rays(&floor(&two, "")), pixels);
}

#[test]
fn a_material_that_returns_no_light_asks_for_no_shadow() {
    let light = "[[light]]\ntype = 'point'\nposition = [0, 20, 0]\n";
    let dull = floor(light, "diffuse = 0\nspecular = 0");
    let on_ball = dull.hits().iter().flatten().filter(|hit| hit.prim.0 == 1).count() as u64;
    assert!(on_ball > 50, "the ball is in the picture");
    assert_eq!(shadow_rays(&dull), on_ball);
}

#[test]
fn only_the_glazed_material_sends_rays() {
    let light = "[[light]]\ntype = 'point'\nposition = [0, 20, 0]\n";
    let glazed = floor(light, "glaze = { weight = 0.5 }");
    let on_floor = glazed.hits().iter().flatten().filter(|hit| hit.prim.0 == 0).count() as u64;
    let (_, statistics) = glazed.render(PlanSettings::default());
    assert_eq!(statistics.rays(glaze::RAYS).cast, on_floor);
    // A glazed material that no object is of calls for nothing.
    let unused = floor("[material.other]\ncolour = '#808080'\nglaze = { weight = 0.5 }\n", "");
    let plan = Plan::new(&unused.world, &unused.plan_settings(PlanSettings::default())).expect("a plan");
    assert!(!plan.effects_on().any(|effect| effect == id::GLAZE));
}

/// Between two mirrors, a path goes on for as long as it may.
fn mirrors(weight: f64, bounces: u32, pipeline: ColourPipeline) -> Prepared {
    let text = format!(
        "[image]\nwidth = 24\nheight = 24\ncolour = '{}'\n[[camera]]\nposition = [0, 0, 0]\nlook_at = [0.3, 0.4, 1]\n\
         [ambient]\nintensity = 0.7\n[[light]]\ntype = 'point'\nposition = [0.2, 0.1, 0]\n\
         [material.a]\ncolour = '#d08040'\nspecular = 3\nglaze = {{ weight = {weight}, bounces = {bounces} }}\n\
         [material.b]\ncolour = '#4080d0'\nglaze = {{ weight = {weight}, bounces = {bounces} }}\n\
         [[sphere]]\ncentre = [0, 0, 0]\nradius = 2\nmaterial = 'a'\n\
         [[sphere]]\ncentre = [1, 0.5, 1]\nradius = 0.3\nmaterial = 'b'\n",
        pipeline.name()
    );
    prepare(parse(&text), [24, 24], Numerics::Watertight)
}

fn glaze_value(value: &str) -> PlanSettings {
    PlanSettings { with: vec![format!("glaze={value}")], ..PlanSettings::default() }
}

#[test]
fn paths_stop_where_it_does_not_show() {
    let bytes = |film: &Film, pipeline| film.to_rgb8(pipeline);
    for pipeline in [ColourPipeline::Display, ColourPipeline::Linear] {
        // W = weight^n < 2^-53 first at n = 54 for a half and n = 27 for a quarter: so many levels of rays, not 120.
        for (weight, levels) in [(0.5, 54), (0.25, 27)] {
            let prepared = mirrors(weight, 120, pipeline);
            let (film, statistics) = prepared.render(PlanSettings::default());
            let (whole, all) = prepared.render(glaze_value("every-bounce"));
            assert_eq!(bytes(&film, pipeline), bytes(&whole, pipeline), "{pipeline:?}, {weight}");
            // From within a closed ball every ray hits: a ray a pixel and level.
            let cast = |s: &Statistics| s.rays(glaze::RAYS).cast;
            assert_eq!((cast(&statistics), cast(&all)), (24 * 24 * levels, 24 * 24 * 120));
        }
    }
    // Rounded to eight bits at every step, the least change can go on: nothing stops.
    let (_, statistics) = mirrors(0.5, 120, ColourPipeline::U8).render(PlanSettings::default());
    assert_eq!(statistics.rays(glaze::RAYS).cast, 24 * 24 * 120);
}

#[test]
fn paths_that_stopped_too_early_would_show() {
    // The same pictures with bounces cut at 6: W = 2^-6 is above the steps of eight bits, and the test above would
    // fail.
    let (short, _) = mirrors(0.5, 6, ColourPipeline::Display).render(PlanSettings::default());
    let (long, _) = mirrors(0.5, 120, ColourPipeline::Display).render(PlanSettings::default());
    assert_ne!(short.to_rgb8(ColourPipeline::Display), long.to_rgb8(ColourPipeline::Display));
}

#[test]
fn values_are_checked() {
    let prepared = scene("glaze");
    let error = |with: &str| {
        let plan_settings = PlanSettings { with: vec![with.into()], ..PlanSettings::default() };
        let error = Plan::new(&prepared.world, &plan_settings).err().expect("it cannot be used");
        (error.to_string(), error.hint().to_owned())
    };
    assert_eq!(error("glaez").1, "did you mean `glaze`?");
    assert!(error("shadows=3").0.contains("`shadows` takes no value"));
    assert!(error("glaze=never").0.contains("`never` cannot be the number of bounces of `glaze`"));
}

#[test]
fn a_scene_file_is_told_of_unknown_effects_with_their_line() {
    let error = |said: &str| {
        let text = format!("[effects]\nshadows = true\n{said}\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n");
        let effects = parse(&text).effects;
        let error = kiln::effects::check_scene(&effects).expect_err("it is no effect");
        (error.to_string().rsplit('/').next().unwrap_or_default().to_owned(), error.hint().to_owned())
    };
    assert_eq!(
        error("glaez = true"),
        ("scene.toml:3: unknown key `glaez`".into(), "did you mean `glaze`?".into())
    );
    let (what, _) = error("terminator = 16");
    assert_eq!(what, "scene.toml:3: `terminator` takes no value, and `16` was given");
}

/// What a scene file says counts, unless the user says otherwise; a value comes along.
#[test]
fn the_users_word_comes_before_the_scenes() {
    let text = "[effects]\nglaze = 'every-bounce'\nshadows = false\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\nmaterial = 'm'\n\
                [material.m]\ncolour = '#ffffff'\nglaze = {}\n[[light]]\ntype = 'point'\nposition = [5, 5, 5]\n\
                [[camera]]\nposition = [0, 0, 5]\nlook_at = [0, 0, 0]\n";
    let prepared = prepare(parse(text), [8, 8], Numerics::Watertight);
    let decide = |with: &[&str]| {
        let with = with.iter().map(|&name| name.into()).collect();
        let plan_settings =
            PlanSettings { scene: prepared.scene_effects.clone(), with, ..PlanSettings::default() };
        let decisions = Plan::new(&prepared.world, &plan_settings).expect("a plan").decisions;
        let of =
            |name: &str| decisions.iter().find(|d| d.effect.name() == name).cloned().expect("one of each");
        [of("glaze"), of("shadows")].map(|d| (d.on, d.value))
    };
    assert_eq!(decide(&[]), [(true, Some("every-bounce".into())), (false, None)]);
    assert_eq!(decide(&["shadows"]), [(true, Some("every-bounce".into())), (true, None)]);
}

/// `cargo xtask make-effects` writes the page and the pictures.
#[test]
fn the_page_shows_every_effect() {
    let page = std::fs::read_to_string(repository("scenes/effects/README.md")).expect("there is a page");
    for effect in EFFECTS {
        let picture = format!("assets/docs/effect-{}.png", effect.name());
        assert!(page.contains(&format!("## {}\n", effect.name())), "{} is not on the page", effect.name());
        assert!(page.contains(&format!("](../../{picture})")), "{picture} is not on the page");
        let size = std::fs::metadata(repository(&picture)).map(|file| file.len()).unwrap_or(0);
        assert!((1..100_000).contains(&size), "{picture} has {size} bytes");
    }
}
