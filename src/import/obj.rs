//! Wavefront OBJ importer, on `tobj` in double precision.
//!
//! MTL materials become Phong: colour `Kd`, k_d = 1, k_s = maximum of `Ks`, n = `Ns`, k_a = 1. Colours are display
//! values. Materials with `Pr`, `Pm`, `Ps` or `Pc` become metallic-roughness (`obj_pbr`). `norm` and `bump` become
//! normal maps.

use std::cell::RefCell;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3};

use super::Source;
use super::images::{Channels, ImageLoader};
use super::obj_pbr;
use super::obj_text::{BUMP_MULTIPLIER, clean_mtl, clean_obj, find_obj_fault, is_point_or_line};
use super::polygon::{Cuts, Triangulator};
use super::tangents::make_tangents;
use crate::error::{Error, Place, Result, Warnings, contain};
use crate::film::Colour;
use crate::film::colour::srgb_decode;
use crate::limits::{self, unreadable};
use crate::scene::{
    Attribute, Material, MaterialId, Mesh, MetallicRoughness, NormalMap, Object, Opacity, Phong, Sampler,
    Scene, Shape, Texture,
};

/// Reads an OBJ file, its materials and their textures.
pub(crate) fn read(source: &Source, warnings: &mut Warnings) -> Result<Scene> {
    check_memory(source)?;
    let original = source.text();
    if original.lines().any(|line| is_point_or_line(line.trim_start())) {
        warnings.push(format!("{}: points and lines are not drawn", source.file.display()));
    }
    let text = clean_obj(&original);
    let options = tobj::LoadOptions {
        single_index: false,
        triangulate: false,
        ignore_points: true,
        ignore_lines: true,
    };
    let shared = RefCell::new(&mut *warnings);
    let load_materials = |name: &Path| read_mtl(source, name, &mut shared.borrow_mut());
    let (models, materials) = contain(|| tobj::load_obj_buf(&mut text.as_bytes(), &options, load_materials))
        .unwrap_or(Err(tobj::LoadError::GenericFailure))
        .map_err(|e| explain(source, &text, &e))?;
    let materials = materials.unwrap_or_default();
    warn_of_unknown_materials(&text, &materials, &source.file, warnings);

    let mut scene = Scene::default();
    let mut images = ImageLoader::new(source);
    for material in &materials {
        let material = convert_material(material, source, &mut scene, &mut images, warnings)?;
        scene.add_material(material);
    }
    let mut plain = None;
    let mut triangulator = Triangulator::new();
    let mut cuts = Cuts::default();
    let mut has_normals = faces_with_normals(&text).into_iter();
    for model in models {
        let material = match model.mesh.material_id {
            Some(id) => MaterialId(id as u32),
            None => *plain.get_or_insert_with(|| scene.add_material(Material::Phong(Phong::default()))),
        };
        let mut mesh = convert_mesh(&model.mesh, &mut has_normals, &mut triangulator, &mut cuts);
        if scene.materials[material.0 as usize].normal_map().is_some() {
            make_tangents(&mut mesh);
        }
        scene.objects.push(Object { name: model.name, input: 0, material, shape: Shape::Mesh(mesh) });
    }
    cuts.warn(&source.file, warnings);
    Ok(scene)
}

