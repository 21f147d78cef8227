//! Features for render farms: metadata of pictures, division of a picture into shards and merging to the same bytes,
//! skipping of frames that are up to date, and termination by signals.

use std::collections::{BTreeMap, BTreeSet};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::{self, repository};
use crate::workshop::Workshop;
#[cfg(unix)]
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

/// A small animation.
const SCENE: &[u8] = include_bytes!("../farm/scene.toml");

impl Workshop {
    /// Runs a command that must end with `code`. Returns standard output, or standard error if that is empty.
    #[track_caller]
    fn ends(&self, code: i32, arguments: &str) -> String {
        let (out, err) = self.code(arguments, code);
        if out.is_empty() { err } else { out }
    }

    /// The modification time of a file, by which a file that was written again is noticed.
    fn written(&self, name: &str) -> std::time::SystemTime {
        std::fs::metadata(self.path(name)).and_then(|m| m.modified()).expect("a file with a time")
    }
}

// -------------------------------------------------------------------------------------------------- shards of a picture

#[test]
fn a_picture_in_seven_shards_becomes_the_bytes_of_one_run() {
    let workshop = Workshop::with("scene.toml", SCENE);
    // 90 x 47 pixels are 6 x 3 tiles; those of the last column and row are smaller.
    for (out, more) in [
        ("a.png", ""),
        ("b.png", "--colour u8 --crop 3,5,71,40"),
        ("c.exr", "--aov all"),
        ("f.exr", "--aov all --samples 4 --crop 3,5,71,40 --bits 16"),
        ("d.jpg", "--colour display"),
        ("e.png", "--samples 4 --filter mitchell --noise 0.01 --seed 3"),
    ] {
        let render = format!("render scene.toml --size 90x47 {more} -o {out} --progress none");
        workshop.ends(0, &render);
        let whole = workshop.bytes(out);
        let mut shards = Vec::new();
        for i in 1..=7 {
            let shard = workshop.ends(0, &format!("{render} --shard {i}/7 --list-outputs"));
            workshop.ends(0, &format!("{render} --shard {i}/7 --threads {}", 1 + i % 3));
            shards.push(shard.trim().to_owned());
        }
        assert_eq!(shards[1], format!("{}.2of7.shard", &out[..1]));
        // Shards in any order, also with one of them twice.
        shards.rotate_left(3);
        shards.push(shards[0].clone());
        workshop.ends(0, &format!("merge {} -o joined.{}", shards.join(" "), &out[2..]));
        assert_eq!(workshop.bytes(&format!("joined.{}", &out[2..])), whole, "{out} {more}");
    }
}

/// A background that bypasses the exposure is stored in shards of display values as it is displayed, which is no radiance.
#[test]
fn shards_of_displayed_colours_are_not_merged_into_radiance() {
    let scene = "[image]\nbackground = '#804020'\nexposure = 1\n[[sphere]]\ncentre = [0, 0, 0]\nradius = 1\n";
    let workshop = Workshop::with("scene.toml", scene);
    for out in ["a.png", "b.exr"] {
        let render = format!("render scene.toml --size 40x20 -o {out} --progress none");
        workshop.ends(0, &render);
        workshop.ends(0, &format!("{render} --shard 1/1"));
        workshop.ends(0, &format!("merge {}.1of1.shard -o joined.{}", &out[..1], &out[2..]));
        assert_eq!(workshop.bytes(&format!("joined.{}", &out[2..])), workshop.bytes(out), "{out}");
    }
    let said = workshop.ends(2, "merge a.1of1.shard -o c.exr");
    assert!(said.contains("which are no radiance") && said.contains("for an .exr"), "{said}");
}

