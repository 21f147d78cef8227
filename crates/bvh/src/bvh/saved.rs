//! [`Bvh::save`] and [`Bvh::load`].
//!
//! A file is a sequence of words of 64 bits in the byte order of the machine that wrote it: the numbers of [`Header`],
//! the primitives without a slot, [`Bvh::clockwise`], the nodes, the triangle leaves and the analytic shapes, each in
//! as many words as every other of its kind, and a checksum. Each word is mixed into the checksum by an invertible
//! function, so a change of a single word changes it. A file with the right checksum may still hold anything: [`check`]
//! guarantees that traversals of the tree read no index out of range, and end.

use std::io::{Error, ErrorKind, Read, Result, Write};
use std::sync::{Arc, OnceLock};

use bytemuck::{Pod, bytes_of, cast_slice, pod_read_unaligned};
use glam::DVec3;

use super::placed_meshes::InstanceTable;
use super::wide::{Child, Content, Node, SmallLeafBatch, TriangleLeaf, WIDTH, Wide};
use super::{Accelerator, Bvh, Layout, Preset};
use crate::geometry::lanes::LANES4;
use crate::geometry::{
    AnalyticShape, Bounds, Corner, Disk, Double, Exact, Fast, NO_PRIMITIVE, Numerics, PrimId, Sphere, Tier,
    Triangle4, Watertight,
};

/// The first word of a file. Its bytes are in another order on machines of the other byte order.
const MAGIC: u64 = u64::from_be_bytes(*b"kiln-bvh");

/// The second word. It changes with every change of what follows, and of [`Node`] and [`Child`].
const VERSION: u64 = 2;

/// Words of a node: planes, children, and which are present.
const NODE: usize = 24 + WIDTH / 2 + 1;

/// Words of an analytic shape: kind, id, centre, radius and normal.
const SHAPE: usize = 9;

/// Words of a triangle leaf: corners and ids.
const fn words_of_leaf<C: Corner>() -> usize {
    (size_of::<[[[C::Scalar; LANES4]; 3]; 3]>() + size_of::<[u32; LANES4]>()) / 8
}

/// Words that are read at once.
const BLOCK: usize = 1 << 13;

/// The numbers behind [`VERSION`].
#[derive(Debug, Clone, Copy, Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Header {
    /// Indices of [`Numerics::ALL`] and [`Preset::ALL`].
    numerics: u64,
    preset: u64,
    /// The number of primitives, and of those without a slot.
    primitives: u64,
    without_slot: u64,
    clockwise: u64,
    nodes: u64,
    triangles: u64,
    analytic: u64,
    /// 1 and the bits of [`Wide::cost_at_build`], or twice 0.
    refitted: u64,
    cost_at_build: u64,
}

/// The checksum of words.
#[derive(Clone, Copy)]
struct Checksum(u64);

impl Checksum {
    const NEW: Self = Checksum(MAGIC ^ VERSION);

    fn add(&mut self, words: impl IntoIterator<Item = u64>) {
        // Every step is invertible; the factor is that of splitmix64.
        let mix = |sum: u64, word: u64| ((sum ^ word).wrapping_mul(0xbf58_476d_1ce4_e5b9)).rotate_left(29);
        self.0 = words.into_iter().fold(self.0, mix);
    }
}

fn damaged(what: &str) -> Error {
    Error::new(ErrorKind::InvalidData, format!("a saved tree is damaged: {what}"))
}

/// Writes words and adds them up.
pub(crate) struct Writer<'a> {
    to: &'a mut dyn Write,
    bytes: Vec<u8>,
    checksum: Checksum,
}

impl Writer<'_> {
    /// Writes values, whose size is that of whole words.
    fn put(&mut self, bytes: &[u8]) -> Result<()> {
        self.checksum.add(bytes.chunks_exact(8).map(pod_read_unaligned));
        self.bytes.extend_from_slice(bytes);
        if self.bytes.len() >= 8 * BLOCK {
            self.to.write_all(&self.bytes)?;
            self.bytes.clear();
        }
        Ok(())
    }
}

/// Reads words and adds them up; none beyond the last that is asked for.
struct Reader<'a> {
    from: &'a mut dyn Read,
    block: Vec<u64>,
    checksum: Checksum,
}

