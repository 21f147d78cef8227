//! The price of accuracy: what a ray costs in each of kiln's tiers and in other libraries, and what it gets wrong.
//!
//! Speed is that of [`speed`](super::speed) on one mesh, errors are those of [`leaks`] and of the rays of
//! its closed meshes compared with the tier `exact`. All rays have f32 values, so that no tier rounds its input.

use std::sync::atomic::Ordering;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::plot::{Mark, Scatter};
use super::speed::{Kind, RaySets, ReferenceHits, Settings, SpeedRow, measure};
use super::{Engine, Icosphere, LEVEL, Label, LeakRayKind, Mesh, Numbers, PLACEMENTS, leaks, own, ray};
use crate::timing::{Clock, Quartiles};
use kiln::bvh::detail::{Layout, Precision};
use kiln::bvh::{Numerics, Preset, Ray};
use kiln::error::{Error, Result, Warnings};
use kiln::film::Film;
use kiln::job::{RenderJob, RenderSettings, prepare};
use kiln::render::RenderControl;
use kiln::scene::{Look, Scene, Transport};

/// Cost and errors of a library in one mode: a tier of kiln, Embree with or without its robust mode, a layout of others.
#[derive(Debug, Clone, PartialEq)]
pub struct PriceRow {
    /// The library.
    pub engine: &'static str,
    /// The mode.
    pub mode: &'static str,
    /// Widest instruction set of its traversal.
    pub isa: &'static str,
    /// Nanoseconds a ray of each kind of [`Kind::ALL`], in the fastest of the library's settings in this mode; `None`
    /// if there are no rays of the kind.
    pub ns: [Option<Quartiles>; 4],
    /// What it gets wrong.
    pub errors: RayErrors,
    /// Pictures in a tier of kiln, by [`TRANSPORTS`].
    pub pictures: Option<[PicturePrice; 2]>,
}

impl PriceRow {
    /// Library, mode and instruction set.
    pub fn name(&self) -> String {
        format!("{} {}, {}", self.engine, self.mode, self.isa)
    }

    /// Nanoseconds a ray: the geometric mean of the kinds, so that the ratio of two rows is the mean of their ratios.
    pub fn mean_ns(&self) -> Option<f64> {
        let medians: Vec<f64> = self.ns.iter().flatten().map(|ns| ns.median.ln()).collect();
        (!medians.is_empty()).then(|| (medians.iter().sum::<f64>() / medians.len() as f64).exp())
    }
}

/// A plot of wrong answers against time, as SVG.
pub fn plot(rows: &[PriceRow]) -> String {
    let mark = |row: &PriceRow| {
        let group = usize::from(row.engine != "kiln") + usize::from(row.engine == "embree");
        let label = format!("{} {}", row.engine, row.mode);
        Some(Mark { x: Quartiles::exact(row.mean_ns()?), y: row.errors.wrong, group, is_filled: true, label })
    };
    // By the widest instructions alone, whose rows are the first: labels of more would lie on each other.
    let is_first = |(index, row): &(usize, &PriceRow)| {
        !rows[..*index].iter().any(|before| (before.engine, before.mode) == (row.engine, row.mode))
    };
    let marks: Vec<Mark> =
        rows.iter().enumerate().filter(is_first).filter_map(|(_, row)| mark(row)).collect();
    let groups = ["kiln", "other libraries", "Embree"].into_iter().zip(0..);
    let plot = Scatter {
        size: [760.0, 460.0],
        text: 11.0,
        axes: ["nanoseconds a ray, mean of four kinds", "wrong answers a million rays at edges and vertices"],
        groups: groups.filter(|(_, group)| marks.iter().any(|mark| mark.group == *group)).collect(),
        marks,
        joined: Vec::new(),
        floor: None,
    };
    plot.svg()
}

/// Errors per million rays.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RayErrors {
    /// Leaks of rays at vertices and edges of a closed mesh and along the axes, from inside and outside.
    pub leaks_aimed: f64,
    /// Leaks of rays in random directions, from inside.
    pub leaks_random: f64,
    /// Leaks of secondary rays, whose origins have kiln's offset in kiln, that of pbrt in other libraries.
    pub leaks_secondary: f64,
    /// Of all these rays but secondary ones, and of grazing rays at a giant plane: false hits, false misses and hits of a
    /// triangle that is not among the nearest.
    pub wrong: f64,
    /// Largest error of a distance in f32 ulp; `None` for libraries whose distances are not read.
    pub worst_t: Option<f64>,
}

