//! `kiln bench`: detection of wrong hits, counts that are independent of the thread count, exit codes and output.

use std::process::{Command, Output};
use std::sync::atomic::AtomicBool;

use kiln::render::RenderControl;
use kiln_lab::bench::generate::Family;
use kiln_lab::bench::speed::{
    Kind, NAMES, RaySets, Settings, SpeedRow, Viewpoint, engines, measure, scene, view_setup,
};
use kiln_lab::bench::{Engine, Mesh};
use serde_json::Value;

fn measured(engines: &[Engine], mesh: &Mesh, threads: usize) -> Vec<SpeedRow> {
    let setup = view_setup(&scene(mesh), Viewpoint::Outside, 64).expect("a view");
    let ray_sets = RaySets::new(mesh, &setup);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    let cancel = AtomicBool::new(false);
    let control = RenderControl { cancel: &cancel, progress: &|_, _| {}, time_stages: false };
    let settings = Settings { runs: 1, pool: &pool, check: true };
    measure(engines, mesh, &ray_sets, &settings, &control).expect("rows")
}

/// Every engine that is compiled in or there.
fn all() -> Vec<Engine> {
    engines(1).0
}

/// An engine that forgets a triangle.
fn forgetful(engine: Engine) -> Engine {
    Engine::new(engine.label.clone(), move |mesh| {
        let mut mesh = mesh.clone();
        mesh.triangles.pop();
        engine.build(&mesh)
    })
}

#[test]
fn a_forgotten_triangle_is_noticed_in_every_engine() {
    let mesh = Family::Sphere.mesh(200);
    let forgetful: Vec<Engine> = all().into_iter().map(forgetful).collect();
    for row in measured(&forgetful, &mesh, 2) {
        let wrong = row.wrong.expect("they were compared")[Kind::Random as usize];
        // Of 4096 random rays some 60 % hit the sphere, and 1 in 200 of those the triangle, from inside or outside.
        assert!((3..100).contains(&wrong), "{row:?}");
    }
}

/// Adapters give the right numbers to the right rays: hardly any answer is wrong, and none of kiln's tiers that promise
/// it.
#[test]
fn engines_answer_as_the_oracle_does() {
    for family in Family::ALL {
        let mesh = family.mesh(2000);
        for row in measured(&all(), &mesh, 2) {
            let (wrong, rays) =
                (row.all_wrong().expect("they were compared"), row.rays.iter().sum::<usize>());
            let label = &row.label;
            assert!(wrong * 100 < rays as u64, "{family:?} {label:?}: {:?} of {rays}", row.wrong);
            if label.engine == "kiln" && label.tier != Some("fast") {
                assert_eq!(wrong, 0, "{family:?} {label:?}");
            }
            assert!(row.rates.iter().all(|rates| rates.len() == 1 && rates[0] > 0.0), "{row:?}");
        }
    }
}

#[test]
fn counts_do_not_depend_on_threads() {
    let mesh = Family::Soup.mesh(3000);
    let counted = |threads| -> Vec<_> {
        measured(&all(), &mesh, threads).into_iter().map(|row| (row.tests, row.wrong, row.rays)).collect()
    };
    let one = counted(1);
    assert!(one[0].0.iter().all(|tests| tests.is_some_and(|tests| tests.nodes > 0 && tests.primitives > 0)));
    assert_eq!(one, counted(3));
}

/// Runs `kiln bench`, without Embree.
fn run(arguments: &str) -> Output {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("kiln"));
    command.arg("bench").args(arguments.split_whitespace()).env_remove("KILN_EMBREE");
    command.output().expect("the command starts")
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).expect("the command writes UTF-8")
}

/// The rows of a report, whose envelope states this subject and command.
#[track_caller]
fn rows(output: &Output, subject: &str, command: &str) -> Vec<Value> {
    let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let keys: Vec<&str> = report.as_object().expect("an object").keys().map(String::as_str).collect();
    assert_eq!(keys, ["command", "kiln", "machine", "rows", "schema", "subject"]);
    assert_eq!((&report["schema"], &report["kiln"]), (&1.into(), &env!("CARGO_PKG_VERSION").into()));
    assert_eq!(
        (&report["subject"], &report["command"]),
        (&subject.into(), &format!("kiln {command}").into())
    );
    let facts = report["machine"].as_array().expect("names and values");
    assert!(facts.iter().any(|fact| fact[0] == "processor" && fact[1].is_string()), "{facts:?}");
    report["rows"].as_array().expect("rows").clone()
}

