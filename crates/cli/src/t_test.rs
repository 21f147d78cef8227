//! `kiln compare --t-test`: report of a t-test of two pictures.

use std::fmt::Write;
use std::path::Path;

use serde_json::{Value, json};

use kiln::error::{Result, printable};
use kiln::limits;
use kiln::metrics::t_test::{BINS, ChannelTest, Estimate, LOW, SIGNIFICANCE, TTest};

/// Upper bound of the memory for a test, in bytes per pixel: two pictures of 7 channels, and the file of one, with all of its
/// channels, while it is read.
const BYTES_PER_PIXEL: u64 = 2 * 7 * 4 + 2 * 4 * 16;

/// Tests two pictures; `a` is the reference. Returns the report and the exit code.
pub(crate) fn run(a: &Path, b: &Path, block: u32, as_json: bool) -> Result<(String, u8)> {
    let (reference, tested) = (Estimate::open(a)?, Estimate::open(b)?);
    let (width, height) = (reference.width, reference.height);
    limits::check(limits::product(&[width.into(), height.into(), BYTES_PER_PIXEL]))
        .map_err(|excess| excess.at(a, format!("testing pictures of {width} x {height} pixels")))?;
    let test = TTest::between(&reference, &tested, block)?;
    let code = if test.passed { 0 } else { 2 };
    let report = if as_json { to_json(a, b, &test) } else { to_text(a, b, &test) };
    Ok((report, code))
}

fn to_json(a: &Path, b: &Path, test: &TTest) -> String {
    let report: Value = json!({
        "schema": 1,
        "reference": a.display().to_string(),
        "test": b.display().to_string(),
        "verdict": if test.passed { "no_difference" } else { "different" },
        "t_test": test,
    });
    super::json_text(&report)
}

/// A probability in 12 columns.
fn probability(p: f64) -> String {
    if p == 0.0 || p >= 1e-4 { format!("{p:>12.4}") } else { format!("{p:>12.1e}") }
}

fn to_text(a: &Path, b: &Path, test: &TTest) -> String {
    let TTest { width, height, block, threshold, passed, channels } = test;
    let unit = if *block == 1 { "pixels".to_owned() } else { format!("blocks of {block} x {block} pixels") };
    let mut text = String::new();
    let _ = writeln!(
        text,
        "{} and {}: {width} x {height} pixels, Welch's t-test of {unit}, p-values by channel",
        printable(&a.to_string_lossy()),
        printable(&b.to_string_lossy())
    );
    let mut row = |name: &str, cell: &dyn Fn(&ChannelTest) -> String, note: &str| {
        let cells: String = channels.iter().map(|channel| format!("{:>12}", cell(channel))).collect();
        let line = format!("  {name:<13}{cells}  {note}");
        let _ = writeln!(text, "{}", line.trim_end());
    };
    row("p-value", &|channel| channel.channel.clone(), "");
    for bin in 0..BINS {
        let name = format!("{:.2} to {:.2}", bin as f64 / BINS as f64, (bin + 1) as f64 / BINS as f64);
        row(&name, &|channel| channel.histogram[bin].to_string(), &bar(channels, bin));
    }
    row("tested", &|channel| channel.tested.to_string(), &unit);
    row("left out", &|channel| channel.left_out.to_string(), "equal in both, without variance");
    row("certain", &|channel| channel.certain.to_string(), "different without variance: p = 0");
    row(
        "below",
        &|channel| format!("{:.4}", channel.below_low),
        &format!("share of p below {LOW}; expected {LOW}"),
    );
    row(
        "chi-squared",
        &|channel| format!("{:.1}", channel.chi_squared),
        "of the histogram against a uniform one; expected 19",
    );
    let uniform = |channel: &ChannelTest| channel.uniform.map_or("-".into(), probability);
    row("uniform", &uniform, "probability of that; - where there are fewer than 100 p-values");
    row("difference", &|channel| format!("{:+.3e}", channel.difference), "mean of B - A over all pixels");
    row("error", &|channel| format!("{:.3e}", channel.standard_error), "standard error of the difference");
    row("equal means", &|channel| probability(channel.equal_means), "probability of a difference so great");
    let _ = if *passed {
        writeln!(
            text,
            "no difference found: no probability is below {threshold:.1e} ({SIGNIFICANCE} over all tests)"
        )
    } else {
        writeln!(
            text,
            "different: a probability is below {threshold:.1e} ({SIGNIFICANCE} over all tests), or pixels are certain"
        )
    };
    text
}

/// A bar for the counts of a bin in all channels, ten marks long if they are as expected, and 40 at most.
fn bar(channels: &[ChannelTest], bin: usize) -> String {
    let count: u64 = channels.iter().map(|channel| channel.histogram[bin]).sum();
    let tested: u64 = channels.iter().map(|channel| channel.tested).sum();
    let marks = if tested == 0 { 0.0 } else { 10.0 * (BINS as f64) * count as f64 / tested as f64 };
    if marks > 40.0 { "#".repeat(39) + "+" } else { "#".repeat(marks.round() as usize) }
}
