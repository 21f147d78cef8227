//! Renders scenes as the command does; scales and translates scenes.

use std::path::Path;

use glam::{DMat4, DVec3};
use kiln::bvh::detail::Layout;
use kiln::bvh::{Hit, Ray, Traversal};
use kiln::effects::{Plan, PlanSettings};
use kiln::error::Warnings;
use kiln::film::{Film, Window};
use kiln::job::RenderSettings;
use kiln::render::{RenderControl, Statistics, render};
use kiln::scene::{Numerics, PictureSettings, PixelSampler, Sampling, Scene, Shape, Step};
use kiln::world::{StandardView, View, World, fitted_camera, headlight, recenter};

/// A scene from a file.
pub fn load(file: &Path) -> Scene {
    kiln::import::load(&[file.to_owned()], &mut Warnings::default()).expect("a usable scene")
}

/// A scene from the text of a scene file.
pub fn parse(toml: &str) -> Scene {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("scene.toml");
    std::fs::write(&file, toml).expect("the scene is written");
    load(&file)
}

/// Settings with a change of their picture.
pub fn changed(mut settings: RenderSettings, change: impl FnOnce(&mut PictureSettings)) -> RenderSettings {
    change(&mut settings.picture);
    settings
}

/// Sampling settings, and those of `other` where they say none.
pub fn or(own: Sampling, other: Sampling) -> Sampling {
    let Sampling { samples, filter, filter_radius, noise, min_samples, seed, sampler, first, total } = own;
    Sampling {
        samples: samples.or(other.samples),
        filter: filter.or(other.filter),
        filter_radius: filter_radius.or(other.filter_radius),
        noise: noise.or(other.noise),
        min_samples: min_samples.or(other.min_samples),
        seed: if seed == 0 { other.seed } else { seed },
        sampler: if sampler == PixelSampler::default() { other.sampler } else { sampler },
        first: first.or(other.first),
        total: total.or(other.total),
    }
}

/// A scene made ready, seen by its first camera.
pub struct Prepared {
    pub world: World,
    pub view: View,
    pub size: [u32; 2],
    pub scene_effects: kiln::scene::EffectsSection,
    pub sampling: kiln::scene::Sampling,
    pub transport: Option<kiln::scene::Transport>,
    /// As `PlanSettings::lens`.
    pub lens: Option<String>,
}

/// Gives a scene a camera and a light where it has none, as the command does.
pub fn equip(scene: &mut Scene) {
    if scene.cameras.is_empty() {
        let camera = fitted_camera(scene, StandardView::Auto, 1.0, Default::default()).expect("a camera");
        scene.cameras.push(camera);
    }
    if scene.lights.is_empty() {
        scene.lights.extend(headlight(&scene.cameras[0]));
    }
}

pub fn prepare(mut scene: Scene, size: [u32; 2], numerics: Numerics) -> Prepared {
    recenter(&mut scene);
    let camera = scene.cameras[0].clone();
    let mut view = View::new(&camera, camera.projection, size).expect("a usable camera");
    let (pipeline, sampling) = (scene.picture.pipeline(), scene.picture.sampling());
    let (scene_effects, transport) = (scene.effects.clone(), scene.picture.transport);
    let world = World::prepare(scene, pipeline, Layout::default(), numerics);
    let lens = camera.lens.filter(|lens| lens.radius > 0.0).map(|lens| {
        view.set_lens(&camera, lens, None, &world).expect("a usable lens");
        format!("camera `{}`", camera.name)
    });
    Prepared { world, view, size, scene_effects, sampling, transport, lens }
}

impl Prepared {
    /// Plan settings with the scene's effects and, where they say none, its sampling.
    pub fn plan_settings(&self, plan_settings: PlanSettings) -> PlanSettings {
        let sampling = or(plan_settings.sampling, self.sampling);
        let transport = plan_settings.transport.or(self.transport);
        PlanSettings {
            scene: self.scene_effects.clone(),
            sampling,
            transport,
            lens: self.lens.clone(),
            ..plan_settings
        }
    }

    pub fn render(&self, plan_settings: PlanSettings) -> (Film, Statistics) {
        let plan = Plan::new(&self.world, &self.plan_settings(plan_settings)).expect("a plan");
        let [width, height] = self.size;
        let window = Window { x: 0, y: 0, width, height };
        let control = RenderControl { time_stages: true, ..RenderControl::default() };
        render(&self.world, &self.view, &plan, window, |_, _| true, &control).expect("a picture")
    }

    /// The ray of every pixel, row by row from the top.
    pub fn rays(&self) -> Vec<Ray> {
        let precision = self.world.numerics().ray_precision();
        let [width, height] = self.size;
        (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .map(|(x, y)| self.view.ray(x, y, precision))
            .collect()
    }

    /// What each of them hits.
    pub fn hits(&self) -> Vec<Option<Hit>> {
        let mut traversal = Traversal::default();
        self.rays().iter().map(|ray| self.world.accelerator.closest_hit(ray, &mut traversal)).collect()
    }
}

/// A scene with its first camera and default effects, at a size, in a tier.
pub fn picture(scene: Scene, size: [u32; 2], numerics: Numerics) -> Film {
    prepare(scene, size, numerics).render(PlanSettings::default()).0
}

/// The bits of a picture.
pub fn bits(film: &Film, [width, height]: [u32; 2]) -> Vec<[u32; 3]> {
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    pixels.map(|(x, y)| film.pixel(x, y).map(f32::to_bits)).collect()
}

/// Everything in a scene, cameras and lights with it, made `scale` times as large and then moved.
pub fn placed(mut scene: Scene, scale: f64, offset: DVec3) -> Scene {
    let place = |p: &mut DVec3| *p = *p * scale + offset;
    for object in &mut scene.objects {
        match &mut object.shape {
            Shape::Analytic(shape) => {
                place(shape.centre_mut());
                *shape.radius_mut() *= scale;
            }
            Shape::Mesh(mesh) => mesh.positions.iter_mut().for_each(place),
            Shape::Placed(placed) => {
                let map = DMat4::from_translation(offset) * DMat4::from_scale(DVec3::splat(scale));
                placed.placement.then(Step::Affine(map));
            }
        }
    }
    for camera in &mut scene.cameras {
        place(&mut camera.position);
        place(&mut camera.target);
        camera.view_height *= scale;
        camera.view_width = camera.view_width.map(|width| width * scale);
        camera.viewpoint_distance *= scale;
        camera.lens = camera.lens.map(|lens| lens.moved(scale, |p| p * scale + offset));
    }
    for light in &mut scene.lights {
        light.scale(scale);
        light.kind.position_mut().into_iter().for_each(|position| *position += offset);
    }
    scene
}