impl Reader<'_> {
    /// Reads `count` items of as many `words`. Memory grows with what is read, whatever `count` is.
    fn items<T>(
        &mut self,
        count: u64,
        words: usize,
        mut item: impl FnMut(&[u64]) -> Result<T>,
    ) -> Result<Vec<T>> {
        let at_once = BLOCK / words;
        let mut items = Vec::new();
        let mut left = usize::try_from(count).map_err(|_| damaged("a number is too large"))?;
        while left > 0 {
            let now = left.min(at_once);
            left -= now;
            self.block.resize(now * words, 0);
            self.from.read_exact(bytemuck::cast_slice_mut(&mut self.block))?;
            self.checksum.add(self.block.iter().copied());
            for words in self.block.chunks_exact(words) {
                items.push(item(words)?);
            }
        }
        Ok(items)
    }
}

/// The values that fill words.
fn read<T: Pod>(words: &[u64]) -> T {
    pod_read_unaligned(cast_slice(words))
}

impl Bvh {
    /// Writes the structure: [`Bvh::load`] reads it several times as fast as it is built, and every query of what it
    /// reads returns the same bits. The format is that of this version of the crate, and of machines of this byte
    /// order: to keep what took time to build, not to exchange it. It has the size of the structure
    /// ([`Accelerator::describe`]).
    ///
    /// # Errors
    /// Those of `to`, and [`ErrorKind::Unsupported`] for a structure with user geometry or with instances.
    pub fn save(&self, mut to: impl Write) -> Result<()> {
        let mut writer = Writer { to: &mut to, bytes: Vec::new(), checksum: Checksum::NEW };
        let unsupported = || {
            let what = "a structure with user geometry or instances cannot be saved";
            Error::new(ErrorKind::Unsupported, what)
        };
        let saved =
            self.instances.ids().is_none().then(|| self.accelerator().save(self, &mut writer)).flatten();
        saved.unwrap_or_else(|| Err(unsupported()))?;
        let Checksum(sum) = writer.checksum;
        writer.put(&sum.to_ne_bytes())?;
        writer.to.write_all(&writer.bytes)?;
        writer.to.flush()
    }

    /// Reads what [`Bvh::save`] wrote, and nothing beyond. Its traversal is the widest that this machine has.
    ///
    /// # Errors
    /// Those of `from`; [`ErrorKind::UnexpectedEof`] for a file that ends too early, [`ErrorKind::InvalidData`] for one
    /// that is something else, of another version or byte order, or damaged: a checksum covers every bit.
    pub fn load(mut from: impl Read) -> Result<Self> {
        Self::load_from(&mut from)
    }

    /// Compiled once, not in each crate that loads a tree.
    fn load_from(from: &mut dyn Read) -> Result<Self> {
        let mut reader = Reader { from, block: Vec::new(), checksum: Checksum::NEW };
        let mut start = [0u64; 2];
        reader.from.read_exact(bytemuck::cast_slice_mut(&mut start))?;
        let invalid = |what: &str| Err(Error::new(ErrorKind::InvalidData, what));
        match start {
            [MAGIC, VERSION] => {}
            [MAGIC, _] => return invalid("a tree saved by another version of the crate"),
            [magic, _] if magic == MAGIC.swap_bytes() => {
                return invalid("a tree saved by a machine of another byte order");
            }
            _ => return invalid("not a saved tree"),
        }
        let header = reader.items(1, size_of::<Header>() / 8, |words| Ok(read::<Header>(words)))?[0];
        let numerics = usize::try_from(header.numerics).ok().and_then(|index| Numerics::ALL.get(index));
        match numerics.ok_or_else(|| damaged("an unknown tier"))? {
            Numerics::Fast => load::<Fast>(&header, reader),
            Numerics::Watertight => load::<Watertight>(&header, reader),
            Numerics::Double => load::<Double>(&header, reader),
            Numerics::Exact => load::<Exact>(&header, reader),
        }
    }
}

