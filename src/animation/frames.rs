//! Frame lists as users and render farms write them, and the names of numbered files.
//!
//! Schedulers pass their own range syntax on: Open Job Description `1-10:2`, Deadline `1-10x2`, Flamenco `3, 5-10`.

use std::collections::HashSet;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// The most frames of a list, nine hours at 30 frames a second: bounds the memory that a mistyped list takes.
const MOST_FRAMES: u64 = 1_000_000;

/// Frame numbers without duplicates, in the order in which they were given.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameList(Vec<i32>);

impl FrameList {
    /// The frames from `first` to `last`, in descending order where `last` is the lower one.
    pub fn range(first: i32, last: i32) -> Self {
        FrameList(if first <= last { (first..=last).collect() } else { (last..=first).rev().collect() })
    }

    /// The frames, at least one, in order.
    pub fn frames(&self) -> &[i32] {
        &self.0
    }
}

impl FromStr for FrameList {
    type Err = String;

    /// Parses `1-10`, `1-10:2`, `1-10x2`, `3,7,9-12`: items separated by commas or blanks. Numbers may be
    /// negative and ranges descending. A range contains its last frame if the step meets it. A frame given twice keeps
    /// its first position.
    ///
    /// # Errors
    /// One line that says which item is wrong, and why.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut frames = Vec::new();
        let mut seen = HashSet::new();
        for item in text.split(|c: char| c == ',' || c.is_whitespace()).filter(|item| !item.is_empty()) {
            let range = FrameRange::parse(item)?;
            if range.count() + frames.len() as u64 > MOST_FRAMES {
                return Err(format!("`{item}` makes more than {MOST_FRAMES} frames"));
            }
            frames.extend(range.frames().filter(|&frame| seen.insert(frame)));
        }
        if frames.is_empty() {
            return Err("no frame is named; give frames such as 1-10 or 3,7,9-12".into());
        }
        Ok(FrameList(frames))
    }
}

/// A short form of the list, which [`FrameList::from_str`] parses to the same list.
impl fmt::Display for FrameList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut rest = self.0.as_slice();
        let mut comma = "";
        while let [first, after @ ..] = rest {
            let step = after.first().map_or(0, |next| i64::from(*next) - i64::from(*first));
            let steady =
                1 + rest.windows(2).take_while(|w| i64::from(w[1]) - i64::from(w[0]) == step).count();
            let taken = if steady < 3 { 1 } else { steady };
            write!(f, "{comma}{first}")?;
            if taken > 1 {
                write!(f, "-{}", rest[taken - 1])?;
                if step.abs() != 1 {
                    write!(f, ":{}", step.abs())?;
                }
            }
            rest = &rest[taken..];
            comma = ",";
        }
        Ok(())
    }
}

/// A range of frames, or a single one.
struct FrameRange {
    first: i32,
    last: i32,
    step: u32,
}

impl FrameRange {
    fn parse(item: &str) -> Result<Self, String> {
        let (span, step) = match item.find([':', 'x']) {
            Some(at) => (&item[..at], Some(&item[at + 1..])),
            None => (item, None),
        };
        // A dash at the start is a sign.
        let dash = span.char_indices().skip(1).find(|(_, c)| *c == '-');
        let split = dash.map(|(at, _)| (&span[..at], &span[at + 1..]));
        let number = |text: &str| {
            text.parse::<i32>().map_err(|_| match text {
                "" => format!("`{item}` lacks a frame; write ranges as 1-10 or 1-10:2"),
                "all" => "write the frames as a list, such as 0-299; without --frames, `kiln animate` makes all".into(),
                _ => format!("`{text}` in `{item}` is not the number of a frame; write frames as 1-10, 1-10:2 or 3,7,9-12"),
            })
        };
        let (first, last) = match split {
            Some((first, last)) => (number(first)?, number(last)?),
            None => (number(span)?, number(span)?),
        };
        let step = match step {
            None => 1,
            Some(_) if split.is_none() => return Err(format!("`{item}` has a step and no range")),
            Some(text) => {
                let step = text.parse::<i32>().ok().filter(|&step| step != 0);
                let step =
                    step.ok_or_else(|| format!("`{text}` in `{item}` is not a step; give 1 or more"))?;
                if step < 0 && first < last {
                    return Err(format!("`{item}` steps away from its last frame"));
                }
                step.unsigned_abs()
            }
        };
        Ok(FrameRange { first, last, step })
    }

