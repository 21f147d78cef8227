//! Trees of lights, for scenes with many: a light is chosen with a probability about in proportion to the light that it
//! brings to a point (Conty and Kulla, Importance Sampling of Many Lights with Adaptive Tree Splitting, 2018), in time
//! logarithmic in their number. Of a group of lights, power and distance count, not the directions into which it
//! radiates: so each light that can light a point has a probability above 0 there.

use glam::DVec3;

use super::WorldLight;
use crate::film::colour::luminance;
use crate::scene::{Falloff, LightKind};

/// The number of punctual lights, or of emissive objects, from which a tree chooses among them. Choosing among few without
/// weighing their distances is cheaper.
pub(super) const MANY: usize = 5;

/// The least squared distance of lights from a point within their bounds, over the square of half the diagonal of these.
const NEAREST: f64 = 1.0 / 16.0;

/// A light's place and power, of which a tree is made.
#[derive(Clone, Copy)]
pub(super) struct LocalLight {
    /// The corners of its bounds.
    pub(super) bounds: [DVec3; 2],
    /// What a facing surface receives from it at every distance, and at distance 1, falling with the squared distance.
    pub(super) constant: f64,
    pub(super) falling: f64,
}

/// A balanced binary tree of lights.
pub(crate) struct LightTree {
    /// The nodes in depth-first order. That of n lights has those of its first n / 2 lights behind it, and then those of the
    /// others: trees of n lights have 2 n - 1 nodes.
    nodes: Vec<Node>,
    /// The light of each leaf.
    lights: Vec<u32>,
    /// The leaf of each light.
    leaves: Vec<u32>,
}

struct Node {
    /// The centre of the bounds, and half of their sides.
    centre: DVec3,
    half: DVec3,
    constant: f64,
    falling: f64,
}

impl Node {
    /// About what a facing surface at a point receives. The distance is the geometric mean of those to the centre and to the
    /// nearest point of the bounds, neither below [`NEAREST`]: beside large bounds, most light comes from their near part.
    #[inline]
    fn importance(&self, from: DVec3) -> f64 {
        let (away, nearest) = ((from - self.centre).abs(), self.half.length_squared() * NEAREST);
        let (to_centre, to_bounds) =
            (away.length_squared(), (away - self.half).max(DVec3::ZERO).length_squared());
        self.constant + self.falling / (to_centre.max(nearest) * to_bounds.max(nearest)).sqrt()
    }
}

impl LightTree {
    /// The tree of some lights, one at least.
    pub(super) fn new(lights: &[LocalLight]) -> Self {
        let mut order: Vec<u32> = (0..lights.len() as u32).collect();
        let mut nodes = Vec::with_capacity(2 * order.len() - 1);
        build(lights, &mut order, &mut nodes);
        let mut leaves = vec![0; order.len()];
        (0..).zip(&order).for_each(|(leaf, &light)| leaves[light as usize] = leaf);
        LightTree { nodes, lights: order, leaves }
    }

    /// Walks from the root to a leaf. `goes_left` decides by the probability of the first half of the lights of a node, and by
    /// the first light of the second half. Returns the leaf and its probability.
    #[inline]
    fn descend(&self, from: DVec3, mut goes_left: impl FnMut(f64, usize) -> bool) -> (usize, f64) {
        let (mut node, mut first, mut count, mut probability) = (0, 0, self.lights.len(), 1.0);
        while count > 1 {
            let half = count / 2;
            let [left, right] = [node + 1, node + 2 * half];
            let [of_left, of_right] = [left, right].map(|child| self.nodes[child].importance(from));
            let sum = of_left + of_right;
            // At a light itself, or so far away that nothing arrives, each half has the same share.
            let share = if sum.is_finite() && sum > 0.0 { of_left / sum } else { 0.5 };
            if goes_left(share, first + half) {
                (node, count, probability) = (left, half, probability * share);
            } else {
                (node, first, count, probability) =
                    (right, first + half, count - half, probability * (1.0 - share));
            }
        }
        (first, probability)
    }

    /// The light that a number in [0, 1) chooses from a point, and its probability.
    #[inline]
    pub(crate) fn sample(&self, from: DVec3, mut number: f64) -> (usize, f64) {
        let (leaf, probability) = self.descend(from, |share, _| {
            let is_left = number < share;
            number = if is_left { number / share } else { (number - share) / (1.0 - share) };
            number = number.min(1.0 - f64::EPSILON);
            is_left
        });
        (self.lights[leaf] as usize, probability)
    }

    /// The probability with which a light is chosen from a point.
    #[inline]
    pub(super) fn probability(&self, light: usize, from: DVec3) -> f64 {
        let leaf = self.leaves[light] as usize;
        self.descend(from, |_, middle| leaf < middle).1
    }
}