/// Writes a tree of the structure `of`.
pub(crate) fn save<T: Tier>(wide: &Wide<T>, of: &Bvh, writer: &mut Writer) -> Result<()> {
    let index_of = |found: Option<usize>| found.map_or(u64::MAX, |index| index as u64);
    let without_slot: Vec<u64> =
        (0..).zip(&of.has_slot).filter(|(_, has_slot)| !**has_slot).map(|(id, _)| id).collect();
    let header = Header {
        numerics: index_of(Numerics::ALL.iter().position(|&tier| tier == T::NUMERICS)),
        preset: index_of(Preset::ALL.iter().position(|&preset| Some(preset) == of.layout.preset())),
        primitives: of.has_slot.len() as u64,
        without_slot: without_slot.len() as u64,
        clockwise: of.clockwise.len() as u64,
        nodes: wide.nodes.len() as u64,
        triangles: wide.triangles.len() as u64,
        analytic: wide.analytic.len() as u64,
        refitted: wide.cost_at_build.is_some().into(),
        cost_at_build: wide.cost_at_build.unwrap_or_default().to_bits(),
    };
    // The checksum begins behind these.
    writer.to.write_all(bytes_of(&[MAGIC, VERSION]))?;
    writer.put(bytes_of(&header))?;
    writer.put(cast_slice(&without_slot))?;
    of.clockwise.iter().try_for_each(|&id| writer.put(&u64::from(id).to_ne_bytes()))?;
    for Node { planes, children, present } in &wide.nodes {
        writer.put(cast_slice(planes.as_flattened().as_flattened()))?;
        writer.put(bytes_of(Child::bits(children)))?;
        writer.put(&u64::from(*present).to_ne_bytes())?;
    }
    for TriangleLeaf { corners, ids } in &wide.triangles {
        writer.put(cast_slice(corners.corners.as_flattened().as_flattened()))?;
        writer.put(bytes_of(ids))?;
    }
    for (shape, prim) in &wide.analytic {
        let (kind, centre, radius, normal) = match *shape {
            None => (0, DVec3::ZERO, 0.0, DVec3::ZERO),
            Some(AnalyticShape::Sphere(Sphere { centre, radius })) => (1, centre, radius, DVec3::ZERO),
            Some(AnalyticShape::Disk(Disk { centre, normal, radius })) => (2, centre, radius, normal),
        };
        let numbers = [centre.x, centre.y, centre.z, radius, normal.x, normal.y, normal.z];
        writer.put(bytes_of(&[kind, u64::from(prim.0)]))?;
        writer.put(bytes_of(&numbers))?;
    }
    Ok(())
}

/// Reads what follows the header.
fn load<T: Tier>(header: &Header, mut reader: Reader) -> Result<Bvh> {
    let preset = usize::try_from(header.preset).ok().and_then(|index| Preset::ALL.get(index));
    let layout = Layout::Wide(*preset.ok_or_else(|| damaged("an unknown preset"))?);
    let Some((_, instructions)) = layout.tree() else { return Err(damaged("not a tree")) };
    let most = [header.nodes, header.triangles, header.analytic].into_iter().max();
    let is_large = header.primitives >= u64::from(NO_PRIMITIVE) || most >= Some(Child::MAX_INDICES as u64);
    // Every primitive has a slot or is one of those without.
    let slots = header.triangles.saturating_mul(LANES4 as u64).saturating_add(header.analytic);
    if is_large || header.without_slot > header.primitives || header.primitives - header.without_slot > slots
    {
        return Err(damaged("a number is too large"));
    }
    let without_slot = reader.items(header.without_slot, 1, |id| Ok(id[0]))?;
    let id_of = |word: u64| u32::try_from(word).map_err(|_| damaged("an id is too large"));
    let clockwise = reader.items(header.clockwise, 1, |id| id_of(id[0]))?;
    let nodes = reader.items(header.nodes, NODE, |words| {
        let planes: [[f32; WIDTH]; 6] = read(&words[..24]);
        let children: [u32; WIDTH] = read(&words[24..NODE - 1]);
        let present = u32::try_from(words[NODE - 1]).map_err(|_| damaged("a node"))?;
        let planes = [0, 1, 2].map(|axis: usize| [planes[2 * axis], planes[2 * axis + 1]]);
        Ok(Node { planes, children: children.map(Child::of_bits), present })
    })?;
    let words = words_of_leaf::<T::Corner>();
    let triangles = reader.items(header.triangles, words, |words| {
        let (corners, ids) = words.split_at(words.len() - LANES4 / 2);
        Ok(TriangleLeaf::<T::Corner> { corners: Triangle4 { corners: read(corners) }, ids: read(ids) })
    })?;
    let analytic = reader.items(header.analytic, SHAPE, |words| {
        let [x, y, z, radius, normal @ ..]: [f64; 7] = read(&words[2..]);
        let (centre, normal) = (DVec3::new(x, y, z), DVec3::from(normal));
        let shape = match words[0] {
            0 => None,
            1 => Some(AnalyticShape::from(Sphere { centre, radius })),
            2 => Some(AnalyticShape::from(Disk { centre, normal, radius })),
            _ => return Err(damaged("an unknown kind of shape")),
        };
        Ok((shape, PrimId(id_of(words[1])?)))
    })?;
    let Reader { from, checksum: Checksum(expected), .. } = reader;
    let mut checksum = [0];
    from.read_exact(bytemuck::cast_slice_mut(&mut checksum))?;
    if checksum != [expected] {
        return Err(damaged("its checksum is wrong"));
    }

    let mut has_slot = vec![true; header.primitives as usize];
    for id in without_slot {
        let at = usize::try_from(id).ok().and_then(|id| has_slot.get_mut(id));
        *at.ok_or_else(|| damaged("an id is too large"))? = false;
    }
    let cost_at_build = (header.refitted == 1).then(|| f64::from_bits(header.cost_at_build));
    let mut wide =
        Wide::<T> { nodes, triangles, analytic, depth: 0, batch: None, instructions, cost_at_build };
    wide.depth = check(&wide, has_slot.len())?;
    if !wide.nodes.is_empty() {
        wide.batch = SmallLeafBatch::new(&wide);
    }
    let accelerator: Arc<dyn Accelerator> = Arc::new(wide);
    let (closedness, unbalanced, expansions) = (OnceLock::new(), OnceLock::new(), OnceLock::new());
    let instances = InstanceTable::default();
    let numerics = T::NUMERICS;
    Ok(Bvh {
        accelerator,
        layout,
        numerics,
        has_slot,
        instances,
        clockwise,
        closedness,
        unbalanced,
        expansions,
    })
}