#[test]
fn json_rows_have_the_keys_that_others_rely_on() {
    let output = run("--triangles 500 --size 32 --runs 2 --json");
    assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), ""));
    let rows = rows(&output, "a bumpy sphere", "bench --triangles 500 --size 32 --runs 2 --json");
    let keys = [
        "engine",
        "layout",
        "tier",
        "preset",
        "threads",
        "isa",
        "build_ms",
        "nodes",
        "depth",
        "sah_cost",
        "bytes_per_triangle",
        "mrays_per_s",
        "tests_per_ray",
        "wrong_hits",
    ];
    for row in &rows {
        let row = row.as_object().expect("an object");
        assert!(keys.iter().all(|key| row.contains_key(*key)), "{row:?}");
    }
    let row = rows.iter().find(|row| row["engine"] == "kiln" && row["tier"] == "watertight").expect("kiln");
    for kind in ["primary", "shadow", "diffuse", "random"] {
        let speed = &row["mrays_per_s"][kind];
        let [lower, median, upper] =
            ["lower", "median", "upper"].map(|key| speed[key].as_f64().expect("a number"));
        assert!(0.0 < lower && lower <= median && median <= upper, "{speed}");
        assert!(row["tests_per_ray"][kind]["nodes"].as_f64() > Some(0.0), "{row}");
    }
    // 8 * 8².
    assert_eq!((&row["triangles"], &row["threads"], &row["wrong_hits"]), (&512.into(), &1.into(), &0.into()));
    assert!(row["build_ms"]["median"].as_f64() > Some(0.0));
    for name in NAMES {
        assert!(rows.iter().any(|row| row["engine"] == name), "{name} is there, or skipped with a reason");
    }
    let embree = rows.iter().find(|row| row["engine"] == "embree").expect("a row all the same");
    assert!(
        embree["skipped_reason"]
            .as_str()
            .is_some_and(|reason| reason.starts_with("KILN_EMBREE names no library; "))
    );
    assert_eq!(embree["wrong_hits"], Value::Null);
}

#[test]
fn the_table_and_the_page_need_nothing_else() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = folder.path().join("page.html");
    let arguments =
        format!("--triangles 500 --size 32 --runs 1 --engine kiln --engine obvhs --page {}", page.display());
    let output = run(&arguments);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let said = text(&output.stdout);
    assert!(said.starts_with("a bumpy sphere: 512 triangles\nrays: 1,024 primary, "), "{said}");
    assert!(said.contains("times as fast"), "{said}");
    assert!(said.lines().all(|line| line.chars().count() <= 120), "{said}");
    let html = std::fs::read_to_string(page).expect("the page");
    let (_, rest) = html.split_once("id=\"bench\">").expect("an element");
    let report: Value =
        serde_json::from_str(rest.split("</script>").next().expect("its text")).expect("JSON");
    let rows = report["rows"].as_array().expect("rows");
    assert!(rows.iter().any(|row| row["engine"] == "obvhs"), "{report}");
    for row in rows {
        assert!(said.contains(row["layout"].as_str().expect("a name")), "{row}");
        let facts = ["build_ms", "mrays_per_s", "wrong_hits_by_kind", "rays", "runs", "clock"];
        assert!(facts.iter().all(|key| !row[*key].is_null()), "{row}");
    }
    assert!(!["http", "src=", "href=", "url("].iter().any(|link| html.contains(link)));
}

#[test]
fn a_file_is_benched_by_its_triangles() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("both.toml");
    let sphere = "[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n";
    let triangle = "[[triangles]]\nvertices = [[-1, 0, 0], [1, 0, 0], [0, 1, 0]]\nindices = [[0, 1, 2]]\n";
    let bench = |scene: String| {
        std::fs::write(&file, scene).expect("the file is written");
        run(&format!("{} --size 16 --runs 1 --engine kiln/watertight", file.display()))
    };
    let output = bench(format!("{sphere}{triangle}"));
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert_eq!(
        text(&output.stderr),
        "kiln: note: 1 analytic shape(s) left out: triangles alone are compared\n"
    );
    assert!(text(&output.stdout).starts_with("both.toml: 1 triangles\n"), "{}", text(&output.stdout));
    let output = bench(sphere.to_owned());
    assert_eq!(output.status.code(), Some(3));
    assert!(
        text(&output.stderr).contains("both.toml: there is no triangle in it"),
        "{}",
        text(&output.stderr)
    );
}