#[test]
fn parts_that_make_no_picture_are_refused_in_a_line() {
    let workshop = Workshop::with("scene.toml", SCENE);
    for i in 1..=3 {
        workshop.ends(0, &format!("render scene.toml -o a.png --progress none --shard {i}/3"));
    }
    workshop.ends(0, "render scene.toml -o b.png --progress none --shard 2/3 --without shadows");
    workshop.ends(0, "render scene.toml -o c.png --progress none --shard 2/4");
    let shard = workshop.bytes("a.2of3.shard");
    workshop.write("short.shard", &shard[..shard.len() - 40]);
    let mut wrong = shard.clone();
    wrong[shard.len() / 2] ^= 1;
    workshop.write("wrong.shard", wrong);
    workshop.write("text.shard", "hello");
    for (second, says) in [
        ("", "kiln: error: a.1of3.shard: shard 2 of 3 is missing\n"),
        (
            "b.2of3.shard",
            "kiln: error: b.2of3.shard: a shard of another scene or with other settings than a.1of3.shard\n",
        ),
        ("c.2of4.shard", "kiln: error: c.2of4.shard: one of 4 shards; a.1of3.shard is one of 3\n"),
        ("short.shard", "kiln: error: short.shard: the shard is damaged; render it again\n"),
        ("wrong.shard", "kiln: error: wrong.shard: the shard is damaged; render it again\n"),
        ("text.shard", "kiln: error: text.shard: not a shard of a picture\n"),
        ("scene.toml", "kiln: error: scene.toml: not a shard of a picture\n"),
        ("none.shard", "kiln: error: none.shard: no such file\n"),
    ] {
        let said = workshop.ends(3, &format!("merge a.1of3.shard {second} a.3of3.shard -o joined.png"));
        assert!(said.starts_with(says), "{second}: {said}");
        assert_eq!(said.lines().count(), 2, "an error and a hint: {said}");
        assert!(!workshop.path("joined.png").exists());
    }
    workshop.ends(0, "merge a.1of3.shard a.2of3.shard a.3of3.shard -o joined.png");
}

#[test]
fn shards_are_made_again_only_where_they_have_to_be() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let render = "render scene.toml -o a.png --shard 2/3 --skip-existing --progress plain";
    workshop.ends(0, render);
    let first = workshop.bytes("a.2of3.shard");
    assert!(workshop.ends(0, render).contains("a.2of3.shard exists with"));
    assert!(!workshop.ends(0, &format!("{render} --samples 4")).contains("exists with"));
    assert!(!workshop.ends(0, render).contains("exists with"));
    workshop.write("a.2of3.shard", &first[..first.len() - 1]);
    assert!(!workshop.ends(0, render).contains("exists with"));
    assert_eq!(workshop.bytes("a.2of3.shard"), first);
}

// -------------------------------------------------------------------------------------------------------------- frames

#[test]
fn shards_of_frames_are_dealt_out_in_turn() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let list = |more: &str| {
        workshop.ends(0, &format!("render scene.toml --frames 0-9,11 -o f_%03d.png --list-outputs {more}"))
    };
    assert_eq!(list("--shard 2/4"), "f_001.png\nf_005.png\nf_009.png\n");
    assert_eq!(list("").lines().count(), 11);
    assert_eq!(workshop.names(), ["scene.toml"], "nothing is rendered");
    workshop.ends(0, "render scene.toml --frames 0-9,11 -o f_%03d.png --shard 2/4 --progress none");
    assert_eq!(workshop.names(), ["f_001.png", "f_005.png", "f_009.png", "scene.toml"]);
    // More shards than frames: the last ones are empty, which is not an error.
    let said = workshop.ends(0, "render scene.toml --frames 1-3 -o f_%03d.png --shard 4/4 --progress plain");
    assert!(said.contains("no frame to render"), "{said}");
    for wrong in ["0/4", "5/4", "2"] {
        workshop.ends(2, &format!("render scene.toml --frames 1-3 -o f_%03d.png --shard {wrong}"));
    }
}

/// `kiln animate` deals out and skips numbered frames as `kiln render --frames` does, with the same bytes.
#[test]
fn animate_shards_and_skips_frames() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let animate = "animate scene.toml -o f_##.png --skip-existing --progress plain --shard";
    workshop.ends(0, &format!("{animate} 2/3"));
    // Of the frames 0 to 11, every third from the second.
    assert_eq!(workshop.names(), ["f_01.png", "f_04.png", "f_07.png", "f_10.png", "scene.toml"]);
    assert!(workshop.ends(0, &format!("{animate} 2/3")).contains("no frame to render; 4 existed"));
    let said = workshop.ends(0, &format!("{animate} 1/1"));
    assert!(
        said.contains("wrote 8 frame(s), f_00.png to f_11.png") && said.contains("; 4 existed"),
        "{said}"
    );
    workshop.ends(0, "verify scene.toml -o f_##.png");
    workshop.ends(0, "render scene.toml --frames 0-11 -o g_##.png --progress none");
    for frame in 0..12 {
        let [ours, theirs] = ["f", "g"].map(|name| workshop.bytes(&format!("{name}_{frame:02}.png")));
        assert!(ours == theirs, "frame {frame}");
    }
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

