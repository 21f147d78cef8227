//! Winding numbers by expansions, of a point in each lane.

use std::f64::consts::TAU;

use glam::DVec3;

use super::WindingNumber;
use super::expansions::{Content, Expansions, Node, SLACK, U};
use crate::bvh::Primitive;
use crate::bvh::crossings::{CONTAINS_DIRECTION, winding_ray};
use crate::geometry::simd::{Doubles, InstructionSet, Simd, Vector, with_simd};
use crate::geometry::{AnalyticShape, LineTest, Side, Triangle};

impl Expansions {
    /// Calls `set` with the index of each point and the winding number around it. `stack` is scratch memory.
    pub(in crate::bvh) fn evaluate(
        &self,
        points: &[DVec3],
        beta: f64,
        instructions: InstructionSet,
        stack: &mut Waiting,
        set: &mut dyn FnMut(usize, WindingNumber),
    ) {
        with_simd!(instructions, simd => self.evaluate_by(simd, points, beta, stack, set));
    }

    /// Points are together in lanes. Each lane adds the same numbers in the same order as the point by itself, and so
    /// with every instruction set.
    #[inline(always)]
    fn evaluate_by<S: Simd>(
        &self,
        simd: S,
        points: &[DVec3],
        beta: f64,
        stack: &mut Waiting,
        set: &mut dyn FnMut(usize, WindingNumber),
    ) {
        let unknown = WindingNumber { value: 0.0, error: f64::INFINITY };
        simd.run(
            #[inline(always)]
            || {
                for (group, points) in points.chunks(S::D::LANES).enumerate() {
                    let point = |lane: usize| points[lane.min(points.len() - 1)];
                    let is_finite = |lane: &usize| points[*lane].as_vec3().is_finite();
                    let lanes = (0..points.len()).filter(is_finite).fold(0, |lanes, lane| lanes | 1 << lane);
                    let sums = self.sums::<S::D>(point, lanes, beta, stack);
                    for lane in 0..points.len() {
                        let number = if lanes >> lane & 1 != 0 { sums.number(lane) } else { unknown };
                        set(group * S::D::LANES + lane, number);
                    }
                }
            },
        );
    }

    #[inline(always)]
    fn sums<D: Doubles>(
        &self,
        point: impl Fn(usize) -> DVec3,
        lanes: u32,
        beta: f64,
        stack: &mut Waiting,
    ) -> Sums<D> {
        let q = [0, 1, 2].map(
            #[inline(always)]
            |axis: usize| D::from_f64(|lane| point(lane)[axis]),
        );
        let beta_squared = beta.max(1.0) * beta.max(1.0);
        let mut sums = Sums::new();
        stack.clear();
        stack.extend((lanes != 0 && !self.nodes.is_empty()).then_some((WHOLE, 0, lanes)));
        while let Some((part, index, lanes)) = stack.pop() {
            let tree = match &self.content {
                Content::Parts(parts) if part != WHOLE => &*parts[part as usize],
                _ => self,
            };
            let node = &tree.nodes[index as usize];
            let r = minus(node.centre, &q);
            let square = dot(&r, &r);
            let expanded = D::splat(beta_squared * node.reach_squared).lt(square) & lanes;
            if expanded != 0 {
                // The sum has more terms than those of this tree.
                let share = (512 + self.count) as f64 / (512 + tree.count) as f64;
                sums.add_node(node, &r, square, share, expanded);
            }
            let lanes = lanes & !expanded;
            if lanes == 0 {
                continue;
            }
            if node.second != 0 {
                stack.extend([(part, node.second, lanes), (part, index + 1, lanes)]);
                continue;
            }
            match &tree.content {
                Content::Parts(_) => stack.push((node.first, 0, lanes)),
                Content::Primitives(primitives) => {
                    for primitive in &primitives[node.first as usize..node.end as usize] {
                        match primitive {
                            Primitive::Triangle(Triangle(corners)) => sums.add_triangle(corners, &q, lanes),
                            Primitive::Analytic(shape) => sums.add_shape(shape, &point, lanes),
                        }
                    }
                }
            }
        }
        sums
    }
}

