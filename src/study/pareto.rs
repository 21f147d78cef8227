//! Pareto front of time and error.

/// Indices of the points of time and error that no other point dominates, in ascending order of time. A point dominates
/// another if it is worse in neither value and better in one; of equal points, the first is returned. NaN is excluded.
pub fn front(points: &[[f64; 2]]) -> Vec<usize> {
    let mut order: Vec<usize> =
        (0..points.len()).filter(|&i| points[i].iter().all(|x| !x.is_nan())).collect();
    order.sort_by(|&a, &b| {
        let ([time_a, error_a], [time_b, error_b]) = (points[a], points[b]);
        time_a.total_cmp(&time_b).then(error_a.total_cmp(&error_b)).then(a.cmp(&b))
    });
    let mut least = f64::INFINITY;
    order.retain(|&i| {
        let is_less = points[i][1] < least;
        least = least.min(points[i][1]);
        is_less
    });
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dominated_points_are_excluded() {
        // (2, 3) dominates (3, 4) and (2, 5); (5, 1) dominates (6, 2) and occurs twice.
        let points = [[3.0, 4.0], [1.0, 9.0], [2.0, 3.0], [5.0, 1.0], [2.0, 5.0], [5.0, 1.0], [6.0, 2.0]];
        assert_eq!(front(&points), [1, 2, 3]);
        assert_eq!(front(&[[1.0, 0.0], [0.5, 0.0], [2.0, 0.0]]), [1], "of equal errors, the fastest remains");
        assert_eq!(front(&[[1.0, f64::NAN], [2.0, 1.0]]), [1]);
        assert_eq!(front(&[]), [0usize; 0]);
    }
}