#[test]
fn frames_of_a_turntable_have_a_rate_and_a_duration() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.write("a.obj", TRIANGLE);
    let length = "--fps 10 --duration 1";
    let small = "a.obj --size 8x8 --draft";
    let render =
        |more: &str| workshop.ends(0, &format!("render {small} -o f_###.png --progress plain {more}"));
    // 2 of the 10 frames of a second are a fifth of a turn of 360 degrees.
    let note = "kiln: note: 2 of 10 frames cover 72 of the 360 degrees; --duration sets the seconds of the whole turn\n";
    assert!(render(&format!("--frames 0-1 {length}")).contains(note));
    assert!(
        render(&format!("--frames 4,5 {length} --shard 2/2")).contains(note),
        "of the list, not the shard"
    );
    // 3 of 300 frames, 30 a second for 10 seconds.
    assert!(render("--frames 150-152").contains("3 of 300 frames cover 3.6 of the 360 degrees"));
    for list in ["0-9", "3", "0-8:2"] {
        let said = render(&format!("--frames {list} {length}"));
        assert!(said.contains("orbits once") && !said.contains(" of the 360 degrees"), "{list}: {said}");
    }
    let said = workshop.ends(0, "render scene.toml --frames 0-1 -o s_#.png --progress plain");
    assert!(!said.contains(" of the 360 degrees"), "an animation of its own: {said}");

    render(&format!("--frames 0-9 {length}"));
    workshop.ends(0, &format!("verify {small} {length} -o f_###.png"));
    workshop.ends(1, &format!("verify {small} -o f_###.png --frames 0-9"));
    workshop.ends(0, &format!("animate {small} {length} -o g_###.png --progress none"));
    assert!(workshop.bytes("f_003.png") == workshop.bytes("g_003.png"));
    // Frame 3 of 10 and frame 90 of 300 are at the same time, 0.3 of the turn.
    let pixels = |name: &str| image::open(workshop.path(name)).expect("a picture").into_rgb8();
    render("--frames 90");
    assert_eq!(pixels("f_003.png"), pixels("f_090.png"));
    assert_ne!(pixels("f_003.png"), pixels("f_002.png"));
}

#[test]
fn only_whole_frames_of_the_same_settings_are_skipped() {
    for ending in ["png", "exr"] {
        let workshop = Workshop::with("scene.toml", SCENE);
        let name = |frame: u32| format!("f_{frame:04}.{ending}");
        let render =
            format!("render scene.toml --frames 0-5 -o f_####.{ending} --skip-existing --progress plain");
        let said = workshop.ends(0, &render);
        assert!(!said.contains("existed"), "{said}");
        let right: Vec<Vec<u8>> = (0..6).map(|frame| workshop.bytes(&name(frame))).collect();
        let before: Vec<_> = (0..6).map(|frame| workshop.written(&name(frame))).collect();
        assert!(workshop.ends(0, &render).contains("no frame to render; 6 existed"));
        // Frame 1 is truncated, 2 has other settings, 3 is another frame, 4 is empty, 5 is missing.
        workshop.write(&name(1), &right[1][..right[1].len() - 1]);
        workshop.ends(
            0,
            &format!("render scene.toml --frames 2 -o {} --progress none --without shadows", name(2)),
        );
        workshop.write(&name(3), &right[0]);
        workshop.write(&name(4), "");
        std::fs::remove_file(workshop.path(&name(5))).expect("it is there");
        let said = workshop.ends(0, &render);
        assert!(said.contains("wrote 5 frame(s)") && said.contains("; 1 existed"), "{said}");
        for (frame, right) in (0..6).zip(&right) {
            assert!(workshop.bytes(&name(frame)) == *right, "frame {frame}");
        }
        assert_eq!(workshop.written(&name(0)), before[0], "it is left alone");
    }
    let said = Workshop::with("scene.toml", SCENE)
        .ends(2, "render scene.toml --frames 0-5 -o f_####.jpg --skip-existing");
    assert!(said.contains("JPEG"), "{said}");
}

