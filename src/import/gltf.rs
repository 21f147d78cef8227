//! glTF 2.0, text and binary, read by the `gltf` crate.
//!
//! Buffers and pictures are opened here rather than by `gltf::import`, which loses the whole file for one missing
//! picture. The node hierarchy is flattened into world space; skins are posed as their joints stand at rest.

use std::path::Path;

use glam::{DMat4, DQuat, DVec2, DVec3};

use super::pictures::{self, Pictures};
use super::uri::{self, Resource};
use super::{Source, unreadable};
use crate::error::{Error, Place, Result, Warnings};
use crate::film::Colour;
use crate::scene::{
    Attribute, Camera, Falloff, ImageId, Light, LightKind, Material, MaterialId, Mesh, MetallicRoughness,
    Object, Projection, Sampler, Scene, Shape, Texture, Wrap,
};

/// Reads a .gltf or .glb file.
pub fn read(source: &Source, warnings: &mut Warnings) -> Result<Scene> {
    let bytes = source.bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&source.bytes);
    let gltf::Gltf { document, blob } =
        gltf::Gltf::from_slice(bytes).map_err(|e| explain(&source.file, e))?;
    check_accessors(&document, &source.file)?;
    let buffers = load_buffers(&document, blob, source)?;
    let mut loader =
        Loader { source, buffers, images: Vec::new(), scene: Scene::default(), warnings, plain: None };
    loader.warn_of_what_is_not_drawn(&document);
    loader.images = loader.load_images(&document);
    for material in document.materials() {
        let material = loader.material(&material);
        loader.scene.add_material(material);
    }
    let world_from_node = world_transforms(&document, &source.file, loader.warnings)?;
    for node in document.nodes() {
        if let Some(transform) = world_from_node[node.index()] {
            loader.node(&node, &transform, &world_from_node)?;
        }
    }
    let mut scene = loader.scene;
    place_targets(&mut scene);
    Ok(scene)
}

fn explain(file: &Path, e: gltf::Error) -> Error {
    let text = e.to_string();
    let gltf::Error::Validation(faults) = e else {
        return Error::input(file, format!("not a usable glTF file: {text}"), "export it again as glTF 2.0");
    };
    let unread: Vec<String> = faults
        .iter()
        .filter(|(_, fault)| *fault == gltf::json::validation::Error::Unsupported)
        .filter_map(|(path, _)| {
            // The path reads `extensionsRequired[0] = "NAME"`.
            let name = path.as_str().strip_prefix("extensionsRequired")?.split('"').nth(1)?;
            Some(name.to_owned())
        })
        .collect();
    if !unread.is_empty() {
        let what = format!("requires glTF extensions that kiln does not read: {}", unread.join(", "));
        let hint = "export it without compression or quantisation (for example with `gltf-transform copy` or \
                    `gltfpack -noq`)";
        return Error::input(file, what, hint);
    }
    let (path, fault) = &faults[0];
    let what = format!("not a usable glTF file: {path}: {fault}");
    Error::input(file, what, "export it again as glTF 2.0")
}

/// The `gltf` crate reads accessors without checking their numbers: none at all, or sums beyond 64 bits, make it panic
/// or wrap round, and steps shorter than an element or other types than the format allows make it read garbage.
fn check_accessors(document: &gltf::Document, file: &Path) -> Result<()> {
    let fits = |view: Option<gltf::buffer::View>, offset: usize, count: usize, size: usize| {
        let Some(view) = view else { return count > 0 };
        let stride = view.stride().unwrap_or(size);
        let steps = count.checked_sub(1).and_then(|steps| stride.checked_mul(steps));
        let end = steps.and_then(|bytes| bytes.checked_add(offset)?.checked_add(size));
        let inside = end.is_some_and(|end| end <= view.length());
        inside && stride >= size && view.offset().checked_add(view.length()).is_some()
    };
    for accessor in document.accessors() {
        let (count, size) = (accessor.count(), accessor.size());
        let mut usable = fits(accessor.view(), accessor.offset(), count, size);
        if let Some(sparse) = accessor.sparse() {
            let (indices, values) = (sparse.indices(), sparse.values());
            let index_size = indices.index_type().size();
            usable &= fits(Some(indices.view()), indices.offset(), sparse.count(), index_size);
            usable &= fits(Some(values.view()), values.offset(), sparse.count(), size);
        }
        if !usable {
            let item = Place::item(file, format!("accessor {}", accessor.index()));
            let what = "its elements do not lie inside its buffer view";
            return Err(Error::input(item, what, "export the file again"));
        }
    }
    Ok(())
}

