//! Normal maps: decoding, and limiting the perturbation.

use glam::DVec3;

/// The normal in the tangent frame for a texel `encoded`, 0 to 1: mapped to -1 to 1, x and y multiplied by `scale` (glTF 2.0,
/// section 3.9.3). Not normalised.
pub fn decode(encoded: DVec3, scale: f64) -> DVec3 {
    (2.0 * encoded - 1.0) * DVec3::new(scale, scale, 1.0)
}

/// The shading `normal` turned towards `tilted` as far as the reflection of `view` stays above the surface with the geometric normal
/// `outer`. All vectors have length 1 and lie on the side of `view`.
///
/// A normal that reflects the view into the surface would be shaded as if seen from below. Keller et al., The Iray Light Transport
/// Simulation and Rendering System (2017, appendix A.3, "Local Shading Normal Adaption") turn it until the reflection is tangential.
/// This function does the same, but on the path from the unperturbed normal: a flat normal map changes nothing, also where the
/// unperturbed normal itself reflects into the surface; that normal is then returned.
pub fn limit_tilt(normal: DVec3, tilted: DVec3, outer: DVec3, view: DVec3) -> DVec3 {
    // With n = normal + k (tilted - normal), the height of the reflection times n.n, 2 (n.v)(n.o) - (v.o)(n.n), is a k^2 + b k + c.
    let d = tilted - normal;
    let v_o = view.dot(outer);
    let c = 2.0 * normal.dot(view) * normal.dot(outer) - v_o * normal.length_squared();
    let b =
        2.0 * (d.dot(view) * normal.dot(outer) + normal.dot(view) * d.dot(outer)) - 2.0 * v_o * normal.dot(d);
    let a = 2.0 * d.dot(view) * d.dot(outer) - v_o * d.length_squared();
    if c <= 0.0 {
        return normal;
    }
    if a + b + c >= 0.0 && tilted.dot(outer) > 0.0 {
        return tilted;
    }
    // The smallest positive root, in the form without cancellation; the height at k = 0 is c > 0.
    let root = (b * b - 4.0 * a * c).max(0.0).sqrt();
    let k = if b < 0.0 { 2.0 * c / (root - b) } else { (b + root) / (-2.0 * a) };
    // Where n.v and n.o both change their sign, the height is positive again at k = 1, with a root before.
    let k = if k > 0.0 && k < 1.0 { k } else { 0.0 };
    (normal + k * d).try_normalize().unwrap_or(normal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn mirrored(view: DVec3, normal: DVec3) -> DVec3 {
        2.0 * view.dot(normal) * normal - view
    }

    #[test]
    fn texels_by_hand() {
        // 255 decodes to 1, 0 to -1; 0 lies between 127 and 128.
        assert_eq!(decode(DVec3::new(1.0, 0.0, 1.0), 0.5), DVec3::new(0.5, -0.5, 1.0));
        let flat = decode(DVec3::new(128.0, 127.0, 255.0) / 255.0, 1.0);
        assert!((flat - DVec3::new(1.0 / 255.0, -1.0 / 255.0, 1.0)).length() < 1e-15);
    }

    /// Seen from 30 degrees above a flat surface, a normal tilted away by 15 degrees reflects along it; larger tilts are limited to
    /// that.
    #[test]
    fn a_tilt_is_held_by_hand() {
        let at = |degrees: f64| DVec3::new(degrees.to_radians().sin(), degrees.to_radians().cos(), 0.0);
        let view = at(-60.0);
        for tilt in [16.0, 40.0, 80.0, 100.0, 170.0] {
            let held = limit_tilt(DVec3::Y, at(tilt), DVec3::Y, view);
            assert!((held - at(15.0)).length() < 1e-7, "{tilt}: {held}");
        }
        for tilt in [14.9, 0.0, -14.9, -60.0, -74.9] {
            assert_eq!(limit_tilt(DVec3::Y, at(tilt), DVec3::Y, view), at(tilt));
        }
    }

    fn unit(v: [f64; 3]) -> Option<DVec3> {
        DVec3::from(v).try_normalize()
    }

    proptest! {
        /// Where the unperturbed normal reflects the view above the surface, so does the limited one, for any normal map.
        #[test]
        fn nothing_is_mirrored_below(
            outer in prop::array::uniform3(-1.0f64..1.0),
            bend in prop::array::uniform3(-0.4f64..0.4),
            tilt in prop::array::uniform3(-3.0f64..3.0),
            view in prop::array::uniform3(-1.0f64..1.0),
        ) {
            let (Some(outer), Some(view)) = (unit(outer), unit(view)) else { return Ok(()) };
            let view = if view.dot(outer) < 0.0 { -view } else { view };
            let (Some(normal), Some(tilted)) =
                ((outer + DVec3::from(bend)).try_normalize(), (outer + DVec3::from(tilt)).try_normalize())
            else { return Ok(()) };
            let held = limit_tilt(normal, tilted, outer, view);
            if mirrored(view, normal).dot(outer) > 0.0 {
                prop_assert!(mirrored(view, held).dot(outer) > -1e-9, "{held}");
                prop_assert!(held.dot(view) > -1e-9 && held.dot(outer) > -1e-9, "{held}");
            } else {
                prop_assert_eq!(held, normal);
            }
        }
    }
}