#[test]
fn a_texel_an_option_or_a_vertex_makes_another_picture_and_where_files_lie_does_not() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let texture = |value: u8| {
        let mut picture = image::RgbImage::from_pixel(4, 4, image::Rgb([200, 100, 50]));
        picture.put_pixel(3, 2, image::Rgb([200, value, 50]));
        picture
    };
    let model = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n";
    for folder in ["one", "other"] {
        std::fs::create_dir(workshop.path(folder)).expect("a folder");
        workshop.write(&format!("{folder}/a.obj"), model);
        workshop.write(&format!("{folder}/a.mtl"), "newmtl m\nKd 1 1 1\nmap_Kd a.png\n");
        texture(100).save(workshop.path(&format!("{folder}/a.png"))).expect("it can be written");
        workshop.ends(0, &format!("render {folder}/a.obj --size 32x24 -o {folder}.png --progress none"));
    }
    assert_eq!(workshop.bytes("one.png"), workshop.bytes("other.png"), "also what they say of themselves");
    let verify = "verify one/a.obj --size 32x24 -o one.png";
    workshop.ends(0, verify);
    for same in ["--threads 3", "--bvh fast-build", "--numerics watertight"] {
        workshop.ends(0, &format!("{verify} {same}"));
    }
    for (other, why) in [
        ("--samples 2", "; samples: 16, not 2"),
        ("--without shadows", "different: without: the default, not shadows\n"),
        ("--view top", "different: camera: { name = \"auto\""),
        ("--crop 0,0,9,9", "different: crop: the default, not 0,0,9,9\n"),
        ("--colour display", "different: colour: linear, not display; "),
        ("--numerics double", "different: numerics: watertight, not double\n"),
        ("--shading flat", "different: shading: phong, not flat; "),
    ] {
        let said = workshop.ends(1, &format!("{verify} {other}"));
        assert!(said.contains(why), "{other}: {said}");
    }
    workshop.ends(1, &verify.replace("32x24", "32x25"));
    texture(101).save(workshop.path("one/a.png")).expect("it can be written");
    workshop.ends(1, verify);
    texture(100).save(workshop.path("one/a.png")).expect("it can be written");
    workshop.ends(0, verify);
    workshop.write("one/a.obj", model.replace("v 0 1 0", "v 0 1.0000000000000002 0"));
    workshop.ends(1, verify);
}

#[test]
fn verify_lists_what_is_missing_broken_and_different() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.ends(0, "render scene.toml -o f_####.png --frames 0-11 --progress none");
    let with_scene = "verify scene.toml -o f_####.png";
    let alone = "verify f_####.png --frames 0-11";
    for verify in [with_scene, alone] {
        assert_eq!(
            workshop.ends(0, verify),
            "12 of 12 valid, 0 missing, 0 broken, 0 with different settings\n"
        );
    }
    std::fs::remove_file(workshop.path("f_0002.png")).expect("it is there");
    let bytes = workshop.bytes("f_0003.png");
    workshop.write("f_0003.png", &bytes[..bytes.len() - 12]);
    workshop.write("f_0004.png", workshop.bytes("f_0005.png"));
    workshop.ends(0, "render scene.toml -o f_####.png --frames 7 --samples 2 --progress none");
    image::RgbImage::new(96, 64).save(workshop.path("f_0009.png")).expect("it can be written");
    for verify in [with_scene, alone] {
        let said = workshop.ends(1, verify);
        let lines: Vec<&str> = said.lines().collect();
        assert_eq!(lines[0], "f_0002.png: missing: no such file");
        assert_eq!(lines[1], "f_0003.png: broken: ends too early");
        assert_eq!(lines[2], "f_0004.png: different: is frame 5");
        let why = match verify == alone {
            true => "rendered from another scene, with other settings or by another version of kiln",
            false => {
                "filter: gaussian, not the default; filter-radius: 1.5, not the default; samples: 2, not the default; \
                 seed: 0, not the default"
            }
        };
        assert_eq!(lines[3], format!("f_0007.png: different: {why}"));
        assert_eq!(lines[4], "f_0009.png: different: no fingerprint of kiln in the file");
        assert_eq!(lines[5], "7 of 12 valid, 1 missing, 1 broken, 3 with different settings");
        assert_eq!(lines[6], "to render again: --frames 2-4,7,9");
        let report: Value =
            serde_json::from_str(&workshop.ends(1, &format!("{verify} --json"))).expect("JSON");
        assert_eq!(
            (&report["schema"], &report["pictures"], &report["valid"]),
            (&1.into(), &12.into(), &7.into())
        );
        assert_eq!(report["missing"][0]["frame"], 2);
        assert_eq!(report["broken"][0]["file"], "f_0003.png");
        let other: Vec<&Value> =
            report["different"].as_array().expect("a list").iter().map(|f| &f["frame"]).collect();
        assert_eq!(other, [4, 7, 9]);
        assert_eq!(report["to_render"], "2-4,7,9");
    }
    workshop.ends(0, "render scene.toml -o f_####.png --frames 2-4,7,9 --progress none");
    workshop.ends(0, with_scene);
    for (code, wrong) in [
        (2, "verify f_####.png"),
        (2, "verify f_####.jpg --frames 1-3"),
        (2, "verify f.png --frames 1-3"),
        (2, "verify a_##.png b_##.png --frames 1"),
        (2, "verify scene.toml -o f_####.png --frames 0-12"),
        (3, "verify none.toml -o f_####.png"),
    ] {
        workshop.ends(code, wrong);
    }
}

