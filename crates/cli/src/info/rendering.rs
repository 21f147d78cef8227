//! What a render without options takes: time and memory of the acceleration structure, mip maps, effects.

use std::collections::HashSet;
use std::sync::Arc;
use std::time::Instant;

use serde_json::{Value, json};

use super::{FileNames, Lines};
use kiln::bvh::detail::Description;
use kiln::effects::Decision;
use kiln::error::{Error, Result, Warnings};
use kiln::import::sharing::shared;
use kiln::job::{RenderControl, RenderSettings, Session};
use kiln::limits::{self, Bytes};
use kiln::scene::{Attribute, Look, Mesh, Scene, Shape, shell_quoted};

/// Stored primitives up to which the acceleration structure is built to measure it, which takes a few seconds.
const MOST_BUILT: usize = 4_000_000;

/// Bytes of the acceleration structure for a stored primitive. Measured: docs/decisions.md.
const BVH_BYTES: u64 = 70;

/// Peak memory while building for a stored primitive, beside the scene, in bytes. Measured: docs/decisions.md.
const PEAK_BYTES: u64 = 270;

/// Cost of a render without options, before its first ray.
pub(super) struct Rendering {
    primitives: usize,
    /// Primitives in the acceleration structure: those of a shared mesh once, and one for each of its places.
    stored: usize,
    /// Memory of the meshes as they were loaded.
    mesh_bytes: usize,
    /// Memory of the images without mip maps.
    image_bytes: usize,
    /// `None` if the scene has more than [`MOST_BUILT`] primitives, an error if it cannot be rendered.
    outcome: Result<Option<Built>>,
    warnings: Warnings,
}

struct Built {
    seconds: f64,
    threads: usize,
    description: Description,
    /// The camera as a table of `--camera`.
    camera: String,
    /// Bytes of the mip maps of each image.
    mip_maps: Vec<usize>,
    decisions: Vec<Decision>,
    /// Peak memory of the process while loading and building.
    peak: Option<u64>,
}

impl Rendering {
    /// Builds a scene, if it is not too large or `is_built` says so. `after_loading` was measured then.
    pub(super) fn of(scene: Scene, is_built: bool, after_loading: &Memory) -> Self {
        let mut warnings = Warnings::default();
        let stored = stored_primitives(&scene);
        Rendering {
            stored,
            primitives: scene.primitive_count(),
            mesh_bytes: mesh_bytes(&scene),
            image_bytes: scene.images.iter().map(|image| image.pixels.as_bytes().len()).sum(),
            outcome: (is_built || stored <= MOST_BUILT)
                .then(|| build(scene, after_loading, &mut warnings))
                .transpose(),
            warnings,
        }
    }

    /// Warnings and notes of the preparation of a render.
    pub(super) fn warnings(&self) -> &Warnings {
        &self.warnings
    }

    /// Bytes of the acceleration structure, and at the peak.
    fn bytes(&self) -> [Option<u64>; 2] {
        let stored = self.stored as u64;
        match &self.outcome {
            Ok(Some(built)) => [Some(built.description.bytes as u64), built.peak],
            Ok(None) => {
                let scene = (self.mesh_bytes + self.image_bytes) as u64;
                [Some(stored * BVH_BYTES), Some(stored * PEAK_BYTES + scene)]
            }
            Err(_) => [None; 2],
        }
    }

    fn built(&self) -> Option<&Built> {
        self.outcome.as_ref().ok()?.as_ref()
    }

    fn mip_map_bytes(&self) -> Option<usize> {
        self.built().map(|built| built.mip_maps.iter().sum())
    }

    /// Adds the lines on time, memory and effects.
    pub(super) fn add(&self, lines: &mut Lines, names: &FileNames) {
        let count = self.primitives;
        match &self.outcome {
            Err(error) => {
                lines.add("render", format!("not possible: {}", names.shorten(&error.to_string())));
            }
            Ok(None) => {
                lines.add("build", format!("not measured with {count} primitives; --build does"));
            }
            Ok(Some(Built { seconds, threads, description, .. })) => {
                let nodes = description.nodes;
                let what = format!("{count} primitives in {nodes} nodes, on {threads} thread(s)");
                let time = match *seconds {
                    seconds if seconds < 0.1 => format!("{:.1} ms", seconds * 1000.0),
                    seconds => format!("{seconds:.2} s"),
                };
                lines.add("build", format!("about {time}, measured: {what}"));
            }
        }
        let shown = |bytes: usize| Bytes(bytes as u64);
        let [bvh, peak] = self.bytes();
        let mut parts = vec![format!("meshes as loaded {}", shown(self.mesh_bytes))];
        parts.extend(bvh.map(|bytes| format!("acceleration structure {}", Bytes(bytes))));
        if self.image_bytes > 0 {
            let mip_maps = self.mip_map_bytes().filter(|&bytes| bytes > 0);
            let mip_maps = mip_maps.map_or(String::new(), |bytes| format!(" and mip maps {}", shown(bytes)));
            parts.push(format!("textures {}{mip_maps}", shown(self.image_bytes)));
        }
        parts.extend(peak.map(|bytes| format!("about {} at most before the first ray", Bytes(bytes))));
        lines.add("memory", parts.join(", "));
        if let Some(built) = self.built() {
            let on = built.decisions.iter().filter(|decision| decision.on);
            let on: Vec<&str> = on.map(|decision| decision.effect.name()).collect();
            lines.add("view", format!("--camera {}", shell_quoted(&built.camera)));
            lines.add("effects", if on.is_empty() { "none".into() } else { on.join(", ") });
        }
    }

