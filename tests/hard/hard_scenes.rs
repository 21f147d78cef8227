//! The scenes of `scenes/hard` in every tier, checked against the assertions in their file heads.
//! `scenes/hard/README.md` describes the format.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use crate::common::borders::{TIGHT, sound};
use crate::common::picture::{equip, prepare};
use crate::common::repository;
use kiln::error::Warnings;
use kiln::scene::Numerics;

/// Pixels in 8 bits, row by row from the top.
#[derive(Clone, PartialEq)]
struct Picture {
    width: usize,
    pixels: Vec<[u8; 3]>,
}

/// The comparison of a pixel's channels with a colour.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Against {
    Equal,
    AtLeast,
    AtMost,
}

#[derive(Debug, Clone, PartialEq)]
enum Form {
    /// Every pixel.
    Every(Against, [u8; 3]),
    /// This number of pixels.
    Exactly(usize, [u8; 3]),
    /// These pixels.
    These(Vec<[usize; 2]>, Against, [u8; 3]),
    /// The pictures of the tiers are equal.
    Same(Vec<Numerics>),
    /// No two pictures of the tiers differ in more pixels.
    Between(usize, Vec<Numerics>),
    /// The picture differs from another scene's in no more pixels.
    From(usize, String),
}

#[derive(Debug, Clone, PartialEq)]
struct Expectation {
    tiers: Vec<Numerics>,
    form: Form,
}

/// Names of tiers, between commas.
fn tiers(text: &str) -> Option<Vec<Numerics>> {
    let named = |name: &str| Numerics::ALL.into_iter().find(|tier| tier.name() == name.trim());
    text.split(',').map(named).collect()
}

fn colour(text: &str) -> Option<[u8; 3]> {
    let digits = text.strip_prefix('#').filter(|digits| digits.len() == 6)?;
    let [_, r, g, b] = u32::from_str_radix(digits, 16).ok()?.to_be_bytes();
    Some([r, g, b])
}

/// `#rrggbb`, `at least #rrggbb` or `at most #rrggbb`.
fn against(text: &str) -> Option<(Against, [u8; 3])> {
    let (how, text) = match (text.strip_prefix("at least "), text.strip_prefix("at most ")) {
        (Some(rest), _) => (Against::AtLeast, rest),
        (_, Some(rest)) => (Against::AtMost, rest),
        _ => (Against::Equal, text),
    };
    Some((how, colour(text)?))
}

/// `X,Y X,Y …` or `X,Y to X,Y`.
fn pixels(text: &str) -> Option<Vec<[usize; 2]>> {
    let pixel = |text: &str| {
        let (x, y) = text.split_once(',')?;
        Some([x.parse().ok()?, y.parse().ok()?])
    };
    match text.split_once(" to ") {
        Some((from, to)) => {
            let ([left, top], [right, bottom]) = (pixel(from)?, pixel(to)?);
            let all = (top..=bottom).flat_map(|y| (left..=right).map(move |x| [x, y]));
            Some(all.collect()).filter(|all: &Vec<_>| !all.is_empty())
        }
        None => text.split(' ').map(pixel).collect(),
    }
}

fn form(text: &str) -> Option<Form> {
    if let Some(rest) = text.strip_prefix("every pixel is ") {
        return against(rest).map(|(how, colour)| Form::Every(how, colour));
    }
    if let Some(rest) = text.strip_prefix("no pixel is ") {
        return colour(rest).map(|colour| Form::Exactly(0, colour));
    }
    if let Some((count, rest)) = text.strip_prefix("exactly ").and_then(|t| t.split_once(" pixels are ")) {
        return Some(Form::Exactly(count.parse().ok()?, colour(rest)?));
    }
    if let Some((places, rest)) = text.strip_prefix("pixels ").and_then(|t| t.split_once(" are ")) {
        let (how, colour) = against(rest)?;
        return Some(Form::These(pixels(places)?, how, colour));
    }
    if let Some(rest) = text.strip_prefix("same picture in ") {
        return tiers(rest).map(Form::Same);
    }
    let (count, rest) = text.strip_prefix("at most ")?.split_once(" pixels differ ")?;
    let count = count.parse().ok()?;
    match (rest.strip_prefix("between "), rest.strip_prefix("from ")) {
        (Some(names), _) => Some(Form::Between(count, tiers(names)?)),
        (_, Some(file)) => Some(Form::From(count, file.to_owned())),
        _ => None,
    }
}

/// `# expect: FORM` or `# expect (TIERS): FORM`; `None` for other lines.
fn expectation(line: &str) -> Option<Result<Expectation, String>> {
    let rest = line.strip_prefix("# expect")?;
    let read = || {
        let (of, text) = rest.split_once(": ")?;
        let tiers = match of.trim() {
            "" => TIGHT.to_vec(),
            "(all tiers)" => Numerics::ALL.to_vec(),
            names => tiers(names.strip_prefix('(')?.strip_suffix(')')?)?,
        };
        Some(Expectation { tiers, form: form(text)? })
    };
    Some(read().ok_or_else(|| format!("not understood: {line}")))
}

