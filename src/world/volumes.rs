//! The volumes of a world: media within closed surfaces that transmit light.
//!
//! Where several volumes hold a point, the one that encloses least is the medium there. So a volume within another goes
//! before it, and where two overlap the medium is the same whichever a path enters first (with priorities set by hand:
//! Schmidt and Budge, Simple Nested Dielectrics in Ray Traced Images, journal of graphics tools 7(2), 2002).

use std::cell::LazyCell;
use std::collections::HashMap;
use std::sync::Arc;

use glam::DVec3;

use super::PreparedMaterial;
use crate::bvh::Primitive;
use crate::bvh::detail::EDGE_DISTANCE;
use crate::scene::mesh::support::PointTrees;
use crate::scene::mesh::topology::Topology;
use crate::scene::{Material, Mesh, Object, Phong, Shape, bounds};

/// The volumes of a world.
#[derive(Debug)]
pub(crate) struct Volumes {
    /// In the order of precedence.
    volumes: Vec<Volume>,
    /// For each object, the index of its volume.
    of_object: Vec<Option<u32>>,
    /// The box around all volumes.
    bounds: [DVec3; 2],
}

/// A volume.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Volume {
    /// The index of refraction; 1 for one that no light enters.
    pub(crate) ior: f64,
    /// The absorption coefficient by channel, per unit of length; infinite for an opaque medium.
    absorption: Option<DVec3>,
    /// Whether the surface is closed and has one winding. Otherwise nothing is inside, and the back alone tells that a
    /// ray came through the medium.
    pub(crate) is_closed: bool,
    /// The corners of its box, farther out by what points of surfaces may be off.
    bounds: [DVec3; 2],
}

impl Volume {
    /// The volume of a material, without a surface; `None` for an opaque or thin one.
    fn new(material: &PreparedMaterial) -> Option<Self> {
        let (ior, absorption) = match material {
            Material::MetallicRoughness(m) => {
                let volume = m.layers.volume.filter(|_| m.layers.transmission > 0.0)?;
                let colour = volume.attenuation_colour.clamp(DVec3::ZERO, DVec3::ONE);
                let distance = volume.attenuation_distance;
                (m.layers.ior, distance.is_finite().then(|| colour.map(|c| -libm::log(c) / distance)))
            }
            Material::Phong(Phong { refraction, .. }) => ((*refraction)?.ior, None),
        };
        let ior = if ior > 0.0 && ior.is_finite() { ior } else { 1.0 };
        Some(Volume { ior, absorption, is_closed: false, bounds: [DVec3::ZERO; 2] })
    }

    /// Whether a point may be inside. `false` is certain of a closed surface.
    pub(crate) fn may_hold(&self, point: DVec3) -> bool {
        is_within(self.bounds, point)
    }

    /// The transmittance over a distance (Beer and Lambert).
    pub(crate) fn transmittance(&self, distance: f64) -> DVec3 {
        // `f64::max` turns the NaN of 0 times infinity into 0.
        let passed = |coefficient: f64| libm::exp(-(coefficient * distance).max(0.0));
        self.absorption.map_or(DVec3::ONE, |absorption| absorption.map(passed))
    }
}

fn is_within([min, max]: [DVec3; 2], point: DVec3) -> bool {
    point.cmpge(min).all() && point.cmple(max).all()
}

impl Volumes {
    /// The volumes of objects; `None` where there are none.
    pub(super) fn new(objects: &[Object], materials: &[PreparedMaterial]) -> Option<Self> {
        let (mut found, mut closed_meshes) = (Vec::new(), HashMap::new());
        let trees = LazyCell::new(|| PointTrees::of(objects));
        for (index, object) in objects.iter().enumerate() {
            let Some(volume) = Volume::new(&materials[object.material.0 as usize]) else { continue };
            let Some((min, max)) = bounds(&trees, std::slice::from_ref(object)) else { continue };
            // Origins move by EDGE_DISTANCE of their triangle's coordinates; points in f32 are off by 4 times as much.
            let margin = 8.0 * EDGE_DISTANCE * min.abs().max(max.abs()).max_element();
            let is_closed = match &object.shape {
                Shape::Analytic(shape) => shape.is_closed(),
                Shape::Mesh(mesh) => is_closed(mesh),
                Shape::Placed(placed) => {
                    let mesh = &placed.mesh;
                    *closed_meshes.entry(Arc::as_ptr(mesh)).or_insert_with(|| is_closed(mesh))
                }
            };
            let volume = Volume { is_closed, bounds: [min - margin, max + margin], ..volume };
            found.push((enclosed(object, min / 2.0 + max / 2.0), index, volume));
        }
        found.sort_by(|(a, ..), (b, ..)| a.total_cmp(b));
        let mut of_object = vec![None; objects.len()];
        (0..).zip(&found).for_each(|(volume, (_, object, _))| of_object[*object] = Some(volume));
        let volumes: Vec<Volume> = found.into_iter().map(|(.., volume)| volume).collect();
        let bounds = volumes
            .iter()
            .map(|volume| volume.bounds)
            .reduce(|[min, max], other| [min.min(other[0]), max.max(other[1])])?;
        Some(Volumes { volumes, of_object, bounds })
    }

    /// The index of an object's volume.
    pub(crate) fn of_object(&self, object: u32) -> Option<u32> {
        self.of_object[object as usize]
    }

    /// A volume by its index.
    pub(crate) fn get(&self, volume: u32) -> &Volume {
        &self.volumes[volume as usize]
    }

    /// Whether a point may be inside any volume.
    pub(crate) fn may_hold(&self, point: DVec3) -> bool {
        is_within(self.bounds, point)
    }
}

fn is_closed(mesh: &Mesh) -> bool {
    Topology::of_triangles(&mesh.positions, &mesh.triangles).closed_objects == [Some(true)]
}

/// How much a closed surface encloses: the sum of signed tetrahedra between its triangles and `middle`.
fn enclosed(object: &Object, middle: DVec3) -> f64 {
    let signed = object.shape.primitives().map(|primitive| match primitive {
        Primitive::Triangle(triangle) => {
            let [a, b, c] = triangle.0.map(|corner| corner - middle);
            a.dot(b.cross(c)) / 6.0
        }
        Primitive::Analytic(shape) => shape.volume(),
    });
    signed.sum::<f64>().abs()
}
