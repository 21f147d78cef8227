//! `compare-two-studies`: whether a study can be repeated.

use std::cmp::Ordering;
use std::process::Stdio;

use serde_json::Value;

use crate::run::{Kiln, Result, json, list, number};

/// Study a scene twice and compare the two studies
///
/// All errors must be equal to the bit. Settings whose times differ by more than their quartiles in both studies must be
/// in the same order. Exit code 1 if they are not.
#[derive(clap::Args)]
pub struct Options {
    /// The scene
    #[arg(default_value = "scenes/assignment.toml")]
    scene: String,
    /// Size of the pictures
    #[arg(long, default_value = "128x128")]
    size: String,
}

/// Times, and the bytes of a thread's tile, which depend on the tiles that the thread rendered.
const TIMED: [&str; 3] = ["build_ms", "trace_ms", "tile_bytes"];

/// A row of a study without [`TIMED`].
fn untimed(row: &Value) -> Value {
    let mut row = row.clone();
    if let Some(fields) = row.as_object_mut() {
        fields.retain(|name, _| !TIMED.contains(&name.as_str()));
    }
    row
}

/// The order of two rows of a study by time; equal if their quartiles overlap.
fn order(study: &Value, i: usize, j: usize) -> Result<Ordering> {
    let [a, b] = [i, j].map(|row| &study["rows"][row]["trace_ms"]);
    if number(&a["upper"])? < number(&b["lower"])? {
        return Ok(Ordering::Less);
    }
    Ok(if number(&b["upper"])? < number(&a["lower"])? { Ordering::Greater } else { Ordering::Equal })
}

/// Prints the differences. Returns `false` if there are any.
pub fn run(kiln: &Kiln, options: &Options) -> Result<bool> {
    let folder = tempfile::tempdir()?;
    let study = |name: &str| -> Result<Value> {
        let made = folder.path().join(name);
        let mut command =
            kiln.command(&["study", &options.scene, "--size", &options.size, "--progress", "none"]);
        let done = command.arg("-o").arg(&made).stdout(Stdio::null()).status()?;
        if done.success() {
            json(&made.join("study.json"))
        } else {
            Err(format!("{command:?}: {done}").into())
        }
    };
    let (first, second) = (study("a")?, study("b")?);
    let (rows, others) = (list(&first["rows"]), list(&second["rows"]));
    let differ = rows.iter().zip(others).filter(|(a, b)| untimed(a) != untimed(b));
    let mut faults: Vec<&str> = differ.map(|(a, _)| a["setting"].as_str().unwrap_or("?")).collect();
    if rows.len() != others.len() || ["floors", "geometry"].iter().any(|part| first[part] != second[part]) {
        faults.push("floors, geometry or the list of settings");
    }
    let errors = if faults.is_empty() {
        "are the same to the bit".into()
    } else {
        format!("differ: {}", faults.join(", "))
    };
    println!("{} settings: errors {errors}", rows.len());

    let (mut pairs, mut apart, mut turned) = (0, 0, Vec::new());
    for j in 0..rows.len().min(others.len()) {
        for i in 0..j {
            pairs += 1;
            let orders = [order(&first, i, j)?, order(&second, i, j)?];
            if !orders.contains(&Ordering::Equal) {
                apart += 1;
                if orders[0] != orders[1] {
                    turned.push((&rows[i], &rows[j]));
                }
            }
        }
    }
    println!(
        "{apart} of {pairs} pairs of settings differ in time by more than their quartiles in both; {} are in another order",
        turned.len()
    );
    for (a, b) in &turned {
        let text = |row: &Value| {
            ["parameter", "setting"].map(|part| row[part].as_str().unwrap_or("?").to_owned()).join(": ")
        };
        println!("  {} and {}", text(a), text(b));
    }
    Ok(faults.is_empty() && turned.is_empty())
}