/// Checks the memory needed for parsing, from the counts of vertices and corners.
///
/// # Errors
/// [`Error::Input`] with the bytes needed.
fn check_memory(source: &Source) -> Result<()> {
    // The cleaned text reserves an eighth more than the file. Per attribute of a vertex: f64 in tobj's arrays (which
    // double as they grow), in its model and in the mesh, and a map entry. Per corner: 26 bytes of a face, doubled, and
    // indices in the model and the mesh.
    const ATTRIBUTE: u64 = 160;
    const CORNER: u64 = 80;
    let mut needed = source.bytes.len() as u64 * 9 / 8;
    for line in source.bytes.split(|byte| matches!(byte, b'\n' | b'\r')) {
        needed += match line.trim_ascii_start() {
            [b'v', ..] => ATTRIBUTE,
            [b'f', b' ' | b'\t', corners @ ..] => {
                let ends = |pair: &&[u8]| !pair[0].is_ascii_whitespace() && pair[1].is_ascii_whitespace();
                CORNER * (1 + corners.trim_ascii().windows(2).filter(ends).count() as u64)
            }
            _ => 0,
        };
    }
    limits::check(needed).map_err(|excess| {
        Error::input(source.file.as_path(), format!("reading its meshes {excess}"), excess.hint())
    })
}

fn explain(source: &Source, text: &str, e: &tobj::LoadError) -> Error {
    match find_obj_fault(text) {
        Some((line, what)) => Error::input(Place::line(&source.file, line), what, "correct the line"),
        None => Error::input(source.file.as_path(), format!("not a usable OBJ file: {e}"), "export it again"),
    }
}

fn read_mtl(source: &Source, name: &Path, warnings: &mut Warnings) -> tobj::MTLLoadResult {
    let name = PathBuf::from(name.to_string_lossy().replace('\\', "/"));
    let path = source.sibling(&name);
    match source.files.read(&path) {
        Ok(bytes) => {
            let text = String::from_utf8_lossy(bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&bytes));
            let text = clean_mtl(&text, &path.display().to_string(), warnings);
            let read = contain(|| tobj::load_mtl_buf(&mut text.as_bytes()));
            let read = read.unwrap_or(Err(tobj::LoadError::GenericFailure)).or_else(|e| {
                warnings.push(format!("{}: materials left out: {e}", path.display()));
                Ok(Default::default())
            });
            read.map(|(mut materials, names)| {
                find_images(&mut materials, &name, source);
                (materials, names)
            })
        }
        Err(e) => {
            let e = unreadable(&path, &e);
            warnings.push(format!("{}: materials left out: {e}", source.file.display()));
            Ok(Default::default())
        }
    }
}

/// Searches images beside the MTL file `name`, then beside the OBJ, because exporters write paths relative to either.
fn find_images(materials: &mut [tobj::Material], name: &Path, source: &Source) {
    let Some(folder) = name.parent().filter(|folder| !folder.as_os_str().is_empty()) else { return };
    let images = materials.iter_mut().flat_map(|m| {
        let others = m.unknown_param.iter_mut();
        let others = others.filter(|(key, _)| *key == "norm" || obj_pbr::MAPS.contains(&key.as_str()));
        let textures = [m.diffuse_texture.as_mut(), m.dissolve_texture.as_mut(), m.normal_texture.as_mut()];
        let textures = textures.into_iter().flatten();
        textures.chain(others.map(|(_, image)| image))
    });
    for image in images {
        let beside = folder.join(&*image);
        if source.files.has(&source.sibling(&beside)) {
            *image = beside.to_string_lossy().into_owned();
        }
    }
}

fn warn_of_unknown_materials(text: &str, materials: &[tobj::Material], file: &Path, warnings: &mut Warnings) {
    let known: HashSet<&str> = materials.iter().map(|m| m.name.as_str()).collect();
    let used = text.lines().filter_map(|line| line.strip_prefix("usemtl "));
    for name in used.filter(|name| !known.contains(name)).collect::<std::collections::BTreeSet<_>>() {
        warnings.push(format!("{}: material `{name}` is not defined; drawn in grey", file.display()));
    }
}

