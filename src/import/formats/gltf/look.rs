//! Materials, textures, cameras and lights.

use std::borrow::Cow;

use glam::{DMat4, DVec3};
use gltf::material::AlphaMode;
use serde::Deserialize;

use crate::error::{Place, Result};
use crate::film::Colour;
use crate::import::files::uri::{self, Resource};
use crate::import::formats::gltf::document::NO_IMAGE;
use crate::import::formats::gltf::layers::AlphaUse;
use crate::import::formats::gltf::{Loader, dvec3};
use crate::import::formats::scene_file::{LensSection, lens};
use crate::import::images::{self, Channels, ImageLoader};
use crate::scene::{
    Camera, Falloff, ImageId, Interpolation, Light, LightKind, Material, MetallicRoughness, Minify, Opacity,
    Projection, Scene, Sensor, Texture, TextureSampler, TextureSlot, Textures, Wrap,
};

impl Loader<'_> {
    pub(super) fn load_images(&mut self) -> Result<Vec<Option<ImageId>>> {
        let mut files = ImageLoader::new(self.source);
        self.document.images().map(|image| self.load_image(&image, &mut files)).collect()
    }

    fn load_image(&mut self, image: &gltf::Image, files: &mut ImageLoader) -> Result<Option<ImageId>> {
        let place = Place::item(&self.source.file, format!("image {}", image.index()));
        match image.source() {
            gltf::image::Source::View { view, .. } => {
                let buffers = std::mem::take(&mut self.buffers);
                let loaded = bytes_of(&buffers, &view).map(|bytes| self.embedded_image(place.clone(), bytes));
                self.buffers = buffers;
                loaded.unwrap_or_else(|| {
                    self.warnings.left_out(format!("{place}: texture left out: it lies outside its buffer"));
                    Ok(None)
                })
            }
            gltf::image::Source::Uri { uri: NO_IMAGE, .. } => {
                let file = self.source.file.display();
                let what = "texture left out: it names no image, or only one of a format that is not read";
                self.warnings.left_out(format!("{file}: {what}"));
                Ok(None)
            }
            gltf::image::Source::Uri { uri, .. } => match uri::resolve(uri, self.source) {
                Ok(Resource::Data(bytes)) => self.embedded_image(place, &bytes),
                Ok(Resource::File(file)) => {
                    files.of_file(&mut self.scene, &file, Channels::Colour, self.warnings)
                }
                Err(what) => {
                    self.warnings.left_out_file(format!("{place}: texture left out: {what}"));
                    Ok(None)
                }
            },
        }
    }

    /// Image from bytes of the file; equal bytes are decoded once.
    fn embedded_image(&mut self, place: Place, bytes: &[u8]) -> Result<Option<ImageId>> {
        let hash = blake3::hash(bytes);
        if let Some(known) = self.embedded.get(&hash) {
            if known.is_none() {
                self.warnings
                    .left_out(format!("{place}: texture left out: same bytes as an unreadable image"));
            }
            return Ok(*known);
        }
        let made = images::of_bytes(&mut self.scene, self.source, place, bytes, self.warnings)?;
        self.embedded.insert(hash, made);
        Ok(made)
    }

    /// The alpha channel of an image as a grey image; `None` without one. An image that cannot be read has its warning
    /// from [`Loader::load_images`].
    pub(super) fn alpha_of(&mut self, image: &gltf::Image, alpha_use: AlphaUse) -> Result<Option<ImageId>> {
        let place = Place::item(&self.source.file, format!("image {}", image.index()));
        let glossiness = alpha_use.map(f64::from_bits);
        let what = glossiness.map_or("alpha".into(), |factor| format!("roughness by glossiness {factor}"));
        let name = format!("{place}, {what}");
        if let Some(known) = self.source.files.image(&name) {
            return Ok(Some(self.scene.add_image(known)));
        }
        let bytes = match image.source() {
            gltf::image::Source::View { view, .. } => bytes_of(&self.buffers, &view).map(Cow::Borrowed),
            gltf::image::Source::Uri { uri, .. } => match uri::resolve(uri, self.source) {
                Ok(Resource::Data(bytes)) => Some(Cow::Owned(bytes)),
                Ok(Resource::File(file)) => self.source.files.read(&file).ok().map(Cow::Owned),
                Err(_) => None,
            },
        };
        let Some(bytes) = bytes else { return Ok(None) };
        images::alpha_of_bytes(&mut self.scene, place, name, &bytes, |alpha, largest| match glossiness {
            None => alpha,
            Some(factor) => (f64::from(largest) - factor * f64::from(alpha)).round() as u16,
        })
    }

    /// A texture, with the first texture coordinates.
    pub(super) fn texture(&self, texture: &gltf::Texture) -> Option<Texture> {
        use Interpolation::{Linear, Nearest};
        use gltf::texture::{MagFilter, MinFilter, WrappingMode};
        let wrap = |mode| match mode {
            WrappingMode::ClampToEdge => Wrap::ClampToEdge,
            WrappingMode::MirroredRepeat => Wrap::MirroredRepeat,
            WrappingMode::Repeat => Wrap::Repeat,
        };
        let image = (*self.images.get(texture.source().index())?)?;
        let sampler = texture.sampler();
        Some(Texture {
            image,
            coordinates: 0,
            sampler: TextureSampler {
                wrap_u: wrap(sampler.wrap_s()),
                wrap_v: wrap(sampler.wrap_t()),
                magnify: sampler.mag_filter().map(|filter| match filter {
                    MagFilter::Nearest => Nearest,
                    MagFilter::Linear => Linear,
                }),
                minify: sampler.min_filter().map(|filter| match filter {
                    MinFilter::Nearest => Minify { within: Nearest, between: None },
                    MinFilter::Linear => Minify { within: Linear, between: None },
                    MinFilter::NearestMipmapNearest => Minify { within: Nearest, between: Some(Nearest) },
                    MinFilter::LinearMipmapNearest => Minify { within: Linear, between: Some(Nearest) },
                    MinFilter::NearestMipmapLinear => Minify { within: Nearest, between: Some(Linear) },
                    MinFilter::LinearMipmapLinear => Minify { within: Linear, between: Some(Linear) },
                }),
            },
        })
    }

    pub(super) fn material(&mut self, m: &gltf::Material) -> Result<Material> {
        let pbr = m.pbr_metallic_roughness();
        // Factors are clamped to the ranges of the format.
        let colour = |factors: [f32; 3]| dvec3(factors).clamp(DVec3::ZERO, DVec3::ONE);
        let [r, g, b, _] = pbr.base_color_factor();
        let strength = f64::from(m.emissive_strength().unwrap_or(1.0).clamp(0.0, f32::MAX));
        let emission = colour(m.emissive_factor()) * strength;
        let layers = crate::import::formats::gltf::layers::layers(m);
        let mut textures = self.textures(m, &layers)?;
        let opacity = self.opacity(m, &mut textures)?;
        let mut material = MetallicRoughness {
            name: m.name().map_or_else(|| format!("material {}", m.index().unwrap_or(0)), str::to_owned),
            base_colour: Colour::Linear(colour([r, g, b])),
            metallic: f64::from(pbr.metallic_factor()).clamp(0.0, 1.0),
            roughness: f64::from(pbr.roughness_factor()).clamp(0.0, 1.0),
            emission: Colour::Linear(emission),
            unlit: m.unlit(),
            opacity,
            layers,
            double_sided: m.double_sided(),
            textures,
        };
        self.replace_by_specular_glossiness(m, &mut material)?;
        Ok(Material::MetallicRoughness(material))
    }

    /// The opacity of a material: the alpha of its base colour (glTF 2.0, section 3.9.4), with its texture;
    /// `None` for an opaque one.
    fn opacity(&mut self, m: &gltf::Material, textures: &mut Textures) -> Result<Option<Opacity>> {
        let cutoff = match m.alpha_mode() {
            AlphaMode::Opaque => return Ok(None),
            AlphaMode::Mask => Some(f64::from(m.alpha_cutoff().unwrap_or(0.5))),
            AlphaMode::Blend => None,
        };
        let pbr = m.pbr_metallic_roughness();
        let [.., alpha] = pbr.base_color_factor();
        let slot = TextureSlot::Opacity;
        textures[slot] = self.alpha_texture_at(m, slot.entry().gltf, None)?;
        Ok(Some(Opacity { factor: f64::from(alpha).clamp(0.0, 1.0), cutoff }))
    }

    pub(super) fn camera(&mut self, camera: &gltf::Camera, name: String, world_from_node: &DMat4) {
        let position = world_from_node.w_axis.truncate();
        let axis = |v: DVec3| world_from_node.transform_vector3(v).try_normalize();
        let (Some(forward), Some(up)) = (axis(DVec3::NEG_Z), axis(DVec3::Y)) else {
            self.left_out(format!("camera {name} has a degenerate transform; left out"));
            return;
        };
        let (projection, view_height, view_width) = match camera.projection() {
            gltf::camera::Projection::Perspective(p) => {
                let height = 2.0 * (f64::from(p.yfov()) / 2.0).tan();
                (Projection::Perspective, height, p.aspect_ratio().map(|a| f64::from(a) * height))
            }
            gltf::camera::Projection::Orthographic(o) => {
                let (width, height) = (2.0 * f64::from(o.xmag()).abs(), 2.0 * f64::from(o.ymag()).abs());
                (Projection::Orthographic, height, Some(width))
            }
        };
        let sizes = [view_height, view_width.unwrap_or(1.0)];
        if !position.is_finite() || sizes.iter().any(|s| !(*s > 0.0 && s.is_finite())) {
            self.left_out(format!(
                "camera {name} has a field of view or magnification of 0, or is not finite; left out"
            ));
            return;
        }
        let target = position + forward;
        let mut found = Camera {
            name,
            position,
            target,
            up,
            projection,
            view_height,
            view_width,
            viewpoint_distance: 1.0,
            lens: None,
            sensor: Sensor::default(),
            fitted: false,
        };
        let extras = &self.root["cameras"][camera.index()]["extras"];
        if extras.is_object() {
            let keys = LensSection::deserialize(extras).map_err(|e| e.to_string());
            match keys.and_then(|keys| lens(&keys, &found).map_err(|fault| fault.what)) {
                Ok(lens) => found.lens = lens,
                Err(e) => {
                    self.left_out(format!("extras of camera {}: {e}; its lens is left out", found.name));
                }
            }
        }
        self.scene.cameras.push(found);
    }

    pub(super) fn light(
        &mut self,
        light: &gltf::khr_lights_punctual::Light,
        name: String,
        world_from_node: &DMat4,
    ) {
        use gltf::khr_lights_punctual::Kind;
        let position = world_from_node.w_axis.truncate();
        let direction =
            world_from_node.transform_vector3(DVec3::NEG_Z).try_normalize().unwrap_or(DVec3::NEG_Z);
        let falloff = Falloff::InverseSquare { range: light.range().map(f64::from) };
        let kind = match light.kind() {
            Kind::Directional => LightKind::Directional { direction, angle: 0.0 },
            Kind::Point => LightKind::Point { position, falloff },
            Kind::Spot { inner_cone_angle, outer_cone_angle } => LightKind::Spot {
                position,
                direction,
                falloff,
                inner_angle: f64::from(inner_cone_angle),
                outer_angle: f64::from(outer_cone_angle),
            },
        };
        // KHR_lights_punctual uses candela or lux, of which a diffuse surface reflects 1/pi; a light of intensity 1
        // shows a surface in its own colour.
        let intensity = f64::from(light.intensity()) / std::f64::consts::PI;
        if !(intensity.is_finite() && position.is_finite()) {
            self.left_out(format!("light {name} is not finite; left out"));
            return;
        }
        if intensity < 0.0 {
            self.left_out(format!("light {name} has a negative intensity ({}); left out", light.intensity()));
            return;
        }
        let colour = Colour::Linear(dvec3(light.color()).clamp(DVec3::ZERO, DVec3::ONE));
        self.scene.lights.push(Light { name, colour, intensity, kind });
        self.scene.has_physical_lights = true;
    }
}

/// The bytes of a buffer view; `None` if it lies outside its buffer.
pub(super) fn bytes_of<'a>(buffers: &'a [Result<Vec<u8>>], view: &gltf::buffer::View) -> Option<&'a [u8]> {
    let range = view.offset()..view.offset().saturating_add(view.length());
    buffers.get(view.buffer().index())?.as_ref().ok()?.get(range)
}

/// Places the camera targets. glTF cameras have a direction only; the target is the point of the view ray nearest to
/// the centre of the scene, so that the orthographic projection shows the scene at a similar size.
pub(super) fn place_targets(scene: &mut Scene) {
    let Some((min, max)) = scene.bounds() else { return };
    let middle = (min + max) / 2.0;
    for camera in &mut scene.cameras {
        let direction = camera.target - camera.position;
        let distance = (middle - camera.position).dot(direction);
        // A non-finite vertex, which is removed later, must not make cameras invalid.
        if distance > 0.0 && distance.is_finite() {
            let factor = distance / camera.viewpoint_distance;
            camera.target = camera.position + direction * distance;
            if camera.projection == Projection::Perspective {
                camera.view_height *= factor;
                camera.view_width = camera.view_width.map(|width| width * factor);
            }
            camera.viewpoint_distance = distance;
        }
    }
}