/// Adds the nodes of some lights, and sorts these as the leaves lie. Lights are divided at the median of the longest side.
fn build(lights: &[LocalLight], order: &mut [u32], nodes: &mut Vec<Node>) {
    let of = |&light: &u32| lights[light as usize].bounds;
    let low = order.iter().map(|light| of(light)[0]).reduce(DVec3::min).unwrap_or_default();
    let high = order.iter().map(|light| of(light)[1]).reduce(DVec3::max).unwrap_or_default();
    let (at, centre, half) = (nodes.len(), 0.5 * (low + high), 0.5 * (high - low));
    let LocalLight { constant, falling, .. } = lights[order[0] as usize];
    nodes.push(Node { centre, half, constant, falling });
    let middle = order.len() / 2;
    if middle > 0 {
        let axis = half.max_position();
        let place = |light: &u32| of(light).map(|corner| corner[axis]).iter().sum::<f64>();
        // The index makes equal places a strict order, so that the halves do not depend on the algorithm.
        order.select_nth_unstable_by(middle, |a, b| place(a).total_cmp(&place(b)).then(a.cmp(b)));
        let (left, right) = order.split_at_mut(middle);
        build(lights, left, nodes);
        build(lights, right, nodes);
        let [left, right] =
            [at + 1, at + 2 * middle].map(|child| [nodes[child].constant, nodes[child].falling]);
        (nodes[at].constant, nodes[at].falling) = (left[0] + right[0], left[1] + right[1]);
    }
}

/// How one of the lights that are not surfaces is chosen.
#[derive(Default)]
pub(crate) struct LightGroups {
    /// The lights that are chosen with equal probability, each as often as the groups.
    pub(crate) singles: Vec<u32>,
    /// The others, where many have a place, and their tree.
    pub(crate) many: Option<(Vec<u32>, LightTree)>,
}

impl LightGroups {
    pub(super) fn new(lights: &[WorldLight]) -> Self {
        let (with_place, without): (Vec<u32>, Vec<u32>) =
            (0..lights.len() as u32).partition(|&light| lights[light as usize].kind.position().is_some());
        if with_place.len() < MANY {
            return LightGroups { singles: (0..lights.len() as u32).collect(), many: None };
        }
        let local = |&light: &u32| {
            let WorldLight { kind, radiance, .. } = &lights[light as usize];
            let is_constant = matches!(
                kind,
                LightKind::Point { falloff: Falloff::None, .. }
                    | LightKind::Spot { falloff: Falloff::None, .. }
            );
            let (position, power) = (kind.position().unwrap_or_default(), luminance(*radiance));
            let (constant, falling) = if is_constant { (power, 0.0) } else { (0.0, power) };
            LocalLight { bounds: [position; 2], constant, falling }
        };
        let tree = LightTree::new(&with_place.iter().map(local).collect::<Vec<_>>());
        LightGroups { singles: without, many: Some((with_place, tree)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lamp(x: f64, y: f64, size: f64, [constant, falling]: [f64; 2]) -> LocalLight {
        let corner = DVec3::new(x, y, 0.0);
        LocalLight { bounds: [corner, corner + DVec3::splat(size)], constant, falling }
    }

    /// Each light is chosen by an interval of numbers as long as its probability, so that n equidistant numbers choose it
    /// n times that often, but for two at its ends. All probabilities together are 1.
    #[test]
    fn lights_are_chosen_with_their_probabilities() {
        let random = |k: usize| ((k * 7919 + 13) % 1000) as f64 / 1000.0;
        for count in [1, 2, 3, 7, 64, 101] {
            let lights: Vec<LocalLight> = (0..count)
                .map(|k| {
                    let powers = [[0.0, 2.0 * random(k) + 0.1], [random(k), 0.0]][usize::from(k % 5 == 1)];
                    lamp(20.0 * random(3 * k), random(5 * k), [0.0, 0.5][k % 2], powers)
                })
                .collect();
            let tree = LightTree::new(&lights);
            let at_lights = [lights[0].bounds[0], lights[count - 1].bounds[0]];
            for from in
                [DVec3::ZERO, DVec3::new(9.0, 0.3, 0.1), DVec3::splat(1e200)].into_iter().chain(at_lights)
            {
                const NUMBERS: usize = 100_000;
                let mut counts = vec![0; count];
                for k in 0..NUMBERS {
                    let (light, probability) = tree.sample(from, (k as f64 + 0.5) / NUMBERS as f64);
                    assert_eq!(probability, tree.probability(light, from));
                    counts[light] += 1;
                }
                let mut total = 0.0;
                for (light, chosen) in counts.into_iter().enumerate() {
                    let probability = tree.probability(light, from);
                    let expected = NUMBERS as f64 * probability;
                    assert!((f64::from(chosen) - expected).abs() < 2.0, "{light}: {chosen}, {expected}");
                    total += probability;
                }
                assert!((total - 1.0).abs() < 1e-12, "{total}");
            }
        }
    }

    /// Of a hundred equal lamps, one in four comes from the lamp at distance 1/8 of the grid's spacing: it brings 64 units, the
    /// others less than 2 pi times the sum of 1 / r over 7 rings, 17 in all; without a tree it would be one in a hundred.
    #[test]
    fn a_near_light_is_chosen_often() {
        let lights: Vec<LocalLight> =
            (0..100).map(|k| lamp(f64::from(k % 10), f64::from(k / 10), 0.0, [0.0, 1.0])).collect();
        let from = DVec3::new(4.0, 4.0, 0.125);
        let probability = LightTree::new(&lights).probability(44, from);
        assert!(probability > 0.25, "{probability}");
    }
}