/// Cost and errors of a picture in a tier.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PicturePrice {
    /// Time in ms.
    pub ms: Quartiles,
    /// Root mean square of the difference to the picture of `exact`, in display values from 0 to 255.
    pub rms: f64,
    /// Pixels that differ from it.
    pub differing: usize,
}

/// The transports of the pictures.
pub const TRANSPORTS: [Transport; 2] = [Transport::Whitted, Transport::Path];

/// What is measured.
pub struct Subject<'a> {
    /// The mesh for speed.
    pub mesh: &'a Mesh,
    /// The rays for speed.
    pub rays: &'a RaySets,
    /// The scene for pictures.
    pub scene: &'a Scene,
    /// Settings of the pictures, but for tier and transport.
    pub picture: &'a RenderSettings,
}

/// Measures kiln's tiers and all available libraries: `runs` timed rounds on `pool`, of one thread, and `rays` aimed rays
/// from each side at each of [`PLACEMENTS`] for errors, on the current pool.
///
/// # Errors
/// [`Error::Interrupted`] when cancelled, [`Error::Failed`] if a library fails, and those of rendering.
pub fn price(
    subject: &Subject,
    rays: u64,
    runs: u32,
    pool: &rayon::ThreadPool,
    control: &RenderControl,
) -> Result<Vec<PriceRow>> {
    let (mut engines, _) = super::speed::engines(1);
    // Of kiln, one layout: it is not the fastest of several.
    engines.retain(|engine| engine.label.engine != "kiln" || is_default(&engine.label));
    let speeds =
        measure(&engines, subject.mesh, subject.rays, &Settings { runs, pool, check: false }, control)?;
    let (mut rows, mut firsts): (Vec<PriceRow>, Vec<Engine>) = Default::default();
    for (engine, speed) in engines.into_iter().zip(&speeds) {
        let (name, mode, isa) = (engine.label.engine, mode(&engine.label), engine.label.isa);
        let at = rows.iter().position(|row| (row.engine, row.mode, row.isa) == (name, mode, isa));
        let at = at.unwrap_or_else(|| {
            let errors = RayErrors::default();
            rows.push(PriceRow { engine: name, mode, isa, ns: [None; 4], errors, pictures: None });
            firsts.push(engine);
            rows.len() - 1
        });
        for (ns, kind) in rows[at].ns.iter_mut().zip(Kind::ALL) {
            *ns = faster(*ns, nanoseconds(speed, kind));
        }
    }
    let errors = ray_errors(&firsts, rays, control)?;
    rows.iter_mut().zip(errors).for_each(|(row, errors)| row.errors = errors);
    let pictures = pool.install(|| pictures(subject, runs, control))?;
    // Pictures are rendered with the widest instructions.
    let widest = own::engine(Layout::default(), Numerics::default()).label.isa;
    let is_rendered = |row: &&mut PriceRow| row.engine == "kiln" && row.isa == widest;
    for (row, pictures) in rows.iter_mut().filter(is_rendered).zip(pictures) {
        row.pictures = Some(pictures);
    }
    Ok(rows)
}

/// Whether it is the default layout, with any instruction set.
fn is_default(label: &Label) -> bool {
    let layouts = [Layout::default(), Layout::Avx2(Preset::default())];
    let of_default = |layout| own::engine(layout, Numerics::default()).label;
    layouts.map(of_default).iter().any(|of| (of.layout, of.preset) == (label.layout, label.preset))
}

/// The tier if the library has several, else its layout; single rays and packets of Embree are settings of one mode.
fn mode(label: &Label) -> &'static str {
    label.tier.unwrap_or(if label.engine == "embree" { "default" } else { label.layout })
}

fn nanoseconds(row: &SpeedRow, kind: Kind) -> Option<Quartiles> {
    let Quartiles { lower, median, upper } = row.mrays_per_s(kind)?;
    Some(Quartiles { lower: 1e3 / upper, median: 1e3 / median, upper: 1e3 / lower })
}

fn faster(a: Option<Quartiles>, b: Option<Quartiles>) -> Option<Quartiles> {
    [a, b].into_iter().flatten().min_by(|a, b| a.median.total_cmp(&b.median))
}

