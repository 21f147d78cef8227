//! Rays of the speed test: primary rays, shadow rays, diffuse rays of one bounce, random rays.

use glam::DVec3;
use rayon::prelude::*;

use super::super::{Mesh, Numbers, own};
use kiln::bvh::detail::{Accelerator, HitBuffer, Layout, Precision, RayBuffer, SurfacePoint};
use kiln::bvh::{Hit, Numerics, Primitive, Ray, Traversal};
use kiln::world::View;

/// Kind of rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Primary rays from a pinhole camera, tile by tile: closest hit.
    Primary,
    /// Shadow rays from these hits to a point light, in the same order: any hit.
    Shadow,
    /// Diffuse rays from these hits, cosine-distributed about the normal: closest hit.
    Diffuse,
    /// Rays between random points of the bounds: closest hit.
    Random,
}

kiln::names!(Kind { Primary = "primary", Shadow = "shadow", Diffuse = "diffuse", Random = "random" });

impl Kind {
    /// Whether these are any-hit queries.
    pub fn is_any_hit(self) -> bool {
        self == Kind::Shadow
    }

    /// Whether neighbouring rays are coherent.
    pub fn is_coherent(self) -> bool {
        matches!(self, Kind::Primary | Kind::Shadow)
    }
}

/// Side of a tile of primary rays in pixels.
const TILE: u32 = 16;

/// Rays per batch, those of a tile.
pub const BATCH: usize = (TILE * TILE) as usize;

/// Camera, picture size and light.
#[derive(Debug, Clone)]
pub struct ViewSetup {
    /// The camera.
    pub view: View,
    /// Width and height of the picture in pixels.
    pub size: u32,
    /// The light.
    pub light: DVec3,
}

/// Rays of every kind, with f32 values.
#[derive(Debug, Clone, Default)]
pub struct RaySets {
    rays: [Vec<Ray>; 4],
}

impl RaySets {
    /// Rays for a picture of the mesh.
    pub fn new(mesh: &Mesh, setup: &ViewSetup) -> Self {
        let accelerator = own::accelerator(mesh, Layout::default(), Numerics::Watertight);
        let primary = primary(setup);
        let hits = closest_hits(&*accelerator, &primary);
        let points: Vec<(u64, Point)> = (0..)
            .zip(primary.iter().zip(&hits))
            .filter_map(|(index, (ray, hit))| Some((index, Point::new(&*accelerator, ray, hit.as_ref()?))))
            .collect();
        let shadow = points.iter().filter_map(|(_, point)| shadow(point, setup.light)).collect();
        let diffuse = points.iter().filter_map(|(index, point)| diffuse(point, *index)).collect();
        let random = random(mesh, primary.len() as u64);
        RaySets { rays: [primary, shadow, diffuse, random] }
    }

    /// The rays of a kind.
    pub fn of(&self, kind: Kind) -> &[Ray] {
        &self.rays[kind as usize]
    }
}

/// Tiles in row-major order, with pixels in row-major order; tiles at the right and lower edges may be smaller.
fn primary(setup: &ViewSetup) -> Vec<Ray> {
    let starts = || (0..setup.size).step_by(TILE as usize);
    let side = |start: u32| start..(start + TILE).min(setup.size);
    let tiles = starts().flat_map(|y| starts().map(move |x| (x, y)));
    let pixels = tiles.flat_map(|(x, y)| side(y).flat_map(move |y| side(x).map(move |x| (x, y))));
    pixels.map(|(x, y)| setup.view.ray(x, y, Precision::Single)).collect()
}

fn closest_hits(accelerator: &dyn Accelerator, rays: &[Ray]) -> Vec<Option<Hit>> {
    let batch = |rays: &[Ray]| {
        let (rays, mut hits) = (RayBuffer::from(rays), HitBuffer::default());
        accelerator.closest_hits(rays.rays(), &mut hits, &mut Traversal::default());
        hits.iter().collect::<Vec<_>>()
    };
    rays.par_chunks(BATCH).flat_map_iter(batch).collect()
}

/// Hit point of a ray, with the normal on the side of the ray.
struct Point {
    surface: SurfacePoint,
    normal: DVec3,
    origin: DVec3,
}

impl Point {
    fn new(accelerator: &dyn Accelerator, ray: &Ray, hit: &Hit) -> Self {
        let (surface, normal) = match accelerator.primitive(hit.slot) {
            Primitive::Triangle(triangle) => {
                let [v, w] = hit.barycentrics;
                let surface =
                    SurfacePoint::on_triangle(triangle.0, [1.0 - v - w, v, w], Numerics::Watertight);
                (surface, triangle.normal().try_normalize().unwrap_or(-ray.direction()))
            }
            Primitive::Analytic(shape) => shape.surface(ray.at(hit.t)),
        };
        let normal = if normal.dot(ray.direction()) > 0.0 { -normal } else { normal };
        Point { surface, normal, origin: surface.origin_towards(normal, Numerics::Fast) }
    }
}

