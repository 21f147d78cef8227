//! [`Bvh`]: crossings, winding numbers, containment and closedness.

use std::mem::take;

use crate::threads::*;
use glam::DVec3;

use super::open_edges::Unbalanced;
use super::splitmix64::splitmix64;
use super::{Bvh, Primitive, Shapes, Traversal, WindingNumber};
use crate::geometry::{
    LineTest, Point, Precision, PrimId, Ray, Rays, Side, Stored, Triangle, order_of_crossings,
};

/// A crossing of a ray and the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct SignedHit {
    /// Distance along the ray.
    pub t: f64,
    /// The primitive that is crossed.
    pub prim: PrimId,
    /// The side on which it is crossed.
    pub side: Side,
}

/// How often the edges of triangles are used. Vertices are those stored, rounded to the tier's precision, and equal if
/// their coordinates are. Triangles with two equal vertices do not count. An analytic shape that is not closed, such as
/// a disk, has one boundary edge, its rim.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Closedness {
    /// Edges of one triangle, and rims.
    pub boundary_edges: usize,
    /// Edges of more than two triangles.
    pub non_manifold_edges: usize,
    /// Edges that triangles use more often in one direction than in the other: boundary edges, inconsistent ones, and
    /// those where an open surface ends on another.
    pub unbalanced_edges: usize,
    /// Edges that triangles use at least twice more often in one direction: between triangles with opposite winding.
    pub inconsistent_edges: usize,
}

/// What decides whether a point is inside of a surface ([`Closedness::rule`]).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InsideRule {
    /// Whether the winding number of a closed surface with consistent winding is not 0: exact, by crossings of a ray.
    Crossings,
    /// Whether the generalised winding number of an open surface exceeds 1/2, or is below -1/2.
    GeneralisedWindingNumber,
    /// Whether two of three rays cross a surface with inconsistent winding an odd number of times. Not certain, but
    /// right for a closed surface that does not intersect itself, whatever the winding.
    Vote,
}

impl std::fmt::Display for InsideRule {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            InsideRule::Crossings => "crossings",
            InsideRule::GeneralisedWindingNumber => "generalised winding number",
            InsideRule::Vote => "vote",
        })
    }
}

impl Closedness {
    /// Whether the triangles are one or more closed surfaces with consistent winding, which may touch, intersect or
    /// contain each other: no edge is unbalanced. Then a winding number does not depend on the direction of the ray.
    pub fn is_closed(&self) -> bool {
        self.unbalanced_edges == 0
    }

    /// What decides whether a point is inside of this surface.
    pub fn rule(&self) -> InsideRule {
        Unbalanced { edges: self.unbalanced_edges, inconsistent: self.inconsistent_edges }.rule()
    }
}

/// The result of [`Bvh::contains`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Containment {
    /// Whether the point is inside, by `rule`.
    pub is_inside: bool,
    /// How far the winding number is from 1/2 or -1/2, beyond the bound on its error: `is_inside` is certain, for the
    /// surface as stored, where this is positive. 1/2 or more for a closed surface; small near holes, where what would
    /// close them decides; 0 for a vote.
    pub margin: f64,
    /// That of the surface.
    pub rule: InsideRule,
}

impl Containment {
    /// That of a surface with consistent winding.
    pub(super) fn of(number: WindingNumber, rule: InsideRule) -> Self {
        Containment { is_inside: number.is_inside(), margin: number.margin(), rule }
    }

    /// A distance from the surface, negative inside.
    pub(super) fn signed(self, distance: f64) -> f64 {
        if self.is_inside { -distance } else { distance }
    }
}

/// The error of queries that require a closed surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NotClosed(pub Closedness);

impl std::fmt::Display for NotClosed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Closedness { boundary_edges, unbalanced_edges, .. } = self.0;
        write!(
            f,
            "the surface is not closed: {boundary_edges} edges have one triangle only, {} are used more often in one \
             direction than in the other",
            unbalanced_edges - boundary_edges
        )
    }
}

impl std::error::Error for NotClosed {}

