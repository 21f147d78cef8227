//! [`Bvh`] over meshes that are placed by transforms and can be moved.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::Arc;

use super::instances::{MeshBvh, can_be_instance};
use super::open_edges::Part;
use super::{
    Bvh, Instance, InvalidMesh, Layout, MeshSpace, NotFinite, Preset, Primitive, Slot, build, over_instances,
};
use crate::geometry::{Mesh, Numerics, Placed, PrimId, Triangle};

/// The instances of a [`Bvh`].
#[derive(Clone, Default)]
pub(super) struct InstanceTable {
    /// The id of the first triangle of each, and the number of all triangles.
    firsts: Vec<u32>,
    /// Their meshes, for the next [`Bvh::set_instances`].
    built: Vec<Arc<MeshBvh>>,
    /// `None` where other triangles are turned over than those of mirrored meshes ([`Bvh::set_clockwise`]).
    parts: Option<Vec<Part>>,
}

impl InstanceTable {
    /// The number of ids; `None` without instances.
    pub(super) fn ids(&self) -> Option<u32> {
        self.firsts.last().copied()
    }

    /// The instances; `None` of a structure over primitives.
    pub(super) fn parts(&self) -> Option<&[Part]> {
        self.parts.as_deref()
    }

    /// To be called where triangles are turned over.
    pub(super) fn forget_parts(&mut self) {
        self.parts = None;
    }

    /// Those of new instances, with what is known of their meshes and, of instances that have not moved, of their
    /// surfaces.
    fn parts_of(&self, placed: &[Placed]) -> Vec<Part> {
        let position = |placed: &Placed| {
            let (linear, offset) = placed.placement.as_one();
            (
                Arc::as_ptr(&placed.mesh),
                linear.to_cols_array().map(f64::to_bits),
                offset.to_array().map(f64::to_bits),
            )
        };
        let before = || self.parts.iter().flatten();
        let expanded = before().filter(|part| part.expansions.get().is_some());
        let expanded: HashMap<_, _> = expanded.map(|part| (position(&part.placed), part)).collect();
        let of_mesh = before().map(|part| (Arc::as_ptr(&part.placed.mesh), part.open_edges.clone()));
        let mut of_mesh: HashMap<_, _> = of_mesh.collect();
        let part = |placed: &Placed| {
            let same = (!expanded.is_empty()).then(|| expanded.get(&position(placed))).flatten();
            let same = same.filter(|part| part.placed.placement == placed.placement);
            Part {
                placed: placed.clone(),
                open_edges: of_mesh.entry(Arc::as_ptr(&placed.mesh)).or_default().clone(),
                expansions: same.map(|part| part.expansions.clone()).unwrap_or_default(),
            }
        };
        placed.iter().map(part).collect()
    }
}

impl Bvh {
    /// Builds over meshes with placements. Ids count the triangles of one instance after the other;
    /// [`Bvh::instance_of`] returns the instance of an id. Hits have the bits of those on moved copies of the meshes,
    /// in a list of triangles ([`Bvh::with`]), but in tier `fast`. The triangles of a mirrored mesh are turned over
    /// ([`Bvh::set_clockwise`]): its outside stays outside.
    ///
    /// A mesh that is placed several times is stored once, and has one tree. A placement that is nearly singular, or so
    /// far away that f32 boxes cull nothing, is stored as a copy.
    ///
    /// # Errors
    /// [`InvalidMesh`], with the id of the first triangle that has a vertex that does not exist, or one that is not
    /// finite in f32 where it is placed.
    pub fn from_instances(
        placed: &[Placed],
        preset: Preset,
        numerics: Numerics,
    ) -> Result<Self, InvalidMesh> {
        let mut bvh = Bvh::over(&[], Layout::Wide(preset), numerics);
        bvh.set_instances(placed)?;
        Ok(bvh)
    }