#[cfg(unix)]
#[test]
fn signals_leave_whole_frames_only() {
    for (signal, code) in [(Signal::TERM, 143), (Signal::INT, 130)] {
        let workshop = Workshop::with("scene.toml", SCENE);
        let mut command = workshop.command(
            "render scene.toml -o f_####.png --frames 0-11 --samples 64 --size 480x320 --progress none",
        );
        let mut child = command.stderr(Stdio::piped()).spawn().expect("the command starts");
        // The signal is sent after the first frame was written.
        let start = Instant::now();
        while !workshop.names().iter().any(|name| name.ends_with(".png")) && start.elapsed().as_secs() < 60 {
            std::thread::sleep(Duration::from_millis(5));
        }
        assert!(child.try_wait().expect("the child can be waited for").is_none(), "there are more to come");
        kill_process(Pid::from_child(&child), signal).expect("the command runs");
        let start = Instant::now();
        let status = child.wait().expect("the child can be waited for");
        // It takes at most a second on a machine that is not busy.
        assert!(start.elapsed() < Duration::from_secs(2), "{:?}", start.elapsed());
        assert_eq!(status.code(), Some(code));
        let names = workshop.names();
        assert!((2..13).contains(&names.len()), "{names:?}");
        for name in names.iter().filter(|name| *name != "scene.toml") {
            let frame: u32 = name[2..6].parse().expect("only frames are left");
            let list = format!("verify f_####.png --frames {frame}");
            workshop.ends(0, &list);
        }
    }
}

// ------------------------------------------------------------------------------------------------ progress and threads

#[test]
fn progress_is_in_the_words_of_who_reads_it() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let start = Instant::now();
    let said = workshop.ends(
        0,
        "render scene.toml -o f_####.png --frames 0-11 --samples 64 --size 240x160 --threads 1 --progress openjd",
    );
    let seconds = start.elapsed().as_secs_f64();
    let progress = said.lines().filter_map(|line| line.strip_prefix("openjd_progress: "));
    let progress: Vec<u32> = progress.map(|n| n.parse().expect("a whole number")).collect();
    assert!(progress.is_sorted() && progress.last() == Some(&100), "{said}");
    assert!(progress.len() as f64 <= seconds + 1.0, "{} lines in {seconds} s", progress.len());
    assert!(said.contains("openjd_status: wrote 12 frame(s)"), "{said}");
    assert!(!said.contains("openjd_fail"), "{said}");
    let (code, out, err) = workshop.said("render none.toml -o f_####.png --frames 0-11 --progress openjd");
    assert_eq!((code, out.as_str()), (3, ""));
    let lines: Vec<&str> = err.lines().collect();
    assert_eq!(lines[0], "openjd_fail: none.toml: no such file");
    assert!(lines.len() == 2 && lines[1].starts_with("hint: "), "{err}");
    workshop.write("a.obj", format!("{TRIANGLE}l 1 2\nf 1 1 2\n"));
    let said = workshop.ends(0, "render a.obj --draft --size 8x8 --frames 0-1 -o g_#.png --progress openjd");
    for line in said.lines() {
        let is_known = ["kiln: note: ", "kiln: warning: ", "openjd_progress: ", "openjd_status: "];
        assert!(is_known.iter().any(|start| line.starts_with(start)), "{line}");
    }
    for expected in
        ["kiln: warning: a.obj", "openjd_status: wrote g_0.png\n", "openjd_status: wrote g_1.png\n"]
    {
        assert!(said.contains(expected), "{expected}: {said}");
    }
    assert!(workshop.ends(2, "render --progress openjd --sise").starts_with("openjd_fail: "));
}

// --------------------------------------------------------------------------------------------------------- JSON lines

/// The events of the table in `docs/farms.md`, each with its keys.
fn documented_events() -> BTreeMap<String, BTreeSet<String>> {
    let page = std::fs::read_to_string(repository("docs/farms.md")).expect("the page");
    let table = page.split("| event |").nth(1).expect("a table of events");
    let rows = table.lines().skip(2).take_while(|line| line.starts_with('|'));
    let spans = |cell: &str| cell.split('`').skip(1).step_by(2).map(str::to_owned).collect::<Vec<_>>();
    rows.map(|row| {
        let cells: Vec<&str> = row.split('|').collect();
        (spans(cells[1])[0].clone(), spans(cells[2]).into_iter().chain(["event".to_owned()]).collect())
    })
    .collect()
}