/// The direction of the rays of [`Bvh::winding_number`] and [`Bvh::contains`]. Rays nearly parallel to an axis meet the
/// fewest boxes; those parallel to it would meet the edges of axis-aligned models, which takes exact arithmetic.
pub const CONTAINS_DIRECTION: DVec3 = DVec3::new(3.0 / 64.0, 5.0 / 64.0, 1.0);

impl Bvh {
    /// The crossings of the ray between `t_min` and `t_max`, in order of distance: each passage through the surface
    /// once, also through edges and vertices, in the plane of triangles, or from a point of the surface.
    ///
    /// Decided by exact arithmetic, in every tier, for the triangles as stored: with corners rounded to the tier's
    /// precision. Counted are the crossings of a ray moved by less than any number, the same for all triangles
    /// (`geometry/crossing.rs` has the derivation): its origin is infinitesimally farther along +x, then +y,
    /// then +z. So for a closed surface, of any ray, their number is even from outside and odd from inside, and a
    /// surface that does not intersect itself is entered and left in turns. Rays that end where another begins have
    /// the crossings of both together.
    ///
    /// t is that of the ray itself, with a relative error below 2^-40, and does not decrease; ordered are the exact t
    /// of the moved ray, which triangles of the same plane have in common: those are ordered by id. A triangle has no
    /// more than one crossing, one without area none, a sphere up to two.
    pub fn crossings(&self, ray: &Ray, traversal: &mut Traversal) -> Vec<SignedHit> {
        let mut found = Vec::new();
        self.each_crossing(ray, traversal, |crossing, primitive| {
            found.push((0, (crossing, primitive.into())));
        });
        let mut places: Vec<u32> = (0..found.len() as u32).collect();
        let mut crossings: Vec<SignedHit> = in_order(ray, &found, &mut places).collect();
        if let Some(shapes) = self.own_shapes() {
            shapes.add_crossings(ray, &mut crossings, 0, traversal);
        }
        crossings
    }

    /// How often the surface winds around a point, counter-clockwise seen from outside: 1 inside of a closed mesh, 0
    /// outside, -1 inside of one that is turned inside out. Overlapping parts are added.
    ///
    /// Exact for a closed surface as stored ([`Bvh::closedness`]), in every tier. A point on the surface is taken as
    /// moved infinitesimally along +x, then +y, then +z. The point is in f64, coordinates below 2^-250 count as 0;
    /// NaN has winding number 0. For a surface that is not closed: the crossings that leave, less those that enter,
    /// of the ray in [`CONTAINS_DIRECTION`].
    pub fn winding_number(&self, point: impl Point, traversal: &mut Traversal) -> i32 {
        self.winding_along(CONTAINS_DIRECTION, point.to_dvec3(), traversal)
    }

    /// [`Bvh::winding_number`] by a ray in another direction.
    fn winding_along(&self, direction: DVec3, point: DVec3, traversal: &mut Traversal) -> i32 {
        let Some(ray) = winding_ray(point, direction) else { return 0 };
        let mut sides = take(&mut traversal.sides);
        self.each_crossing(&ray, traversal, |SignedHit { prim, side, .. }, _| {
            sides.push((prim, if side == Side::Leaving { 1 } else { -1 }));
        });
        if sides.len() > 1 {
            // A split triangle is in several slots; a sphere has two sides.
            sides.sort_unstable();
            sides.dedup();
        }
        let winding_number: i32 = sides.drain(..).map(|(_, side)| side).sum();
        traversal.sides = sides;
        winding_number + self.own_shapes().map_or(0, |shapes| shapes.winding_number(&ray, traversal))
    }

    /// Whether a point is inside the surface, by the rule that its edges call for ([`Closedness::rule`]), and the margin
    /// of certainty. The first call after building takes as long as [`Bvh::closedness`] and, for an open surface,
    /// [`Bvh::generalised_winding_number`].
    pub fn contains(&self, point: impl Point, traversal: &mut Traversal) -> Containment {
        let (point, rule) = (point.to_dvec3(), self.inside_rule());
        if rule == InsideRule::Vote {
            // Winding numbers are odd where the number of crossings is.
            let [x, y, z] = CONTAINS_DIRECTION.to_array();
            let directions = [CONTAINS_DIRECTION, DVec3::new(z, x, y), DVec3::new(y, z, x)];
            let is_odd = |&direction: &DVec3| self.winding_along(direction, point, traversal) % 2 != 0;
            return Containment {
                is_inside: directions.into_iter().filter(is_odd).count() > 1,
                margin: 0.0,
                rule,
            };
        }
        Containment::of(self.generalised_winding_number(point, 1.0, traversal), rule)
    }