    /// Replaces all instances, or primitives. Meshes that are placed before and after (the same [`Arc`]) keep their
    /// trees: moving instances, and adding or removing some, builds the tree over the instances only. Which edges of a
    /// mesh are open is kept, too, as are expansions for generalised winding numbers of instances that do not move.
    /// [`Bvh::closedness`] is computed again when it is needed. On an error nothing changes.
    ///
    /// # Errors
    /// As those of [`Bvh::from_instances`].
    pub fn set_instances(&mut self, placed: &[Placed]) -> Result<(), InvalidMesh> {
        let mut firsts: Vec<u32> = vec![0];
        for placed in placed {
            let count = u32::try_from(placed.triangle_count()).ok();
            let next = count.and_then(|count| firsts.last()?.checked_add(count));
            // Slots have as many numbers, and one is reserved.
            firsts.push(next.filter(|next| *next < u32::MAX).ok_or(InvalidMesh::TooManyTriangles)?);
        }
        let built = self.instances.built.iter();
        let mut spaces: HashMap<*const Mesh, Option<MeshSpace>> =
            built.map(|built| (Arc::as_ptr(&built.mesh), Some(built.space))).collect();
        let mut instances = Vec::new();
        let mut copies = Vec::new();
        for (placed, &first) in placed.iter().zip(&firsts) {
            let space = match spaces.entry(Arc::as_ptr(&placed.mesh)) {
                Entry::Occupied(known) => *known.get(),
                Entry::Vacant(unknown) => {
                    check_mesh(&placed.mesh, first)?;
                    *unknown.insert(MeshSpace::of(&placed.mesh))
                }
            };
            let instance = Instance { placed: placed.clone(), first: PrimId(first) };
            match space {
                Some(space) if space.is_finite_at(&placed.placement) => {}
                _ => check_corners(&instance)?,
            }
            match space {
                Some(space) if can_be_instance(placed, &space, self.numerics) => instances.push(instance),
                _ => copies.extend(instance.slots()),
            }
        }
        let tree = self.layout.tree().expect("a `Bvh` has a tree");
        let precision = self.numerics.precision();
        let rounded = copies
            .into_iter()
            .filter_map(|Slot { primitive, id }| Some(Slot { primitive: primitive.rounded(precision)?, id }));
        let flat = build(rounded, self.layout, self.numerics);
        let mut built = self.instances.built.clone();
        let accelerator = if instances.is_empty() {
            built.clear();
            flat
        } else {
            over_instances(flat, instances, tree, self.numerics, &mut built)
        };
        let mut replaced = Bvh {
            accelerator: accelerator.into(),
            has_slot: Vec::new(),
            instances: InstanceTable { firsts, built, parts: None },
            ..self.clone()
        };
        replaced.set_user_geometry(self.user_geometries().cloned())?;
        // Also clears what is known of the surface.
        replaced.set_clockwise(sides(placed));
        replaced.instances.parts = Some(self.instances.parts_of(placed));
        *self = replaced;
        Ok(())
    }

    /// The index of the instance of a primitive, and the index of the triangle in its mesh. In a structure over
    /// primitives 0, and the id.
    ///
    /// # Panics
    /// For an id that no triangle of the instances has.
    pub fn instance_of(&self, prim: PrimId) -> (usize, u32) {
        match self.instances.firsts.as_slice() {
            [] => (0, prim.0),
            firsts => {
                // Instances without triangles have the id of the next one.
                let after = firsts.partition_point(|first| *first <= prim.0);
                assert!(0 < after && after < firsts.len(), "no triangle has the id {}", prim.0);
                (after - 1, prim.0 - firsts[after - 1])
            }
        }
    }
}

/// For [`Bvh::set_clockwise`].
fn sides(placed: &[Placed]) -> impl Iterator<Item = (usize, bool)> {
    placed.iter().map(|placed| (placed.triangle_count(), placed.is_mirrored()))
}

