//! Proofs of the whole BSDF: white furnace, chi-squared tests of the sampling, reciprocity, extreme values.

mod furnace;
mod robustness;
mod sampling;

use glam::DVec3;

use super::fresnel::{refracted_cosine, relative_index};
use super::ggx::refract;
use super::quadrature::{Peak, direction};
use super::*;

/// A view with a cosine and the azimuth 0.7, so that no axis is special.
fn view(cos: f64) -> DVec3 {
    direction(cos, 0.7)
}

/// A dielectric, where the default is a metal.
fn dielectric() -> BsdfParameters {
    BsdfParameters { metallic: 0.0, ..Default::default() }
}

/// Fully transmitting glass.
fn glass(from_inside: bool) -> BsdfParameters {
    BsdfParameters { transmission: 1.0, from_inside, ..dielectric() }
}

/// The directions near which a BSDF may have peaks: reflected, refracted and straight through. Lobes fall off with
/// alpha at normal incidence; at grazing views, reflections become narrow across the plane of incidence.
fn peaks(p: &BsdfParameters, view: DVec3) -> Vec<Peak> {
    let peak = |direction: DVec3, roughness: f64| Peak {
        direction,
        width: if roughness < 0.01 { 1.0 } else { roughness * roughness },
    };
    let mirror = DVec3::new(-view.x, -view.y, view.z);
    let mut peaks = vec![peak(mirror, p.roughness)];
    if p.clearcoat > 0.0 {
        peaks.push(peak(mirror, p.clearcoat_roughness));
    }
    if p.transmission > 0.0 {
        let eta = relative_index(p.ior, p.from_inside);
        if p.thin_walled {
            peaks.push(peak(-view, p.roughness * (2.0 * p.ior - 2.0).clamp(0.0, 1.0)));
        } else if eta != 0.0 && eta.is_finite() {
            // A refracted lobe has about the width alpha (eta - 1), and contains the direction straight through.
            let width = p.roughness * (eta - 1.0).abs().min(1.0).sqrt();
            peaks.push(peak(-view, width));
            let refracted = refracted_cosine(eta, view.z);
            peaks.extend(refracted.map(|cos| peak(refract(view, DVec3::Z, eta, view.z, cos), width)));
        }
    }
    peaks
}
