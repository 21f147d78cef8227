//! Which settings are worth choosing: those that no other beats in both time and error.

/// Of points of time and error, the indices of those that no other dominates, by time. One dominates another where it is worse in
/// neither and better in one; of equal points the first counts.
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
    fn the_front_of_a_made_up_set() {
        // By hand: (3, 4) is slower and worse than (2, 3); (2, 5) is worse at the time of (2, 3); (5, 1) twice; (6, 2) is
        // beaten by (5, 1).
        let points = [[3.0, 4.0], [1.0, 9.0], [2.0, 3.0], [5.0, 1.0], [2.0, 5.0], [5.0, 1.0], [6.0, 2.0]];
        assert_eq!(front(&points), [1, 2, 3]);
        assert_eq!(
            front(&[[1.0, 0.0], [0.5, 0.0], [2.0, 0.0]]),
            [1],
            "without an error the cheapest is left"
        );
        assert_eq!(front(&[[1.0, f64::NAN], [2.0, 1.0]]), [1]);
        assert_eq!(front(&[]), [0usize; 0]);
    }
}
