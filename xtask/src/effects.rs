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
    let mut page = HEAD.to_owned();
    for effect in list(&explained["effects"]) {
        let [name, summary] = ["name", "summary"].map(|field| effect[field].as_str().unwrap_or_default());
        let (scene, picture) =
            (format!("scenes/effects/{name}.toml"), format!("assets/docs/effect-{name}.png"));
        said(kiln, &["render", &scene, "-o", &picture, "--progress", "none", "--strict"])?;
        if std::fs::metadata(&picture)?.len() > MAX_BYTES {
            return Err(format!("{picture} is larger than {MAX_BYTES} bytes").into());
        }
        let costs = said(kiln, &["explain", &scene, "--measure", "--rounds", "9"])?;
        let table = costs.split("\n\n").next().unwrap_or_default().trim_end();
        let (first, rest) = summary.split_at(summary.chars().next().map_or(0, char::len_utf8));
        writeln!(page, "\n## {name}\n{}{rest}.\n\n![{summary}](../../{picture})\n", first.to_uppercase())?;
        writeln!(page, "```text\n{table}\n```")?;
    }
    std::fs::write("scenes/effects/README.md", page)?;
    Ok(())
}
