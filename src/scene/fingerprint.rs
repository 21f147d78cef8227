//! Fingerprint of everything that determines a picture: a BLAKE3 hash (O'Connor, Aumasson, Neves, Wilcox-O'Hearn 2020)
//! of 256 bits. Equal scenes have equal fingerprints; accidental collisions are negligible.
//!
//! The hash covers the description, including every vertex and texel. Paths and names of files are not hashed.
//!
//! Values are hashed in the wire format of postcard 1 (<https://postcard.jamesmunns.com>): fields in their order, enum
//! variants by their index, floating-point numbers bit by bit. Names of fields and types are not part of it.

use std::sync::Arc;

use serde::Serialize;

use super::{
    Attribute, DecodedImage, DefaultLook, Environment, EnvironmentSource, Light, Material, Mesh,
    MetallicRoughness, Object, Opacity, Phong, Placed, Scene, Shape, TextureSlot,
};

/// Version of what is hashed. Increase it where the order of fields or variants changes.
const ENCODING_VERSION: u32 = 1;

/// An incremental hasher.
#[derive(Clone)]
pub struct Fingerprint(blake3::Hasher);

impl Default for Fingerprint {
    /// Starts with the versions of the encoding and of the program, because versions may render differently.
    fn default() -> Self {
        let mut fingerprint = Fingerprint(blake3::Hasher::new());
        fingerprint.bytes("kiln", env!("CARGO_PKG_VERSION").as_bytes());
        fingerprint.value("encoding", &ENCODING_VERSION);
        fingerprint
    }
}

impl Fingerprint {
    /// Adds named bytes. Name and bytes are each preceded by their length, so that concatenations are unambiguous.
    pub fn bytes(&mut self, name: &str, bytes: &[u8]) {
        for part in [name.as_bytes(), bytes] {
            self.0.update(&(part.len() as u64).to_le_bytes());
            self.0.update(part);
        }
    }

    /// Adds a named value, serialised.
    ///
    /// # Panics
    /// If `value` has a sequence of unknown length. Those of slices and vectors are known.
    pub fn value(&mut self, name: &str, value: &(impl Serialize + ?Sized)) {
        self.bytes(name, &postcard::to_stdvec(value).expect("sequences of known length"));
    }

    /// The fingerprint as 64 hexadecimal digits.
    pub fn finish(&self) -> String {
        self.0.finalize().to_hex().to_string()
    }

    /// Adds a scene, the light that is added to it, and its look. All fields are destructured, so that a new field
    /// fails to compile until it is hashed.
    pub fn scene(&mut self, scene: &Scene, added: Option<&Light>, look: &DefaultLook) {
        let DefaultLook {
            picture,
            path_tracing_reason,
            ambient,
            fill,
            environment,
            // Among the lights of the scene, or `added`.
            light: _,
            ground,
            background,
            has_backdrop,
            notes: _,
            usual_note: _,
        } = look;
        let Scene {
            // Those of the look.
            picture: _,
            background: _,
            ambient: _,
            environment: _,
            cameras,
            lights,
            materials,
            images,
            objects,
            hidden,
            effects,
            animation,
            inputs: _,
            files_read: _,
            // What they change is.
            clips: _,
            variants: _,
            metadata: _,
            import_options: _,
            has_left_out: _,
            has_settings: _,
            has_physical_lights: _,
        } = scene;
        self.value("picture", &(picture.described().entries(), background, ambient));
        if let Some(environment) = environment {
            let Environment { source, rotation, intensity, is_hidden } = environment;
            self.value("environment", &(rotation, intensity, is_hidden));
            match source {
                EnvironmentSource::Image(image) => {
                    self.value("environment image", &(image.width, image.height));
                    self.bytes("environment texels", bytemuck::cast_slice(&image.pixels));
                }
                EnvironmentSource::Sky => self.bytes("sky", &[]),
                EnvironmentSource::Colour(colour) => self.value("environment colour", colour),
            }
        }
        self.value("cameras", cameras);
        lights.iter().chain(added).for_each(|light| self.value("light", light));
        materials.iter().for_each(|material| self.material(material));
        for DecodedImage { name: _, width, height, pixels } in images {
            self.value("image", &(width, height));
            self.bytes("texels", pixels.as_bytes());
        }
        let mut shared = Vec::new();
        // Tracks turn the parts of a mesh about the centre of the whole.
        let has_tracks = animation.as_ref().is_some_and(|animation| !animation.tracks.is_empty());
        let hidden: Vec<_> = hidden.iter().filter(|_| has_tracks).collect();
        if !hidden.is_empty() {
            self.value("hidden", &hidden.iter().map(|hidden| hidden.index).collect::<Vec<_>>());
        }
        for Object { name, input, material, shape } in objects.iter().chain(hidden.iter().map(|h| &h.object))
        {
            self.value("object", &(name, input, material));
            match shape {
                Shape::Analytic(shape) => self.value("shape", shape),
                Shape::Mesh(mesh) => self.mesh(mesh),
                Shape::Placed(placed) => self.placed(placed, &mut shared),
            }
        }
        if let Some(fill) = fill {
            self.value("fill", fill);
        }
        if let Some(ground) = ground {
            self.value("ground", ground);
        }
        if path_tracing_reason.is_some() {
            self.bytes("paths", &[]);
        }
        if *has_backdrop {
            self.bytes("backdrop", &[]);
        }
        // The places in files are not hashed.
        effects
            .iter()
            .for_each(|(name, value, _)| self.value("effect", &(name, value.is_on(), value.value())));
        if let Some(animation) = animation {
            let super::Animation { fps, duration, repeat, tracks, clips } = animation;
            self.value("animation", &(fps, duration, repeat));
            clips.iter().for_each(|clip| self.value("clip", clip));
            for super::animation::Track { target, motion, place: _ } in tracks {
                self.value("track", &(target, motion));
            }
        }
    }