/// Checks that every reference of a tree is to something that exists, every node but the first is the child of one node
/// before it, boxes contain those of their children, primitives are finite and ids below their number; returns the
/// number of nodes on the longest path. Parts of split triangles are larger than the boxes of their leaves, so that is
/// not checked.
fn check<T: Tier>(wide: &Wide<T>, primitives: usize) -> Result<usize> {
    let is_id = |id: u32| (id as usize) < primitives;
    for leaf in &wide.triangles {
        for (lane, &id) in leaf.ids.iter().enumerate().filter(|(_, id)| **id != NO_PRIMITIVE) {
            // As a build stores them: finite in f32, and rounded to the tier's precision.
            let is_stored = leaf.corners.triangle(lane).into_iter().all(|corner| {
                let point = corner.to_dvec3();
                point.as_vec3().is_finite() && T::Corner::from_dvec3(point).to_dvec3() == point
            });
            if !(is_id(id) && is_stored) {
                return Err(damaged("a triangle"));
            }
        }
    }
    for (shape, prim) in &wide.analytic {
        let is_finite = shape.is_none_or(|shape| {
            let Bounds { min, max } = shape.bounds();
            min.is_finite() && max.is_finite() && shape.rounded(T::NUMERICS.precision()) == Some(shape)
        });
        if !is_id(prim.0) || !is_finite {
            return Err(damaged("a shape"));
        }
    }
    // The number of nodes from the root to each; 0 where none refers to it yet.
    let mut depths = vec![0; wide.nodes.len()];
    depths.iter_mut().take(1).for_each(|depth| *depth = 1);
    for (index, node) in wide.nodes.iter().enumerate() {
        if depths[index] == 0 || node.present >= 1 << WIDTH {
            return Err(damaged("a node"));
        }
        for place in 0..WIDTH {
            let (child, b) = (node.children[place], node.bounds(place));
            let is_present = node.present >> place & 1 != 0;
            let is_empty = b.min.cmpgt(b.max).all();
            if !is_present && child == Node::EMPTY.children[place] && is_empty {
                continue;
            }
            let is_box = b.min.is_finite() && b.max.is_finite() && b.min.cmple(b.max).all();
            let is_valid = match child.content() {
                Content::Node(child) => {
                    let child = child as usize;
                    let is_first = child > index && depths.get(child) == Some(&0);
                    is_first && {
                        depths[child] = depths[index] + 1;
                        let whole = wide.nodes[child].whole();
                        b.min.cmple(whole.min).all() && b.max.cmpge(whole.max).all()
                    }
                }
                Content::Triangles(range) => range.len() == 1 && range.end as usize <= wide.triangles.len(),
                Content::Analytic(range) => range.end as usize <= wide.analytic.len(),
            };
            if !is_valid || !(is_present && is_box || !is_present && is_empty) || child == Child::NOTHING {
                return Err(damaged("a node"));
            }
        }
    }
    if wide.nodes.is_empty() && !(wide.triangles.is_empty() && wide.analytic.is_empty()) {
        return Err(damaged("primitives without nodes"));
    }
    Ok(depths.into_iter().max().unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::splitmix64::splitmix64;
    use crate::bvh::{Primitive, Traversal, Update};
    use crate::geometry::{Ray, RayBuffer, Side, UserGeometry};

    fn number(seed: u64) -> f64 {
        (splitmix64(seed) >> 32) as f64 / f64::from(1u32 << 31) - 1.0
    }

    fn vector(seed: u64) -> DVec3 {
        DVec3::from([3 * seed, 3 * seed + 1, 3 * seed + 2].map(number))
    }

    /// Triangles, spheres, disks, and every thirtieth a sphere that is left out.
    fn crowd(count: u64) -> Vec<Primitive> {
        let one = |id: u64| match id % 30 {
            0 => Primitive::from((vector(id).to_array(), 0.0)),
            1 | 2 => Primitive::from((vector(id).to_array(), 0.05)),
            3 => Disk { centre: vector(id), normal: vector(id + 1).normalize(), radius: 0.1 }.into(),
            _ => Primitive::from([1, 2, 3].map(|k| vector(8 * id) + vector(8 * id + k) * 0.1)),
        };
        (0..count).map(one).collect()
    }

    fn saved(bvh: &Bvh) -> Vec<u8> {
        let mut bytes = Vec::new();
        bvh.save(&mut bytes).expect("memory");
        bytes
    }

    #[test]
    fn a_loaded_tree_has_the_bits_of_the_saved_one() {
        for count in [0, 1, 5, 40, 2000] {
            for (numerics, preset) in Numerics::ALL.into_iter().flat_map(|n| Preset::ALL.map(|p| (n, p))) {
                let primitives = crowd(count);
                let mut bvh = Bvh::with(primitives.iter().copied(), preset, numerics).expect("finite");
                bvh.set_clockwise([(count as usize / 2, true)]);
                let bytes = saved(&bvh);
                let mut stream = &[&bytes[..], b"behind"].concat()[..];
                let mut loaded = Bvh::load(&mut stream).expect("the same");
                assert_eq!(stream, b"behind");
                let moved = primitives.iter().map(|p| match *p {
                    Primitive::Triangle(triangle) => {
                        Primitive::from(triangle.0.map(|p| p + DVec3::splat(0.01) * p.x))
                    }
                    other => other,
                });
                let moved: Vec<Primitive> = moved.collect();
                for step in 0..3 {
                    let ray = |seed: u64| {
                        let origin = vector(seed) * 2.0;
                        bvh.ray(origin, vector(seed + 1) - origin).expect("a ray")
                    };
                    let rays: RayBuffer = (900_000..900_400).map(ray).collect();
                    let [a, b] = [&bvh, &loaded].map(|bvh| {
                        let traversal = &mut Traversal::default();
                        let hits = bvh.closest_hits(rays.rays(), traversal);
                        let all: Vec<_> =
                            rays.rays().iter().map(|ray| bvh.all_hits(&ray, traversal)).collect();
                        let of_point =
                            |q| (bvh.nearest(q, 4, 1.0, traversal), bvh.winding_number(q, traversal));
                        let near: Vec<_> = (0..50).map(vector).map(of_point).collect();
                        let description = bvh.accelerator().describe();
                        let tests = traversal.tests;
                        let hits: Vec<_> = hits.iter().collect();
                        (hits, all, near, bvh.closedness(), bvh.left_out(), description, tests)
                    });
                    assert_eq!(a, b, "{count} {numerics:?} {preset:?}");
                    if step == 0 {
                        // Both are refitted by the same cost, relative to that at build.
                        let [a, b] = [&mut bvh, &mut loaded].map(|bvh| bvh.update(moved.iter().copied()));
                        assert_eq!(a, b);
                    }
                    if step == 1 {
                        loaded = Bvh::load(&saved(&loaded)[..]).expect("the same again");
                        let [a, b] =
                            [&mut bvh, &mut loaded].map(|bvh| bvh.update(primitives.iter().copied()));
                        assert_eq!(a, b);
                        assert!(count == 0 || matches!(a, Ok(Update::Refitted(_) | Update::Rebuilt)));
                    }
                }
            }
        }
    }

    #[test]
    fn a_damaged_file_is_an_error() {
        for numerics in [Numerics::Watertight, Numerics::Exact] {
            let bvh = Bvh::with(crowd(60), Preset::BestTrace, numerics).expect("finite");
            let bytes = saved(&bvh);
            let kind = |bytes: &[u8]| Bvh::load(bytes).err().map(|error| error.kind());
            assert_eq!(kind(&bytes), None);
            for length in 0..bytes.len() {
                assert_eq!(kind(&bytes[..length]), Some(ErrorKind::UnexpectedEof), "{length} bytes");
            }
            let flipped = |bit: usize| {
                let mut bytes = bytes.clone();
                bytes[bit / 8] ^= 1 << (bit % 8);
                kind(&bytes)
            };
            // A number of items that is too large ends the file early.
            let errors = [Some(ErrorKind::InvalidData), Some(ErrorKind::UnexpectedEof)];
            let all = 8 * bytes.len();
            // All of the header, and others.
            let others = (0..4000).map(|seed| splitmix64(seed) as usize % all);
            for bit in (0..8 * 8 * 12).chain(others) {
                assert!(errors.contains(&flipped(bit)), "bit {bit} of {all}");
            }
        }
    }

    /// Files with a checksum that is right, and anything else: no panic, and queries that end.
    #[test]
    fn whatever_a_file_holds_its_tree_can_be_traversed() {
        let bvh = Bvh::with(crowd(90), Preset::Balanced, Numerics::Double).expect("finite");
        let bytes = saved(&bvh);
        let words: Vec<u64> = bytes.chunks_exact(8).map(pod_read_unaligned).collect();
        let mut loaded = 0;
        for seed in 0..8_000u64 {
            let random = |k: u64| splitmix64(4 * seed + k);
            let mut words = words.clone();
            let last = words.len() - 1;
            // Mostly among the nodes, with small numbers as often as large ones.
            let place = 2 + random(0) as usize % if seed % 4 == 0 { last - 2 } else { 200 };
            words[place] = match seed % 3 {
                0 => words[place] ^ 1 << (random(1) % 64),
                1 => random(1) >> (random(2) % 64),
                _ => words[2 + random(1) as usize % (last - 2)],
            };
            let Ok(mut bvh) = Bvh::load(&with_checksum(words)[..]) else { continue };
            loaded += 1;
            let traversal = &mut Traversal::default();
            for k in 0..4 {
                let ray = bvh.ray(vector(seed + k) * 2.0, vector(seed + k + 1)).expect("a ray");
                let hit = bvh.closest_hit(&ray, traversal);
                hit.map(|hit| bvh.geometric_normal(&ray, &hit));
                bvh.all_hits(&ray, traversal);
                bvh.crossings(&ray, traversal);
                bvh.nearest(ray.origin(), 3, 1.0, traversal);
                bvh.contains(ray.origin(), traversal);
                bvh.generalised_winding_number(ray.origin(), 1.0, traversal);
                bvh.in_box(ray.origin() - 0.5, ray.origin() + 0.5, traversal);
            }
            bvh.closedness();
            // Refitted if as many primitives are numbered, else rebuilt.
            for primitives in [crowd(90), crowd(bvh.has_slot.len() as u64)] {
                bvh.update(primitives).expect("finite");
                let ray = bvh.ray(vector(seed) * 2.0, vector(seed + 1)).expect("a ray");
                bvh.closest_hit(&ray, traversal);
            }
        }
        // A bit of a coordinate may be any.
        assert!(loaded > 400, "{loaded}");
    }

    #[test]
    fn what_is_not_a_tree_is_said_to_be_none() {
        let said = |bytes: &[u8]| Bvh::load(bytes).err().map(|error| error.to_string());
        let mut bytes = saved(&Bvh::new(crowd(9)).expect("finite"));
        assert_eq!(said(&[7; 100]).as_deref(), Some("not a saved tree"));
        bytes[8] ^= 2;
        assert_eq!(said(&bytes).as_deref(), Some("a tree saved by another version of the crate"));
        bytes[..8].reverse();
        assert_eq!(said(&bytes).as_deref(), Some("a tree saved by a machine of another byte order"));
    }

    /// Nothing is hit.
    struct Nothing;

    impl UserGeometry for Nothing {
        fn bounds(&self) -> [DVec3; 2] {
            [DVec3::ZERO; 2]
        }

        fn intersect(&self, _ray: &Ray, _found: &mut dyn FnMut(f64, Side)) {}
    }

    #[test]
    fn user_geometry_cannot_be_saved_and_none_can() {
        let mut bvh = Bvh::new(crowd(9)).expect("finite");
        let bytes = saved(&bvh);
        bvh.set_user_geometry([Arc::new(Nothing) as Arc<dyn UserGeometry>]).expect("finite");
        assert_eq!(bvh.save(Vec::new()).err().map(|error| error.kind()), Some(ErrorKind::Unsupported));
        bvh.set_user_geometry([]).expect("none");
        assert_eq!(saved(&bvh), bytes);
    }

    /// A triangle, a sphere and a sphere that is left out, in every tier: two leaves below one node.
    #[cfg(target_endian = "little")]
    #[test]
    fn another_format_has_another_version() {
        let primitives = || {
            let triangle = Primitive::from([[1.0, 2.0, 3.0], [5.0, 2.5, 3.5], [1.5, 6.0, 4.0]]);
            [triangle, Primitive::from(([-9.0, 1.0, 2.0], 0.75)), Primitive::from(([7.0; 3], 0.0))]
        };
        let checksums = Numerics::ALL.map(|numerics| {
            let bvh = Bvh::with(primitives(), Preset::Balanced, numerics).expect("finite");
            let bytes = saved(&bvh);
            read::<u64>(&[pod_read_unaligned(&bytes[bytes.len() - 8..])])
        });
        // Recorded. If they change, files of this version of the crate are not those of the last one: `VERSION` has to
        // change, too.
        let recorded =
            [0x0807_2cc5_0192_397c, 0x9954_2c08_5692_120b, 0xf34a_6026_8ed4_9a77, 0xee37_a84d_760f_24d5];
        assert_eq!((VERSION, checksums), (2, recorded), "{checksums:#x?}");
    }

    /// The bytes of a file with another checksum, that of its words.
    fn with_checksum(mut words: Vec<u64>) -> Vec<u8> {
        let last = words.len() - 1;
        let mut checksum = Checksum::NEW;
        checksum.add(words[2..last].iter().copied());
        words[last] = checksum.0;
        cast_slice(&words).to_vec()
    }

    #[test]
    fn a_corner_that_is_not_finite_is_an_error() {
        // Nine numbers that occur nowhere else behind the nodes, exact in f32.
        let corners = [[1.25, 2.25, 3.25], [5.5, 6.5, 7.5], [1.75, 9.75, 4.75]];
        for numerics in Numerics::ALL {
            let bvh = Bvh::with([corners.into()], Preset::Balanced, numerics).expect("finite");
            let bytes = saved(&bvh);
            let size = if matches!(numerics, Numerics::Fast | Numerics::Watertight) { 4 } else { 8 };
            for (coordinate, bad) in corners
                .as_flattened()
                .iter()
                .flat_map(|c| [f64::NAN, f64::INFINITY, f64::NEG_INFINITY].map(|bad| (*c, bad)))
            {
                let bytes_of_number = |x: f64| match size {
                    4 => (x as f32).to_ne_bytes().to_vec(),
                    _ => x.to_ne_bytes().to_vec(),
                };
                let mut bytes = bytes.clone();
                let found = bytes.chunks_exact(size).rposition(|chunk| chunk == bytes_of_number(coordinate));
                let at = size * found.expect("a coordinate");
                bytes[at..at + size].copy_from_slice(&bytes_of_number(bad));
                let words = bytes.chunks_exact(8).map(pod_read_unaligned).collect();
                let error = Bvh::load(&with_checksum(words)[..]).err().map(|error| error.kind());
                assert_eq!(error, Some(ErrorKind::InvalidData), "{numerics:?} {coordinate} {bad}");
            }
        }
    }
}