    fn count(&self) -> u64 {
        1 + u64::from(self.first.abs_diff(self.last)) / u64::from(self.step)
    }

    fn frames(&self) -> impl Iterator<Item = i32> + use<> {
        let (first, step) = (i64::from(self.first), i64::from(self.step));
        let sign = if self.last < self.first { -1 } else { 1 };
        // Between first and last, so it fits into i32.
        (0..self.count() as i64).map(move |i| (first + sign * i * step) as i32)
    }
}

/// The names of numbered files: `frame_####.png` or `frame_%04d.png`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileNames {
    folder: PathBuf,
    before: String,
    after: String,
    /// The minimum width of the number; `None` for a name without number.
    width: Option<usize>,
}

impl FileNames {
    /// Parses a name with one run of `#`, or one `%d` or `%04d`, in its last component. `None` for a name without. A
    /// `%d` before a letter, as in `50%discount`, is no placeholder.
    ///
    /// # Errors
    /// One line, for a name with several placeholders, or with one and bytes that are not UTF-8.
    pub fn parse(name: &Path) -> Result<Option<Self>, String> {
        let Some(file) = name.file_name() else { return Ok(None) };
        let Some(file) = file.to_str() else {
            // Placeholders are ASCII.
            return match placeholders(&file.to_string_lossy()).is_empty() {
                true => Ok(None),
                false => Err(format!("{}: a pattern that is not valid UTF-8; rename it", name.display())),
            };
        };
        let mut placeholders = placeholders(file);
        let Some((start, end, width)) = placeholders.pop() else { return Ok(None) };
        if !placeholders.is_empty() {
            return Err(format!("{}: several places for the number of the frame", name.display()));
        }
        Ok(Some(FileNames {
            folder: name.parent().map(Path::to_owned).unwrap_or_default(),
            before: file[..start].to_owned(),
            after: file[end..].to_owned(),
            width: Some(width),
        }))
    }

    /// Whether the name of a single file is a pattern for frames: with `####`, `%d` or `%04d`. Fewer `#` are common in
    /// file names.
    pub fn is_pattern(name: &Path) -> bool {
        let file = name.file_name().unwrap_or_default().to_string_lossy();
        placeholders(&file).iter().any(|&(start, end, _)| file[start..].starts_with('%') || end - start >= 4)
    }

    /// The name of a single file, the same for every frame.
    pub fn single(name: &Path) -> Self {
        let file = name.file_name().map(|file| file.to_string_lossy().into_owned());
        let folder = name.parent().map(Path::to_owned).unwrap_or_default();
        FileNames { folder, before: file.unwrap_or_default(), after: String::new(), width: None }
    }

    /// The file of a frame. As with C's `%04d`, the number is padded with zeros to the width including the sign; wider
    /// numbers are written in full.
    pub fn of(&self, frame: i32) -> PathBuf {
        let FileNames { folder, before, after, width } = self;
        match width {
            Some(width) => folder.join(format!("{before}{frame:0width$}{after}")),
            None => folder.join(before),
        }
    }

    /// The numbers of the files of these names that exist, in ascending order. If all of them have more digits than the
    /// place in the name, also a file whose number has zeros in front: `f_##.png` does not mean `f_001.png` to `f_150.png`.
    ///
    /// # Errors
    /// Those of reading the folder.
    pub fn existing(&self) -> std::io::Result<(Vec<i32>, Option<String>)> {
        let folder = if self.folder.as_os_str().is_empty() { Path::new(".") } else { &self.folder };
        let (mut numbers, mut other) = (Vec::new(), None);
        for entry in std::fs::read_dir(folder)? {
            let name = entry?.file_name();
            let number = name.to_str().and_then(|name| {
                name.strip_prefix(self.before.as_str())?
                    .strip_suffix(self.after.as_str())?
                    .parse::<i32>()
                    .ok()
            });
            match number {
                Some(number) if self.of(number).file_name() == Some(&name) => numbers.push(number),
                Some(_) => other = name.into_string().ok(),
                None => {}
            }
        }
        numbers.sort_unstable();
        let is_wider = numbers.iter().all(|number| number.to_string().len() > self.width.unwrap_or_default());
        Ok((numbers, other.filter(|_| is_wider)))
    }
}