fn convert_material(
    m: &tobj::Material,
    source: &Source,
    scene: &mut Scene,
    images: &mut ImageLoader,
    warnings: &mut Warnings,
) -> Result<Material> {
    let image = match &m.diffuse_texture {
        Some(name) => images.of_file(scene, &source.sibling(name), Channels::Colour, warnings)?,
        None => None,
    };
    let texture = image.map(|image| Texture { image, sampler: Sampler::default() });
    // MTL does not define a default of Kd; with a texture, white leaves it unchanged.
    let default = if texture.is_some() { [1.0; 3] } else { [0.8; 3] };
    let colour = Colour::Display(m.diffuse.unwrap_or(default).into());
    let opacity = convert_opacity(m, source, scene, images, warnings)?;
    let normal_map = convert_normal_map(m, source, scene, images, warnings)?;
    if obj_pbr::is_physically_based(m) {
        let textures = (texture, normal_map);
        let material = obj_pbr::convert(m, textures, source, scene, images, warnings)?;
        // What lets light through by `Tf` has no opacity by `d`, too.
        let opacity =
            opacity.filter(|opacity| material.layers.transmission == 0.0 || opacity.texture.is_some());
        return Ok(Material::MetallicRoughness(MetallicRoughness { opacity, ..material }));
    }
    if m.unknown_param.contains_key("map_Ke") {
        let (file, name) = (source.file.display(), &m.name);
        warnings.push(format!("{file}: material `{name}` has a map_Ke without Pr or Pm; drawn without it"));
    }
    let emission = m.emissive.filter(|ke| ke.iter().any(|&c| c > 0.0));
    let refraction = obj_pbr::refraction(m);
    let specular = m.specular.map_or(0.0, |ks| ks.into_iter().fold(0.0, f64::max));
    Ok(Material::Phong(Phong {
        name: m.name.clone(),
        colour,
        texture,
        specular,
        shininess: m.shininess.unwrap_or(1.0).max(0.0),
        emission: Colour::Display(emission.unwrap_or([0.0; 3]).into()),
        normal_map,
        opacity: opacity.filter(|opacity| refraction.is_none() || opacity.texture.is_some()),
        refraction,
        ..Phong::default()
    }))
}

/// A number of a key that `tobj` does not read.
fn parameter(m: &tobj::Material, key: &str) -> Option<f64> {
    m.unknown_param.get(key)?.trim().parse().ok().filter(|number: &f64| number.is_finite())
}

/// Opacity from `d` (or `Tr`, which is 1 - `d`) and `map_d`.
fn convert_opacity(
    m: &tobj::Material,
    source: &Source,
    scene: &mut Scene,
    images: &mut ImageLoader,
    warnings: &mut Warnings,
) -> Result<Option<Opacity>> {
    let factor = m.dissolve.or_else(|| Some(1.0 - parameter(m, "Tr")?)).unwrap_or(1.0).clamp(0.0, 1.0);
    if factor == 0.0 {
        let (file, name) = (source.file.display(), &m.name);
        warnings
            .push(format!("{file}: material `{name}` has the opacity 0 (`d` or `Tr`) and cannot be seen"));
    }
    let image = match &m.dissolve_texture {
        Some(name) => images.of_file(scene, &source.sibling(name), Channels::AlphaOrGrey, warnings)?,
        None => None,
    };
    let texture = image.map(|image| Texture { image, sampler: Sampler::default() });
    Ok((factor < 1.0 || texture.is_some()).then_some(Opacity { factor, texture, cutoff: None }))
}

/// Normal map from `norm`, or from the heights of `map_Bump` or `bump`, scaled by `-bm`.
fn convert_normal_map(
    m: &tobj::Material,
    source: &Source,
    scene: &mut Scene,
    images: &mut ImageLoader,
    warnings: &mut Warnings,
) -> Result<Option<NormalMap>> {
    let on = |image| Texture { image, sampler: Sampler::default() };
    if let Some(name) = m.unknown_param.get("norm") {
        if m.normal_texture.is_some() {
            let (file, name) = (source.file.display(), &m.name);
            warnings.push(format!("{file}: material `{name}` has a normal map; drawn without its bump map"));
        }
        let image = images.of_file(scene, &source.sibling(name), Channels::Colour, warnings)?;
        return Ok(image.map(|image| NormalMap { texture: on(image), scale: 1.0 }));
    }
    let Some(name) = &m.normal_texture else { return Ok(None) };
    let bump = images.bump_of_file(scene, &source.sibling(name), warnings)?;
    let multiplier = m.unknown_param.get(BUMP_MULTIPLIER).and_then(|bm| bm.parse::<f64>().ok());
    Ok(bump.map(|(image, steepest)| NormalMap {
        texture: on(image),
        scale: steepest * multiplier.unwrap_or(1.0),
    }))
}

