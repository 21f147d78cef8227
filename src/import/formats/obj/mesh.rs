//! Meshes of the runs of faces of an OBJ text: polygons are triangulated, normals of smoothing groups computed, and
//! each mesh keeps the vertices that it uses, in the order of the text.

use std::borrow::Cow;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::film::colour::srgb_decode;
use crate::import::formats::obj::assembly::{Assembly, Run};
use crate::import::formats::obj::faces::{Faces, MISSING};
use crate::import::meshes::polygon::{Cuts, Triangulator};
use crate::import::meshes::smooth::weighted_normals;
use crate::import::meshes::untextured::NO_UV;
use crate::scene::{Attribute, Mesh};

/// Number of polygons triangulated by one thread.
const BLOCK: usize = 1 << 14;

/// Indices of positions, texture coordinates and normals of triangles; the second or third may be empty.
type Triangles = [Vec<[u32; 3]>; 3];

/// The mesh of each run, and how its polygons were triangulated.
pub(super) fn meshes(assembly: &mut Assembly) -> (Vec<Mesh>, Cuts) {
    let runs = std::mem::take(&mut assembly.runs);
    let mut cuts = Cuts::default();
    let mut triangles: Vec<Triangles> = Vec::with_capacity(runs.len());
    let mut names = Vec::with_capacity(runs.len());
    for Run { name, material, faces } in runs {
        let (of_run, own) = triangulate(faces, &assembly.positions);
        cuts.add(&own);
        triangles.push(of_run);
        names.push(Run { name, material, faces: Faces::default() });
    }
    assembly.runs = names;
    smooth(&mut triangles, &assembly.positions, &mut assembly.normals);
    let Assembly { positions, colours, uvs, normals, .. } = assembly;
    let meshes = match &mut triangles[..] {
        [_] => {
            let take = |values: &mut Vec<DVec3>| Cow::Owned(std::mem::take(values));
            let uvs = Cow::Owned(std::mem::take(uvs));
            let only = triangles.remove(0);
            vec![mesh(only, take(positions), take(colours), uvs, take(normals))]
        }
        _ => {
            let values = (&positions[..], &colours[..], &uvs[..], &normals[..]);
            let mesh = |triangles| {
                mesh(triangles, values.0.into(), values.1.into(), values.2.into(), values.3.into())
            };
            triangles.into_par_iter().map(mesh).collect()
        }
    };
    (meshes, cuts)
}

/// Triangulates the polygons of a run.
fn triangulate(faces: Faces, positions: &[DVec3]) -> (Triangles, Cuts) {
    if faces.polygons.is_empty() {
        return (faces.triangles, Cuts::default());
    }
    let has = [0, 1, 2].map(|kind| {
        kind == 0
            || !faces.triangles[kind].is_empty()
            || faces.corners.iter().any(|corner| corner[kind] != MISSING)
    });
    let block = |triangulator: &mut Triangulator, index: usize| {
        let polygons = index * BLOCK..faces.polygons.len().min((index + 1) * BLOCK);
        triangulate_block(&faces, polygons, has, positions, triangulator)
    };
    let blocks = (0..faces.polygons.len().div_ceil(BLOCK)).into_par_iter();
    let blocks: Vec<(Triangles, Cuts)> = blocks.map_init(Triangulator::new, block).collect();
    let mut triangles = Triangles::default();
    for (kind, all) in triangles.iter_mut().enumerate() {
        all.reserve_exact(blocks.iter().map(|(block, _)| block[kind].len()).sum());
    }
    let mut cuts = Cuts::default();
    for (block, own) in blocks {
        triangles.iter_mut().zip(block).for_each(|(all, of_block)| all.extend(of_block));
        cuts.add(&own);
    }
    (triangles, cuts)
}