/// The placeholders of a file name: start, end, width.
fn placeholders(file: &str) -> Vec<(usize, usize, usize)> {
    let bytes = file.as_bytes();
    let mut found = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let run = |from: usize, is: fn(u8) -> bool| bytes[from..].iter().take_while(|&&b| is(b)).count();
        let hashes = run(at, |b| b == b'#');
        let digits = if bytes[at] == b'%' { run(at + 1, |b| b.is_ascii_digit()) } else { 0 };
        let end = at + 1 + digits;
        if hashes > 0 {
            found.push((at, at + hashes, hashes));
            at += hashes;
        } else if bytes[at] == b'%' && bytes.get(end) == Some(&b'd') {
            // Other uses of `%`, as in `100%`, are literal.
            let width = &file[at + 1..end];
            let begins_word = bytes.get(end + 1).is_some_and(u8::is_ascii_alphabetic);
            if (width.is_empty() && !begins_word) || (width.starts_with('0') && width.len() <= 3) {
                found.push((at, end + 1, width.parse().unwrap_or(0)));
            }
            at = end + 1;
        } else {
            at += 1;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn list(text: &str) -> Vec<i32> {
        text.parse::<FrameList>().unwrap().frames().to_vec()
    }

    #[test]
    fn every_spelling_is_understood() {
        let one_to_ten: Vec<i32> = (1..=10).collect();
        for text in ["1-10", "1-10:1", " 1-10 ", "1-10x1", "1-5,6-10", "1-5 6-10", "1-5, 6-10,"] {
            assert_eq!(list(text), one_to_ten, "{text}");
        }
        for text in ["1-10:2", "1-10x2", "1-9:2", "1,3,5,7,9"] {
            assert_eq!(list(text), [1, 3, 5, 7, 9], "{text}");
        }
        assert_eq!(list("3,7,9-12"), [3, 7, 9, 10, 11, 12]);
        assert_eq!(list("19,40"), [19, 40]);
        assert_eq!(list("1-1"), [1]);
        assert_eq!(list("0007"), [7]);
        assert_eq!(list("-2"), [-2]);
        assert_eq!(list("3 -2"), [3, -2]);
        assert_eq!(list("10-1:-3"), [10, 7, 4, 1]);
    }

    #[test]
    fn frames_named_twice_stand_once_where_they_were_first() {
        assert_eq!(list("5,1-6,5"), [5, 1, 2, 3, 4, 6]);
        assert_eq!(list("3-1,1-3"), [3, 2, 1]);
    }

    #[test]
    fn errors_are_one_clear_line() {
        for (text, message) in [
            ("", "no frame is named; give frames such as 1-10 or 3,7,9-12"),
            (" , ", "no frame is named; give frames such as 1-10 or 3,7,9-12"),
            ("1-", "`1-` lacks a frame; write ranges as 1-10 or 1-10:2"),
            ("1-b", "`b` in `1-b` is not the number of a frame; write frames as 1-10, 1-10:2 or 3,7,9-12"),
            ("1.5", "`1.5` in `1.5` is not the number of a frame; write frames as 1-10, 1-10:2 or 3,7,9-12"),
            ("1-10:0", "`0` in `1-10:0` is not a step; give 1 or more"),
            ("1-10:", "`` in `1-10:` is not a step; give 1 or more"),
            ("1-10:-1", "`1-10:-1` steps away from its last frame"),
            ("5:2", "`5:2` has a step and no range"),
            (
                "1-9999999999",
                "`9999999999` in `1-9999999999` is not the number of a frame; write frames as 1-10, 1-10:2 or 3,7,9-12",
            ),
            ("-2147483648-2147483647", "`-2147483648-2147483647` makes more than 1000000 frames"),
        ] {
            assert_eq!(text.parse::<FrameList>().unwrap_err(), message);
        }
    }

    #[test]
    fn lists_are_shown_short() {
        for (frames, text) in [
            ("1,2,3,4", "1-4"),
            ("1,3,5", "1-5:2"),
            ("5,4,3", "5-3"),
            ("9,6,3,0,-3", "9--3:3"),
            ("1,2,4", "1,2,4"),
            ("-3,-2,-1,7", "-3--1,7"),
        ] {
            assert_eq!(frames.parse::<FrameList>().unwrap().to_string(), text);
        }
    }

    proptest! {
        /// What is shown is read back as the same list.
        #[test]
        fn lists_survive_being_shown(frames in prop::collection::vec(-40i32..40, 1..60)) {
            let mut seen = HashSet::new();
            let list = FrameList(frames.into_iter().filter(|&frame| seen.insert(frame)).collect());
            prop_assert_eq!(list.to_string().parse::<FrameList>().unwrap(), list);
        }

        /// A range with a step is what counting says, in every spelling.
        #[test]
        fn ranges_are_counted(first in -99i32..99, last in -99i32..99, step in 1u32..20) {
            let sign = if last < first { -1 } else { 1 };
            let counted: Vec<i32> =
                (0..).map(|i| first + sign * i * step as i32).take_while(|f| sign * (last - f) >= 0).collect();
            for text in [format!("{first}-{last}:{step}"), format!("{first}-{last}x{step}")] {
                prop_assert_eq!(list(&text), &counted[..], "{}", text);
            }
        }

        /// No input panics, and an error is one line.
        #[test]
        fn no_text_panics(text in "[-0-9:x., a#.]{0,20}|\\PC{0,12}") {
            if let Err(message) = text.parse::<FrameList>() {
                prop_assert!(!message.contains('\n'));
            }
            let _ = FileNames::parse(Path::new(&text));
        }
    }

    fn name(pattern: &str, frame: i32) -> String {
        FileNames::parse(Path::new(pattern)).unwrap().unwrap().of(frame).display().to_string()
    }

    #[test]
    fn names_have_a_place_for_the_number() {
        assert_eq!(name("out/frame_####.png", 7), "out/frame_0007.png");
        assert_eq!(name("out/frame_%04d.png", 7), "out/frame_0007.png");
        assert_eq!(name("%d.exr", 7), "7.exr");
        assert_eq!(name("#.exr", 7), "7.exr");
        assert_eq!(name("a###b.png", 12345), "a12345b.png");
        // C: printf("%04d", -2) writes -002.
        assert_eq!(name("####.png", -2), "-002.png");
        assert_eq!(name("%04d.png", -2), "-002.png");
        assert_eq!(name("shot #3/f_##.png", 1), "shot #3/f_01.png");
        for single in
            ["frame.png", "100%.png", "%x.png", "%4d.png", "-", "a#/b.png", "50%0ff.png", "50%discount.png"]
        {
            assert_eq!(FileNames::parse(Path::new(single)), Ok(None), "{single}");
        }
        assert!(FileNames::parse(Path::new("a##_%d.png")).is_err());
        for (file, is_pattern) in [
            ("a_####.png", true),
            ("%03d.png", true),
            ("%d.png", true),
            ("take #3.png", false),
            ("50%0ff.png", false),
        ] {
            assert_eq!(FileNames::is_pattern(Path::new(file)), is_pattern, "{file}");
        }
        #[cfg(unix)]
        {
            use std::os::unix::ffi::OsStrExt;
            let path = |bytes: &'static [u8]| Path::new(std::ffi::OsStr::from_bytes(bytes));
            assert_eq!(FileNames::parse(path(b"a\xff.png")), Ok(None));
            let said = FileNames::parse(path(b"\xff_####.png")).unwrap_err();
            assert!(said.ends_with("a pattern that is not valid UTF-8; rename it"), "{said}");
        }
    }
}