    /// Whether a point is inside a closed surface.
    ///
    /// # Errors
    /// [`NotClosed`] if the surface is not.
    pub fn contains_if_closed(
        &self,
        point: impl Point,
        traversal: &mut Traversal,
    ) -> Result<bool, NotClosed> {
        if self.inside_rule() != InsideRule::Crossings {
            return Err(NotClosed(self.closedness()));
        }
        Ok(self.contains(point, traversal).is_inside)
    }

    /// The edges of the triangles that keep the surface from being closed. Computed at the first call after building or
    /// [`Bvh::update`], in O(n log n) time.
    pub fn closedness(&self) -> Closedness {
        if let Some(known) = self.closedness.get() {
            return *known;
        }
        // Not while the cell is locked: a thread that waits for parts of this work may take up other work that asks,
        // too.
        let found = closedness(self);
        *self.closedness.get_or_init(|| found)
    }

    /// Calls `found` with the crossings of a ray in no order, and their primitives; those of split triangles several
    /// times.
    fn each_crossing(
        &self,
        ray: &Ray,
        traversal: &mut Traversal,
        mut found: impl FnMut(SignedHit, Primitive),
    ) {
        let test = LineTest::new(ray);
        let mut visit = |prim, primitive| self.cross(&test, prim, primitive, &mut found);
        self.accelerator().each_near_ray(&test, &mut visit, traversal);
    }

    /// The same for the rays of a packet; `found` also takes the index of the ray.
    pub(super) fn each_crossing_of_rays(
        &self,
        rays: Rays,
        traversal: &mut Traversal,
        mut found: impl FnMut(usize, SignedHit, Primitive),
    ) {
        let mut visit = |index, test: &LineTest, prim, primitive| {
            self.cross(test, prim, primitive, |crossing, primitive| found(index, crossing, primitive));
        };
        self.accelerator().each_near_rays(rays, &mut visit, traversal);
    }

    /// Calls `found` with the crossings of a ray and a primitive.
    #[inline(always)]
    fn cross(
        &self,
        test: &LineTest,
        prim: PrimId,
        primitive: Primitive,
        mut found: impl FnMut(SignedHit, Primitive),
    ) {
        let primitive = self.oriented(prim, primitive);
        match &primitive {
            Primitive::Triangle(Triangle(corners)) => {
                if let Some((t, side)) = test.cross_triangle(corners) {
                    found(SignedHit { t, prim, side }, primitive);
                }
            }
            Primitive::Analytic(shape) => {
                for (t, side) in test.cross_shape(shape).into_iter().flatten() {
                    found(SignedHit { t, prim, side }, primitive);
                }
            }
        }
    }
}

/// The ray whose crossings give the winding number around a point; `None` for a point outside of all bounds, which are
/// finite in f32.
pub(super) fn winding_ray(point: DVec3, direction: DVec3) -> Option<Ray> {
    let is_finite = point.as_vec3().is_finite();
    is_finite.then(|| Precision::Double.ray(point, direction, 0.0, f64::INFINITY))
}

/// The crossings of a ray in their order, once each: a split triangle is in several slots. Of those that were found,
/// they are at `places`, which are sorted.
pub(super) fn in_order(
    ray: &Ray,
    found: &[(usize, (SignedHit, Stored<DVec3>))],
    places: &mut [u32],
) -> impl Iterator<Item = SignedHit> {
    let at = |place: &u32| &found[*place as usize].1;
    places.sort_unstable_by(|a, b| {
        let [(a, of_a), (b, of_b)] = [a, b].map(at);
        order_of_crossings(ray, [(a.t, a.side, of_a), (b.t, b.side, of_b)]).then(a.prim.cmp(&b.prim))
    });
    let key = move |place: &u32| (at(place).0.prim, at(place).0.side);
    // Rounded values of ascending numbers: the greater of two is as good a value for the second.
    let mut least = 0.0;
    places.chunk_by(move |a, b| key(a) == key(b)).map(move |same| {
        let crossing = at(&same[0]).0;
        least = crossing.t.max(least);
        SignedHit { t: least, ..crossing }
    })
}

