//! `make-effects`: the page of effects and its pictures.

use std::fmt::Write as _;

use serde_json::Value;

use crate::run::{Kiln, Result, list, output};

/// Make scenes/effects/README.md and its pictures
///
/// The page has for each effect of kiln its picture and its cost. The two scenes of an effect are
/// scenes/effects/NAME.toml, which uses the effect, and no-NAME.toml, which does not.
#[derive(clap::Args)]
pub struct Options {}

const HEAD: &str = "\
# Effects
Each effect that kiln knows, by a scene that calls for it; `no-NAME.toml` beside it does not, and takes no ray, no stage and no
byte for it (`tests/render/effects.rs`). Made by `cargo xtask make-effects`, which runs `kiln explain scenes/effects/NAME.toml --measure` for what
each effect of the scene costs, on one thread of one machine: an effect adds its figures to a picture that has those above it and
none below; *alone* is what the whole picture saves without it. What `adaptive` adds is less than nothing: it takes away samples that
`antialiasing` above it would take of every pixel.
";

const TABLE_HEAD: &str = "
| effect | what calls for it | ms saved without it | rays that it adds | source |
| --- | --- | --: | --: | --- |
";

/// Largest picture of the page, in bytes.
const MAX_BYTES: u64 = 99_999;

/// The text that `kiln` prints.
fn said(kiln: &Kiln, arguments: &[&str]) -> Result<String> {
    Ok(String::from_utf8(output(&mut kiln.command(arguments))?.stdout)?)
}

/// Renders each picture and writes the page.
pub fn run(kiln: &Kiln) -> Result<()> {
    let explained: Value =
        serde_json::from_str(&said(kiln, &["explain", "scenes/assignment.toml", "--json"])?)?;
    let (mut rows, mut sections) = (String::new(), String::new());
    for effect in list(&explained["effects"]) {
        let [name, summary, source] =
            ["name", "summary", "source"].map(|field| effect[field].as_str().unwrap_or_default());
        let (scene, picture) =
            (format!("scenes/effects/{name}.toml"), format!("assets/docs/effect-{name}.png"));
        said(kiln, &["render", &scene, "-o", &picture, "--progress", "none", "--strict"])?;
        if std::fs::metadata(&picture)?.len() > MAX_BYTES {
            return Err(format!("{picture} is larger than {MAX_BYTES} bytes").into());
        }
        let costs = said(kiln, &["explain", &scene, "--measure", "--rounds", "9"])?;
        let table = costs.split("\n\n").next().unwrap_or_default().trim_end();
        let (first, rest) = summary.split_at(summary.chars().next().map_or(0, char::len_utf8));
        rows.push_str(&row(kiln, name, &scene, source)?);
        writeln!(
            sections,
            "\n## {name}\n{}{rest}.\n\n![{summary}](../../{picture})\n",
            first.to_uppercase()
        )?;
        writeln!(sections, "```text\n{table}\n```")?;
    }
    std::fs::write("scenes/effects/README.md", format!("{HEAD}{TABLE_HEAD}{rows}{sections}"))?;
    Ok(())
}

/// The row of the table for an effect: what calls for it in its scene and what it costs there.
fn row(kiln: &Kiln, name: &str, scene: &str, source: &str) -> Result<String> {
    let measured: Value =
        serde_json::from_str(&said(kiln, &["explain", scene, "--measure", "--rounds", "9", "--json"])?)?;
    let effect = list(&measured["effects"]).iter().find(|effect| effect["name"] == name);
    let effect = effect.ok_or_else(|| format!("{scene} does not list {name}"))?;
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    let [saved, rays] = [number(&effect["alone_ms"]["median"]), number(&effect["adds"]["rays"])];
    let why = effect["why"].as_str().unwrap_or_default();
    Ok(format!("| [{name}](#{name}) | {why} | {saved:.1} | {rays} | {source} |\n"))
}
