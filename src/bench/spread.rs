//! Quartiles of repeated measurements.

/// Quartiles of measurements.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Spread {
    /// 25 % quantile.
    pub lower: f64,
    /// 50 % quantile.
    pub median: f64,
    /// 75 % quantile.
    pub upper: f64,
}

impl Spread {
    /// Quartiles of measurements in any order; `None` if there are none.
    pub fn of(measurements: &[f64]) -> Option<Self> {
        let mut sorted = measurements.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |quarter: usize| sorted.get((sorted.len() * quarter / 4).min(sorted.len() - 1)).copied();
        if sorted.is_empty() {
            return None;
        }
        Some(Spread { lower: at(1)?, median: at(2)?, upper: at(3)? })
    }

    /// Whether the quartile ranges are disjoint.
    pub fn is_apart_from(&self, other: &Self) -> bool {
        self.lower > other.upper || other.lower > self.upper
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
