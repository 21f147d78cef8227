//! Adaptive quadrature over the sphere, for tests.

use std::f64::consts::PI;

use glam::DVec3;

/// A direction by the cosine to z and the azimuth.
pub(crate) fn direction(z: f64, phi: f64) -> DVec3 {
    let sine = ((1.0 - z) * (1.0 + z)).max(0.0).sqrt();
    DVec3::new(sine * phi.cos(), sine * phi.sin(), z)
}

/// A rectangle in polar angle and azimuth (radians): [theta from, to, phi from, to].
pub(crate) type Cell = [f64; 4];

/// The nodes and weights of Lobatto's rule with 4 points on -1 to 1, exact to degree 5. It has the ends among its
/// nodes: rules without miss thin strips beyond a jump, such as the edge of a refraction lobe, on all levels of
/// subdivision.
const LOBATTO: [(f64, f64); 4] = [
    (-1.0, 1.0 / 6.0),
    (-0.447_213_595_499_957_9, 5.0 / 6.0),
    (0.447_213_595_499_957_9, 5.0 / 6.0),
    (1.0, 1.0 / 6.0),
];

/// The deepest subdivision: cells of 2^-20 of the first.
const MAX_DEPTH: u32 = 20;

/// A direction near which the integrand changes fast, and the angle within which it does (radians).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Peak {
    pub(crate) direction: DVec3,
    pub(crate) width: f64,
}

/// The integral of `function` per solid angle over a cell, with an error of about `tolerance`. Cells are divided in
/// four until the rule on the parts agrees with that on the whole, and while they are larger than their distance to a
/// peak or its width, whichever is greater.
pub(crate) fn integrate(
    function: &impl Fn(DVec3) -> DVec3,
    cell: Cell,
    peaks: &[Peak],
    tolerance: f64,
) -> DVec3 {
    subdivide(function, cell, peaks, tolerance, rule(function, cell), 0)
}

/// Whether a cell is too large for its distance to a peak.
fn is_coarse([theta0, theta1, phi0, phi1]: Cell, peaks: &[Peak]) -> bool {
    let theta = 0.5 * (theta0 + theta1);
    let centre = direction(theta.cos(), 0.5 * (phi0 + phi1));
    let size = (theta1 - theta0).max(theta.sin() * (phi1 - phi0));
    peaks.iter().any(|peak| size > peak.width + (centre - peak.direction).length())
}

fn rule(function: &impl Fn(DVec3) -> DVec3, [theta0, theta1, phi0, phi1]: Cell) -> DVec3 {
    let (theta, phi) = (0.5 * (theta0 + theta1), 0.5 * (phi0 + phi1));
    let (h, k) = (0.5 * (theta1 - theta0), 0.5 * (phi1 - phi0));
    let mut sum = DVec3::ZERO;
    for (x, u) in LOBATTO {
        let (sine, cosine) = (theta + h * x).sin_cos();
        for (y, v) in LOBATTO {
            let (sin, cos) = (phi + k * y).sin_cos();
            sum += function(DVec3::new(sine * cos, sine * sin, cosine)) * (u * v * sine);
        }
    }
    sum * (h * k)
}

fn subdivide(
    function: &impl Fn(DVec3) -> DVec3,
    cell: Cell,
    peaks: &[Peak],
    tolerance: f64,
    whole: DVec3,
    depth: u32,
) -> DVec3 {
    let [theta0, theta1, phi0, phi1] = cell;
    let (theta, phi) = (0.5 * (theta0 + theta1), 0.5 * (phi0 + phi1));
    let cells = [
        [theta0, theta, phi0, phi],
        [theta0, theta, phi, phi1],
        [theta, theta1, phi0, phi],
        [theta, theta1, phi, phi1],
    ];
    let parts = cells.map(|cell| rule(function, cell));
    let sum: DVec3 = parts.iter().sum();
    let divide = is_coarse(cell, peaks) || (sum - whole).abs().max_element() > tolerance;
    if depth >= MAX_DEPTH || !divide {
        return sum;
    }
    // Parts that need more lie along jumps, twice as many on each level, with errors of random sign.
    let next = std::f64::consts::FRAC_1_SQRT_2 * tolerance;
    (0..4).map(|i| subdivide(function, cells[i], peaks, next, parts[i], depth + 1)).sum()
}

/// The integral of `function` over the sphere, with cells that meet at z and at each of `peaks`.
pub(crate) fn integrate_sphere(function: &impl Fn(DVec3) -> DVec3, peaks: &[Peak], tolerance: f64) -> DVec3 {
    let mut thetas = vec![0.0, 0.25 * PI, 0.5 * PI, 0.75 * PI, PI];
    let mut phis: Vec<f64> = (0..=4).map(|i| f64::from(i) * 0.5 * PI).collect();
    thetas.extend(peaks.iter().map(|peak| peak.direction.z.clamp(-1.0, 1.0).acos()));
    phis.extend(peaks.iter().map(|peak| peak.direction.y.atan2(peak.direction.x).rem_euclid(2.0 * PI)));
    thetas.sort_by(f64::total_cmp);
    phis.sort_by(f64::total_cmp);
    let mut sum = DVec3::ZERO;
    for theta in thetas.windows(2) {
        for phi in phis.windows(2) {
            sum += integrate(function, [theta[0], theta[1], phi[0], phi[1]], peaks, tolerance);
        }
    }
    sum
}

/// The area of the sphere is 4 pi; cos^2 integrates to 4 pi / 3; a narrow peak exp(-(1 - d.p) / s) to 2 pi s.
#[test]
fn integrals_by_hand() {
    let peak = direction(0.3, 1.0);
    let function = |d: DVec3| DVec3::new(1.0, d.z * d.z, ((d.dot(peak) - 1.0) / 1e-5).exp());
    let narrow = Peak { direction: peak, width: 1e-3 };
    let is = integrate_sphere(&function, &[narrow], 1e-8);
    let expected = DVec3::new(4.0 * PI, 4.0 * PI / 3.0, 2e-5 * PI);
    assert!((is - expected).abs().max_element() < 1e-6, "{is}");
    assert!((is.z / expected.z - 1.0).abs() < 1e-3, "{is}");
}