    fn material(&mut self, material: &Material) {
        let textures = material.textures();
        let of = |slot: TextureSlot| textures[slot];
        let normal_map = of(TextureSlot::Normal).map(|texture| (texture, textures.normal_scale));
        let opacity = material.opacity();
        let opacity = opacity.map(|Opacity { factor, cutoff }| (factor, of(TextureSlot::Opacity), cutoff));
        match material {
            Material::Phong(m) => {
                let Phong {
                    name,
                    colour,
                    ambient,
                    diffuse,
                    specular,
                    shininess,
                    emission,
                    glaze,
                    refraction,
                    opacity: _,
                    double_sided,
                    textures: _,
                } = m;
                let terms = (of(TextureSlot::BaseColour), ambient, diffuse, specular, shininess, emission);
                self.value("material", &(0u32, name, colour, terms, glaze, refraction, normal_map, opacity));
                if !double_sided {
                    self.bytes("single-sided", &[]);
                }
            }
            Material::MetallicRoughness(m) => {
                let core = [TextureSlot::BaseColour, TextureSlot::MetallicRoughness, TextureSlot::Emission];
                let [of_colour, of_roughness, of_emission] = core.map(of);
                // The others, by their number from that of the first.
                let first = TextureSlot::Occlusion as u32;
                let others = textures.iter().map(|(slot, texture)| (slot as u32, texture));
                let others: Vec<_> =
                    others.filter_map(|(slot, texture)| Some((slot.checked_sub(first)?, texture))).collect();
                let MetallicRoughness {
                    name,
                    base_colour,
                    metallic,
                    roughness,
                    emission,
                    unlit,
                    opacity: _,
                    layers,
                    double_sided,
                    textures: _,
                } = m;
                let terms =
                    (base_colour, of_colour, metallic, roughness, of_roughness, emission, of_emission);
                let rest = (layers, double_sided, textures.occlusion_strength, others);
                self.value("material", &(1u32, name, terms, unlit, normal_map, opacity, rest));
            }
        }
    }