/// Standard error as JSON lines: each is one of the documented events with all of its keys, and the last one, and no
/// other, says how the run ended.
#[track_caller]
fn events(said: &str) -> Vec<Value> {
    let known = documented_events();
    let parse = |line: &str| serde_json::from_str::<Value>(line).unwrap_or_else(|e| panic!("{line}: {e}"));
    let events: Vec<Value> = said.lines().map(parse).collect();
    for (i, event) in events.iter().enumerate() {
        let name = event["event"].as_str().unwrap_or_else(|| panic!("{event} has a name"));
        let keys: BTreeSet<String> = event.as_object().expect("an object").keys().cloned().collect();
        assert_eq!(Some(&keys), known.get(name), "{event}");
        let is_end = ["error", "interrupted", "done"].contains(&name);
        assert_eq!(is_end, i + 1 == events.len(), "{said}");
    }
    events
}

/// The events of a name.
fn named<'a>(events: &'a [Value], name: &str) -> Vec<&'a Value> {
    events.iter().filter(|event| event["event"] == name).collect()
}

#[test]
fn standard_error_is_json_lines_to_the_end() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.write("a.obj", format!("{TRIANGLE}l 1 2\n"));
    let run = |code: i32, arguments: &str| {
        let (found, out, err) = workshop.said(arguments);
        assert_eq!((found, out.as_str()), (code, ""), "{arguments}: {err}");
        let found = events(&err);
        assert!(!found.is_empty(), "{arguments}");
        found
    };
    // A picture with a warning, about the line, and a note, about a triangle.
    let render = "render a.obj --size 32x24 -o a.png --progress json";
    let found = run(0, render);
    assert!(
        named(&found, "warning")[0]["message"].as_str().is_some_and(|m| m.starts_with("a.obj")),
        "{found:?}"
    );
    assert!(!named(&found, "note").is_empty(), "{found:?}");
    assert_eq!(named(&found, "done").len(), 1);
    let found = run(1, &format!("{render} --strict"));
    assert_eq!((named(&found, "warning").len(), &found[found.len() - 1]["exit_code"]), (1, &1.into()));

    // Frames, in any order.
    for command in ["render scene.toml --frames 0-5", "animate scene.toml --frames 0-5"] {
        let found = run(0, &format!("{command} -o f_#.png --progress=json"));
        let mut frames: Vec<_> =
            named(&found, "frame").iter().map(|e| (e["frame"].as_u64(), e["file"].as_str())).collect();
        frames.sort();
        let names: Vec<String> = (0..6).map(|frame| format!("f_{frame}.png")).collect();
        assert!(
            frames.into_iter().eq((0..).zip(&names).map(|(frame, name)| (Some(frame), Some(name.as_str()))))
        );
    }

    // Errors: an unusable input, unwritable outputs, wrong usage.
    std::fs::create_dir(workshop.path("g_1.png")).expect("a folder");
    for (code, arguments, message, has_hint) in [
        (3, "render none.toml -o a.png", "none.toml: no such file", true),
        (
            4,
            "render scene.toml -o gone/a.png",
            "gone/a.png: cannot be written: its folder does not exist; make it with mkdir -p gone",
            false,
        ),
        (4, "render scene.toml --frames 0-2 -o g_#.png", "g_1.png: is a folder; name a file in it", false),
        (2, "animate scene.toml -o a.gif --shard 1/2", "--shard is for numbered frames", true),
        (2, "render scene.toml --sise 2x2", "unexpected argument '--sise' found", true),
        (2, "rendr scene.toml", "unrecognized subcommand 'rendr'", true),
        (2, "info scene.toml", "unexpected argument '--progress' found", true),
    ] {
        let found = run(code, &format!("{arguments} --progress json"));
        let error = named(&found, "error")[0];
        assert!(error["message"].as_str().is_some_and(|said| said.starts_with(message)), "{error}");
        assert_eq!((&error["exit_code"], error["hint"].is_string()), (&code.into(), has_hint), "{error}");
    }

    let found = run(0, "render scene.toml -o a.png --samples 512 --size 480x320 --threads 1 --progress json");
    for progress in named(&found, "progress") {
        assert!(
            ["done", "total", "elapsed", "eta"].iter().all(|key| progress[key].is_number()),
            "{progress}"
        );
    }
    assert!(!named(&found, "progress").is_empty(), "it takes more than a second");
}

