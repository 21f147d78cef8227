//! Measures a BVH of one's own beside those that `kiln bench` measures, on the same mesh and rays: build time, million
//! rays a second, wrong hits. Here it is a binary tree that splits at the median, in 100 lines.
//!
//! ```sh
//! cargo run --release --example compare_bvh -- model.obj    # without a file: a generated mesh
//! ```
//!
//! Another crate needs `kiln` with the feature `bench`, and `rayon` for the thread pool.

use std::path::PathBuf;

use kiln::bvh::Ray;
use kiln::error::{Result, Warnings};
use kiln::glam::Vec3;
use kiln::job::RenderControl;
use kiln_lab::bench::generate::Family;
use kiln_lab::bench::speed::{
    Kind, RaySets, Settings, SpeedRow, Viewpoint, engines, measure, scene, triangles, view_setup,
};
use kiln_lab::bench::{Built, Engine, Facts, Label, Mesh, RayQueue, singly};

fn main() -> Result<()> {
    let mesh = match std::env::args_os().nth(1) {
        Some(file) => triangles(&kiln::import::load(&[PathBuf::from(file)], &mut Warnings::default())?).mesh,
        None => Family::Sphere.mesh(100_000),
    };
    print!("{}", table(&compare(&mesh, 512, 5)?));
    Ok(())
}

/// Measures [`median_split`] and every engine that is there, in so many rounds on one thread, with the rays of a picture
/// of `size` by `size` pixels.
pub fn compare(mesh: &Mesh, size: u32, runs: u32) -> Result<Vec<SpeedRow>> {
    let (mut all, _) = engines(1);
    all.push(median_split());
    let ray_sets = RaySets::new(mesh, &view_setup(&scene(mesh), Viewpoint::Outside, size)?);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    measure(&all, mesh, &ray_sets, &Settings { runs, pool: &pool, check: true }, &RenderControl::default())
}

/// A line for each engine: median build time in ms, median million rays a second of each kind, wrong hits.
pub fn table(rows: &[SpeedRow]) -> String {
    let line = |cells: [String; 7]| {
        let [name, numbers @ ..] = cells;
        format!("{name:<40}{}\n", numbers.map(|number| format!("{number:>10}")).concat())
    };
    let titles = ["engine", "build ms", "primary", "shadow", "diffuse", "random", "wrong"];
    let mut text = line(titles.map(str::to_owned));
    for row in rows {
        let Label { engine, layout, tier, preset, .. } = row.label;
        let name = [Some(engine), Some(layout), tier, preset].into_iter().flatten().collect::<Vec<_>>();
        let speed = |kind| row.mrays_per_s(kind).map_or("-".into(), |rate| format!("{:.2}", rate.median));
        let [primary, shadow, diffuse, random] = Kind::ALL.map(speed);
        let wrong = row.all_wrong().map_or("-".into(), |wrong| wrong.to_string());
        let build = format!("{:.1}", row.build_ms.median);
        text += &line([name.join(" "), build, primary, shadow, diffuse, random, wrong]);
    }
    text
}

/// The engine that is measured.
pub fn median_split() -> Engine {
    let isa = kiln::bvh::detail::compiled_isa();
    let label = Label { engine: "mine", layout: "median split", tier: None, preset: None, isa };
    Engine::new(label, |mesh| {
        let triangles = (0..mesh.triangles.len() as u32).map(|id| Triangle { corners: mesh.corners(id), id });
        let mut tree = Tree { nodes: Vec::new(), triangles: triangles.collect() };
        let count = tree.triangles.len();
        tree.split(0, count);
        Ok(Box::new(tree))
    })
}

struct Triangle {
    corners: [Vec3; 3],
    id: u32,
}

/// The first child of an inner node follows it.
struct Node {
    min: Vec3,
    max: Vec3,
    /// The triangles of a leaf; none of an inner node.
    triangles: std::ops::Range<usize>,
    /// The second child of an inner node.
    second: usize,
}