/// Leaks and wrong hits of each engine.
fn ray_errors(engines: &[Engine], rays: u64, control: &RenderControl) -> Result<Vec<RayErrors>> {
    let leak_rows = leaks::measure(engines, rays, control)?;
    let mut errors: Vec<RayErrors> = leak_rows.chunks(PLACEMENTS.len()).map(of_leaks).collect();
    let spheres = PLACEMENTS.map(|placement| {
        let sphere = Icosphere::new(LEVEL, placement);
        let rays = LeakRayKind::ALL.map(|kind| leak_rays(&sphere, kind, rays));
        (sphere.mesh, rays.concat())
    });
    let mut counts = vec![(0, 0); engines.len()];
    for (mesh, rays) in spheres.into_iter().chain([(giant_plane(), grazing(rays))]) {
        let exact = own::accelerator(&mesh, Layout::default(), Numerics::Exact);
        let reference = ReferenceHits::new(&*exact, &rays, false);
        for ((engine, errors), (wrong, compared)) in engines.iter().zip(&mut errors).zip(&mut counts) {
            if control.cancel.load(Ordering::Relaxed) {
                return Err(Error::Interrupted);
            }
            let built = engine.build(&mesh)?;
            let mut queue = built.queue(Kind::Random, &rays);
            queue.run();
            *wrong += reference.wrong(&queue.hits());
            *compared += rays.len();
            if let Some(distances) = queue.distances() {
                let worst = reference.worst_distance(&queue.hits(), &distances);
                errors.worst_t = Some(errors.worst_t.map_or(worst, |before| before.max(worst)));
            }
        }
    }
    for (errors, (wrong, compared)) in errors.iter_mut().zip(counts) {
        errors.wrong = wrong as f64 * 1e6 / compared as f64;
    }
    Ok(errors)
}

/// Leaks per million of an engine over all placements.
fn of_leaks(rows: &[leaks::LeakRow]) -> RayErrors {
    let rate = |count: fn(&leaks::Counts) -> u64| {
        let sum =
            |of: fn(&leaks::LeakRow) -> &leaks::Counts| rows.iter().map(|row| count(of(row))).sum::<u64>();
        sum(|row| &row.leaks) as f64 * 1e6 / sum(|row| &row.rays) as f64
    };
    RayErrors {
        leaks_aimed: rate(|counts| counts.primary()),
        leaks_random: rate(|counts| counts.random),
        leaks_secondary: rate(|counts| counts.secondary),
        ..RayErrors::default()
    }
}

/// Rays of one kind with f32 values.
fn leak_rays(sphere: &Icosphere, kind: LeakRayKind, rays: u64) -> Vec<Ray> {
    let count = *leaks::Counts::of_rays(rays).of(kind);
    let single = |(origin, direction)| Precision::Single.ray(origin, direction, 0.0, f64::INFINITY);
    (0..count).into_par_iter().map(|index| single(ray(sphere, kind, index))).collect()
}

/// A plane of 20,000 x 110,000 at a height of -500, as in the assignment, rotated: axis-aligned distances are easier.
fn giant_plane() -> Mesh {
    let [x, z, far, y] = [-1e4, -1e4, 1e5, -500.0];
    let positions =
        [(x, z), (x, far), (-x, z), (-x, far)].map(|(x, z)| (tilt() * DVec3::new(x, y, z)).as_vec3());
    Mesh { positions: positions.to_vec(), triangles: vec![[0, 1, 2], [3, 2, 1]] }
}

/// A rotation after which no edge and no face is axis-aligned.
fn tilt() -> DMat3 {
    DMat3::from_axis_angle(DVec3::new(1.0, 0.3, 0.2).normalize(), 0.4)
}

/// Rays from 2^-14 to 200 above the plane to points up to 90,000 away; a quarter of them at the plane's diagonal.
fn grazing(rays: u64) -> Vec<Ray> {
    let one = |index: u64| {
        let mut numbers = Numbers::new(4, index);
        let heights = [200.0, 1.0, 1e-2, 1e-3, 2f64.powi(-14)];
        let origin =
            DVec3::new(0.0, -500.0 + heights[numbers.below(heights.len())], 0.0).as_vec3().as_dvec3();
        let target = if index.is_multiple_of(4) {
            DVec3::new(-1e4, -500.0, 1e5).lerp(DVec3::new(1e4, -500.0, -1e4), numbers.unit())
        } else {
            DVec3::new(1e4 * (2.0 * numbers.unit() - 1.0), -500.0, 9e4 * numbers.unit())
        };
        let direction = tilt() * (target - origin).normalize();
        Precision::Single.ray(tilt() * origin, direction, 0.0, f64::INFINITY)
    };
    (0..rays).map(one).collect()
}

