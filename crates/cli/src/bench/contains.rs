//! `kiln bench contains`: wrong answers to whether a closed mesh contains a point, and the rate of the right ones.

use std::sync::atomic::AtomicBool;

use clap::Args;
use serde_json::{Value, json};

use super::super::print;
use super::{grouped, quartiles, table, with_progress};
use kiln::error::Result;
use kiln::scene::option::group;
use kiln_lab::bench::contains::{ContainsRate, ContainsRow, rates, wrong_points};
use kiln_lab::bench::{PLACEMENTS, Unavailable};

#[derive(Args)]
#[command(next_help_heading = group::MEASUREMENT)]
pub(crate) struct Arguments {
    /// Number of points per method, over all mesh sizes and placements
    #[arg(long, value_name = "N", default_value_t = 10_000_000,
          value_parser = crate::numbers::whole(1..=1_000_000_000u64))]
    points: u64,
    /// Number of timed rounds after a warm-up round
    #[arg(long, allow_hyphen_values = true, value_name = "N", default_value_t = 5, value_parser = crate::numbers::whole(1..=1000u32))]
    runs: u32,
    /// Number of threads that count wrong answers; times are of one thread [default: all]
    #[arg(long, help_heading = group::LIMITS, allow_hyphen_values = true, value_name = "N", value_parser = crate::numbers::whole(1..=u16::MAX))]
    threads: Option<u16>,
    /// Print JSON
    #[arg(long, help_heading = group::OUTPUT)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments, interrupted: &AtomicBool) -> Result<()> {
    let ((rows, absent), rates) =
        with_progress(arguments.threads, "testing points", interrupted, |control| {
            Ok((wrong_points(arguments.points, control)?, rates(arguments.runs)?))
        })?;
    if arguments.json {
        print(&super::report("generated meshes", as_json(&rows, &rates, absent.as_ref())))
    } else {
        print(&as_text(&rows, &rates, absent.as_ref()))
    }
}

fn as_json(rows: &[ContainsRow], rates: &[ContainsRate], absent: Option<&Unavailable>) -> Value {
    let wrong = rows.iter().map(|row| {
        let rate =
            rates.iter().find(|rate| row.method == "contains" && Some(rate.numerics.name()) == row.tier);
        let [vertex, edge, axis] = row.wrong;
        json!({
            "engine": row.engine[0],
            "layout": row.engine[1],
            "tier": row.tier,
            "method": row.method,
            "placement": row.placement,
            "points": 3 * row.points,
            "wrong": { "vertex": vertex, "edge": edge, "axis": axis },
            "mpoints_per_s": rate.map(|rate| rate.contains),
            "mpoints_per_s_aimed": rate.map(|rate| rate.aimed),
            "closest_mrays_per_s": rate.map(|rate| rate.closest_hits),
            "skipped_reason": null,
        })
    });
    let skipped = absent.map(|absent| {
        let reason = absent.skipped_reason();
        json!({ "engine": absent.name, "points": 0, "wrong": null, "skipped_reason": reason })
    });
    wrong.chain(skipped).collect()
}

fn as_text(rows: &[ContainsRow], rates: &[ContainsRate], absent: Option<&Unavailable>) -> String {
    let points = rows.first().map_or(0, |row| row.points);
    let mut text = format!(
        "Wrong answers to whether a closed mesh of 81,920 triangles contains a point: of {} points each whose rays\n\
         pass through vertices / edge midpoints / both, along an axis. `parity`: an odd number of hits.\n\n",
        grouped(points)
    );
    let titles = ["engine", "layout", "tier", "method"].into_iter().chain(PLACEMENTS.map(|p| p.name));
    // Consecutive rows differ in their placement.
    let lines = rows.chunks(PLACEMENTS.len()).map(|rows| {
        let row = &rows[0];
        let names = [row.engine[0], row.engine[1], row.tier.unwrap_or("-"), row.method].map(str::to_owned);
        names.into_iter().chain(rows.iter().map(|row| row.wrong.map(grouped).join(" / "))).collect()
    });
    text += &table(titles, lines, 4);
    text += "\nMillion queries a second on one thread, of random points, of points of the first two kinds, and of\n\
         rays from the random ones (quartiles):\n\n";
    let titles = ["tier", "contains", "contains, aimed", "closest hit", "ratio"];
    let lines = rates.iter().map(|rate| {
        let numbers = [rate.contains, rate.aimed, rate.closest_hits, rate.ratio].map(quartiles);
        [rate.numerics.name().to_owned()].into_iter().chain(numbers).collect()
    });
    text += &table(titles, lines, 1);
    if let Some(absent) = absent {
        text += &format!("\n{absent}\n");
    }
    text
}
