//! Searches in cumulative sums, for sampling discrete distributions, with tables that shorten them (Chen and Asau, On
//! Generating Random Variates from an Empirical Distribution, 1974).

/// The table for some sums: for each of `parts` equal parts of the unit interval, and for its end, the first entry of the sums
/// that a number there or behind may choose. `parts` is a power of two.
pub(super) fn guide<T: Copy + Into<f64>>(sums: &[T], parts: usize) -> impl Iterator<Item = usize> {
    let total = sums.last().map_or(0.0, |&sum| sum.into());
    (0..=parts).map(move |part| {
        let at = part as f64 / parts as f64 * total;
        sums.partition_point(|&sum| sum.into() <= at)
    })
}

/// The entry of cumulative sums that a number in [0, 1) chooses, and how far into it that is, 0 to 1. Entries of weight 0 are
/// not chosen. `guide` is the table of the sums.
#[inline]
pub(super) fn find<E: Copy + Into<u32>, T: Copy + Into<f64>>(
    guide: &[E],
    sums: &[T],
    number: f64,
) -> (usize, f64) {
    let at = number * sums[sums.len() - 1].into();
    let part = (number * (guide.len() - 1) as f64) as usize;
    // Products are rounded monotonically, so the entry lies between those of the ends of its part.
    let (first, end): (u32, u32) = (guide[part].into(), guide[part + 1].into());
    let (first, end) = (first as usize, end as usize);
    let index = (first + sums[first..end].partition_point(|&sum| sum.into() <= at)).min(sums.len() - 1);
    let before = if index == 0 { 0.0 } else { sums[index - 1].into() };
    let weight = sums[index].into() - before;
    (index, if weight > 0.0 { ((at - before) / weight).clamp(0.0, 1.0) } else { 0.5 })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The entry and the place in it are those of a search through all sums: of even weights, of few that are not 0, and at
    /// numbers just below the ends of a guide's parts.
    #[test]
    fn searches_by_guide_find_what_full_searches_do() {
        let weights: [fn(usize) -> f32; 5] = [
            |_| 1.0,
            |_| 0.0,
            |i| if i % 100 == 7 { 3.0 } else { 0.0 },
            |i| (i as f32).powi(3),
            |i| f32::from(i == 999),
        ];
        for (weight, len) in
            weights.into_iter().flat_map(|weight| [1000, 1024, 2048].map(|len| (weight, len)))
        {
            let sums: Vec<f32> = (0..len)
                .scan(0.0, |sum, i| {
                    *sum += weight(i);
                    Some(*sum)
                })
                .collect();
            let parts = [1, 64, 4096][len % 3];
            let guide: Vec<u32> = guide(&sums, parts).map(|entry| entry as u32).collect();
            for k in 0..100_000u32 {
                let part = f64::from(k % 64) / 64.0;
                let number = match k % 3 {
                    0 => f64::from(k) / 100_000.0,
                    1 => part,
                    _ => (if part > 0.0 { part } else { 1.0 }) - f64::from(f32::EPSILON) / 2.0,
                };
                let at = number * f64::from(sums[len - 1]);
                let expected = sums.partition_point(|&sum| f64::from(sum) <= at).min(len - 1);
                let (index, within) = find(&guide, &sums, number);
                assert_eq!(index, expected, "{number} of {len}");
                let before = if index == 0 { 0.0 } else { f64::from(sums[index - 1]) };
                assert!((before + within * f64::from(sums[index]) - within * before - at).abs() <= 1e-9 * at);
            }
        }
    }
}