fn load_buffers(
    document: &gltf::Document,
    mut blob: Option<Vec<u8>>,
    source: &Source,
) -> Result<Vec<Vec<u8>>> {
    let load = |buffer: gltf::Buffer| {
        let item = format!("buffer {}", buffer.index());
        let fault = |what: String| {
            Error::input(Place::item(&source.file, item.clone()), what, "export the file again")
        };
        let data = match buffer.source() {
            gltf::buffer::Source::Bin => {
                blob.take().ok_or_else(|| fault("the binary part of the file is missing".into()))?
            }
            gltf::buffer::Source::Uri(text) => match uri::resolve(text).map_err(&fault)? {
                Resource::Data(data) => data,
                Resource::File(name) => {
                    let path = source.sibling(name);
                    std::fs::read(&path).map_err(|e| fault(unreadable(&path, &e).to_string()))?
                }
            },
        };
        if data.len() < buffer.length() {
            return Err(fault(format!("{} of {} bytes are there", data.len(), buffer.length())));
        }
        Ok(data)
    };
    document.buffers().map(load).collect()
}

/// Each node's transform into the world, or `None` for nodes that are not in the scene.
///
/// Every node is visited once: a walk along every path would not end in a loop, and takes 2^n steps where n nodes in a
/// row are each named twice.
fn world_transforms(
    document: &gltf::Document,
    file: &Path,
    warnings: &mut Warnings,
) -> Result<Vec<Option<DMat4>>> {
    let mut world_from_node = vec![None; document.nodes().count()];
    let mut parent_of: Vec<Option<usize>> = vec![None; world_from_node.len()];
    let roots: Vec<gltf::Node> = match document.default_scene().or_else(|| document.scenes().next()) {
        Some(scene) => scene.nodes().collect(),
        None => document.nodes().collect(),
    };
    let mut open: Vec<(gltf::Node, DMat4, Option<usize>)> =
        roots.into_iter().rev().map(|node| (node, DMat4::IDENTITY, None)).collect();
    while let Some((node, world_from_parent, parent)) = open.pop() {
        let index = node.index();
        if world_from_node[index].is_some() {
            if std::iter::successors(parent, |&above| parent_of[above]).any(|above| above == index) {
                let item = Place::item(file, format!("node {index}"));
                return Err(Error::input(item, "the nodes contain themselves", "correct the hierarchy"));
            }
            let file = file.display();
            warnings.push(format!("{file}: node {index} is in the scene more than once; drawn once"));
            continue;
        }
        let transform = world_from_parent * parent_from_node(&node);
        world_from_node[index] = Some(transform);
        parent_of[index] = parent;
        open.extend(node.children().map(|child| (child, transform, Some(index))));
    }
    Ok(world_from_node)
}

fn parent_from_node(node: &gltf::Node) -> DMat4 {
    match node.transform() {
        gltf::scene::Transform::Matrix { matrix } => glam::Mat4::from_cols_array_2d(&matrix).as_dmat4(),
        gltf::scene::Transform::Decomposed { translation, rotation, scale } => {
            let rotation = DQuat::from_array(rotation.map(f64::from));
            // An unnormalised rotation would scale.
            let rotation =
                if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
            DMat4::from_scale_rotation_translation(dvec3(scale), rotation, dvec3(translation))
        }
    }
}