/// The shadow ray to the light; `None` if the light is on the other side.
fn shadow(point: &Point, light: DVec3) -> Option<Ray> {
    if (light - point.surface.position).dot(point.normal) <= 0.0 {
        return None;
    }
    let to_light = light - point.origin;
    let distance = to_light.length();
    // The ray ends before the light by the rounding error of its direction.
    let beside = 2.0 * Precision::Single.epsilon();
    let ray =
        Precision::Single.ray(point.origin, to_light / distance, 0.0, single(distance * (1.0 - beside)));
    (ray.t_max() > 0.0).then_some(ray)
}

fn single(x: f64) -> f64 {
    f64::from(x as f32)
}

/// The sum of the normal and a random direction is cosine-distributed.
fn diffuse(point: &Point, index: u64) -> Option<Ray> {
    let direction = (point.normal + Numbers::new(10, index).direction()).try_normalize()?;
    let ray = Precision::Single.ray(point.origin, direction, 0.0, f64::INFINITY);
    // Rounding may turn the direction into the surface.
    (ray.direction().dot(point.normal) > 0.0).then_some(ray)
}

fn random(mesh: &Mesh, count: u64) -> Vec<Ray> {
    let corners = || mesh.positions.iter().map(|p| p.as_dvec3());
    let (Some(min), Some(max)) = (corners().reduce(DVec3::min), corners().reduce(DVec3::max)) else {
        return Vec::new();
    };
    let one = |index: u64| {
        let mut numbers = Numbers::new(11, index);
        let mut point = || min + (max - min) * DVec3::new(numbers.unit(), numbers.unit(), numbers.unit());
        let (from, to) = (point(), point());
        Some(Precision::Single.ray(from, (to - from).try_normalize()?, 0.0, f64::INFINITY))
    };
    (0..count).filter_map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::super::super::generate::Family;
    use super::super::{Viewpoint, scene, view_setup};
    use super::*;

    fn ray_sets(mesh: &Mesh, size: u32) -> (ViewSetup, RaySets) {
        let setup = view_setup(&scene(mesh), Viewpoint::Outside, size).expect("a view");
        let ray_sets = RaySets::new(mesh, &setup);
        (setup, ray_sets)
    }

    #[test]
    fn primary_rays_are_in_tile_order() {
        let (setup, ray_sets) = ray_sets(&Family::Sphere.mesh(1000), 40);
        let primary = ray_sets.of(Kind::Primary);
        let at = |x, y| setup.view.ray(x, y, Precision::Single);
        assert_eq!(primary.len(), 1600);
        // The second ray of the first tile, the first of its second row, and the first of the second tile.
        assert_eq!((primary[1], primary[16], primary[256]), (at(1, 0), at(0, 1), at(16, 0)));
        // The third tile is 8 wide, so the second row of tiles begins after 256 + 256 + 128 rays.
        assert_eq!((primary[512 + 8], primary[640]), (at(32, 1), at(0, 16)));
    }

    #[test]
    fn all_values_are_f32() {
        let (_, ray_sets) = ray_sets(&Family::Soup.mesh(1000), 64);
        for kind in Kind::ALL {
            assert!(!ray_sets.of(kind).is_empty(), "{kind:?}");
            for ray in ray_sets.of(kind) {
                for number in
                    [ray.origin().to_array(), ray.direction().to_array(), [ray.t_min(), ray.t_max(), 0.0]]
                        .concat()
                {
                    assert_eq!(number, f64::from(number as f32), "{kind:?} {ray:?}");
                }
            }
        }
    }

    #[test]
    fn diffuse_rays_are_cosine_distributed() {
        let (normal, origin) = (DVec3::new(1.0, 2.0, -2.0) / 3.0, DVec3::ZERO);
        let surface = SurfacePoint { position: origin, start: origin, reach: DVec3::ZERO };
        let rays = (0..100_000).filter_map(|index| diffuse(&Point { surface, normal, origin }, index));
        let cosines: Vec<f64> = rays.map(|ray| ray.direction().dot(normal)).collect();
        // With the density cos / pi, the mean cosine is 2/3 and the mean squared cosine 1/2, so the mean of n samples
        // has the standard deviation sqrt((1/2 - 4/9) / n).
        let n = cosines.len() as f64;
        assert!(n > 99_990.0, "few are lost to rounding");
        let mean = cosines.iter().sum::<f64>() / n;
        assert!((mean - 2.0 / 3.0).abs() < 5.0 / (18.0 * n).sqrt(), "{mean}");
    }

    #[test]
    fn shadow_rays_end_before_the_light_and_start_on_its_side() {
        let normal = DVec3::Y;
        let surface = SurfacePoint { position: DVec3::ZERO, start: DVec3::ZERO, reach: DVec3::ONE };
        let point = Point { surface, normal, origin: surface.origin_towards(normal, Numerics::Fast) };
        let light = DVec3::new(3.0, 4.0, 0.0);
        let ray = shadow(&point, light).expect("a ray");
        // The light is 5 away.
        assert!(ray.t_max() < 5.0 && ray.t_max() > 5.0 * (1.0 - 1e-6), "{}", ray.t_max());
        assert!((ray.at(ray.t_max()) - light).length() < 1e-5);
        assert_eq!(shadow(&point, -light), None);
    }
}
