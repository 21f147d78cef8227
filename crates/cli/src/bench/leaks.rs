//! `kiln bench leaks`: number of rays that leak through a closed mesh, in kiln and in other libraries.

use std::fmt::Write;
use std::sync::atomic::AtomicBool;

use clap::Args;
use serde_json::{Value, json};

use super::super::print;
use super::{grouped, table, with_progress};
use kiln::error::Result;
use kiln::scene::option::group;
use kiln_lab::bench::leaks::{Counts, LeakRow, NAMES, engines, measure};
use kiln_lab::bench::{PLACEMENTS, Unavailable};

#[derive(Args)]
#[command(next_help_heading = group::MEASUREMENT)]
pub(crate) struct Arguments {
    /// Number of rays aimed at vertices and edges, from each side, per mesh size and placement; 6 % more are parallel to axes
    #[arg(long, value_name = "N", default_value_t = 1_000_000,
          value_parser = crate::numbers::whole(1..=1_000_000_000u64))]
    rays: u64,
    /// Number of threads [default: all]
    #[arg(long, help_heading = group::LIMITS, allow_hyphen_values = true, value_name = "N", value_parser = crate::numbers::whole(1..=u16::MAX))]
    threads: Option<u16>,
    /// Print JSON
    #[arg(long, help_heading = group::OUTPUT)]
    json: bool,
    /// Engine to test; may be repeated [default: all that are available]
    #[arg(long, value_name = "NAME", value_parser = NAMES)]
    engine: Vec<String>,
}

pub(crate) fn run(arguments: &Arguments, interrupted: &AtomicBool) -> Result<()> {
    let (mut engines, mut absent) = engines();
    if !arguments.engine.is_empty() {
        let typed = |name: &str| arguments.engine.iter().any(|engine| engine == name);
        engines.retain(|engine| typed(engine.label.engine));
        absent.retain(|absent| typed(absent.name));
        if let Some(absent) = absent.first() {
            return Err(absent.error());
        }
    }
    let rows = with_progress(arguments.threads, "casting rays", interrupted, |control| {
        measure(&engines, arguments.rays, control)
    })?;
    if arguments.json {
        print(&super::report("generated meshes", as_json(&rows, &absent)))
    } else {
        print(&as_text(&rows, &absent, arguments.rays))
    }
}

fn as_json(rows: &[LeakRow], absent: &[Unavailable]) -> Value {
    let measured = rows.iter().map(|row| {
        json!({
            "engine": row.engine,
            "layout": row.layout,
            "tier": row.tier,
            "placement": row.placement,
            "triangles": row.triangles,
            "rays": row.rays.total(),
            "rays_inside": row.rays.inside(),
            "rays_axis_aligned": row.rays.axis_aligned,
            "rays_outside": row.rays.outside,
            "rays_secondary": row.rays.secondary,
            "rays_random": row.rays.random,
            "leaks": row.leaks.total(),
            "leaks_inside": row.leaks.inside(),
            "leaks_axis_aligned": row.leaks.axis_aligned,
            "leaks_outside": row.leaks.outside,
            "leaks_secondary": row.leaks.secondary,
            "leaks_random": row.leaks.random,
            "followed_through": row.followed_through,
            "skipped_reason": null,
        })
    });
    let skipped = absent.iter().map(|absent| {
        json!({
            "engine": absent.name, "layout": null, "tier": null, "placement": null, "rays": 0, "leaks": null,
            "skipped_reason": absent.skipped_reason(),
        })
    });
    measured.chain(skipped).collect()
}

fn as_text(rows: &[LeakRow], absent: &[Unavailable], rays: u64) -> String {
    let counts = Counts::of_rays(rays);
    let mut text = format!(
        "Rays that slip through a closed mesh: from inside / from outside / secondary / random.\n\
         From inside {} rays are aimed at vertices and edges and {} go along the axes; from outside {} are aimed;\n\
         {} secondary rays leave the edges of a tetrahedron of 65,536 triangles inwards; {} from inside go anywhere.\n\n",
        grouped(counts.aimed),
        grouped(counts.axis_aligned),
        grouped(counts.outside),
        grouped(counts.secondary),
        grouped(counts.random),
    );
    text += &rates(rows, |leaks, _| grouped(leaks));
    if rays != 1_000_000 {
        text += "\nOf a million rays:\n\n";
        text += &rates(rows, |leaks, rays| grouped((leaks as f64 * 1e6 / rays as f64).round() as u64));
    }
    let [_, moved, ..] = PLACEMENTS;
    let [x, y, z] = moved.centre.to_array();
    let _ = writeln!(text, "\n{}: to ({x}, {y}, {z})", moved.name);
    let mut short: Vec<&str> =
        rows.iter().filter(|row| !row.followed_through).map(|row| row.engine).collect();
    short.dedup();
    for name in short {
        let _ = writeln!(
            text,
            "{name}: finds only the first crossing, so rays from outside need not leave again"
        );
    }
    for absent in absent {
        let _ = writeln!(text, "{absent}");
    }
    text
}

/// A table with a line per layout and tier and a column per placement. `cell` formats leaks and rays.
fn rates(rows: &[LeakRow], cell: impl Fn(u64, u64) -> String) -> String {
    let titles = ["engine", "layout", "tier", "triangles"].into_iter().chain(PLACEMENTS.map(|p| p.name));
    // Consecutive rows differ in their placement.
    let lines = rows.chunks(PLACEMENTS.len()).map(|rows| {
        let row = &rows[0];
        let names = [row.engine, row.layout, row.tier.unwrap_or("-")].map(str::to_owned);
        let leaks = rows.iter().map(|row| {
            let inside = cell(row.leaks.inside(), row.rays.inside());
            let outside = cell(row.leaks.outside, row.rays.outside);
            let secondary = cell(row.leaks.secondary, row.rays.secondary);
            format!("{inside} / {outside} / {secondary} / {}", cell(row.leaks.random, row.rays.random))
        });
        names.into_iter().chain([grouped(row.triangles as u64)]).chain(leaks).collect()
    });
    table(titles, lines, 3)
}