impl Against {
    fn holds(self, pixel: [u8; 3], colour: [u8; 3]) -> bool {
        pixel.into_iter().zip(colour).all(|(a, b)| match self {
            Against::Equal => a == b,
            Against::AtLeast => a >= b,
            Against::AtMost => a <= b,
        })
    }
}

/// How many pixels differ by more than one step in a channel.
fn differences(a: &Picture, b: &Picture) -> usize {
    let far = |(a, b): (&[u8; 3], &[u8; 3])| a.iter().zip(b).any(|(a, b)| a.abs_diff(*b) > 1);
    a.pixels.iter().zip(&b.pixels).filter(|pair| far(*pair)).count()
}

/// The pictures of scene files by file and tier, each rendered once.
#[derive(Default)]
struct Gallery(HashMap<(PathBuf, &'static str), Picture>);

impl Gallery {
    /// The picture of a file. Its pixels must be finite, and its import must give no warnings.
    fn show(&mut self, file: &Path, numerics: Numerics) -> Picture {
        let make = || {
            let mut warnings = Warnings::default();
            let mut scene = kiln::import::load(&[file.to_owned()], &mut warnings)
                .unwrap_or_else(|e| panic!("{}: {e}", file.display()));
            assert_eq!(warnings.messages(), [""; 0], "{}", file.display());
            equip(&mut scene);
            let size = scene.picture.size().expect("it gives its size");
            assert!(size.iter().all(|side| (64..=128).contains(side)), "{}: {size:?}", file.display());
            let pipeline = scene.picture.pipeline();
            let prepared = prepare(scene, size, numerics);
            assert_eq!(prepared.world.too_small, 0, "{}", file.display());
            let bytes = sound(&prepared).to_rgb8(pipeline);
            Picture { width: size[0] as usize, pixels: bytes.as_chunks().0.to_vec() }
        };
        self.0.entry((file.to_owned(), numerics.name())).or_insert_with(make).clone()
    }

    /// The failures of an expectation of a file.
    fn faults(&mut self, file: &Path, expectation: &Expectation) -> Vec<String> {
        let mut faults = Vec::new();
        let pairs = |tiers: &[Numerics]| -> Vec<[Numerics; 2]> {
            let after = |i: usize| tiers[i + 1..].iter().map(move |b| [tiers[i], *b]);
            (0..tiers.len()).flat_map(after).collect()
        };
        if let Form::Same(tiers) | Form::Between(_, tiers) = &expectation.form {
            for [a, b] in pairs(tiers) {
                let (one, other) = (self.show(file, a), self.show(file, b));
                let differ = differences(&one, &other);
                let right = match expectation.form {
                    Form::Between(most, _) => differ <= most,
                    _ => one == other,
                };
                if !right {
                    faults.push(format!("{} and {}: {differ} pixels differ", a.name(), b.name()));
                }
            }
            return faults;
        }
        for &tier in &expectation.tiers {
            let picture = self.show(file, tier);
            let at = |i: usize| [i % picture.width, i / picture.width];
            let unlike = |[x, y]: [usize; 2], how: Against, colour: [u8; 3]| {
                let inside = x < picture.width && y < picture.pixels.len() / picture.width;
                if !inside {
                    return Some(format!("pixel {x},{y} is outside the picture"));
                }
                let pixel = picture.pixels[y * picture.width + x];
                let [r, g, b] = pixel;
                (!how.holds(pixel, colour)).then(|| format!("pixel {x},{y} is #{r:02x}{g:02x}{b:02x}"))
            };
            let fault = match &expectation.form {
                Form::Every(how, colour) => {
                    (0..picture.pixels.len()).find_map(|i| unlike(at(i), *how, *colour))
                }
                Form::These(places, how, colour) => {
                    places.iter().find_map(|place| unlike(*place, *how, *colour))
                }
                Form::Exactly(count, colour) => {
                    let found = picture.pixels.iter().filter(|pixel| *pixel == colour).count();
                    (found != *count).then(|| format!("{found} pixels are"))
                }
                Form::From(most, other) => {
                    let other = self.show(&file.with_file_name(other), tier);
                    let differ = differences(&picture, &other);
                    (differ > *most).then(|| format!("{differ} pixels differ"))
                }
                Form::Same(_) | Form::Between(..) => None,
            };
            faults.extend(fault.map(|fault| format!("{}: {fault}", tier.name())));
        }
        faults
    }
}

/// The scene files, in order.
fn files() -> Vec<PathBuf> {
    let folder = std::fs::read_dir(repository("scenes/hard")).expect("the folder is there");
    let names = folder.map(|entry| entry.expect("an entry").path());
    let mut files: Vec<PathBuf> =
        names.filter(|file| file.extension().is_some_and(|e| e == "toml")).collect();
    files.sort();
    files
}

#[test]
fn every_scene_meets_its_expectations() {
    let mut gallery = Gallery::default();
    let mut faults = Vec::new();
    for file in files() {
        let text = std::fs::read_to_string(&file).expect("it can be read");
        let name = file.file_name().expect("it has a name").to_string_lossy().into_owned();
        let mut expectations = 0;
        for (line, read) in text.lines().filter_map(|line| Some((line, expectation(line)?))) {
            expectations += 1;
            match read {
                Ok(read) => faults.extend(
                    gallery.faults(&file, &read).iter().map(|fault| format!("{name}: {line}\n    {fault}")),
                ),
                Err(fault) => faults.push(format!("{name}: {fault}")),
            }
        }
        if expectations == 0 {
            faults.push(format!("{name}: it expects nothing"));
        }
        // Every tier renders the scene, also those without an expectation.
        Numerics::ALL.iter().for_each(|tier| drop(gallery.show(&file, *tier)));
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn the_readme_lists_every_scene() {
    let readme = std::fs::read_to_string(repository("scenes/hard/README.md")).expect("there is one");
    let listed: Vec<&str> = readme
        .lines()
        .filter_map(|line| line.strip_prefix("| `")?.split_once(".toml` |"))
        .map(|l| l.0)
        .collect();
    let names: Vec<String> = files()
        .iter()
        .map(|f| f.file_stem().expect("it has a name").to_string_lossy().into_owned())
        .collect();
    assert_eq!(listed, names);
    assert!(names.len() >= 10);
}

#[test]
fn expectations_are_parsed() {
    let read = |line: &str| expectation(line).map(|read| read.map(|e| (e.tiers.len(), e.form)));
    let grey = [16, 32, 255];
    let right =
        |line: &str, tiers: usize, form: Form| assert_eq!(read(line), Some(Ok((tiers, form))), "{line}");
    right("# expect: every pixel is at least #1020ff", 3, Form::Every(Against::AtLeast, grey));
    right("# expect (all tiers): no pixel is #1020ff", 4, Form::Exactly(0, grey));
    right("# expect (fast, exact): exactly 7 pixels are #1020ff", 2, Form::Exactly(7, grey));
    let corner = vec![[1, 2], [2, 2], [1, 3], [2, 3]];
    right("# expect: pixels 1,2 to 2,3 are at most #1020ff", 3, Form::These(corner, Against::AtMost, grey));
    right("# expect: pixels 1,2 9,9 are #1020ff", 3, Form::These(vec![[1, 2], [9, 9]], Against::Equal, grey));
    right("# expect: same picture in fast, double", 3, Form::Same(vec![Numerics::Fast, Numerics::Double]));
    let three = vec![Numerics::Watertight, Numerics::Double, Numerics::Exact];
    right("# expect: at most 5 pixels differ between watertight, double, exact", 3, Form::Between(5, three));
    right("# expect: at most 5 pixels differ from a.toml", 3, Form::From(5, "a.toml".into()));
    assert_eq!(expectation("# a comment"), None);
    for wrong in [
        "# expect every pixel is #102030",
        "# expects: every pixel is #102030",
        "# expect (quick): every pixel is #102030",
        "# expect: every pixel is #1020",
        "# expect: every pixel is nearly #102030",
        "# expect: pixels 3,3 to 2,2 are #102030",
        "# expect: pixels 3 are #102030",
        "# expect: exactly some pixels are #102030",
        "# expect: same picture in two tiers",
        "# expect: at most 3 pixels differ",
        "# expect: it is beautiful",
    ] {
        assert!(matches!(expectation(wrong), Some(Err(_))), "{wrong}");
    }
}

#[test]
fn unmet_expectations_are_reported() {
    // A picture of two pixels, and expectations that it does not meet.
    let file = Path::new("a.toml");
    let pixels = vec![[10, 20, 30], [40, 50, 60]];
    let mut gallery = Gallery::default();
    gallery.0.insert((file.into(), "fast"), Picture { width: 2, pixels: pixels.clone() });
    let turned = pixels.into_iter().rev().collect();
    gallery.0.insert((file.into(), "exact"), Picture { width: 2, pixels: turned });
    let mut faults = |text: &str| {
        let line = format!("# expect (fast): {text}");
        gallery.faults(file, &expectation(&line).expect("an expectation").expect("a form"))
    };
    assert_eq!(faults("pixels 0,0 are #0a141e"), [""; 0]);
    assert_eq!(faults("every pixel is at most #28323c"), [""; 0]);
    assert_eq!(faults("pixels 1,0 are #0a141e"), ["fast: pixel 1,0 is #28323c"]);
    assert_eq!(faults("every pixel is at least #0a141f"), ["fast: pixel 0,0 is #0a141e"]);
    assert_eq!(faults("pixels 0,1 are #0a141e"), ["fast: pixel 0,1 is outside the picture"]);
    assert_eq!(faults("no pixel is #28323c"), ["fast: 1 pixels are"]);
    assert_eq!(faults("same picture in fast, exact"), ["fast and exact: 2 pixels differ"]);
    assert_eq!(faults("at most 1 pixels differ between fast, exact"), ["fast and exact: 2 pixels differ"]);
    assert_eq!(faults("at most 2 pixels differ between fast, exact"), [""; 0]);
}