    /// Adds `build`, `memory` and `effects`, and the bytes of mip maps to `textures`.
    pub(super) fn add_to_json(&self, report: &mut Value) {
        let built = self.built();
        let [bvh, peak] = self.bytes();
        report["build"] = json!({
            "measured": built.is_some(),
            "seconds": built.map(|built| built.seconds),
            "threads": built.map(|built| built.threads),
            "nodes": built.map(|built| built.description.nodes),
            "error": self.outcome.as_ref().err().map(Error::to_string),
        });
        report["memory"] = json!({
            "meshes": self.mesh_bytes,
            "acceleration_structure": bvh,
            "textures": self.image_bytes,
            "mip_maps": self.mip_map_bytes(),
            "peak": peak,
        });
        let decisions = built.map(|built| {
            let decisions = built.decisions.iter();
            decisions
                .map(|d| json!({ "name": d.effect.name(), "on": d.on, "why": d.why }))
                .collect::<Vec<_>>()
        });
        report["effects"] = json!(decisions);
        let camera = built.map(|built| &built.camera);
        report["render"] =
            json!({ "camera": camera, "warnings": self.warnings.messages(), "notes": self.warnings.notes() });
        let mip_maps = built.map_or(&[][..], |built| &built.mip_maps);
        for (texture, bytes) in report["textures"].as_array_mut().into_iter().flatten().zip(mip_maps) {
            texture["mip_map_bytes"] = json!(bytes);
        }
    }
}

fn build(scene: Scene, after_loading: &Memory, warnings: &mut Warnings) -> Result<Built> {
    limits::reset_peak_memory();
    let before = limits::resident_memory();
    let settings = RenderSettings { mesh_look: Look::Studio, ..RenderSettings::default() };
    let session = Session::still(scene)?;
    let mut picture = session.resolve(&settings, warnings)?;
    // Nothing is rendered.
    Arc::make_mut(&mut picture).meters = false;
    let camera = picture.recentering.map_or_else(
        || picture.camera.to_inline(),
        |recentering| recentering.moved_back(&picture.camera).to_inline(),
    );
    let start = Instant::now();
    let job = session.into_job(&picture, false, &RenderControl::default(), warnings)?;
    let seconds = start.elapsed().as_secs_f64();
    // A render does not have what the analysis of the scene has left in the allocator.
    let growth = limits::peak_memory().zip(before).map(|(peak, before)| peak.saturating_sub(before));
    let built = growth.zip(after_loading.resident).map(|(growth, loaded)| growth + loaded);
    Ok(Built {
        seconds,
        threads: rayon::current_num_threads(),
        camera,
        description: job.world.accelerator.describe(),
        mip_maps: job.world.images.iter().map(|image| image.mip_map_bytes()).collect(),
        decisions: job.plan.decisions,
        peak: built.max(after_loading.peak),
    })
}

/// Memory of the process, where the system tells it.
pub(super) struct Memory {
    resident: Option<u64>,
    peak: Option<u64>,
}

impl Memory {
    pub(super) fn now() -> Self {
        Memory { resident: limits::resident_memory(), peak: limits::peak_memory() }
    }
}

fn stored_primitives(scene: &Scene) -> usize {
    let saved = |(first, group): (usize, Vec<usize>)| {
        (group.len() - 1) * scene.objects[first].shape.primitive_count().saturating_sub(1)
    };
    scene.primitive_count() - shared(&scene.objects).into_iter().map(saved).sum::<usize>()
}

/// Bytes of all meshes; those of a shared one count once.
fn mesh_bytes(scene: &Scene) -> usize {
    let mut seen = HashSet::new();
    let meshes = scene.objects.iter().filter(|object| match &object.shape {
        Shape::Placed(placed) => seen.insert(Arc::as_ptr(&placed.mesh)),
        _ => true,
    });
    meshes.filter_map(|object| object.shape.mesh()).map(bytes_of).sum()
}

fn bytes_of(mesh: &Mesh) -> usize {
    fn of<'a, T: 'a>(attributes: impl IntoIterator<Item = &'a Attribute<T>>) -> usize {
        let of_one = |attribute: &Attribute<T>| {
            let triangles = attribute.triangles.as_ref().map_or(0, |t| size_of_val(t.as_slice()));
            size_of_val(attribute.values.as_slice()) + triangles
        };
        attributes.into_iter().map(of_one).sum()
    }
    let Mesh { positions, triangles, normals, uvs, colours, alphas, tangents, is_mirrored: _ } = mesh;
    size_of_val(positions.as_slice())
        + size_of_val(triangles.as_slice())
        + of(normals)
        + of(uvs)
        + of(colours)
        + of(alphas)
        + of(tangents)
}