#[cfg(unix)]
#[test]
fn an_interrupt_is_the_last_of_the_json_lines() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let mut command = workshop
        .command("render scene.toml -o f_####.png --frames 0-11 --samples 64 --size 480x320 --progress json");
    let child = command.stderr(Stdio::piped()).spawn().expect("the command starts");
    let start = Instant::now();
    while !workshop.names().iter().any(|name| name.ends_with(".png")) && start.elapsed().as_secs() < 60 {
        std::thread::sleep(Duration::from_millis(5));
    }
    kill_process(Pid::from_child(&child), Signal::INT).expect("the command runs");
    let output = child.wait_with_output().expect("the child can be waited for");
    assert_eq!(output.status.code(), Some(130));
    let found = events(&String::from_utf8(output.stderr).expect("UTF-8"));
    assert_eq!(
        named(&found, "interrupted"),
        [&serde_json::json!({ "event": "interrupted", "exit_code": 130 })]
    );
    for frame in named(&found, "frame") {
        assert!(workshop.path(frame["file"].as_str().expect("a name")).exists(), "{frame}");
    }
}

/// A reader that stops reading does not keep the process from ending.
#[cfg(target_os = "linux")]
#[test]
fn a_full_pipe_does_not_hold_an_interrupt_up() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let (reader, mut writer) = std::io::pipe().expect("a pipe");
    // Linux: 16 pages of 4096 bytes; what kiln adds then blocks.
    std::io::Write::write_all(&mut writer, &[b'x'; 16 * 4096]).expect("they fit");
    let mut command = workshop.command("render none.toml -o a.png --progress json");
    let mut child = command.stderr(writer).spawn().expect("the command starts");
    std::thread::sleep(Duration::from_millis(500));
    assert!(child.try_wait().expect("the child can be waited for").is_none(), "it waits to write its error");
    kill_process(Pid::from_child(&child), Signal::INT).expect("the command runs");
    let start = Instant::now();
    assert_eq!(child.wait().expect("the child can be waited for").code(), Some(130));
    // It takes at most a second on a machine that is not busy.
    assert!(start.elapsed() < Duration::from_secs(2), "{:?}", start.elapsed());
    drop(reader);
}

#[cfg(target_os = "linux")]
#[test]
fn threads_follow_the_allocation() {
    let workshop = Workshop::with("scene.toml", SCENE);
    let threads = |command: &mut Command| -> u64 {
        let status =
            command.args(["--stats", "stats.json", "--progress", "none"]).status().expect("it starts");
        assert!(status.success());
        let stats: Value = serde_json::from_slice(&workshop.bytes("stats.json")).expect("JSON");
        stats["threads"].as_u64().expect("a number")
    };
    let render = "render scene.toml -o a.png";
    let all = std::thread::available_parallelism().expect("Linux says").get() as u64;
    if std::env::var_os("RAYON_NUM_THREADS").is_none() {
        assert_eq!(threads(&mut workshop.command(render)), all);
    }
    let slurm = |n: &str, more: &str| {
        threads(workshop.command(&format!("{render} {more}")).env("SLURM_CPUS_PER_TASK", n))
    };
    assert_eq!(slurm("1", ""), 1);
    assert_eq!(slurm("1000", ""), all, "no more than there are");
    assert_eq!(slurm("1", "--threads 3"), 3, "what is typed wins");
    assert_eq!(slurm("nonsense", "--threads 1"), 1);
    // One of the processors that this test may use.
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux has it");
    let allowed = status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:")).expect("a list");
    let first: String = allowed.trim().chars().take_while(char::is_ascii_digit).collect();
    let mut bound = Command::new("taskset");
    bound.args(["-c", &first]).arg(assert_cmd::cargo::cargo_bin!("kiln")).args(render.split_whitespace());
    bound
        .current_dir(workshop.path("").as_path())
        .env_remove("RAYON_NUM_THREADS")
        .env_remove("SLURM_CPUS_PER_TASK");
    if Command::new("taskset").arg("--version").output().is_err() {
        eprintln!("threads_follow_the_allocation: skipped in part: taskset is not there");
        return;
    }
    assert_eq!(threads(&mut bound), 1);
}

/// The frames of the scene of these tests differ from each other.
#[test]
fn the_frames_of_the_small_animation_differ() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.ends(0, "render scene.toml -o f_####.png --frames 0-11 --progress none");
    let pixels = |frame: usize| {
        image::open(workshop.path(&format!("f_{frame:04}.png"))).expect("a picture").into_rgb8()
    };
    for frame in 1..12 {
        assert_ne!(pixels(frame), pixels(frame - 1), "frame {frame}");
    }
}