/// The line of sight of a glTF camera has no end; it is given one beside the middle of the scene, so that a switch to
/// the orthographic projection shows the scene at a like size.
fn place_targets(scene: &mut Scene) {
    let Some((min, max)) = scene.bounds() else { return };
    let middle = (min + max) / 2.0;
    for camera in &mut scene.cameras {
        let direction = camera.target - camera.position;
        let distance = (middle - camera.position).dot(direction);
        if distance > 0.0 {
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

struct Loader<'a> {
    source: &'a Source,
    buffers: Vec<Vec<u8>>,
    images: Vec<Option<ImageId>>,
    scene: Scene,
    warnings: &'a mut Warnings,
    plain: Option<MaterialId>,
}

impl Loader<'_> {
    fn warn(&mut self, what: impl std::fmt::Display) {
        self.warnings.push(format!("{}: {what}", self.source.file.display()));
    }

    fn warn_of_what_is_not_drawn(&mut self, document: &gltf::Document) {
        if document.animations().next().is_some() {
            self.warn("it has animations; drawn at rest");
        }
        const READ: [&str; 3] =
            ["KHR_lights_punctual", "KHR_materials_emissive_strength", "KHR_materials_unlit"];
        let unread: Vec<&str> = document.extensions_used().filter(|name| !READ.contains(name)).collect();
        for name in unread {
            self.warn(format!("extension {name} is not used"));
        }
        let transparent =
            document.materials().filter(|m| m.alpha_mode() != gltf::material::AlphaMode::Opaque).count();
        if transparent > 0 {
            self.warn(format!("{transparent} material(s) are transparent; drawn opaque"));
        }
    }

    fn load_images(&mut self, document: &gltf::Document) -> Vec<Option<ImageId>> {
        let mut files = Pictures::default();
        document.images().map(|image| self.load_image(&image, &mut files)).collect()
    }

    fn load_image(&mut self, image: &gltf::Image, files: &mut Pictures) -> Option<ImageId> {
        let name = format!("{}: image {}", self.source.file.display(), image.index());
        match image.source() {
            gltf::image::Source::View { view, .. } => {
                let range = view.offset()..view.offset().checked_add(view.length())?;
                let Some(bytes) = self.buffers.get(view.buffer().index()).and_then(|data| data.get(range))
                else {
                    self.warnings.push(format!("{name}: texture left out: it lies outside its buffer"));
                    return None;
                };
                pictures::of_bytes(&mut self.scene, &name, bytes, self.warnings)
            }
            gltf::image::Source::Uri { uri, .. } => match uri::resolve(uri) {
                Ok(Resource::Data(bytes)) => {
                    pictures::of_bytes(&mut self.scene, &name, &bytes, self.warnings)
                }
                Ok(Resource::File(file)) => {
                    files.of_file(&mut self.scene, &self.source.sibling(file), self.warnings)
                }
                Err(what) => {
                    self.warnings.push(format!("{name}: texture left out: {what}"));
                    None
                }
            },
        }
    }

    fn texture(&self, texture: &gltf::Texture) -> Option<Texture> {
        use gltf::texture::WrappingMode;
        let wrap = |mode| match mode {
            WrappingMode::ClampToEdge => Wrap::ClampToEdge,
            WrappingMode::MirroredRepeat => Wrap::MirroredRepeat,
            WrappingMode::Repeat => Wrap::Repeat,
        };
        let image = (*self.images.get(texture.source().index())?)?;
        let sampler = texture.sampler();
        Some(Texture {
            image,
            sampler: Sampler { wrap_u: wrap(sampler.wrap_s()), wrap_v: wrap(sampler.wrap_t()) },
        })
    }

    fn material(&self, m: &gltf::Material) -> Material {
        let pbr = m.pbr_metallic_roughness();
        let [r, g, b, _] = pbr.base_color_factor();
        let emission = dvec3(m.emissive_factor()) * f64::from(m.emissive_strength().unwrap_or(1.0));
        Material::MetallicRoughness(MetallicRoughness {
            name: m.name().map_or_else(|| format!("material {}", m.index().unwrap_or(0)), str::to_owned),
            base_colour: Colour::Linear(dvec3([r, g, b])),
            base_colour_texture: pbr.base_color_texture().and_then(|t| self.texture(&t.texture())),
            metallic: f64::from(pbr.metallic_factor()).clamp(0.0, 1.0),
            roughness: f64::from(pbr.roughness_factor()).clamp(0.0, 1.0),
            metallic_roughness_texture: pbr
                .metallic_roughness_texture()
                .and_then(|t| self.texture(&t.texture())),
            emission: Colour::Linear(emission),
            emission_texture: m.emissive_texture().and_then(|t| self.texture(&t.texture())),
            unlit: m.unlit(),
        })
    }

    fn node(
        &mut self,
        node: &gltf::Node,
        world_from_node: &DMat4,
        world_from_nodes: &[Option<DMat4>],
    ) -> Result<()> {
        let name = node.name().map_or_else(|| format!("node {}", node.index()), str::to_owned);
        if let Some(camera) = node.camera() {
            self.camera(&camera, name.clone(), world_from_node);
        }
        if let Some(light) = node.light() {
            self.light(&light, name.clone(), world_from_node);
        }
        let Some(mesh) = node.mesh() else { return Ok(()) };
        for primitive in mesh.primitives() {
            let Some(mut triangles) = self.primitive(&primitive, &name)? else { continue };
            match node.skin().and_then(|skin| self.pose(&skin, &primitive, world_from_nodes)) {
                Some(matrices) => deform(&mut triangles, &matrices),
                None => triangles.transform(world_from_node),
            }
            let material = match primitive.material().index() {
                Some(index) => MaterialId(index as u32),
                None => self.plain_material(),
            };
            let shape = Shape::Mesh(triangles);
            self.scene.objects.push(Object { name: name.clone(), input: 0, material, shape });
        }
        Ok(())
    }

    fn plain_material(&mut self) -> MaterialId {
        let scene = &mut self.scene;
        *self.plain.get_or_insert_with(|| {
            scene.add_material(Material::MetallicRoughness(MetallicRoughness {
                metallic: 0.0,
                ..MetallicRoughness::default()
            }))
        })
    }

    /// The triangles of one primitive in its mesh's own space; `None` for points and lines.
    fn primitive(&mut self, primitive: &gltf::Primitive, name: &str) -> Result<Option<Mesh>> {
        use gltf::mesh::Mode;
        if matches!(primitive.mode(), Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            self.warn(format!("{name}: points and lines are not drawn"));
            return Ok(None);
        }
        let reader = primitive.reader(|buffer| self.buffers.get(buffer.index()).map(Vec::as_slice));
        let fault = |what: &str| {
            let item = Place::item(&self.source.file, format!("{name}, primitive {}", primitive.index()));
            Error::input(item, what, "export the file again")
        };
        if let Some(accessor) = primitive.get(&gltf::Semantic::Positions) {
            use gltf::accessor::{DataType, Dimensions};
            if (accessor.data_type(), accessor.dimensions()) != (DataType::F32, Dimensions::Vec3) {
                return Err(fault("its positions are not three floating-point numbers each"));
            }
        }
        let positions: Vec<DVec3> = match reader.read_positions() {
            Some(positions) => positions.map(dvec3).collect(),
            None if primitive.get(&gltf::Semantic::Positions).is_none() => {
                self.warn(format!("{name}: a mesh without positions is not drawn"));
                return Ok(None);
            }
            None => return Err(fault("its positions lie outside their buffer")),
        };
        let count = positions.len();
        let order: Vec<u32> = match (reader.read_indices(), primitive.indices()) {
            (Some(indices), _) => indices.into_u32().collect(),
            (None, Some(_)) => return Err(fault("its indices lie outside their buffer")),
            (None, None) => (0..count as u32).collect(),
        };
        let mut triangles = into_triangles(&order, primitive.mode());
        let before = triangles.len();
        triangles.retain(|t| t.iter().all(|&i| (i as usize) < count));
        let out_of_range = before - triangles.len();

        // An attribute that does not go with the positions is as good as none.
        let uv_set =
            primitive.material().pbr_metallic_roughness().base_color_texture().map_or(0, |t| t.tex_coord());
        let normals = reader.read_normals().map(|values| values.map(dvec3).collect::<Vec<_>>());
        let uvs = reader.read_tex_coords(uv_set).map(|uvs| {
            uvs.into_f32().map(|[u, v]| DVec2::new(f64::from(u), f64::from(v))).collect::<Vec<_>>()
        });
        let colours = reader.read_colors(0).map(|c| c.into_rgb_f32().map(dvec3).collect::<Vec<_>>());
        let mesh = Mesh {
            normals: normals.filter(|v| v.len() == count).map(Attribute::per_position),
            uvs: uvs.filter(|v| v.len() == count).map(Attribute::per_position),
            colours: colours.filter(|v| v.len() == count).map(Attribute::per_position),
            positions,
            triangles,
        };
        if primitive.morph_targets().next().is_some() {
            self.warn(format!("{name}: morph targets are not used"));
        }
        if out_of_range > 0 {
            self.warn(format!("{name}: left out {out_of_range} triangle(s) with an index out of range"));
        }
        Ok(Some(mesh))
    }

    /// One matrix a vertex, from the rest pose of a skin's joints (glTF 2.0, section 3.7.3).
    fn pose(
        &mut self,
        skin: &gltf::Skin,
        primitive: &gltf::Primitive,
        world_from_nodes: &[Option<DMat4>],
    ) -> Option<Vec<DMat4>> {
        let get = |buffer: gltf::Buffer| self.buffers.get(buffer.index()).map(Vec::as_slice);
        let reader = primitive.reader(get);
        let joints: Vec<[u16; 4]> = reader.read_joints(0)?.into_u16().collect();
        let weights: Vec<[f32; 4]> = reader.read_weights(0)?.into_f32().collect();
        let joint_from_mesh: Option<Vec<DMat4>> = skin
            .reader(get)
            .read_inverse_bind_matrices()
            .map(|matrices| matrices.map(|m| glam::Mat4::from_cols_array_2d(&m).as_dmat4()).collect());
        let world_from_mesh: Vec<DMat4> = skin
            .joints()
            .enumerate()
            .map(|(i, joint)| {
                let world_from_joint = world_from_nodes[joint.index()].unwrap_or(DMat4::IDENTITY);
                let inverse_bind = joint_from_mesh.as_ref().and_then(|m| m.get(i)).copied();
                world_from_joint * inverse_bind.unwrap_or(DMat4::IDENTITY)
            })
            .collect();
        let blend = |(joints, weights): (&[u16; 4], &[f32; 4])| {
            let mut sum = DMat4::ZERO;
            for (&joint, &weight) in joints.iter().zip(weights) {
                sum += *world_from_mesh.get(joint as usize)? * f64::from(weight);
            }
            // The last row of a blend is the sum of the weights.
            (sum.w_axis.w > 0.0).then(|| sum * (1.0 / sum.w_axis.w))
        };
        let matrices: Option<Vec<DMat4>> = joints.iter().zip(&weights).map(blend).collect();
        if matrices.is_none() {
            self.warn("a skin refers to joints it does not have; drawn without it");
        }
        matrices
    }

    fn camera(&mut self, camera: &gltf::Camera, name: String, world_from_node: &DMat4) {
        let position = world_from_node.w_axis.truncate();
        let axis = |v: DVec3| world_from_node.transform_vector3(v).try_normalize();
        let (Some(forward), Some(up)) = (axis(DVec3::NEG_Z), axis(DVec3::Y)) else {
            self.warn(format!("camera {name} has no size; left out"));
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
            self.warn(format!("camera {name} sees nothing; left out"));
            return;
        }
        let target = position + forward;
        self.scene.cameras.push(Camera {
            name,
            position,
            target,
            up,
            projection,
            view_height,
            view_width,
            viewpoint_distance: 1.0,
        });
    }

    fn light(&mut self, light: &gltf::khr_lights_punctual::Light, name: String, world_from_node: &DMat4) {
        use gltf::khr_lights_punctual::Kind;
        let position = world_from_node.w_axis.truncate();
        let direction =
            world_from_node.transform_vector3(DVec3::NEG_Z).try_normalize().unwrap_or(DVec3::NEG_Z);
        let falloff = Falloff::InverseSquare { range: light.range().map(f64::from) };
        let kind = match light.kind() {
            Kind::Directional => LightKind::Directional { direction },
            Kind::Point => LightKind::Point { position, falloff },
            Kind::Spot { inner_cone_angle, outer_cone_angle } => LightKind::Spot {
                position,
                direction,
                falloff,
                inner_angle: f64::from(inner_cone_angle),
                outer_angle: f64::from(outer_cone_angle),
            },
        };
        // KHR_lights_punctual gives candela or lux, of which a diffuse surface reflects 1/pi; intensity 1 here shows a
        // surface in its own colour.
        let intensity = f64::from(light.intensity()) / std::f64::consts::PI;
        if !(intensity.is_finite() && position.is_finite()) {
            self.warn(format!("light {name} is not finite; left out"));
            return;
        }
        let colour = Colour::Linear(dvec3(light.color()));
        self.scene.lights.push(Light { name, colour, intensity, kind });
    }
}

fn deform(mesh: &mut Mesh, world_from_vertex: &[DMat4]) {
    for (position, m) in mesh.positions.iter_mut().zip(world_from_vertex) {
        *position = m.transform_point3(*position);
    }
    if let Some(normals) = &mut mesh.normals {
        for (normal, m) in normals.values.iter_mut().zip(world_from_vertex) {
            *normal = crate::scene::normal_matrix(m) * *normal;
        }
    }
}

fn into_triangles(order: &[u32], mode: gltf::mesh::Mode) -> Vec<[u32; 3]> {
    use gltf::mesh::Mode;
    match mode {
        Mode::TriangleStrip => order
            .windows(3)
            .enumerate()
            .map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] })
            .collect(),
        Mode::TriangleFan => order.windows(2).skip(1).map(|w| [order[0], w[0], w[1]]).collect(),
        _ => order.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
    }
}

fn dvec3(v: [f32; 3]) -> DVec3 {
    DVec3::from(v.map(f64::from))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans() {
        use gltf::mesh::Mode;
        let order = [5, 6, 7, 8];
        assert_eq!(into_triangles(&order, Mode::TriangleStrip), [[5, 6, 7], [7, 6, 8]]);
        assert_eq!(into_triangles(&order, Mode::TriangleFan), [[5, 6, 7], [5, 7, 8]]);
        assert_eq!(into_triangles(&order, Mode::Triangles), [[5, 6, 7]]);
        assert!(into_triangles(&[], Mode::TriangleFan).is_empty());
    }
}