    /// Adds an instance; a shared mesh is hashed once.
    fn placed<'a>(&mut self, placed: &'a Placed, shared: &mut Vec<&'a Arc<Mesh>>) {
        let Placed { mesh, placement } = placed;
        let index = shared.iter().rposition(|other| Arc::ptr_eq(other, mesh));
        self.value("placed", &(index.unwrap_or(shared.len()), placement));
        if index.is_none() {
            self.mesh(mesh);
            shared.push(mesh);
        }
    }

    fn mesh(&mut self, mesh: &Mesh) {
        let Mesh { positions, triangles, normals, uvs, colours, alphas, tangents, is_mirrored } = mesh;
        self.bytes("positions", bytemuck::cast_slice(positions));
        self.bytes("triangles", bytemuck::cast_slice(triangles));
        self.attribute("normals", normals.as_ref());
        uvs.iter().for_each(|uvs| self.attribute("uvs", Some(uvs)));
        self.attribute("colours", colours.as_ref());
        self.attribute("alphas", alphas.as_ref());
        self.attribute("tangents", tangents.as_ref());
        if *is_mirrored {
            self.bytes("mirrored", &[]);
        }
    }

    fn attribute<T: bytemuck::NoUninit>(&mut self, name: &str, attribute: Option<&Attribute<T>>) {
        let Some(Attribute { values, triangles }) = attribute else { return };
        self.bytes(name, bytemuck::cast_slice(values));
        if let Some(triangles) = triangles {
            self.bytes("corners", bytemuck::cast_slice(triangles));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{
        ImageId, MaterialId, Phong, PictureSettings, Placement, Sphere, Texture, TextureSampler,
    };
    use glam::{DMat4, DVec2, DVec3};

    fn of(scene: &Scene) -> String {
        let mut fingerprint = Fingerprint::default();
        fingerprint.scene(scene, None, &DefaultLook::of_files(scene, scene.picture));
        fingerprint.finish()
    }

    fn scene() -> Scene {
        let mut scene = Scene::default();
        let pixels = [[1u8, 2, 3]; 4].into_iter().collect();
        scene.add_image(DecodedImage { name: "a.png".into(), width: 2, height: 2, pixels });
        let texture = Texture { image: ImageId(0), sampler: TextureSampler::default(), coordinates: 0 };
        let textures = [(TextureSlot::BaseColour, Some(texture))].into();
        scene.add_material(Material::Phong(Phong { textures, ..Phong::default() }));
        let mesh = Mesh {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
            triangles: vec![[0, 1, 2]],
            uvs: vec![Attribute::per_position(vec![DVec2::ZERO, DVec2::X, DVec2::Y])],
            ..Mesh::default()
        };
        let object = |shape| Object { name: "a".into(), input: 0, material: MaterialId(0), shape };
        let place = Placed::new(mesh.clone().into(), Placement::new(DMat4::IDENTITY));
        scene.objects = vec![
            object(Shape::Mesh(mesh)),
            object(Shape::Placed(place.clone())),
            object(Shape::Placed(place)),
            object(Shape::Analytic(Sphere { centre: DVec3::ZERO, radius: 1.0 }.into())),
        ];
        scene
    }

    #[test]
    fn the_least_change_is_seen_and_names_of_files_are_not() {
        let base = of(&scene());
        assert_eq!(base.len(), 64);
        assert_eq!(of(&scene()), base, "the same of equal scenes");
        let changes: [fn(&mut Scene); 9] = [
            |scene| {
                scene.images[0].pixels = [[1u8, 2, 3], [1, 2, 3], [1, 2, 3], [1, 2, 4]].into_iter().collect();
            },
            |scene| (scene.images[0].width, scene.images[0].height) = (4, 1),
            |scene| scene.picture = PictureSettings::of_size([1, 2]),
            |scene| scene.picture.seed = Some(1),
            |scene| {
                let Shape::Mesh(mesh) = &mut scene.objects[0].shape else { panic!("a mesh") };
                mesh.positions[1].x = mesh.positions[1].x.next_up();
            },
            |scene| {
                let Shape::Mesh(mesh) = &mut scene.objects[0].shape else { panic!("a mesh") };
                mesh.uvs[0].values[2].y = -1.0;
            },
            |scene| {
                let Shape::Mesh(mesh) = &mut scene.objects[0].shape else { panic!("a mesh") };
                mesh.is_mirrored = true;
            },
            |scene| {
                let Shape::Placed(placed) = &mut scene.objects[2].shape else { panic!("a placed mesh") };
                placed.placement = Placement::new(DMat4::from_translation(DVec3::Z));
            },
            |scene| scene.objects.swap(0, 3),
        ];
        let mut seen = vec![base.clone()];
        for change in changes {
            let mut changed = scene();
            change(&mut changed);
            seen.push(of(&changed));
        }
        let mut different = seen.clone();
        different.sort();
        different.dedup();
        assert_eq!(different.len(), seen.len(), "each change is one of its own");
        let mut renamed = scene();
        renamed.images[0].name = "/elsewhere/a.png".into();
        assert_eq!(of(&renamed), base);
    }

    /// The wire format, byte by byte: a varint, a tag and eight bytes, a variant's index, a length and characters.
    #[test]
    fn values_are_hashed_without_the_names_of_fields() {
        #[derive(Serialize)]
        enum Kind {
            _First,
            Second(&'static str),
        }
        #[derive(Serialize)]
        struct Pair {
            count: u32,
            weight: Option<f64>,
            kind: Kind,
        }
        let (mut values, mut bytes) = (Fingerprint::default(), Fingerprint::default());
        values.value("pair", &Pair { count: 300, weight: Some(-2.0), kind: Kind::Second("ab") });
        // 300 = 2 * 128 + 44; -2 has the sign bit and the exponent 1024.
        bytes.bytes("pair", &[0x80 | 44, 2, 1, 0, 0, 0, 0, 0, 0, 0, 0xc0, 1, 2, b'a', b'b']);
        assert_eq!(values.finish(), bytes.finish());
    }

    /// A change here changes the fingerprints of all pictures: increase [`ENCODING_VERSION`].
    #[test]
    fn the_encoding_of_a_scene_is_stable() {
        let mut fingerprint = Fingerprint(blake3::Hasher::new());
        fingerprint.value("encoding", &ENCODING_VERSION);
        let scene = scene();
        fingerprint.scene(&scene, None, &DefaultLook::of_files(&scene, scene.picture));
        assert_eq!(fingerprint.finish(), "aa464cac8ba0d92be3b91b0a653d543e8d28c21e86901dd8e341ad0d43a888e9");
    }

    #[test]
    fn names_and_values_do_not_run_into_each_other() {
        let two = |parts: [(&str, &[u8]); 2]| {
            let mut fingerprint = Fingerprint::default();
            parts.iter().for_each(|(name, bytes)| fingerprint.bytes(name, bytes));
            fingerprint.finish()
        };
        assert_ne!(two([("a", b"bc"), ("d", b"")]), two([("ab", b"c"), ("d", b"")]));
        assert_ne!(two([("a", b"b"), ("c", b"d")]), two([("a", b""), ("b", b"cd")]));
    }
}
