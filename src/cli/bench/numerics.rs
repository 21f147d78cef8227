//! `kiln bench numerics`: cost and errors of each numerics tier.

use std::sync::atomic::AtomicBool;

use clap::Args;
use serde_json::{Value, json};

use super::super::print;
use super::{aligned, grouped, with_progress};
use crate::bench::tiers::{TierRow, tiers};
use crate::error::Result;
use crate::timing::Spread;

#[derive(Args)]
pub(crate) struct Arguments {
    /// Rays aimed at the mesh from each side, at each size and place; 6 in a hundred more go along the axes
    #[arg(long, value_name = "N", default_value_t = 1_000_000,
          value_parser = crate::cli::numbers::whole(1..=100_000_000u64))]
    rays: u64,
    /// Runs that are timed, after one to warm up; the tiers take turns
    #[arg(long, allow_hyphen_values = true, value_name = "N", default_value_t = 15, value_parser = crate::cli::numbers::whole(1..=1000u32))]
    runs: u32,
    /// Threads to count on; times are those of one thread
    #[arg(long, allow_hyphen_values = true, value_name = "N", value_parser = crate::cli::numbers::whole(1..=u16::MAX))]
    threads: Option<u16>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments, interrupted: &AtomicBool) -> Result<()> {
    let rows = with_progress(arguments.threads, "casting rays", interrupted, |control| {
        tiers(arguments.rays, arguments.runs, control)
    })?;
    if arguments.json {
        print(&super::report("generated meshes", as_json(&rows, arguments)))
    } else {
        print(&as_text(&rows, arguments))
    }
}

fn as_json(rows: &[TierRow], arguments: &Arguments) -> Value {
    let row = |row: &TierRow| {
        json!({
            "tier": row.numerics.name(),
            "rays": arguments.rays,
            "runs": arguments.runs,
            "relative_time": { "picture": row.picture, "aimed": row.aimed },
            "leaks_per_million": row.leaks,
            "wrong_per_million": row.wrong,
            "worst_t_error_ulps": row.worst,
        })
    };
    rows.iter().map(row).collect()
}

fn as_text(rows: &[TierRow], arguments: &Arguments) -> String {
    let titles =
        ["tier", "time, picture", "time, aimed", "leaks per million", "wrong per million", "worst t, ulp"];
    let mut lines = vec![titles.map(str::to_owned).to_vec()];
    for row in rows {
        let time = |Spread { lower, median, upper }: Spread| format!("{median:.2} ({lower:.2}-{upper:.2})");
        let three_digits =
            |x: f64| if x == 0.0 || x >= 10.0 { grouped(x.round() as u64) } else { format!("{x:.3}") };
        let worst = match row.worst {
            0.0 => "0".into(),
            small if small < 0.01 => format!("{small:.0e}"),
            worst => format!("{worst:.2}"),
        };
        let name = row.numerics.name().to_owned();
        lines.push(vec![
            name,
            time(row.picture),
            time(row.aimed),
            three_digits(row.leaks),
            three_digits(row.wrong),
            worst,
        ]);
    }
    format!(
        "Times of a ray on one thread, relative to `fast`: medians and quartiles of {} runs, over an icosphere of 81,920 triangles.\n\
         Leaks and wrong hits over it at four sizes and places, {} rays aimed at vertices and edges from each side; wrong\n\
         answers and distances, in units of the last place of f32, also over a giant plane at grazing angles. Right is `exact`.\n\n{}",
        arguments.runs,
        grouped(arguments.rays),
        aligned(&lines, 1)
    )
}
