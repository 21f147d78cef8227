//! Limits on what files may hold, in numbers rather than bytes, for files that are not trusted.

use crate::error::{Error, Place};

/// What is counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Counted {
    /// Triangles and analytic shapes of all inputs, those of an instanced mesh for each of its placements.
    Triangles,
    /// Texels of all textures.
    Texels,
    /// Nodes of a glTF file, and placements.
    Nodes,
}

/// The most of each kind that input files may hold, in the order of [`Counted::ALL`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits([u64; 3]);

impl Limits {
    /// Those without options. Triangles are numbered in 32 bits.
    pub const DEFAULT: Limits = Limits([u32::MAX as u64, 1 << 32, 1 << 24]);

    /// Those that differ from the default.
    pub fn changed(self) -> impl Iterator<Item = (Counted, u64)> {
        let of = move |counted: Counted| (counted, self.0[counted as usize]);
        Counted::ALL.into_iter().map(of).filter(|&(k, most)| most != Limits::DEFAULT.0[k as usize])
    }

    /// These limits with another one for a kind.
    pub fn with(mut self, counted: Counted, most: u64) -> Self {
        self.0[counted as usize] = most;
        self
    }
}

impl Default for Limits {
    fn default() -> Self {
        Limits::DEFAULT
    }
}

names!(Counted { Triangles = "triangles", Texels = "texels", Nodes = "nodes" });

impl Counted {
    /// Checks a number of them against the limits; `place` is named in the error.
    ///
    /// # Errors
    /// [`Error::Input`] if there are more than the limit.
    pub fn check(self, count: u64, limits: &Limits, place: impl Into<Place>) -> crate::error::Result<()> {
        let most = limits.0[self as usize];
        let name = self.name();
        if count <= most {
            return Ok(());
        }
        let hint = match self {
            Counted::Triangles if count > u64::from(u32::MAX) => {
                "kiln numbers at most 4,294,967,295: fewer placements, or meshes of fewer triangles"
                    .to_owned()
            }
            _ => format!("if you trust the file, give --limit {name}={count}"),
        };
        Err(Error::input(place, format!("{count} {name}; the limit is {most}"), hint))
    }
}

/// Parses a limit, such as `triangles=1000000`.
///
/// # Errors
/// A message that states the valid form.
pub fn parse_count(text: &str) -> Result<(Counted, u64), String> {
    let form = || "give triangles=N, texels=N or nodes=N, such as triangles=1000000".to_owned();
    let (name, number) = text.split_once('=').ok_or_else(form)?;
    let counted = Counted::ALL.into_iter().find(|counted| counted.name() == name).ok_or_else(form)?;
    let most: u64 = number.parse().map_err(|_| form())?;
    if counted == Counted::Triangles && most > u64::from(u32::MAX) {
        return Err("kiln numbers at most 4294967295 triangles".to_owned());
    }
    Ok((counted, most))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_parsed() {
        assert_eq!(parse_count("triangles=12"), Ok((Counted::Triangles, 12)));
        assert_eq!(parse_count("nodes=0"), Ok((Counted::Nodes, 0)));
        for bad in ["", "triangles", "vertices=1", "texels=-1", "texels=1e9", "triangles=4294967296"] {
            assert!(parse_count(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn counts_beyond_the_default_are_refused() {
        let file = std::path::Path::new("a.obj");
        let check = |counted: Counted, count| counted.check(count, &Limits::default(), file);
        assert_eq!(check(Counted::Texels, 1 << 32), Ok(()));
        let e = check(Counted::Texels, (1 << 32) + 1).expect_err("too many");
        assert_eq!(e.to_string(), "a.obj: 4294967297 texels; the limit is 4294967296");
        assert!(e.hint().ends_with("give --limit texels=4294967297"), "{}", e.hint());
        assert!(check(Counted::Triangles, 1 << 32).expect_err("too many").hint().contains("numbers at most"));
    }
}
