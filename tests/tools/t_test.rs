//! `kiln compare --t-test`, end to end.

use crate::workshop::Workshop;

/// The inside of a diffuse sphere with a lamp in it.
fn scene(emission: f64) -> String {
    format!(
        "[image]\nwidth = 40\nheight = 30\ntransport = 'path'\nsampler = 'independent'\n\
         [[camera]]\nposition = [0.1, 0.2, 0]\nlook_at = [1, 0.3, 0.2]\nvertical_fov = 90\n\
         [material.wall]\ncolour = '#c0a080'\n\
         [material.lamp]\ncolour = '#000000'\nemission = '#ffffff'\nemission_intensity = {emission}\n\
         [[sphere]]\nmaterial = 'wall'\ncentre = [0, 0, 0]\nradius = 1.5\n\
         [[sphere]]\nmaterial = 'lamp'\ncentre = [0.3, 0.9, 0.1]\nradius = 0.2\n"
    )
}

impl Workshop {
    fn of_lamps() -> Self {
        let folder = Workshop::with("scene.toml", scene(4.0));
        folder.write("brighter.toml", scene(4.4));
        folder
    }

    /// Renders 32 samples a pixel of a scene with the AOVs of the test.
    fn render(&self, scene: &str, output: &str, options: &str) {
        let arguments = format!("render {scene} -o {output} --samples 32 --aov samples,variance {options}");
        self.code(&arguments, 0);
    }
}

#[test]
fn two_seeds_agree_and_a_brighter_lamp_is_found() {
    let folder = Workshop::of_lamps();
    folder.render("scene.toml", "a.exr", "--seed 1");
    folder.render("scene.toml", "b.exr", "--seed 2");
    folder.render("brighter.toml", "c.exr", "--seed 3");
    let (out, _) = folder.code("compare --t-test a.exr b.exr --block 2", 0);
    assert!(out.contains("no difference found") && out.contains("blocks of 2 x 2 pixels"), "{out}");
    let rows = out.lines().filter(|line| line.contains(" to ")).count();
    assert_eq!(rows, 20, "{out}");
    // Blocks: 20 x 15 of 300.
    let tested = out.lines().find(|line| line.contains("tested")).expect("a line");
    assert!(tested.split_whitespace().skip(1).take(3).all(|count| count == "300"), "{tested}");

    let (json, _) = folder.code("compare --t-test a.exr c.exr --json", 2);
    let report: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!((&report["verdict"], &report["t_test"]["passed"]), (&"different".into(), &false.into()));
    let red = &report["t_test"]["channels"][0];
    let sum: u64 =
        red["histogram"].as_array().expect("bins").iter().map(|n| n.as_u64().expect("a count")).sum();
    assert_eq!((sum, &red["tested"], &red["channel"]), (1200, &1200.into(), &"R".into()));
    assert!(red["equal_means"].as_f64().expect("a number") < 1e-6 && red["difference"].as_f64() > Some(0.0));
    let (_, said) = folder.code("compare --t-test a.exr a.exr", 2);
    assert!(said.contains("both pictures have the seed 1") && said.contains("--seed"), "{said}");
}

#[test]
fn what_cannot_be_tested_is_said_with_what_to_do() {
    let folder = Workshop::of_lamps();
    folder.render("scene.toml", "a.exr", "");
    folder.render("scene.toml", "b.exr", "--seed 1");
    folder.render("scene.toml", "sobol.exr", "--sampler sobol");
    folder.render("scene.toml", "mitchell.exr", "--filter mitchell");
    folder.render("scene.toml", "small.exr", "--size 20x15");
    folder.render("scene.toml", "display.exr", "--colour display");
    folder.code("render scene.toml -o bare.exr --samples 4", 0);
    folder.code("render scene.toml -o one.exr --aov samples,variance", 0);
    folder.code("render scene.toml -o a.png", 0);
    let hint = "hint: write it by `kiln render --samples N --sampler independent --aov samples,variance`";
    for (file, what) in [
        ("sobol.exr", "its samples are not independent (`--sampler sobol`)"),
        ("mitchell.exr", "seen through a filter with negative lobes"),
        ("display.exr", "clamped values of `--colour display`"),
        ("bare.exr", "without the channel `Variance.R`"),
        ("one.exr", "1 sample(s) of the pixel at (0, 0)"),
    ] {
        for pair in [format!("a.exr {file}"), format!("{file} a.exr")] {
            let (_, said) = folder.code(&format!("compare --t-test {pair}"), 3);
            assert!(said.starts_with(&format!("kiln: error: {file}: {what}")), "{said}");
            assert!(said.contains(hint) && said.lines().count() == 2, "{said}");
        }
    }
    assert!(folder.code("compare --t-test a.exr a.png", 3).1.contains("not an EXR picture"));
    assert!(folder.code("compare --t-test a.exr missing.exr", 3).1.contains("missing.exr"));
    assert!(folder.code("compare --t-test b.exr small.exr", 2).1.contains("sizes differ"));
    for options in ["--display", "--heat-map h.png", "--fail-above max=1", "--block 0", "--block 2000"] {
        folder.code(&format!("compare --t-test a.exr b.exr {options}"), 2);
    }
    folder.code("compare a.exr a.exr --block 2", 2);
}
