//! Shares of work divided among machines: frames of a list, or tiles of a picture.

use std::fmt;
use std::str::FromStr;

/// The `index`-th of `of` shards, counted from 1. Items are assigned round-robin, so that neighbouring items, which
/// take similar time, go to different shards. The assignment is deterministic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Shard {
    index: u32,
    of: u32,
}

impl Shard {
    /// The only shard: all items.
    pub const ALL: Shard = Shard { index: 1, of: 1 };

    /// The `index`-th of `of` shards; `None` unless 1 <= index <= of <= a million.
    pub fn new(index: u32, of: u32) -> Option<Self> {
        ((1..=of).contains(&index) && of <= 1_000_000).then_some(Shard { index, of })
    }

    /// Index of the shard, counted from 1.
    pub fn index(self) -> u32 {
        self.index
    }

    /// Number of shards.
    pub fn of(self) -> u32 {
        self.of
    }

    /// Whether the item at index `place`, from 0, belongs to the shard.
    pub fn has(self, place: usize) -> bool {
        place % self.of as usize == self.index as usize - 1
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.of)
    }
}

impl Default for Shard {
    fn default() -> Self {
        Shard::ALL
    }
}

impl From<Shard> for String {
    fn from(shard: Shard) -> String {
        shard.to_string()
    }
}

impl TryFrom<String> for Shard {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers =
            text.split_once('/').and_then(|(i, n)| Some((i.trim().parse().ok()?, n.trim().parse().ok()?)));
        numbers
            .and_then(|(index, of)| Shard::new(index, of))
            .ok_or_else(|| "give it as I/N, the I-th of N shards counted from 1, such as 2/7".into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_thing_belongs_to_one_share() {
        for of in 1..9 {
            let shards: Vec<Shard> = (1..=of).map(|i| format!("{i}/{of}").parse().unwrap()).collect();
            for place in 0..30 {
                assert_eq!(shards.iter().filter(|shard| shard.has(place)).count(), 1, "{place} of {of}");
            }
            // The sizes of shards differ by at most one item.
            let counts = shards.iter().map(|shard| (0..30).filter(|&place| shard.has(place)).count());
            let counts: Vec<usize> = counts.collect();
            assert!(counts.iter().max().unwrap() - counts.iter().min().unwrap() <= 1, "{counts:?}");
        }
    }

    #[test]
    fn shares_that_are_none_are_refused() {
        for text in ["", "1", "0/4", "5/4", "1/0", "-1/4", "1/4/2", "a/b"] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
    }
}