/// A damaged picture is one line of the report and does not end the run.
#[test]
fn verify_needs_no_more_memory_than_a_row_or_a_block() {
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.write("a.exr", common::oversized_images::exr(60_000, 60_000, &["B", "G", "R"]));
    workshop.write("a.png", common::oversized_images::png(i32::MAX as u32, i32::MAX as u32));
    for name in ["a.exr", "a.png"] {
        let said = workshop.ends(1, &format!("verify {name}"));
        assert!(said.starts_with(&format!("{name}: broken: a picture of ")), "{said}");
        assert!(said.contains("the limit for sizes in a file is 4.0 GiB"), "{said}");
    }
    // A picture that cannot be decoded is rendered again.
    workshop.ends(0, "render scene.toml -o a.png --skip-existing --progress none");
    workshop.ends(0, "verify a.png");
}

/// A shard with a changed header or length of values, and the matching hash.
fn changed(shard: &[u8], change: impl FnOnce(&mut Value), numbers: usize) -> Vec<u8> {
    let lines: Vec<&[u8]> = shard.splitn(3, |&b| b == b'\n').collect();
    let mut head: Value = serde_json::from_slice(lines[1]).expect("a head");
    change(&mut head);
    let mut bytes = [lines[0], b"\n", head.to_string().as_bytes(), b"\n"].concat();
    bytes.extend(vec![0u8; numbers]);
    let hash = *blake3::hash(&bytes).as_bytes();
    bytes.extend(hash);
    bytes
}

/// Errors in a shard name the shard, and not the picture to be written.
#[test]
fn corrupt_shards_are_named() {
    use serde_json::json;
    let workshop = Workshop::with("scene.toml", SCENE);
    workshop.ends(0, "render scene.toml -o a.png --shard 1/1 --size 16x16 --progress none");
    let shard = workshop.bytes("a.1of1.shard");
    // 16 x 16 pixels of three f32.
    let whole = 16 * 16 * 12;
    let channels = |count: usize| (0..count).map(|i| format!("Layer{i}.X")).collect::<Vec<_>>();
    let cases: [(&str, Vec<u8>, &str); 9] = [
        (
            "empty",
            changed(&shard, |head| head["window"] = json!([0, 0, 0, 0]), 0),
            "is 0 x 0 pixels at (0, 0)",
        ),
        (
            "far",
            changed(&shard, |head| head["window"] = json!(vec![u32::MAX; 4]), whole),
            "is 4294967295 x 4294967295",
        ),
        (
            "part",
            changed(&shard, |head| head["attributes"]["size"] = json!([16, 15]), whole),
            "is no part of its picture of 16 x 15 pixels",
        ),
        (
            "channels",
            changed(&shard, |head| head["channels"] = json!(channels(1000)), whole),
            "the shard has too few",
        ),
        ("more", changed(&shard, |_| (), whole + 4), "the shard has too many pixels"),
        (
            "twice",
            changed(&shard, |head| head["channels"] = json!(["R"]), whole / 3 * 4),
            "has settings or channels",
        ),
        (
            "nul",
            changed(&shard, |head| head["channels"] = json!(["a\0b"]), whole / 3 * 4),
            "has a channel `a\\u{0}b`",
        ),
        (
            "key",
            changed(&shard, |head| head["metadata"][0][0] = json!("compression"), whole),
            "has a setting",
        ),
        // The last of a million shards of 40,000 x 40,000 pixels: six tiles of the 6,250,000.
        (
            "shard",
            changed(
                &shard,
                |head| {
                    head["window"] = json!([0, 0, 40_000, 40_000]);
                    head["attributes"]["size"] = json!([40_000, 40_000]);
                    head["shard"] = json!(1_000_000);
                    head["of"] = json!(1_000_000);
                },
                6 * 256 * 12,
            ),
            "a picture of 40000 x 40000 pixels needs ",
        ),
    ];
    for (name, bytes, expected) in cases {
        workshop.write(&format!("{name}.shard"), bytes);
        let said = workshop.ends(3, &format!("merge {name}.shard -o out.exr"));
        assert!(said.starts_with(&format!("kiln: error: {name}.shard: {expected}")), "{name}: {said}");
        assert!(!workshop.path("out.exr").exists(), "{name}");
    }
    workshop.ends(0, "merge a.1of1.shard -o out.png");
}
