//! `kiln study`: properties of every study, on a small one, and the files that it writes.

use std::path::Path;
use std::process::{Command, Output};
use std::sync::OnceLock;

use crate::common::repository;
use kiln_lab::bench::errors::PictureError;
use kiln_lab::study::{ReferenceKind, SettingRow, Study, TechniqueTest, to_csv};
use kiln_lab::timing::Quartiles;

/// A study of the assignment scene, small and quick, in a folder that goes when the tests end.
fn made(inputs: &[&str], more: &[&str]) -> (tempfile::TempDir, Output) {
    let folder = tempfile::tempdir().expect("a folder");
    let output = Command::new(assert_cmd::cargo::cargo_bin!("kiln"))
        .current_dir(repository("."))
        .args([&["study"], inputs, &["--progress", "none", "--rounds", "1"], more, &["-o"]].concat())
        .arg(folder.path())
        .output()
        .expect("kiln runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    (folder, output)
}

fn read(folder: &Path) -> Study {
    let text = std::fs::read_to_string(folder.join("study.json")).expect("JSON");
    serde_json::from_str(&text).expect("a study")
}

/// The files are read again, to time loading, with the same options.
#[test]
fn files_are_read_with_the_options_of_the_command() {
    let text = std::fs::read_to_string(repository("assets/import/square.gltf")).expect("a file");
    let text =
        text.replacen('{', r#"{ "extensionsUsed": ["VENDOR_x"], "extensionsRequired": ["VENDOR_x"], "#, 1);
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("a.gltf");
    std::fs::write(&file, text).expect("a file");
    let buffer = "square two.bin";
    std::fs::copy(repository("assets/import").join(buffer), folder.path().join(buffer)).expect("a file");
    let options = ["--ignore-required-extensions", "--size", "16x16", "--parameter", "bvh"];
    made(&[file.to_str().expect("UTF-8")], &options);
}

/// One for all tests.
fn tiny() -> &'static (tempfile::TempDir, Output) {
    static TINY: OnceLock<(tempfile::TempDir, Output)> = OnceLock::new();
    TINY.get_or_init(|| made(&["scenes/assignment.toml"], &["--size", "48x48"]))
}

#[test]
fn the_acceleration_structure_makes_no_error() {
    let study = read(tiny().0.path());
    let rows: Vec<_> = study.rows.iter().filter(|row| row.parameter == "bvh").collect();
    // Three presets, another layout, and brute force over so small a scene.
    assert_eq!(rows.len(), 5);
    let base = study.rows.iter().find(|row| row.base).expect("the picture as asked for");
    for row in rows {
        assert_eq!(row.fingerprint, base.fingerprint, "{}", row.name());
        assert_eq!(row.twin, base.twin, "{}", row.name());
        assert_eq!(row.rays, base.rays, "{}", row.name());
    }
}

#[test]
fn exact_is_its_own_measure() {
    let study = read(tiny().0.path());
    let exact = study.rows.iter().find(|row| row.name() == "numerics: exact").expect("a row");
    assert_eq!(exact.reference, ReferenceKind::SameSamples);
    assert!(exact.twin.expect("finite").are_none());
    let exact = study.geometry.iter().find(|tier| tier.numerics == "exact").expect("a tier");
    assert_eq!((exact.false_hits, exact.false_misses, exact.wrong_primitives), (0, 0, 0));
    assert_eq!(exact.t_ulps, Some([0.0; 3]));
    // The tetrahedron is closed, and no tier but `fast` lets anything out of it.
    for tier in study.geometry.iter().filter(|tier| tier.numerics != "fast") {
        assert_eq!(tier.leaks_per_million, Some(0.0), "{}", tier.numerics);
        assert!(tier.leak_rays > 100_000);
    }
}

#[test]
fn more_samples_are_closer_to_the_limit() {
    let study = read(tiny().0.path());
    let rows: Vec<_> = study.rows.iter().filter(|row| row.parameter == "samples").collect();
    // 1, 2, 4, … 32.
    assert_eq!(rows.len(), 6);
    let errors: Vec<f64> = rows.iter().map(|row| row.limit.expect("finite").rmse).collect();
    assert!(errors.windows(2).all(|pair| pair[1] < pair[0]), "{errors:?}");
    for (row, samples) in rows.iter().zip([1.0, 2.0, 4.0, 8.0, 16.0, 32.0]) {
        assert_eq!(row.samples_per_pixel, samples);
    }
    // Variance of stratified samples falls between n^-1 and n^-2 (Mitchell 1996): 16 times as many, at least 4 times as
    // close.
    assert!(errors[1] / errors[5] > 4.0, "{errors:?}");
    // The limit's own error is that of 1024 samples, 32 times as many: far below.
    assert!(study.floors[0].rmse * 5.0 < errors[5], "{} {errors:?}", study.floors[0].rmse);
}

#[test]
fn parameters_without_anything_to_do_are_left_out_with_a_reason() {
    let study = read(tiny().0.path());
    let why = |parameter: &str| {
        study.left_out.iter().find(|[name, _]| name == parameter).map(|[_, why]| why.clone())
    };
    // The assignment has spheres and flat triangles, glaze and a light, but no pictures.
    assert!(why("texture filter").is_some_and(|why| !why.is_empty()), "{:?}", study.left_out);
    assert!(why("glaze bounces").is_none() && why("shadows").is_none());
    for [parameter, _] in &study.left_out {
        assert!(study.rows.iter().all(|row| row.parameter != *parameter), "{parameter}");
    }
    // No path is traced: what varies paths is not listed, and nothing is tested or limited by bounces.
    let of_paths = |name: &str| PATHS.contains(&name);
    assert!(!study.left_out.iter().any(|[name, _]| of_paths(name)), "{:?}", study.left_out);
    assert!(!study.rows.iter().any(|row| of_paths(&row.parameter)));
    assert!(study.technique_tests.is_empty() && study.floors.iter().all(|floor| floor.bounces.is_none()));
}

#[test]
fn giving_up_an_effect_is_an_error_and_saves_rays() {
    let study = read(tiny().0.path());
    let base = study.rows.iter().find(|row| row.base).expect("a base");
    for name in ["glaze bounces: 0 bounces", "shadows: off"] {
        let row = study.rows.iter().find(|row| row.name() == name).expect("a row");
        assert!(row.rays < base.rays && row.primary_rays == base.primary_rays, "{name}");
        assert!(row.twin.expect("finite").rmse > base.twin.expect("finite").rmse, "{name}");
    }
}

/// The errors by their causes that `explain --measure` prints, without times, which are measured again.
fn explained_errors(scene: &str) -> Vec<PictureError> {
    let output = Command::new(assert_cmd::cargo::cargo_bin!("kiln"))
        .current_dir(repository("."))
        .args(["explain", scene, "--size", "48x48", "--measure", "--rounds", "1", "--json"])
        .output()
        .expect("kiln runs");
    let explained: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    timeless(&serde_json::from_value::<Vec<PictureError>>(explained["errors"].clone()).expect("errors"))
}

fn timeless(errors: &[PictureError]) -> Vec<PictureError> {
    let without = |error: &PictureError| PictureError { time: Quartiles::exact(1.0), ..error.clone() };
    errors.iter().map(without).collect()
}

/// Page and `explain` have the same errors, of a scene file and of a mesh, which the study draws in another look.
#[test]
fn errors_are_those_of_explain() {
    let study = read(tiny().0.path());
    assert_eq!(explained_errors("scenes/assignment.toml"), timeless(&study.errors));
    let causes: Vec<&str> = study.errors.iter().map(|error| error.cause.as_str()).collect();
    assert_eq!(causes[0], "one sample a pixel");
    assert!(causes.contains(&"8 bits"), "{causes:?}");
    // Sixteen samples are closer to many than one at the centre; rounding is by half a step.
    let [samples, .., rounding] = &study.errors[..] else { panic!("{causes:?}") };
    assert!(samples.then.beyond_step < samples.now.beyond_step && samples.time.median > 2.0);
    assert_eq!((rounding.now.beyond_step, rounding.now.largest), (0.0, 0.5));
    // The first lines that are printed are the result and the same table.
    let printed = String::from_utf8_lossy(&tiny().1.stdout).into_owned();
    assert!(printed.contains("`--samples 16` leaves"), "{printed}");
    assert!(printed.contains("one sample a pixel  "), "{printed}");

    let mesh = "assets/import/l.obj";
    let (folder, _) = made(&[mesh], &["--size", "48x48", "--quick"]);
    let errors = timeless(&read(folder.path()).errors);
    assert_eq!(explained_errors(mesh), errors);
    assert_eq!(errors[0].cause, "noise");
}

/// Of two runs, all that is not time is the same to the bit.
#[test]
fn errors_do_not_depend_on_the_run_or_on_threads() {
    let first = read(tiny().0.path());
    let (folder, _) = made(&["scenes/assignment.toml"], &["--size", "48x48", "--threads", "2"]);
    let second = read(folder.path());
    assert_eq!(
        (first.floors, first.geometry, first.left_out),
        (second.floors, second.geometry, second.left_out)
    );
    assert_eq!(first.rows.len(), second.rows.len());
    for (a, b) in first.rows.iter().zip(&second.rows) {
        assert_eq!(
            (&a.limit, &a.twin, &a.fingerprint, a.rays),
            (&b.limit, &b.twin, &b.fingerprint, b.rays),
            "{}",
            a.name()
        );
    }
}

/// The cells of a line of CSV.
fn cells(line: &str) -> Vec<String> {
    let (mut cells, mut is_quoted) = (vec![String::new()], false);
    for c in line.chars() {
        match c {
            '"' => is_quoted = !is_quoted,
            ',' if !is_quoted => cells.push(String::new()),
            c => cells.last_mut().expect("a cell").push(c),
        }
    }
    cells
}

#[test]
fn the_tables_hold_the_same() {
    let folder = tiny().0.path();
    let csv = std::fs::read_to_string(folder.join("study.csv")).expect("CSV");
    let json = std::fs::read_to_string(folder.join("study.json")).expect("JSON");
    let rows = serde_json::from_str::<serde_json::Value>(&json).expect("JSON")["rows"].take();
    let rows = rows.as_array().expect("a list");
    let mut lines = csv.lines().map(cells);
    let names = lines.next().expect("names");
    let lines: Vec<_> = lines.collect();
    assert_eq!(lines.len(), rows.len());
    for (line, row) in lines.iter().zip(rows) {
        assert_eq!(line.len(), names.len());
        for (name, cell) in names.iter().zip(line) {
            let value = name.split('.').fold(row, |value, part| &value[part]);
            match value {
                // A missing error stays missing: it is not 0.
                serde_json::Value::Null => assert_eq!(cell, "", "{name}"),
                // What reads JSON here may be off by the last bit.
                serde_json::Value::Number(number) if number.is_f64() => {
                    let (a, b) = (cell.parse::<f64>().expect("a number"), number.as_f64().expect("a number"));
                    assert!((a - b).abs() <= f64::EPSILON * b.abs(), "{name}: {a} {b}");
                }
                serde_json::Value::String(text) => assert_eq!(cell, text, "{name}"),
                other => assert_eq!(*cell, other.to_string(), "{name}"),
            }
        }
    }
    let mut rows = read(folder).rows;
    (rows[0].limit, rows[0].setting) = (None, "a, \"quoted\" name".into());
    let line = to_csv(&rows).lines().nth(1).expect("a row").to_owned();
    assert!(line.contains(",\"a, \"\"quoted\"\" name\","), "{line}");
}

/// The JSON that the page of a study has in an element.
fn embedded(folder: &Path, name: &str) -> serde_json::Value {
    let page = std::fs::read_to_string(folder.join("index.html")).expect("a page");
    let start = format!("<script type=\"application/json\" id=\"{name}\">");
    let (_, rest) = page.split_once(&start).expect("an element");
    serde_json::from_str(rest.split("</script>").next().expect("its text")).expect("JSON")
}

/// All that the page says is drawn from `study.json`, and its pictures are those of its rows.
#[test]
fn the_page_has_the_json_that_is_written() {
    for (folder, _) in [tiny(), room()] {
        let json = std::fs::read_to_string(folder.path().join("study.json")).expect("JSON");
        let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
        assert_eq!(embedded(folder.path(), "study"), json);
        assert_eq!(json["schema"], 3);
        let pictures = embedded(folder.path(), "pictures");
        let files = pictures["files"].as_array().expect("files");
        assert!(files.iter().all(|file| file.as_str().expect("text").starts_with("data:image/png;base64,")));
        assert_eq!(pictures["rows"].as_array().map(Vec::len), json["rows"].as_array().map(Vec::len));
    }
}

#[test]
fn the_page_needs_no_network() {
    let page = std::fs::read_to_string(tiny().0.path().join("index.html")).expect("a page");
    for outside in ["http:", "https:", "src=\"/", "url(", "@import", "<link"] {
        assert!(!page.contains(outside), "{outside}");
    }
    for inside in ["<svg", "data:image/png;base64,", "prefers-color-scheme", "kiln study", "</html>"] {
        assert!(page.contains(inside), "{inside}");
    }
}

#[test]
fn advice_is_printed_and_is_that_of_the_front() {
    let (folder, output) = tiny();
    let study = read(folder.path());
    let printed = String::from_utf8_lossy(&output.stdout);
    assert!(!study.advice.is_empty());
    for advice in &study.advice {
        assert!(printed.contains(&advice.text), "{printed}");
        let Some(row) = advice.row.map(|row| &study.rows[row]) else { continue };
        assert!(row.limit.expect("finite").rmse < advice.below);
        // Nothing that is as good is quicker.
        let is_comparable = |other: &&SettingRow| {
            other.filter == row.filter && !other.has_effect_off && other.parameter != "bvh"
        };
        let quicker = study.rows.iter().filter(is_comparable).find(|other| {
            other.limit.is_some_and(|limit| limit.rmse < advice.below)
                && other.trace_ms.median < row.trace_ms.median
        });
        assert!(quicker.is_none(), "{}: {:?}", advice.text, quicker.map(|row| row.name()));
    }
}

/// The first sentence, on the page and printed, is on the largest of the errors.
#[test]
fn the_report_begins_with_its_result() {
    let (folder, output) = tiny();
    let study = read(folder.path());
    let printed = String::from_utf8_lossy(&output.stdout);
    let sentence = printed.lines().next().expect("a line");
    let largest = study.errors.iter().map(|error| error.now.beyond_step).fold(0.0, f64::max);
    let error = study.errors.iter().find(|error| error.now.beyond_step == largest).expect("an error");
    let percent = |share: f64| format!("{:.1$} %", 100.0 * share, usize::from(100.0 * share < 10.0));
    let begins = format!("{} of the pixels are off by more than one step of 255 ", percent(largest));
    assert!(sentence.starts_with(&begins), "{sentence}");
    let leaves = format!("`{}` leaves {} in ", error.options, percent(error.then.beyond_step));
    assert!(sentence.contains(&leaves) && sentence.ends_with(" times the time."), "{sentence}");
    assert_eq!(embedded(folder.path(), "study")["headline"], sentence);
    // Acceleration structures change no picture, so that none is a next step.
    assert!(study.steps.iter().all(|step| step.parameter != "bvh"));
}

/// The page begins with crops of a quick picture, a recommended one and the limit, each with a command that makes it.
#[test]
fn the_page_begins_with_three_pictures_and_their_commands() {
    let (folder, _) = tiny();
    let study = read(folder.path());
    let (report, pictures) = (embedded(folder.path(), "study"), embedded(folder.path(), "pictures"));
    for title in ["quick", "recommended"] {
        let row = report["selection"][title].as_u64().expect("a row") as usize;
        assert!(pictures["rows"][row]["own"].is_u64(), "{title}");
        assert_eq!(report["commands"][row], study.command_with(&study.rows[row].options), "{title}");
    }
    assert_ne!(report["selection"]["quick"], report["selection"]["recommended"]);
    assert!(pictures["limit"].is_u64() && pictures["place"].is_array());
    // The limit: two halves of 512 samples each.
    let limit = study.command_with(study.limit_options.as_deref().expect("options"));
    let expected =
        "kiln render scenes/assignment.toml --size 48x48 -o picture.png --numerics exact --samples 1024";
    assert!(limit == expected && report["limit_command"] == expected, "{limit}");
    assert!(study.limit_ms.is_some_and(|ms| ms > 0.0));
}

/// Settings without shadows or glaze are other pictures; structures give the same one: neither is advised or marked.
#[test]
fn what_is_no_accuracy_is_not_on_the_front() {
    let (folder, _) = tiny();
    let study = read(folder.path());
    let off = |row: &&SettingRow| row.has_effect_off;
    let names: Vec<String> = study.rows.iter().filter(off).map(SettingRow::name).collect();
    assert_eq!(names, ["glaze bounces: 0 bounces", "shadows: off"]);
    let report = embedded(folder.path(), "study");
    assert!(!report["front"].as_array().expect("rows").is_empty());
    for row in study.rows.iter().filter(|row| row.has_effect_off || row.parameter == "bvh") {
        for list in ["compared", "front"] {
            assert!(
                !report[list].as_array().expect("rows").contains(&row.id.into()),
                "{list}: {}",
                row.name()
            );
        }
        assert!(study.advice.iter().all(|advice| advice.row != Some(row.id)), "{}", row.name());
    }
}

#[test]
fn a_mesh_alone_can_be_studied() {
    let (folder, output) = made(&["assets/import/l.obj"], &["--size", "24x24"]);
    let study = read(folder.path());
    // A headlight casts shadows; nothing is glazed, and the picture adds up light linearly.
    let left_out: Vec<&str> = study.left_out.iter().map(|[parameter, _]| parameter.as_str()).collect();
    assert!(left_out.contains(&"glaze bounces") && left_out.contains(&"colour"), "{left_out:?}");
    assert!(String::from_utf8_lossy(&output.stdout).contains("left out: glaze bounces: "));
    // Without the default look of meshes.
    let command = study.command_with("--samples 2");
    assert_eq!(command, "kiln render assets/import/l.obj --size 24x24 --draft -o picture.png --samples 2");
}

#[test]
fn a_folder_that_cannot_be_made_is_said_before_any_work() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("file");
    std::fs::write(&file, "").expect("a file");
    let code = |output: &Path, inputs: &str| {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("kiln"));
        let output = command.args(["study", inputs, "-o"]).arg(output).output().expect("kiln runs");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (status, said) = code(&file.join("inside"), "no-such-scene.toml");
    assert_eq!(status, Some(4), "{said}");
    // What was made for nothing goes again; what was there stays.
    let (status, said) = code(&folder.path().join("new/deep"), "no-such-scene.toml");
    assert_eq!(status, Some(3), "{said}");
    assert!(!folder.path().join("new").exists() && folder.path().exists());
    let old = folder.path().join("old");
    std::fs::create_dir(&old).expect("a folder");
    assert_eq!(code(&old, "no-such-scene.toml").0, Some(3));
    assert!(old.exists());
}

