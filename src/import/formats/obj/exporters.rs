//! Values of MTL files that exporters write in a sense of their own. They are converted to that of the format, with
//! notes.

use std::path::Path;

use crate::error::Warnings;
use crate::import::formats::obj::pbr;
use crate::import::meshes::colours::MAX_UNIT;

/// Converts a material; returns whether it was changed.
type Conversion<'a> = &'a dyn Fn(&mut tobj::Material) -> bool;

/// Converts the materials of a file.
pub(super) fn convert(materials: &mut [tobj::Material], file: &Path, warnings: &mut Warnings) {
    let components = || materials.iter().filter_map(|m| m.diffuse).flatten();
    let are_bytes = components().all(|c| c.fract() == 0.0) && components().any(|c| c > 1.0);
    let conventions: [(_, Conversion); 4] = [
        ("colours above 1 are read on a scale of 0 to 255", &|m| from_bytes(m, are_bytes)),
        ("`Kd 0 0 0` beside map_Kd is read as white, as Maya writes it", &whiten),
        ("`Tf` of `illum 4` without `d` is read as 1 - transparency, as Maya writes it", &invert_filter),
        ("`Tr 1` is read as opaque, as some exporters write it", &|m| {
            m.dissolve.is_none()
                && pbr::number(m, "Tr") >= Some(1.0)
                && m.unknown_param.remove("Tr").is_some()
        }),
    ];
    for (what, convert) in conventions {
        let mut converted = materials.iter_mut().filter_map(|m| convert(m).then_some(&m.name));
        if let Some(first) = converted.next() {
            let more = match converted.count() {
                0 => String::new(),
                count => format!(" and {count} more"),
            };
            warnings.note(format!("{}: {what}: material `{first}`{more}", file.display()));
        }
    }
}

/// Divides colours by 255, if `are_bytes` or `Kd` is above [`MAX_UNIT`]: `Kd`, and others above 1.
fn from_bytes(m: &mut tobj::Material, are_bytes: bool) -> bool {
    let is_above = |colour: &[f64; 3], limit| colour.iter().any(|&c| c > limit);
    let in_bytes = m.diffuse.is_some_and(|kd| are_bytes || is_above(&kd, MAX_UNIT));
    let others = [&mut m.specular, &mut m.emissive].into_iter().flatten().filter(|c| is_above(c, 1.0));
    if in_bytes {
        m.diffuse.iter_mut().chain(others).flatten().for_each(|c| *c /= 255.0);
    }
    in_bytes
}

/// Leaves out a `Kd` of 0 beside a `map_Kd`.
fn whiten(m: &mut tobj::Material) -> bool {
    let is_black = m.diffuse == Some([0.0; 3]) && m.diffuse_texture.is_some();
    m.diffuse.take_if(|_| is_black).is_some()
}

/// Converts `Tf` of Maya, whose materials have `illum 4` and no `d`: to the filter of glass for an index above 1, else
/// to `d`. Returns whether that differs from the material without `Tf`.
fn invert_filter(m: &mut tobj::Material) -> bool {
    let has_opacity = m.dissolve.is_some() || m.unknown_param.contains_key("Tr");
    let Some(filter) = pbr::filter(m).filter(|_| m.illumination_model == Some(4) && !has_opacity) else {
        return false;
    };
    if m.optical_density.is_some_and(|ior| ior > 1.0) {
        let [r, g, b] = filter.to_array().map(|c| 1.0 - c);
        m.unknown_param.insert("Tf".into(), format!("{r} {g} {b}"));
        return true;
    }
    m.unknown_param.remove("Tf");
    m.dissolve = Some(filter.element_sum() / 3.0).filter(|&opacity| opacity < 1.0);
    m.dissolve.is_some()
}