/// The index of the tree over all parts on the stack, where those of parts are theirs.
const WHOLE: u32 = u32::MAX;

/// Nodes that wait: the tree that each is of, its index there, and the lanes that it is for.
pub(in crate::bvh) type Waiting = Vec<(u32, u32, u32)>;

/// What is added up for a point in each lane.
struct Sums<D> {
    value: D,
    error: D,
    /// The product of `cos θ + i sin θ`, up to a positive factor, where θ are half the solid angles of triangles: its
    /// argument is their sum but for full turns.
    product: [D; 2],
    /// [`pseudo_angle`] of the product.
    angle: D,
    /// The full turns.
    turns: D,
}

/// A number that grows with the argument of a complex number with `|re| + |im|` = 1, in units of a quarter turn; it
/// differs from the argument by less than 0.05. As that of `atan2`, it has the sign of the imaginary part.
#[inline(always)]
fn pseudo_angle<D: Doubles>([re, im]: [D; 2]) -> D {
    (D::splat(1.0) - re).copysign(im)
}

#[inline(always)]
fn minus<D: Doubles>(a: [f64; 3], b: &[D; 3]) -> [D; 3] {
    [D::splat(a[0]) - b[0], D::splat(a[1]) - b[1], D::splat(a[2]) - b[2]]
}

