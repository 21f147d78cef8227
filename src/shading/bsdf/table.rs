//! Tables over the unit interval, square or cube, interpolated linearly, and the quadrature that fills them.

/// Values at the nodes of a regular grid of `D` dimensions that covers 0 to 1 in each, `C` values a node.
pub(crate) struct Table<const D: usize, const C: usize> {
    nodes: [usize; D],
    values: Vec<[f64; C]>,
}

impl<const D: usize, const C: usize> Table<D, C> {
    /// The values of `function` at `nodes` (2 or more) equidistant positions of each dimension. The last runs fastest.
    pub(crate) fn new(nodes: [usize; D], mut function: impl FnMut([f64; D]) -> [f64; C]) -> Self {
        let position = |mut index: usize| {
            let mut at = [0.0; D];
            for d in (0..D).rev() {
                at[d] = (index % nodes[d]) as f64 / (nodes[d] - 1) as f64;
                index /= nodes[d];
            }
            at
        };
        let values = (0..nodes.iter().product()).map(|index| function(position(index))).collect();
        Table { nodes, values }
    }

    /// A table of given values, in the order of [`Table::new`].
    pub(crate) fn from_values(nodes: [usize; D], values: Vec<[f64; C]>) -> Self {
        assert_eq!(values.len(), nodes.iter().product::<usize>());
        Table { nodes, values }
    }

    /// A table of stored values, in the order of [`Table::new`]: eight bytes each, the least significant first.
    pub(crate) fn from_bytes(nodes: [usize; D], bytes: &[u8]) -> Self {
        let (numbers, _) = bytes.as_chunks::<8>();
        let (values, _) = numbers.as_chunks::<C>();
        Self::from_values(nodes, values.iter().map(|node| node.map(f64::from_le_bytes)).collect())
    }

    /// The values of all nodes.
    pub(crate) fn values(&self) -> &[[f64; C]] {
        &self.values
    }

    /// The multilinear interpolation at a position, each coordinate clamped to 0 to 1.
    #[inline]
    pub(crate) fn at(&self, position: [f64; D]) -> [f64; C] {
        let (mut base, mut fraction, mut stride) = (0, [0.0; D], [0; D]);
        let mut step = 1;
        for d in (0..D).rev() {
            let scaled = position[d].clamp(0.0, 1.0) * (self.nodes[d] - 1) as f64;
            let cell = (scaled as usize).min(self.nodes[d] - 2);
            fraction[d] = scaled - cell as f64;
            stride[d] = step;
            base += cell * step;
            step *= self.nodes[d];
        }
        let mut sum = [0.0; C];
        for corner in 0..1usize << D {
            let (mut index, mut weight) = (base, 1.0);
            for d in 0..D {
                let upper = corner >> d & 1 == 1;
                index += if upper { stride[d] } else { 0 };
                weight *= if upper { fraction[d] } else { 1.0 - fraction[d] };
            }
            for (total, value) in sum.iter_mut().zip(self.values[index]) {
                *total += weight * value;
            }
        }
        sum
    }
}

/// The points of a Fibonacci lattice in the unit square, all of equal weight; `numbers` are two successive Fibonacci
/// numbers, the first the count.
pub(crate) fn lattice(numbers: [usize; 2]) -> impl Iterator<Item = [f64; 2]> {
    let [count, step] = numbers;
    (0..count).map(move |i| [i, i * step % count].map(|k| (k as f64 + 0.5) / count as f64))
}

/// The tent transform of a coordinate of [`lattice`]. It makes the error second order in the count where the integrand
/// is smooth (Hickernell, Obtaining O(N^(-2+e)) Convergence for Lattice Quadrature Rules, MCQMC 2000), and greater at
/// jumps.
pub(crate) fn tent(x: f64) -> f64 {
    1.0 - (2.0 * x - 1.0).abs()
}

/// Checks that the table in a file beside this one has the values of a function, up to rounding. With the environment
/// variable KILN_WRITE_TABLES, it writes that file.
#[cfg(test)]
pub(crate) fn check_stored<const D: usize, const C: usize>(
    file: &str,
    stored: &[u8],
    nodes: [usize; D],
    function: impl FnMut([f64; D]) -> [f64; C],
) {
    let made = Table::new(nodes, function);
    if std::env::var_os("KILN_WRITE_TABLES").is_some() {
        let bytes: Vec<u8> = made.values().as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src/shading/bsdf");
        std::fs::write(folder.join(file), bytes).expect("the table is written");
        return;
    }
    let stored = Table::<D, C>::from_bytes(nodes, stored);
    for (stored, made) in stored.values().as_flattened().iter().zip(made.values().as_flattened()) {
        assert!((stored - made).abs() <= 1e-12, "{file}: {stored} instead of {made}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Linear interpolation in three dimensions reproduces a function that is linear in each of them.
    #[test]
    fn multilinear_functions_are_exact() {
        let function = |p: [f64; 3]| [1.0 + 2.0 * p[0] * p[1] - p[2], p[0] * p[1] * p[2]];
        let table = Table::new([3, 4, 6], function);
        for p in [[0.0; 3], [1.0; 3], [0.3, 0.9, 0.51], [0.99, 0.01, 0.2]] {
            let (is, expected) = (table.at(p), function(p));
            assert!((is[0] - expected[0]).abs() < 1e-14 && (is[1] - expected[1]).abs() < 1e-14);
        }
        assert_eq!(table.at([7.0, 1.0, 0.0]), table.at([1.0, 1.0, 0.0]));
    }

    /// int x^2 y^3 = 1 / 12.
    #[test]
    fn lattice_integrates() {
        let sum: f64 = lattice([377, 233]).map(|[x, y]| tent(x).powi(2) * tent(y).powi(3)).sum();
        assert!((sum / 377.0 - 1.0 / 12.0).abs() < 1e-4, "{sum}");
    }
}
