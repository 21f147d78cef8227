//! What repeated measurements say: the middle, and how far they scatter.

/// The quartiles of some measurements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// A quarter of the measurements is not above it.
    pub lower: f64,
    /// Half of them are not above it.
    pub median: f64,
    /// Three quarters of them are not above it.
    pub upper: f64,
}

impl Spread {
    /// Of measurements in any order. `None` where there are none.
    pub fn of(measurements: &[f64]) -> Option<Self> {
        let mut sorted = measurements.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |quarter: usize| sorted.get((sorted.len() * quarter / 4).min(sorted.len() - 1)).copied();
        if sorted.is_empty() {
            return None;
        }
        Some(Spread { lower: at(1)?, median: at(2)?, upper: at(3)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quartiles_by_hand() {
        let spread = |numbers: &[f64]| Spread::of(numbers).map(|s| [s.lower, s.median, s.upper]);
        assert_eq!(spread(&[5.0, 1.0, 4.0, 2.0, 3.0]), Some([2.0, 3.0, 4.0]));
        assert_eq!(spread(&[2.0]), Some([2.0; 3]));
        assert_eq!(spread(&[]), None);
    }
}