struct Tree {
    nodes: Vec<Node>,
    triangles: Vec<Triangle>,
}

impl Tree {
    /// Appends the nodes over a range of triangles, which are reordered.
    fn split(&mut self, start: usize, end: usize) {
        let corners = || self.triangles[start..end].iter().flat_map(|triangle| triangle.corners);
        let (min, max) =
            (corners().fold(Vec3::INFINITY, Vec3::min), corners().fold(-Vec3::INFINITY, Vec3::max));
        let place = self.nodes.len();
        if end - start <= 4 {
            return self.nodes.push(Node { min, max, triangles: start..end, second: 0 });
        }
        self.nodes.push(Node { min, max, triangles: 0..0, second: 0 });
        let (axis, half) = ((max - min).max_position(), (end - start) / 2);
        let centre = |triangle: &Triangle| triangle.corners.iter().map(|corner| corner[axis]).sum::<f32>();
        self.triangles[start..end].select_nth_unstable_by(half, |a, b| centre(a).total_cmp(&centre(b)));
        self.split(start, start + half);
        self.nodes[place].second = self.nodes.len();
        self.split(start + half, end);
    }

    /// The distance and id of the closest hit before `t_max`, or of any.
    fn hit(&self, ray: &SingleRay, is_any: bool) -> Option<u32> {
        let (mut t_max, mut found) = (ray.t_max, None);
        let mut stack = vec![0];
        while let Some(place) = stack.pop() {
            let node = &self.nodes[place];
            if !ray.meets(node.min, node.max, t_max) {
                continue;
            }
            for triangle in &self.triangles[node.triangles.clone()] {
                if let Some(t) = ray.hit(triangle.corners).filter(|&t| t < t_max) {
                    (t_max, found) = (t, Some(triangle.id));
                    if is_any {
                        return found;
                    }
                }
            }
            if node.triangles.is_empty() {
                stack.extend([node.second, place + 1]);
            }
        }
        found
    }
}

impl Built for Tree {
    fn facts(&self) -> Facts {
        let bytes = size_of_val(&self.nodes[..]) + size_of_val(&self.triangles[..]);
        Facts { nodes: Some(self.nodes.len() as u64), bytes: Some(bytes as u64), ..Facts::default() }
    }

    fn queue<'a>(&'a self, kind: Kind, rays: &'a [Ray]) -> Box<dyn RayQueue + 'a> {
        // Rays are converted here, untimed; the closure is timed.
        singly(rays.iter().map(SingleRay::new), move |ray| self.hit(ray, kind.is_any_hit()))
    }
}

/// A ray in f32.
struct SingleRay {
    origin: Vec3,
    direction: Vec3,
    reciprocal: Vec3,
    t_max: f32,
}

impl SingleRay {
    fn new(ray: &Ray) -> Self {
        let [origin, direction] = [ray.origin(), ray.direction()].map(|v| v.as_vec3());
        SingleRay { origin, direction, reciprocal: direction.recip(), t_max: ray.t_max() as f32 }
    }

    /// Whether it meets a box before `t_max`.
    fn meets(&self, min: Vec3, max: Vec3, t_max: f32) -> bool {
        let [a, b] = [min, max].map(|corner| (corner - self.origin) * self.reciprocal);
        let (enter, leave) = (a.min(b).max_element().max(0.0), a.max(b).min_element().min(t_max));
        enter <= leave
    }

    /// Möller and Trumbore, Fast, Minimum Storage Ray-Triangle Intersection, 1997, from both sides.
    fn hit(&self, [a, b, c]: [Vec3; 3]) -> Option<f32> {
        let (ab, ac) = (b - a, c - a);
        let p = self.direction.cross(ac);
        let determinant = ab.dot(p);
        let s = self.origin - a;
        let q = s.cross(ab);
        let [u, v, t] = [s.dot(p), self.direction.dot(q), ac.dot(q)].map(|x| x / determinant);
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t)
    }
}