/// The arguments of a study's command with the options of a row, and another output.
fn arguments_with(study: &Study, options: &str, output: &Path) -> Vec<String> {
    let command = study.command_with(options);
    let words = command.strip_prefix("kiln ").expect("a command").split_whitespace();
    words.map(|word| word.replace("picture.png", &output.display().to_string())).collect()
}

#[test]
fn the_options_of_a_row_make_its_picture() {
    use std::hash::{DefaultHasher, Hash, Hasher};
    let bases: [&[&str]; 5] = [
        &[],
        &["--samples", "8", "--noise", "0.02"],
        &["--filter-radius", "0.7"],
        &["--with", "shadows", "--samples", "2"],
        &["--without", "glaze", "--filter", "mitchell"],
    ];
    for base in bases {
        let small = [&["--size", "20x20"], base].concat();
        let (folder, _) = made(&["scenes/assignment.toml"], &small);
        let study = read(folder.path());
        let mut count = 0;
        for row in &study.rows {
            if !row.has_options {
                assert_eq!(row.options, "", "{}", row.name());
                continue;
            }
            let file = folder.path().join("row.exr");
            let options = arguments_with(&study, &row.options, &file);
            let output = Command::new(assert_cmd::cargo::cargo_bin!("kiln"))
                .current_dir(repository("."))
                .args(&options)
                .output()
                .expect("kiln runs");
            assert!(output.status.success(), "{options:?}: {}", String::from_utf8_lossy(&output.stderr));
            let picture = kiln::film::read::read_picture(&file).expect("a picture");
            let mut hasher = DefaultHasher::new();
            picture.values.iter().flatten().for_each(|channel| channel.to_bits().hash(&mut hasher));
            assert_eq!(format!("{:016x}", hasher.finish()), row.fingerprint, "{}: {options:?}", row.name());
            count += 1;
        }
        // Layouts, some bounces and what cannot be taken back have no options; most have.
        assert!(count > study.rows.len() / 2, "{count} of {} with {base:?}", study.rows.len());
        let none = |name: &str| study.rows.iter().any(|row| row.name() == name && !row.has_options);
        assert!(none("bvh: layout bvh8-portable"));
    }
}