/// Triangulates some polygons of a run, and copies the triangles before each, and those after the last of the run.
fn triangulate_block(
    faces: &Faces,
    polygons: std::ops::Range<usize>,
    has: [bool; 3],
    positions: &[DVec3],
    triangulator: &mut Triangulator,
) -> (Triangles, Cuts) {
    let mut out = Triangles::default();
    let mut cuts = Cuts::default();
    let mut corners = Vec::new();
    let before = |polygon: usize| faces.polygons[polygon].triangles_before;
    let mut copied = if polygons.start == 0 { 0 } else { before(polygons.start - 1) };
    let copy = |out: &mut Triangles, from: usize, until: usize| {
        for kind in (0..3).filter(|&kind| has[kind]) {
            match faces.triangles[kind].get(from..until) {
                Some(triangles) => out[kind].extend_from_slice(triangles),
                None => out[kind].resize(out[kind].len() + until - from, [MISSING; 3]),
            }
        }
    };
    for polygon in polygons.clone() {
        copy(&mut out, copied, before(polygon));
        copied = before(polygon);
        let polygon = &faces.corners[faces.first_corner(polygon)..faces.first_corner(polygon + 1)];
        corners.clear();
        corners.extend(polygon.iter().map(|corner| positions[corner[0] as usize]));
        cuts.count(triangulator.triangulate(&corners, |triangle| {
            for kind in (0..3).filter(|&kind| has[kind]) {
                out[kind].push(triangle.map(|corner| polygon[corner][kind]));
            }
        }));
    }
    if polygons.end == faces.polygons.len() {
        copy(&mut out, copied, faces.triangles[0].len());
    }
    (out, cuts)
}

/// Adds normals for the triangles of smoothing groups: the sum, over the triangles of the group at a position, of their
/// normals, weighted by their angles there (Thürmer and Wüthrich, "Computing vertex normals from polygonal facets",
/// Journal of Graphics Tools 3(1), 1998).
fn smooth(triangles: &mut [Triangles], positions: &[DVec3], normals: &mut Vec<DVec3>) {
    let key = |normal: u32, position: u32| u64::from(normal) << 32 | u64::from(position);
    let smoothed = |normals: &[u32; 3]| normals[0] > MISSING;
    let mut keys: Vec<u64> = Vec::new();
    for [positions, _, normals] in &*triangles {
        let smooth = positions.iter().zip(normals).filter(|(_, normals)| smoothed(normals));
        keys.extend(smooth.flat_map(|(positions, normals)| positions.map(|p| key(normals[0], p))));
    }
    keys.par_sort_unstable();
    keys.dedup();
    let first = normals.len();
    // The keys of a group are consecutive numbers, unless its triangles leave out positions.
    let mut start = 0;
    let mut find = |wanted: u64| {
        if keys[start] >> 32 != wanted >> 32 {
            start = keys.partition_point(|key| key >> 32 < wanted >> 32);
        }
        let at = start + wanted.saturating_sub(keys[start]) as usize;
        if keys.get(at) == Some(&wanted) { at } else { keys.partition_point(|key| *key < wanted) }
    };
    normals.resize(first + keys.len(), DVec3::ZERO);
    for [of_positions, _, of_normals] in triangles {
        let smooth = of_positions.iter().zip(of_normals).filter(|(_, normals)| smoothed(normals));
        for (triangle, indices) in smooth {
            let weighted = weighted_normals(triangle.map(|i| positions[i as usize]));
            let group = indices[0];
            for ((index, position), normal) in indices.iter_mut().zip(triangle).zip(weighted) {
                let at = first + find(key(group, *position));
                normals[at] += normal;
                *index = at as u32;
            }
        }
    }
    normals[first..].iter_mut().for_each(|normal| *normal = normal.normalize_or_zero());
}

