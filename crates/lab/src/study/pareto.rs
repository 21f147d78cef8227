//! Pareto front of time and error, with ties.

use crate::timing::Quartiles;

/// A setting's time and error.
#[derive(Debug, Clone, Copy)]
pub struct TimedError {
    /// Time in ms.
    pub time: Quartiles,
    /// Error, at least 0; NaN is excluded.
    pub error: f64,
}

/// Indices of the points that no other point dominates, in ascending order of time. Times are tied if their quartile
/// ranges overlap, errors if they differ by at most `tolerance`. A point dominates another if it is better or tied in
/// both values, and better in one; of points that are tied in both,
/// the first in the order of `points` is returned.
pub fn front(points: &[TimedError], tolerance: f64) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).filter(|&i| !points[i].error.is_nan()).collect();
    order.sort_by(|&a, &b| {
        let (a, b) = (&points[a], &points[b]);
        a.time.median.total_cmp(&b.time.median).then(a.error.total_cmp(&b.error))
    });
    let mut front: Vec<usize> = Vec::new();
    for candidate in order {
        let TimedError { time, error } = points[candidate];
        // All of the front have a smaller median time, and the last the smallest error.
        if let Some(last) = front.last_mut().filter(|last| points[**last].error <= error + tolerance) {
            let is_tied =
                (points[*last].error - error).abs() <= tolerance && !points[*last].time.is_apart_from(&time);
            if is_tied && candidate < *last {
                *last = candidate;
            }
            continue;
        }
        while front.pop_if(|last| !points[*last].time.is_apart_from(&time)).is_some() {}
        front.push(candidate);
    }
    front
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The front of points of lower quartile, median, upper quartile and error.
    fn front_of(points: &[[f64; 4]], tolerance: f64) -> Vec<usize> {
        let point = |&[lower, median, upper, error]: &[f64; 4]| TimedError {
            time: Quartiles { lower, median, upper },
            error,
        };
        front(&points.iter().map(point).collect::<Vec<_>>(), tolerance)
    }

    #[test]
    fn dominated_points_are_excluded() {
        let points = [[3.0, 4.0], [1.0, 9.0], [2.0, 3.0], [5.0, 1.0], [2.0, 5.0], [5.0, 1.0], [6.0, 2.0]];
        // (2, 3) dominates (3, 4) and (2, 5); (5, 1) dominates (6, 2) and occurs twice.
        let exact = |points: &[[f64; 2]]| {
            front_of(&points.iter().map(|&[t, e]| [t, t, t, e]).collect::<Vec<_>>(), 0.0)
        };
        assert_eq!(exact(&points), [1, 2, 3]);
        assert_eq!(exact(&[[1.0, 0.0], [0.5, 0.0], [2.0, 0.0]]), [1], "of equal errors, the fastest remains");
        assert_eq!(exact(&[[1.0, f64::NAN], [2.0, 1.0]]), [1]);
        assert_eq!(exact(&[]), [0usize; 0]);
    }

    #[test]
    fn small_differences_are_ties() {
        // The second is slower, and closer by less than the tolerance.
        assert_eq!(front_of(&[[1.0, 1.1, 1.2, 0.011974], [3.0, 3.1, 3.2, 0.011953]], 1e-4), [0]);
        assert_eq!(front_of(&[[1.0, 1.1, 1.2, 0.011974], [3.0, 3.1, 3.2, 0.011853]], 1e-4), [0, 1]);
        // Tied in both: the first of the list.
        assert_eq!(front_of(&[[1.0, 1.4, 1.6, 0.01], [1.0, 1.1, 1.5, 0.01]], 1e-4), [0]);
        // The first has a smaller median, but the times overlap, and the second is closer.
        assert_eq!(
            front_of(&[[1.0, 1.1, 1.3, 0.02], [1.2, 1.4, 1.5, 0.01], [2.0, 2.0, 2.0, 0.001]], 1e-4),
            [1, 2]
        );
    }
}