/// Both pictures of the scene in every tier of [`Numerics::ALL`], in turns, on the current pool.
fn pictures(subject: &Subject, runs: u32, control: &RenderControl) -> Result<Vec<[PicturePrice; 2]>> {
    let job = |numerics: Numerics, transport: Transport| -> Result<RenderJob> {
        let mut settings = RenderSettings { mesh_look: Look::Studio, ..subject.picture.clone() };
        (settings.picture.numerics, settings.picture.transport) = (Some(numerics), Some(transport));
        prepare(subject.scene.clone(), &settings, &mut Warnings::default())
    };
    let mut rows = vec![[None; 2]; Numerics::ALL.len()];
    for (index, transport) in TRANSPORTS.into_iter().enumerate() {
        let jobs: Vec<RenderJob> =
            Numerics::ALL.into_iter().map(|numerics| job(numerics, transport)).collect::<Result<_>>()?;
        let mut films: Vec<Option<Film<[u8; 3]>>> = jobs.iter().map(|_| None).collect();
        let mut ms = vec![Vec::new(); jobs.len()];
        for round in 0..=runs {
            for ((job, film), ms) in jobs.iter().zip(&mut films).zip(&mut ms) {
                let clock = Clock::start(1);
                *film = Some(job.render(control)?.0);
                // Round 0 is the warm-up.
                if round > 0 {
                    ms.push(clock.seconds() * 1e3);
                }
            }
        }
        let films: Vec<_> = films.into_iter().flatten().collect();
        let Some(exact) = films.last() else { continue };
        for ((row, film), ms) in rows.iter_mut().zip(&films).zip(&ms) {
            let ms = Quartiles::of(ms).unwrap_or(Quartiles::exact(0.0));
            let (rms, differing) = difference(film.stored(), exact.stored());
            row[index] = Some(PicturePrice { ms, rms, differing });
        }
    }
    Ok(rows.into_iter().filter_map(|[whitted, path]| Some([whitted?, path?])).collect())
}

/// Root mean square over all channels, and the number of pixels that differ.
fn difference(a: &[[u8; 3]], b: &[[u8; 3]]) -> (f64, usize) {
    let squares =
        a.iter().zip(b).flat_map(|(a, b)| a.iter().zip(b)).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2));
    let differing = a.iter().zip(b).filter(|(a, b)| a != b).count();
    ((squares.sum::<f64>() / (3 * a.len().max(1)) as f64).sqrt(), differing)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hits_are_compared_with_the_closest_exact_hit() {
        // Two squares' halves, at z = 0 and z = -1, and a ray from z = 1.
        let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        let positions = [0.0, -1.0].iter().flat_map(|&z| corners.map(|[x, y]| glam::vec3(x, y, z)));
        let mesh = Mesh { positions: positions.collect(), triangles: vec![[0, 1, 2], [3, 4, 5]] };
        let exact = own::accelerator(&mesh, Layout::default(), Numerics::Exact);
        let ray = |x: f64| Precision::Single.ray(DVec3::new(x, 0.25, 1.0), -DVec3::Z, 0.0, f64::INFINITY);
        let wrong = |x: f64, hit: Option<u32>| ReferenceHits::new(&*exact, &[ray(x)], false).wrong(&[hit]);
        assert_eq!([wrong(0.25, Some(0)), wrong(2.0, None)], [0, 0]);
        assert_eq!([wrong(0.25, Some(1)), wrong(0.25, None), wrong(2.0, Some(0))], [1, 1, 1]);
        let three_ulp = 1.0 + 3.0 * f64::from(f32::EPSILON);
        let rays = [ray(0.25)];
        assert_eq!(ReferenceHits::new(&*exact, &rays, false).worst_distance(&[Some(0)], &[three_ulp]), 3.0);
    }

    #[test]
    fn the_difference_of_pictures_by_hand() {
        let [a, b] = [[[1, 2, 3], [4, 5, 6]], [[1, 2, 3], [4, 5, 9]]];
        assert_eq!(difference(&a, &b), (1.5f64.sqrt(), 1));
        assert_eq!(difference(&a, &a), (0.0, 0));
    }

    #[test]
    fn the_mean_of_ratios_is_the_ratio_of_means() {
        let row = |ns: [f64; 4]| PriceRow {
            engine: "kiln",
            mode: "fast",
            isa: "avx2",
            ns: ns.map(|ns| Some(Quartiles::exact(ns))),
            errors: RayErrors::default(),
            pictures: None,
        };
        let [a, b] = [row([1.0, 2.0, 4.0, 8.0]), row([2.0, 4.0, 8.0, 16.0])];
        let ratio = b.mean_ns().zip(a.mean_ns()).map(|(b, a)| b / a);
        assert!((ratio.expect("both have rays") - 2.0).abs() < 1e-12);
    }
}
