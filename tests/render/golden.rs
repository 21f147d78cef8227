//! The pictures of the assignment, as golden images, made by the commands that `docs/assignment.md` lists.
//!
//! On the platform they were made on they must be equal to the last pixel; elsewhere, where the platform's `pow` may
//! differ in the last bit, no channel may be off by more than 1, except in one pixel of a thousand (edges). Re-make
//! them with `KILN_BLESS=1 cargo test --release --test render golden::` and look at each before committing it. A
//! picture that differs is left beside its golden one as NAME.new.png.

use std::path::PathBuf;

use crate::common::repository;
use assert_cmd::Command;

/// Name and options of every picture; the table of `docs/assignment.md` has the same.
const PICTURES: &[(&str, &str)] = &[
    ("view1", "--camera view1"),
    ("view2", "--camera view2"),
    ("view3", "--camera view3"),
    ("perspective", "--camera origin --projection perspective"),
    ("orthographic", "--camera origin --projection orthographic"),
    ("flat", "--camera view2 --shading flat"),
    ("ambient", "--camera view2 --shading ambient"),
    ("diffuse", "--camera view2 --shading diffuse"),
    ("phong", "--camera view2 --shading phong --without shadows --without glaze"),
    ("with-shadows", "--camera view2 --without glaze"),
    ("without-shadows", "--camera view2 --without shadows"),
    ("with-glaze", "--camera origin"),
    ("without-glaze", "--camera origin --without glaze"),
    ("colour-u8", "--camera view2 --colour u8"),
    ("colour-linear", "--camera view2 --colour linear"),
];

/// The operating system and the architecture that the checked-in pictures were made on.
const MADE_ON: (&str, &str) = ("linux", "x86_64");

const SIZE: &str = "192x192";

fn golden(name: &str) -> PathBuf {
    repository("tests/golden").join(format!("{name}.png"))
}

fn render(name: &str, options: &str, to: &std::path::Path) {
    Command::new(assert_cmd::cargo::cargo_bin!("kiln"))
        .current_dir(repository("."))
        .args(["render", "scenes/assignment.toml", "--size", SIZE, "--progress", "none", "-o"])
        .arg(to)
        .args(options.split_whitespace())
        .assert()
        .success();
    assert!(to.is_file(), "{name} was not written");
}

/// How many pixels differ by more than `most` in some channel.
fn different_pixels(a: &image::RgbImage, b: &image::RgbImage, most: u8) -> usize {
    assert_eq!(a.dimensions(), b.dimensions());
    let differs =
        |(a, b): &(&image::Rgb<u8>, &image::Rgb<u8>)| a.0.iter().zip(b.0).any(|(a, b)| a.abs_diff(b) > most);
    a.pixels().zip(b.pixels()).filter(differs).count()
}

#[test]
fn pictures_are_as_they_were() {
    let bless = std::env::var_os("KILN_BLESS").is_some();
    let folder = tempfile::tempdir().expect("a folder for pictures");
    let mut faults = Vec::new();
    for (name, options) in PICTURES {
        if bless {
            render(name, options, &golden(name));
            continue;
        }
        let new = folder.path().join(format!("{name}.png"));
        render(name, options, &new);
        let Ok(expected) = image::open(golden(name)) else {
            faults.push(format!("{name}: no golden picture"));
            continue;
        };
        let (expected, found) = (expected.into_rgb8(), image::open(&new).expect("a picture").into_rgb8());
        let pixels = (found.width() * found.height()) as usize;
        let here = (std::env::consts::OS, std::env::consts::ARCH);
        let (most, allowed) = if here == MADE_ON { (0, 0) } else { (1, pixels / 1000) };
        let different = different_pixels(&expected, &found, most);
        if different > allowed {
            let candidate = golden(name).with_extension("new.png");
            std::fs::copy(&new, &candidate).expect("the candidate is kept");
            faults
                .push(format!("{name}: {different} of {pixels} pixels differ; see {}", candidate.display()));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn the_comparison_notices_a_pixel() {
    let a = image::RgbImage::from_pixel(8, 8, image::Rgb([10, 20, 30]));
    let mut b = a.clone();
    assert_eq!(different_pixels(&a, &b, 0), 0);
    b.get_pixel_mut(3, 4).0[2] = 31;
    assert_eq!(different_pixels(&a, &b, 0), 1);
    assert_eq!(different_pixels(&a, &b, 1), 0);
}

#[test]
fn the_page_lists_every_picture() {
    let page = std::fs::read_to_string(repository("docs/assignment.md")).expect("there is a page");
    for (name, options) in PICTURES {
        assert!(
            page.contains(&format!("| `{options}` |")),
            "docs/assignment.md does not have `{options}` for {name}"
        );
    }
}

#[test]
fn every_golden_picture_is_one_of_these() {
    for file in std::fs::read_dir(repository("tests/golden")).expect("the golden pictures") {
        let name = file.expect("a file").file_name().to_string_lossy().into_owned();
        let known = PICTURES.iter().any(|(known, _)| name == format!("{known}.png"));
        assert!(known || name.ends_with(".new.png"), "tests/golden/{name} belongs to no test");
    }
}