/// For each face of a cleaned text, in order, whether all its corners have a normal index.
fn faces_with_normals(text: &str) -> Vec<bool> {
    let corners = |line: &str| line.split_whitespace().skip(1).count();
    text.lines()
        .filter(|line| line.starts_with("f ") && corners(line) >= 3)
        .map(|line| {
            let normal = |corner: &str| corner.split('/').nth(2).is_some_and(|n| !n.is_empty());
            line.split_whitespace().skip(1).all(normal)
        })
        .collect()
}

/// Converts a tobj model. `has_normals` holds for each face whether it has normal indices; tobj repeats those of the
/// previous face if not. `cuts` counts how polygons were triangulated.
fn convert_mesh(
    m: &tobj::Mesh,
    has_normals: &mut impl Iterator<Item = bool>,
    triangulator: &mut Triangulator,
    cuts: &mut Cuts,
) -> Mesh {
    let positions = triples(&m.positions);
    let mut corners: Vec<[usize; 3]> = Vec::with_capacity(m.indices.len());
    // For each triangle, whether its face has normal indices.
    let mut smooth: Vec<bool> = Vec::with_capacity(m.indices.len() / 3);
    if m.face_arities.is_empty() {
        corners.extend((0..m.indices.len() / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]));
        smooth.extend(has_normals.by_ref().take(corners.len()));
    } else {
        let mut polygon = Vec::new();
        let mut start = 0;
        for &arity in &m.face_arities {
            let end = start + arity as usize;
            polygon.clear();
            polygon.extend(m.indices[start..end].iter().map(|&i| positions[i as usize]));
            cuts.count(triangulator.triangulate(&polygon, |t| corners.push(t.map(|i| start + i))));
            smooth.resize(corners.len(), has_normals.next().unwrap_or(true));
            start = end;
        }
    }
    let pick = |indices: &[u32]| corners.iter().map(|c| c.map(|i| indices[i])).collect::<Vec<_>>();
    let normals = (!m.normals.is_empty() && smooth.contains(&true)).then(|| {
        let mut values = triples(&m.normals);
        let mut triangles = pick(&m.normal_indices);
        if smooth.contains(&false) {
            let own = values.len() as u32;
            values.push(DVec3::ZERO);
            let flat = triangles.iter_mut().zip(&smooth).filter(|(_, smooth)| !**smooth);
            flat.for_each(|(triangle, _)| *triangle = [own; 3]);
        }
        Attribute { values, triangles: Some(triangles) }
    });
    // v points up in OBJ.
    let uvs = (!m.texcoords.is_empty()).then(|| Attribute {
        values: m.texcoords.chunks_exact(2).map(|c| DVec2::new(c[0], 1.0 - c[1])).collect(),
        triangles: Some(pick(&m.texcoord_indices)),
    });
    let colours = (!m.vertex_color.is_empty()).then(|| {
        let decoded = triples(&m.vertex_color).into_iter();
        Attribute::per_position(decoded.map(|c| DVec3::from(c.to_array().map(srgb_decode))).collect())
    });
    Mesh { triangles: pick(&m.indices), positions, normals, uvs, colours, alphas: None, tangents: None }
}

fn triples(values: &[f64]) -> Vec<DVec3> {
    values.chunks_exact(3).map(DVec3::from_slice).collect()
}