/// The parameters of path tracing.
const PATHS: [&str; 6] =
    ["path bounces", "indirect light", "roulette", "clamp", "light technique", "light samples"];

/// A study of a room of paths, for all tests.
fn room() -> &'static (tempfile::TempDir, Output) {
    static ROOM: OnceLock<(tempfile::TempDir, Output)> = OnceLock::new();
    ROOM.get_or_init(|| {
        let parameters =
            PATHS.iter().chain(&["samples", "together"]).flat_map(|parameter| ["--parameter", parameter]);
        let size = ["--size", "48x36", "--samples", "4"];
        made(&["scenes/effects/path.toml"], &size.into_iter().chain(parameters).collect::<Vec<_>>())
    })
}

/// The rows of a parameter.
fn rows_of<'a>(study: &'a Study, parameter: &str) -> Vec<&'a SettingRow> {
    let rows: Vec<_> = study.rows.iter().filter(|row| row.parameter == parameter).collect();
    assert!(!rows.is_empty(), "{parameter}");
    rows
}

fn relative(row: &SettingRow) -> f64 {
    row.limit.expect("finite").rel_mse
}

#[test]
fn paths_are_priced_against_a_limit_of_many_bounces() {
    let study = read(room().0.path());
    assert_eq!(study.floors[0].bounces, Some(128));
    let count = |parameter| rows_of(&study, parameter).len();
    // Bounces 0, 1, 2, 4, 6 of the scene, 8, 16; ambient occlusion, none, paths; ...
    assert_eq!(PATHS.map(count), [7, 3, 3, 4, 3, 4]);
    for row in PATHS.iter().flat_map(|parameter| rows_of(&study, parameter)) {
        assert_eq!(row.reference, ReferenceKind::Limit, "{}", row.name());
        assert!(row.trace_ms.median > 0.0 && relative(row) > 0.0, "{}", row.name());
        assert_eq!(row.samples_per_pixel, 16.0, "{}", row.name());
    }
    let samples: Vec<f64> = rows_of(&study, "samples").into_iter().map(relative).collect();
    assert!(samples[0] > 4.0 * samples[4], "1 and 16 samples: {samples:?}");
}