/// A vertex that is compared by the bits of its coordinates.
pub(super) type Vertex = [u64; 3];

pub(super) fn vertex_of(position: DVec3) -> Vertex {
    // -0 + 0 is 0.
    position.to_array().map(|x| (x + 0.0).to_bits())
}

/// About the most edges that are sorted together, and the most parts: every primitive is visited for each, so that of large
/// meshes an eighth of the edges is in memory.
const EDGES: usize = 1 << 20;
const MOST_PARTS: usize = 8;

fn closedness(bvh: &Bvh) -> Closedness {
    let open = bvh.own_shapes().map_or(0, Shapes::open);
    let mut closedness = Closedness { boundary_edges: open, unbalanced_edges: open, ..Closedness::default() };
    let parts = (3 * bvh.ids() as usize).div_ceil(EDGES).clamp(1, MOST_PARTS) as u64;
    let mut edges: Vec<([Vertex; 2], bool)> = Vec::new();
    for part in 0..parts {
        // Of split triangles, which are in several slots, the first one counts.
        let mut is_known = vec![false; bvh.ids() as usize];
        edges.clear();
        bvh.each_oriented(|prim, primitive| {
            if std::mem::replace(&mut is_known[prim.0 as usize], true) {
                return;
            }
            match primitive {
                Primitive::Triangle(Triangle(corners)) => {
                    let [a, b, c] = corners.map(vertex_of);
                    if a != b && b != c && c != a {
                        let ends = [[a, b], [b, c], [c, a]]
                            .map(|[from, to]| ([from.min(to), from.max(to)], from < to));
                        edges.extend(ends.into_iter().filter(|(ends, _)| part_of(ends[0], parts) == part));
                    }
                }
                Primitive::Analytic(shape) => {
                    let open = usize::from(part == 0 && !shape.is_closed());
                    closedness.boundary_edges += open;
                    closedness.unbalanced_edges += open;
                }
            }
        });
        edges.par_sort_unstable();
        for uses in edges.chunk_by(|a, b| a.0 == b.0) {
            let forward = uses.iter().filter(|(_, is_forward)| *is_forward).count();
            closedness.boundary_edges += usize::from(uses.len() == 1);
            closedness.non_manifold_edges += usize::from(uses.len() > 2);
            let excess = uses.len().abs_diff(2 * forward);
            closedness.unbalanced_edges += usize::from(excess > 0);
            closedness.inconsistent_edges += usize::from(excess > 1);
        }
    }
    closedness
}