/// # Errors
/// The first triangle with a vertex that does not exist, or that is not finite. `first` is the id of the first
/// triangle.
fn check_mesh(mesh: &Mesh, first: u32) -> Result<(), InvalidMesh> {
    let vertices = mesh.positions.len();
    for (index, corners) in mesh.triangles.iter().enumerate() {
        let triangle = first as usize + index;
        for &vertex in corners {
            let position = mesh.positions.get(vertex as usize);
            let position = position.ok_or(InvalidMesh::Index { triangle, vertex, vertices })?;
            if !position.is_finite() {
                return Err(NotFinite::Primitive(triangle).into());
            }
        }
    }
    Ok(())
}

/// # Errors
/// The first triangle with a corner that is not finite in f32.
fn check_corners(instance: &Instance) -> Result<(), NotFinite> {
    for Slot { primitive, id } in instance.slots() {
        if let Primitive::Triangle(Triangle(corners)) = primitive
            && !corners.iter().all(|corner| corner.as_vec3().is_finite())
        {
            return Err(NotFinite::Primitive(id.0 as usize));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use glam::{DMat4, DVec3};

    use super::*;
    use crate::bvh::Traversal;
    use crate::bvh::splitmix64::splitmix64;
    use crate::geometry::{Hit, Placement, Step};

    /// From -1 to 1.
    fn number(seed: u64) -> f64 {
        (splitmix64(seed) >> 11) as f64 * 2f64.powi(-52) - 1.0
    }

    fn vector(seed: u64) -> DVec3 {
        DVec3::from([1, 2, 3].map(|axis| number(10 * seed + axis)))
    }

    fn mesh(positions: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Arc<Mesh> {
        Arc::new(Mesh { positions, triangles, ..Mesh::default() })
    }

    /// A tetrahedron, an octahedron, triangles that are not closed, one without extent, and none.
    fn meshes() -> Vec<Arc<Mesh>> {
        let tetrahedron = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let [p, n] = [DVec3::AXES, DVec3::AXES.map(|axis| -axis)];
        let sides = |i: u32| {
            let [x, y, z] = [0, 1, 2].map(|axis| if i >> axis & 1 == 0 { axis } else { axis + 3 });
            if i.count_ones().is_multiple_of(2) { [x, y, z] } else { [x, z, y] }
        };
        vec![
            mesh(corners.into(), tetrahedron),
            mesh(p.into_iter().chain(n).collect(), (0..8).map(sides).collect()),
            mesh((0..90).map(vector).collect(), (0..30).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect()),
            mesh(vec![DVec3::ONE], vec![[0; 3]]),
            mesh(Vec::new(), Vec::new()),
        ]
    }

    /// A placement by one or two steps: turned, scaled and sheared; of 16 one is singular.
    fn placement(seed: u64) -> Placement {
        let turned = DMat4::from_axis_angle(vector(seed).normalize(), 3.0 * number(seed + 1));
        let scale =
            DVec3::new(1.0, 0.5 + 0.4 * number(seed + 2), if seed.is_multiple_of(3) { -1.0 } else { 1.0 });
        let scale = if splitmix64(seed).is_multiple_of(16) { DVec3::new(1.0, 1.0, 0.0) } else { scale };
        let moved = DMat4::from_translation(2.0 * vector(seed + 3));
        let mut placement = Placement::new(moved * turned * DMat4::from_scale(scale));
        if seed.is_multiple_of(4) {
            placement.then(Step::Shift { middle: vector(seed + 4), scale: 1.25 });
        }
        placement
    }

    fn copied(placed: &[Placed]) -> Vec<Primitive> {
        let corners = |placed: &Placed| {
            (0..placed.triangle_count() as u32)
                .map(|i| Primitive::from(placed.corners_of(i)))
                .collect::<Vec<_>>()
        };
        placed.iter().flat_map(corners).collect()
    }

    fn without_slot(hit: Hit) -> (u64, PrimId, [u64; 2]) {
        (hit.t.to_bits(), hit.prim, hit.barycentrics.map(f64::to_bits))
    }

    /// All queries of two structures, by tens of rays, points and boxes. Expansions are of the same parts, or those of
    /// `those` are of the triangles of all.
    fn check_equal(these: &Bvh, those: &Bvh, seed: u64, is_strict: bool, has_same_parts: bool) {
        let traversal = &mut Traversal::default();
        let closedness = those.closedness();
        assert_eq!(these.closedness(), closedness);
        for bvh in [these, those] {
            assert_eq!(
                (bvh.inside_rule(), bvh.unbalanced_edges()),
                (closedness.rule(), closedness.unbalanced_edges)
            );
        }
        for k in 0..40 {
            let seed = 1000 * seed + 7 * k;
            let (from, q) = (3.0 * vector(seed), 2.5 * vector(seed + 1));
            let ray = these.ray(from, q - from).expect("finite");
            if is_strict {
                let [a, b] = [these, those].map(|bvh| bvh.closest_hit(&ray, &mut Traversal::default()));
                assert_eq!(a.map(without_slot), b.map(without_slot));
                assert_eq!(these.occluded(&ray, traversal), those.occluded(&ray, traversal));
                let [a, b] = [these, those].map(|bvh| {
                    let all = bvh.all_hits(&ray, &mut Traversal::default());
                    all.into_iter().map(without_slot).collect::<Vec<_>>()
                });
                assert_eq!(a, b);
            }
            assert_eq!(these.crossings(&ray, traversal), those.crossings(&ray, traversal));
            let [a, b] = [these, those].map(|bvh| bvh.contains(q, &mut Traversal::default()));
            assert!(if has_same_parts {
                a == b
            } else {
                a.is_inside == b.is_inside || a.margin.max(b.margin) <= 0.0
            });
            for beta in [1.0, 2.0, f64::INFINITY] {
                let [a, b] = [these, those]
                    .map(|bvh| bvh.generalised_winding_number(q, beta, &mut Traversal::default()));
                let is_equal =
                    if has_same_parts { a == b } else { (a.value - b.value).abs() <= a.error + b.error };
                assert!(is_equal, "{a:?} {b:?}");
            }
            assert_eq!(these.winding_number(q, traversal), those.winding_number(q, traversal));
            for limit in [f64::INFINITY, 0.3] {
                let closest = [these, those].map(|bvh| {
                    let traversal = &mut Traversal::default();
                    (bvh.closest_point_within(q, limit, traversal), bvh.nearest(q, 7, limit, traversal))
                });
                assert_eq!(closest[0], closest[1]);
            }
            let size = 0.3 * vector(seed + 2).abs();
            let [a, b] = [these, those].map(|bvh| bvh.in_box(q - size, q + size, &mut Traversal::default()));
            assert_eq!(a, b);
        }
    }

    /// Meshes are added, removed and moved at random; the structure that is updated, one that is built anew and one of
    /// copies answer alike, to the bit.
    #[test]
    fn moved_instances_are_hit_as_copies_are() {
        let meshes = meshes();
        for (tier, numerics) in (0..).zip(Numerics::ALL) {
            let mut placed: Vec<Placed> = Vec::new();
            let mut bvh = Bvh::from_instances(&placed, Preset::default(), numerics).expect("nothing");
            let mut counts = [0; 2];
            for step in 0..24u64 {
                let seed = 100 * step + 10_000 * tier;
                let at = splitmix64(seed) as usize;
                match step % 4 {
                    0 | 1 => {
                        let mesh = &meshes[at % meshes.len()];
                        placed.push(Placed::new(mesh.clone(), placement(seed)));
                    }
                    2 => {
                        let at = at % placed.len();
                        placed[at].placement = placement(seed);
                    }
                    _ if step % 8 == 7 => drop(placed.remove(at % placed.len())),
                    _ => placed
                        .iter_mut()
                        .for_each(|p| p.placement.then(Step::Affine(DMat4::from_rotation_x(0.3)))),
                }
                bvh.set_instances(&placed).expect("finite");
                let fresh = Bvh::from_instances(&placed, Preset::default(), numerics).expect("finite");
                let mut copies = Bvh::with(copied(&placed), Preset::default(), numerics).expect("finite");
                copies.set_clockwise(sides(&placed));
                check_equal(&bvh, &fresh, seed, true, true);
                check_equal(&bvh, &copies, seed, numerics != Numerics::Fast, false);
                counts[usize::from(bvh.accelerator().describe().layout == "instances")] += 1;
            }
            assert!(counts[1] > 15, "{counts:?}");
        }
    }

    /// Two halves of a tetrahedron, each open, are closed where they meet; a mirrored one is turned over.
    #[test]
    fn open_parts_close_each_other() {
        let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let lower = mesh(corners.clone(), vec![[0, 2, 1], [0, 1, 3]]);
        let upper = mesh(corners.iter().map(|p| *p - DVec3::ONE).collect(), vec![[0, 3, 2], [1, 2, 3]]);
        let halves = |offset: f64, scale: f64| {
            let place = |mesh: &Arc<Mesh>, by| {
                let map = DMat4::from_scale(DVec3::new(scale, 1.0, 1.0)) * DMat4::from_translation(by);
                Placed::new(mesh.clone(), Placement::new(map))
            };
            [place(&lower, DVec3::ZERO), place(&upper, DVec3::ONE + DVec3::X * offset)]
        };
        let inside = DVec3::new(0.1, 0.2, 0.3);
        for numerics in Numerics::ALL {
            let mut bvh =
                Bvh::from_instances(&halves(0.0, 1.0), Preset::default(), numerics).expect("finite");
            for scale in [1.0, -1.0] {
                // Each has four open edges.
                for (offset, expected) in [(2.0, 8), (0.0, 0), (0.25, 8)] {
                    bvh.set_instances(&halves(offset, scale)).expect("finite");
                    assert_eq!(
                        (bvh.unbalanced_edges(), bvh.closedness().unbalanced_edges),
                        (expected, expected)
                    );
                }
                bvh.set_instances(&halves(0.0, scale)).expect("finite");
                let q = inside * DVec3::new(scale, 1.0, 1.0);
                let number = bvh.generalised_winding_number(q, 1.0, &mut Traversal::default());
                assert_eq!((number.value, number.error), (1.0, 0.0));
            }
        }
    }

    /// The expansions of parts that have not moved are kept, in any order, as are the open edges of a mesh.
    #[test]
    fn what_is_known_of_parts_is_kept() {
        let meshes = meshes();
        let mut placed: Vec<Placed> =
            (0..20).map(|i| Placed::new(meshes[i % 3].clone(), placement(50 + 10 * i as u64))).collect();
        let mut bvh = Bvh::from_instances(&placed, Preset::default(), Numerics::Double).expect("finite");
        let addresses = |bvh: &Bvh| {
            let parts = bvh.instances.parts().expect("instances").iter();
            parts
                .map(|part| {
                    [Arc::as_ptr(&part.expansions).cast::<()>(), Arc::as_ptr(&part.open_edges).cast()]
                })
                .collect::<Vec<_>>()
        };
        bvh.generalised_winding_number([0.1; 3], 1.0, &mut Traversal::default());
        let mut before = addresses(&bvh);
        placed[7].placement = placement(9);
        placed.swap(2, 11);
        before.swap(2, 11);
        bvh.set_instances(&placed).expect("finite");
        for (index, (before, after)) in before.into_iter().zip(addresses(&bvh)).enumerate() {
            assert_eq!([before[0] == after[0], before[1] == after[1]], [index != 7, true], "{index}");
        }
    }

    #[test]
    fn ids_are_those_from_instances() {
        let meshes = meshes();
        let places = [0, 3, 4, 4, 1, 0].map(|i: usize| Placed::new(meshes[i].clone(), placement(1)));
        let mut bvh = Bvh::from_instances(&places, Preset::default(), Numerics::Double).expect("finite");
        let ids = [0, 3, 4, 5, 12, 13, 16].map(|id| bvh.instance_of(PrimId(id)));
        assert_eq!(ids, [(0, 0), (0, 3), (1, 0), (4, 0), (4, 7), (5, 0), (5, 3)]);
        bvh.update(copied(&places)).expect("finite");
        assert_eq!(bvh.instance_of(PrimId(13)), (0, 13));
    }

    /// A placement that is stored as a copy has no list of primitives to be refitted.
    #[test]
    fn primitives_replace_instances() {
        let flat = Placement::new(DMat4::from_scale(DVec3::new(1.0, 1.0, 0.0)));
        let placed = [Placed::new(meshes()[0].clone(), flat)];
        let mut bvh = Bvh::from_instances(&placed, Preset::default(), Numerics::Double).expect("finite");
        assert_eq!(
            bvh.accelerator().describe().layout,
            Bvh::new([]).expect("none").accelerator().describe().layout
        );
        assert_eq!(bvh.update([]), Ok(crate::bvh::Update::Rebuilt));
        assert_eq!(bvh.closest_point([0.0; 3], &mut Traversal::default()), None);
    }

    /// Far instances are culled: a ray beside a thousand of them tests few boxes, and no triangle.
    #[test]
    fn what_is_not_near_is_not_visited() {
        let octahedron = &meshes()[1];
        let at = |i: u32| DMat4::from_translation(DVec3::new(f64::from(i), 0.0, 0.0) * 3.0);
        let placed: Vec<Placed> =
            (0..1000).map(|i| Placed::new(octahedron.clone(), Placement::new(at(i)))).collect();
        let bvh = Bvh::from_instances(&placed, Preset::default(), Numerics::Double).expect("finite");
        let count = |query: &dyn Fn(&mut Traversal)| {
            let mut traversal = Traversal::default();
            query(&mut traversal);
            traversal.tests
        };
        let tests = count(&|t| assert!(bvh.contains([1500.1, 0.2, 0.1], t).is_inside));
        assert!(tests.nodes < 60 && tests.primitives < 40, "{tests:?}");
        let q = DVec3::new(1500.0, 2.0, 0.0);
        let tests = count(&|t| assert_eq!(bvh.closest_point(q, t).map(|p| p.distance), Some(1.0)));
        assert!(tests.nodes < 60 && tests.primitives < 40, "{tests:?}");
        let tests = count(&|t| assert_eq!(bvh.in_box([1.2, 1.2, 1.2], [2900.0, 3.0, 3.0], t), []));
        assert!(tests.primitives == 0, "{tests:?}");
    }

    #[test]
    fn what_is_not_finite_changes_nothing() {
        let good = Placed::new(meshes()[0].clone(), Placement::default());
        let mut bvh = Bvh::from_instances(std::slice::from_ref(&good), Preset::default(), Numerics::Double)
            .expect("finite");
        let far = Placement::new(DMat4::from_translation(DVec3::X * 1e39));
        let nan = mesh(vec![DVec3::NAN; 3], vec![[0, 1, 2]]);
        let wrong = mesh(vec![DVec3::ZERO; 3], vec![[0, 1, 2], [0, 1, 3]]);
        let cases = [
            (Placed::new(good.mesh.clone(), far), InvalidMesh::NotFinite(NotFinite::Primitive(4))),
            (Placed::new(nan, Placement::default()), InvalidMesh::NotFinite(NotFinite::Primitive(4))),
            (
                Placed::new(wrong, Placement::default()),
                InvalidMesh::Index { triangle: 5, vertex: 3, vertices: 3 },
            ),
        ];
        for (bad, error) in cases {
            assert_eq!(bvh.set_instances(&[good.clone(), bad]), Err(error));
            assert!(bvh.contains([0.1; 3], &mut Traversal::default()).is_inside);
        }
    }
}