/// Only the lamp is seen without bounces. Each bounce of the first few adds light and rays.
#[test]
fn errors_fall_with_bounces() {
    let study = read(room().0.path());
    let bounces = rows_of(&study, "path bounces");
    let errors: Vec<f64> = bounces.iter().map(|row| relative(row)).collect();
    assert!(errors[0] > 2.0 * errors[1] && errors[1] > errors[2] && errors[2] > errors[3], "{errors:?}");
    let rays: Vec<u64> = bounces.iter().map(|row| row.rays).collect();
    assert!(rays.windows(2).all(|pair| pair[0] < pair[1]), "{rays:?}");
    let indirect = rows_of(&study, "indirect light");
    let [ambient, none, paths] = [indirect[0], indirect[1], indirect[2]];
    assert!(ambient.setting.contains("ambient occlusion") && none.setting.starts_with("none"));
    assert!(relative(paths) < relative(none) && relative(paths) < relative(ambient));
    // One bounce is direct light alone.
    assert_eq!(none.fingerprint, bounces[1].fingerprint);
}

/// Of a box that is closed but for one side, roulette ends paths that others follow for up to 32 bounces.
#[test]
fn roulette_and_light_samples_change_rays() {
    let study = read(room().0.path());
    let rays = |parameter| rows_of(&study, parameter).iter().map(|row| row.rays).collect::<Vec<_>>();
    let roulette = rays("roulette");
    assert!(roulette[0] > roulette[1] && roulette[1] > roulette[2], "{roulette:?}");
    // The light samples of the others are so many as those of the first, times their number; no other rays are added.
    let lights = rays("light samples");
    let shadow_rays = lights[1] - lights[0];
    let expected = [0, 1, 3, 7].map(|more| lights[0] + more * shadow_rays);
    // Samples that give no light, such as those from below the horizon, cast no ray: they vary.
    let near = |(a, b): (&u64, &u64)| a.abs_diff(*b) * 100 < *b;
    assert!(lights.iter().zip(&expected).all(near), "{lights:?} {expected:?}");
    let errors: Vec<f64> = rows_of(&study, "light samples").into_iter().map(relative).collect();
    assert!(errors[3] < errors[0], "{errors:?}");
    let techniques = rows_of(&study, "light technique");
    assert!(relative(techniques[0]) > 2.0 * relative(techniques[2]), "the lamp is small");
}