/// The part of edges that one with this vertex is in.
fn part_of(vertex: Vertex, parts: u64) -> u64 {
    if parts == 1 { 0 } else { vertex.into_iter().fold(0, |hash, bits| splitmix64(hash ^ bits)) % parts }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Layout;
    use crate::bvh::splitmix64::splitmix64;
    use crate::geometry::{BATCH, Numerics, PACKET, RayBuffer};

    /// Crossings sorted by id; once each.
    type Found = Vec<(PrimId, u64, Side)>;

    fn sort(mut found: Found) -> Found {
        found.sort_unstable_by_key(|(prim, _, side)| (*prim, *side == Side::Leaving));
        found.dedup();
        found
    }

    fn crossings(bvh: &Bvh, ray: &Ray) -> Found {
        let mut found = Vec::new();
        bvh.each_crossing(ray, &mut Traversal::default(), |SignedHit { t, prim, side }, _| {
            found.push((prim, t.to_bits(), side));
        });
        sort(found)
    }

    /// The crossings of each ray, of all together.
    fn crossings_of_packets(bvh: &Bvh, rays: &RayBuffer) -> Vec<Found> {
        let mut found = vec![Vec::new(); rays.len()];
        let of_packets = found.chunks_mut(PACKET).zip(rays.rays().chunks(PACKET));
        for (found, rays) in of_packets {
            let traversal = &mut Traversal::default();
            bvh.each_crossing_of_rays(rays, traversal, |index, SignedHit { t, prim, side }, _| {
                found[index].push((prim, t.to_bits(), side));
            });
        }
        found.into_iter().map(sort).collect()
    }

    #[test]
    fn every_layout_has_the_crossings_of_brute_force() {
        let number = |seed: u64| (splitmix64(seed) >> 44) as f64 / f64::from(1 << 19) - 1.0;
        let vector = |seed: u64| DVec3::from([3 * seed, 3 * seed + 1, 3 * seed + 2].map(number));
        let primitives: Vec<Primitive> = (0..400)
            .map(|seed| {
                let corners = [0, 1, 2].map(|k| vector(8 * seed) + vector(8 * seed + 1 + k) * 0.3);
                let ball = Primitive::from((corners[0].to_array(), 0.1));
                if seed % 7 == 0 { ball } else { Primitive::from(corners) }
            })
            .collect();
        let mut count = 0;
        for numerics in Numerics::ALL {
            let built = |layout| {
                let mut bvh = Bvh::over(&primitives, layout, numerics);
                bvh.set_clockwise([(100, false), (50, true), (0, true), (50, true), (200, false)]);
                bvh
            };
            let exhaustive = built(Layout::BruteForce);
            let trees: Vec<_> = Layout::trees().map(|layout| (layout, built(layout))).collect();
            // Rays with zeros in their direction are not traced as streams.
            let mut packets = [(); 2].map(|()| (RayBuffer::default(), Vec::new()));
            for seed in 10_000..10_300 {
                let (origin, direction) = (vector(2 * seed) * 1.5, vector(2 * seed + 1));
                let axis = DVec3::AXES[seed as usize % 3];
                let direction = if seed % 3 == 0 { axis } else { direction.normalize() };
                // Half of them through a corner of a triangle.
                let corner = match primitives[seed as usize % 400].rounded(numerics.precision()) {
                    Some(Primitive::Triangle(Triangle([a, ..]))) if seed % 2 == 0 => a - direction,
                    _ => origin,
                };
                let ray = Precision::Double.ray(corner, direction, 0.0, f64::INFINITY);
                let expected = crossings(&exhaustive, &ray);
                for (layout, tree) in &trees {
                    let name = numerics.name();
                    assert_eq!(crossings(tree, &ray), expected, "{layout:?}, {name}, {ray:?}");
                }
                count += expected.len();
                let (rays, of_rays) = &mut packets[usize::from(seed % 3 == 0)];
                rays.push(&ray);
                of_rays.push(expected);
            }
            for (rays, expected) in &packets {
                for (layout, tree) in &trees {
                    assert_eq!(crossings_of_packets(tree, rays), *expected, "{layout:?}");
                }
            }
        }
        // More than one for each ray in each tier.
        assert!(count > 300 * Numerics::ALL.len(), "{count} crossings");
    }

    /// [`Nearby::each_near_rays`] takes any number of rays, not only those of a packet.
    #[test]
    fn crossings_of_more_rays_than_a_stream_holds() {
        let triangle = Primitive::from([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        let rays: RayBuffer = (0..2 * BATCH + 3)
            .map(|i| {
                // Every other one passes the triangle, at x and y below 1/2.
                let x = (i / 2) as f64 / (2 * BATCH + 3) as f64 - if i % 2 == 0 { 0.0 } else { 2.0 };
                Precision::Double.ray(
                    DVec3::new(x, 0.25, 1.0),
                    DVec3::new(1e-3, 1e-3, -1.0),
                    0.0,
                    f64::INFINITY,
                )
            })
            .collect();
        for layout in Layout::trees().chain([Layout::BruteForce]) {
            let tree = Bvh::over(&[triangle], layout, Numerics::Watertight);
            let (mut found, traversal) = (Vec::new(), &mut Traversal::default());
            tree.each_crossing_of_rays(rays.rays(), traversal, |index, _, _| found.push(index));
            found.sort_unstable();
            found.dedup();
            assert!(found.iter().copied().eq((0..2 * BATCH + 3).step_by(2)), "{layout:?}: {found:?}");
        }
    }
}