#[test]
fn scaling_has_a_row_for_every_mesh_and_a_plot() {
    let folder = tempfile::tempdir().expect("a folder");
    let plot = folder.path().join("plot.svg");
    let arguments = format!("scaling --largest 10000 --size 16 --runs 1 --json --plot {}", plot.display());
    let output = run(&arguments);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let rows = rows(&output, "generated meshes", &format!("bench {arguments}"));
    let subjects: Vec<&str> = rows.iter().filter_map(|row| row["subject"].as_str()).collect();
    assert_eq!(subjects, ["sphere", "sphere", "soup", "soup", "thin", "thin"]);
    assert!(rows.iter().all(|row| row["engine"] == "kiln" && row["wrong_hits"].is_null()));
    let svg = std::fs::read_to_string(plot).expect("the plot");
    for word in ["<svg ", "Building", "bytes a triangle", "soup, kiln", "10⁴"] {
        assert!(svg.contains(word), "{word}");
    }
}

/// The tier of f32 loses rays, those above it never; the picture of `exact` is the reference of the others.
#[test]
fn the_price_of_accuracy_has_a_row_for_every_tier_and_a_plot() {
    let folder = tempfile::tempdir().expect("a folder");
    let plot = folder.path().join("plot.svg");
    let arguments =
        format!("price --triangles 500 --size 32 --rays 500 --runs 1 --json --plot {}", plot.display());
    let output = run(&arguments);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let rows = rows(&output, "a bumpy sphere", &format!("bench {arguments}"));
    let modes = |of: &dyn Fn(&Value) -> bool| -> Vec<&Value> {
        rows.iter().filter(|row| of(row)).map(|row| &row["mode"]).collect()
    };
    // The widest instructions come first; those of kiln are AVX2 again on a machine with more.
    let widest = |row: &Value| row["engine"] == "kiln" && row["isa"] == rows[0]["isa"];
    let tiers = ["fast", "watertight", "double", "exact"];
    assert_eq!(modes(&widest), tiers);
    let others = modes(&|row| row["engine"] == "kiln" && row["isa"] != rows[0]["isa"]);
    assert!(others.is_empty() || others == tiers, "{others:?}");
    assert_eq!(modes(&|row| row["engine"] == "obvhs"), ["bvh2", "cwbvh"]);
    for row in &rows {
        let number = |key: &str| row[key].as_f64().unwrap_or_else(|| panic!("{key}: {row}"));
        let is_closed = ["watertight", "double", "exact"].iter().any(|tier| row["mode"] == *tier);
        assert_eq!(
            number("leaks_aimed_per_million") + number("leaks_secondary_per_million") == 0.0,
            is_closed
        );
        assert!(number("wrong_per_million") == 0.0 || !is_closed, "{row}");
        assert!(row["ns_per_ray"]["primary"]["median"].as_f64() > Some(0.0), "{row}");
        assert_eq!(row["worst_t_error_ulps"].is_number(), row["engine"] == "kiln");
        assert_eq!(row["pictures"]["path"]["rms"].is_number(), widest(row));
    }
    let exact = rows.iter().find(|row| row["mode"] == "exact").expect("a row");
    for transport in ["whitted", "path"] {
        let picture = &exact["pictures"][transport];
        assert_eq!((&picture["rms"], &picture["differing_pixels"]), (&0.0.into(), &0.into()));
    }
    let svg = std::fs::read_to_string(plot).expect("the plot");
    for word in
        ["<svg ", "kiln watertight", "obvhs cwbvh", "wrong answers a million rays at edges and vertices"]
    {
        assert!(svg.contains(word), "{word}");
    }
}

#[test]
fn asking_for_what_is_not_there_is_an_error() {
    let errors = [
        ("--engine embree", 1, "embree: KILN_EMBREE names no library\nhint: set KILN_EMBREE to "),
        ("--engine emrbee", 2, "no engine is called `emrbee`\nhint: engines are kiln, "),
        ("--engine kiln/nothing", 2, "no engine is called `kiln/nothing`\nhint: engines are kiln, "),
        ("--runs 0", 2, "invalid value '0' for '--runs <N>': give a whole number from 1 to 1000\nhint: "),
        ("--from above", 2, "invalid value 'above' for '--from <PLACE>'\nhint: "),
        ("gone.obj", 3, "gone.obj: no such file\nhint: "),
    ];
    for (arguments, code, error) in errors {
        let output = run(arguments);
        let said = text(&output.stderr);
        assert_eq!((output.status.code(), text(&output.stdout)), (Some(code), ""), "{arguments}: {said}");
        assert!(said.starts_with(&format!("kiln: error: {error}")), "{arguments}: {said}");
    }
}