#[test]
fn techniques_are_tested_for_agreement() {
    let (folder, output) = room();
    let study = read(folder.path());
    let names: Vec<&str> = study.technique_tests.iter().map(|test| test.name.as_str()).collect();
    assert_eq!(names, ["control", "BSDF samples", "samples of lights"]);
    for TechniqueTest { name, test, .. } in &study.technique_tests {
        // 48 x 36 pixels are 12 x 9 blocks of 4 x 4. The front of the room is 2 wide and 3.6 away, where 48 pixels are
        // 2 * 3.6 * tan(15 degrees) * 4 / 3 = 2.57: of the 5.3 black columns of pixels on each side, 4 are a column of blocks.
        let tested = test.channels.iter().map(|channel| channel.tested).collect::<Vec<_>>();
        assert!(tested == [108 - 2 * 9; 3], "{tested:?}");
        for channel in &test.channels {
            assert_eq!(channel.histogram.iter().sum::<u64>(), channel.tested);
            assert!(channel.equal_means >= test.threshold, "{test:?}");
        }
        assert!(String::from_utf8_lossy(&output.stdout).contains(&format!("t-test, {name}")));
    }
}

#[test]
fn the_options_of_paths_make_their_pictures() {
    use std::hash::{DefaultHasher, Hash, Hasher};
    let (folder, _) = room();
    let study = read(folder.path());
    let has_options = |parameter: &str| rows_of(&study, parameter)[0].has_options;
    assert_eq!(PATHS.map(has_options), [true, false, false, true, false, true]);
    for name in ["path bounces: 2 bounces (16 samples)", "clamp: 1 (16 samples)"] {
        let row = study.rows.iter().find(|row| row.name() == name).expect("a row");
        let file = folder.path().join("row.exr");
        let output = Command::new(assert_cmd::cargo::cargo_bin!("kiln"))
            .current_dir(repository("."))
            .args(arguments_with(&study, &row.options, &file))
            .output()
            .expect("kiln runs");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let picture = kiln::film::read::read_picture(&file).expect("a picture");
        let mut hasher = DefaultHasher::new();
        picture.values.iter().flatten().for_each(|channel| channel.to_bits().hash(&mut hasher));
        assert_eq!(format!("{:016x}", hasher.finish()), row.fingerprint, "{name}");
    }
}

