//! stub
use glam::DVec3;
pub(crate) struct PreparedEnvironment {
    pub(crate) is_hidden: bool,
    pub(crate) radiance: DVec3,
}
pub(crate) struct EnvironmentSample {
    pub(crate) direction: DVec3,
    pub(crate) radiance: DVec3,
    pub(crate) pdf: f64,
}
impl PreparedEnvironment {
    pub(crate) fn eval(&self, _: DVec3) -> DVec3 {
        self.radiance
    }
    pub(crate) fn pdf(&self, _: DVec3) -> f64 {
        0.25 / std::f64::consts::PI
    }
    pub(crate) fn sample(&self, [x, y]: [f64; 2]) -> EnvironmentSample {
        let z = 1.0 - 2.0 * x;
        let r = (1.0 - z * z).max(0.0).sqrt();
        let (s, c) = (2.0 * std::f64::consts::PI * y).sin_cos();
        EnvironmentSample {
            direction: DVec3::new(r * c, r * s, z),
            radiance: self.radiance,
            pdf: self.pdf(DVec3::Z),
        }
    }
}
