//! stub: Lambert
use glam::DVec3;
#[derive(Debug, Clone, Copy, Default)]
pub struct BsdfParameters {
    pub base_colour: DVec3,
    pub metallic: f64,
    pub roughness: f64,
    pub specular: f64,
}
#[derive(Debug, Clone, Copy)]
pub struct Bsdf {
    c: DVec3,
}
pub struct BsdfSample {
    pub direction: DVec3,
    pub weight: DVec3,
    pub pdf: f64,
    pub is_delta: bool,
    pub is_transmission: bool,
}
impl Bsdf {
    pub fn new(p: &BsdfParameters, _: DVec3) -> Self {
        Bsdf { c: p.base_colour }
    }
    pub fn eval(&self, l: DVec3) -> DVec3 {
        if l.z > 0.0 { self.c * l.z / std::f64::consts::PI } else { DVec3::ZERO }
    }
    pub fn pdf(&self, l: DVec3) -> f64 {
        l.z.max(0.0) / std::f64::consts::PI
    }
    pub fn is_delta(&self) -> bool {
        false
    }
    pub fn sample(&self, [x, y, _]: [f64; 3]) -> Option<BsdfSample> {
        let r = x.sqrt();
        let (s, c) = (2.0 * std::f64::consts::PI * y).sin_cos();
        let direction = DVec3::new(r * c, r * s, (1.0 - x).sqrt());
        Some(BsdfSample {
            direction,
            weight: self.c,
            pdf: direction.z / std::f64::consts::PI,
            is_delta: false,
            is_transmission: false,
        })
    }
}