#[inline(always)]
fn dot<D: Doubles>(a: &[D; 3], b: &[D; 3]) -> D {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl<D: Doubles> Sums<D> {
    #[inline(always)]
    fn new() -> Self {
        let [zero, one] = [D::splat(0.0), D::splat(1.0)];
        Sums { value: zero, error: zero, product: [one, zero], angle: zero, turns: zero }
    }

    /// The winding number around the point in a lane.
    #[inline(always)]
    fn number(&self, lane: usize) -> WindingNumber {
        let [value, error, re, im, turns] =
            [self.value, self.error, self.product[0], self.product[1], self.turns].map(|x| x.array()[lane]);
        WindingNumber { value: value + (im.atan2(re) / TAU + turns), error: error * SLACK + 16.0 * U }
    }

    /// Adds the expansion of a node, whose centre is at r from the points in `lanes`. `share` multiplies its rounding.
    #[inline(always)]
    fn add_node(&mut self, node: &Node, r: &[D; 3], square: D, share: f64, lanes: u32) {
        let s = D::splat;
        let inverse = s(1.0) / square.sqrt();
        let [x, y, z] = [r[0] * inverse, r[1] * inverse, r[2] * inverse];
        let t = s(node.radius) * inverse;
        let [xx, yy, zz] = [x * x, y * y, z * z];
        let (xz, yz) = (xx - zz, yy - zz);
        let [vx, vy, vz] = node.vector;
        let vector = s(vx) * x + s(vy) * y + s(vz) * z;
        let [mxx, myy, mxy, mxz, myz] = node.matrix;
        let matrix = s(mxx) * xz
            + s(myy) * yz
            + s(2.0 * mxy) * (x * y)
            + s(2.0 * mxz) * (x * z)
            + s(2.0 * myz) * (y * z);
        let [txxx, tyyy, txxy, txxz, txyy, tyyz, txyz] = node.tensor;
        let three = s(3.0);
        let tensor = x * (s(txxx) * (xx - three * zz) + s(3.0 * txyy) * yz)
            + y * (s(tyyy) * (yy - three * zz) + s(3.0 * txxy) * xz)
            + z * (s(txxz) * (three * xx - zz) + s(tyyz) * (three * yy - zz) + s(6.0 * txyz) * (x * y));
        let t_squared = t * t;
        let value = t_squared * (vector + t * (matrix + t * tensor));
        let error = t_squared * (s(node.rounding * share) + t * t_squared * s(node.truncation));
        self.value = D::select(lanes, self.value + value, self.value);
        self.error = D::select(lanes, self.error + error, self.error);
    }

    /// Adds a triangle for the points q in `lanes`: with a, b and c the vectors to its corners, half the solid angle
    /// is the argument of `re + i im`, where `im = a . (b x c)` and `re = |a| |b| |c| + (a . b) |c| + (b . c) |a| +
    /// (c . a) |b|`.
    ///
    /// a, b and c are off by u, lengths by 4u, `im` by 16u |a| |b| |c| and `re` by 55u: the sum by less than 90u. So
    /// the argument, over a full turn, is off by 90u |a| |b| |c| / 4 hypot(re, im), except that it may be at the
    /// other end of its range where `re` may be negative and `im` may be 0: on the triangle. The products are off by
    /// 16u. A winding number of one triangle is off by 1 at most.
    #[inline(always)]
    fn add_triangle(&mut self, corners: &[DVec3; 3], q: &[D; 3], lanes: u32) {
        let [zero, one] = [D::splat(0.0), D::splat(1.0)];
        let [a, b, c] = [0, 1, 2].map(
            #[inline(always)]
            |k: usize| minus(corners[k].to_array(), q),
        );
        let cross = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
        let [of_a, of_b, of_c] = [dot(&a, &a).sqrt(), dot(&b, &b).sqrt(), dot(&c, &c).sqrt()];
        let lengths = of_a * of_b * of_c;
        let im = dot(&a, &cross);
        let re = lengths + dot(&a, &b) * of_c + dot(&b, &c) * of_a + dot(&c, &a) * of_b;
        let slack = D::splat(128.0 * U) * lengths;
        let size = re.abs() + im.abs();
        let scale = one / size;
        // 1 for NaN, at a corner.
        let error = (slack * scale).min(one) + D::splat(16.0 * U);
        let at_ends = im.abs().le(slack) & re.le(slack);
        let error = D::select(at_ends, one, error);
        self.error = D::select(lanes, self.error + error, self.error);
        let lanes = lanes & zero.lt(size);
        let [re, im] = [re * scale, im * scale];
        let [to_re, to_im] = self.product;
        let product = [to_re * re - to_im * im, to_re * im + to_im * re];
        let scale = one / (product[0].abs() + product[1].abs());
        let product = [product[0] * scale, product[1] * scale];
        let angle = pseudo_angle(product);
        // The nearest integer: adding rounds to integers.
        let round = D::splat(1.5 / f64::EPSILON);
        let turns = (self.angle + pseudo_angle([re, im]) - angle) * D::splat(0.25) + round - round;
        self.product = [0, 1].map(
            #[inline(always)]
            |k: usize| D::select(lanes, product[k], self.product[k]),
        );
        self.angle = D::select(lanes, angle, self.angle);
        self.turns = D::select(lanes, self.turns + turns, self.turns);
    }

    /// Adds another shape: exactly 1 within a closed one; of an open one nothing but the error.
    fn add_shape(&mut self, shape: &AnalyticShape, point: &impl Fn(usize) -> DVec3, lanes: u32) {
        let (mut value, mut error) = (self.value.array(), self.error.array());
        for lane in (0..D::LANES).filter(|lane| lanes >> lane & 1 != 0) {
            if !shape.is_closed() {
                error[lane] += 0.5;
            } else if let Some(ray) = winding_ray(point(lane), CONTAINS_DIRECTION) {
                let sides = LineTest::new(&ray).cross_shape(shape).into_iter().flatten();
                value[lane] +=
                    sides.map(|(_, side)| if side == Side::Leaving { 1.0 } else { -1.0 }).sum::<f64>();
            }
        }
        (self.value, self.error) = (D::load(value), D::load(error));
    }
}