/// The mesh of `triangles`, with the values that they use.
fn mesh(
    [mut positions, mut uvs, mut normals]: Triangles,
    all_positions: Cow<[DVec3]>,
    all_colours: Cow<[DVec3]>,
    all_uvs: Cow<[DVec2]>,
    all_normals: Cow<[DVec3]>,
) -> Mesh {
    let of_positions = || {
        let used = renumber(&mut positions, all_positions.len());
        let mut colours = if all_colours.is_empty() { Vec::new() } else { gather(all_colours, &used) };
        // Colours with a NaN in some channels come from the file and are reported.
        let is_missing = |colour: DVec3| colour.is_nan_mask().all();
        let is_coloured = colours.par_iter().any(|&colour| !is_missing(colour));
        // White for positions without a colour.
        let decode = |colour: DVec3| {
            if is_missing(colour) { DVec3::ONE } else { DVec3::from(colour.to_array().map(srgb_decode)) }
        };
        colours.par_iter_mut().for_each(|colour| *colour = decode(*colour));
        let colours = is_coloured.then(|| Attribute::per_position(colours));
        (gather(all_positions, &used), colours)
    };
    let of_uvs = || attribute(&mut uvs, all_uvs, NO_UV);
    let of_normals = || attribute(&mut normals, all_normals, DVec3::ZERO);
    let ((positions_used, colours), (uv_values, normal_values)) =
        rayon::join(of_positions, || rayon::join(of_uvs, of_normals));
    [&mut positions, &mut uvs, &mut normals].into_iter().for_each(Vec::shrink_to_fit);
    Mesh {
        positions: positions_used,
        triangles: positions,
        uvs: uv_values.map(|values| Attribute { values, triangles: Some(uvs) }).into_iter().collect(),
        normals: normal_values.map(|values| Attribute { values, triangles: Some(normals) }),
        colours,
        alphas: None,
        tangents: None,
        is_mirrored: false,
    }
}

/// The values of an attribute, with `missing` at the end if it is used; `None` if no triangle has the attribute.
fn attribute<T: Copy>(triangles: &mut [[u32; 3]], all: Cow<[T]>, missing: T) -> Option<Vec<T>> {
    if triangles.iter().flatten().all(|&index| index >= MISSING) {
        return None;
    }
    let used = renumber(triangles, all.len());
    let mut values = gather(all, &used);
    let own = values.len() as u32;
    let without = triangles.iter_mut().flatten().filter(|index| **index >= MISSING);
    if without.map(|index| *index = own).count() > 0 {
        values.push(missing);
    }
    Some(values)
}

/// Which elements are used.
enum Used {
    All,
    /// In ascending order.
    Some(Vec<u32>),
}

/// Numbers the elements that `triangles` use from 0, in their order. [`MISSING`] elements are left as they are.
fn renumber(triangles: &mut [[u32; 3]], count: usize) -> Used {
    let present = |index: &u32| *index < MISSING;
    let range = |(min, max): (u32, u32), &index: &u32| (min.min(index), max.max(index));
    let (min, max) = triangles.iter().flatten().filter(|&i| present(i)).fold((u32::MAX, 0), range);
    let span = (max as usize + 1).saturating_sub(min as usize);
    let indices = || triangles.iter().flatten().copied().filter(present);
    // A table of the whole range, unless the elements are scattered over a much larger one.
    let is_dense = span / 16 <= triangles.len();
    let used: Vec<u32> = if is_dense {
        let mut is_used = vec![false; span];
        indices().for_each(|index| is_used[(index - min) as usize] = true);
        if span == count && is_used.iter().all(|&used| used) {
            return Used::All;
        }
        (min..=max).zip(is_used).filter_map(|(index, used)| used.then_some(index)).collect()
    } else {
        let mut used: Vec<u32> = indices().collect();
        used.sort_unstable();
        used.dedup();
        used
    };
    let indices = triangles.iter_mut().flatten().filter(|index| present(index));
    if used.len() == span {
        indices.for_each(|index| *index -= min);
    } else if is_dense {
        let mut number_of = vec![0; span];
        used.iter().zip(0..).for_each(|(&index, number)| number_of[(index - min) as usize] = number);
        indices.for_each(|index| *index = number_of[(*index - min) as usize]);
    } else {
        indices.for_each(|index| *index = used.partition_point(|&used| used < *index) as u32);
    }
    Used::Some(used)
}

/// The used elements of `all`.
fn gather<T: Copy>(all: Cow<[T]>, used: &Used) -> Vec<T> {
    match used {
        Used::All => {
            let mut all = all.into_owned();
            all.shrink_to_fit();
            all
        }
        Used::Some(used) => used.iter().map(|&index| all[index as usize]).collect(),
    }
}