#[test]
fn paths_that_are_asked_for_alone_are_left_out_with_a_reason() {
    let (_, output) = made(&["scenes/assignment.toml"], &["--size", "20x12", "--parameter", "clamp"]);
    let printed = String::from_utf8_lossy(&output.stdout);
    assert!(printed.contains("left out: clamp: the scene has no environment"), "{printed}");
}

#[test]
fn one_parameter_alone_can_be_varied() {
    let (folder, _) = made(&["scenes/assignment.toml"], &["--size", "20x12", "--parameter", "numerics"]);
    let study = read(folder.path());
    // What was asked for, and the four tiers; nothing is held against a picture of many samples.
    assert_eq!(study.rows.len(), 5);
    assert!(study.floors.is_empty() && study.rows.iter().all(|row| row.limit.is_none()));
    assert!(study.rows.iter().all(|row| row.twin.is_some()));
    // Four rays across a pixel.
    assert!(study.geometry.iter().all(|tier| tier.rays == 16 * 20 * 12));
    let output = Command::new(assert_cmd::cargo::cargo_bin!("kiln"))
        .args(["study", "x.toml", "-o", "x", "--parameter", "colours"])
        .output()
        .expect("kiln runs");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(2) && said.contains("no parameter `colours`"), "{said}");
}
