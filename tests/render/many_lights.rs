//! Scenes with many lights: light adds up, whichever tree chooses among the lights.

use std::fmt::Write;

use crate::adaptive::{Mean, mean_of};
use crate::common::picture::parse;
use crate::path::room_file;
use kiln::scene::{Sampling, Scene};

/// Lamps of each kind.
const EACH: usize = 5;
const KINDS: usize = 5;

/// A room with lamps of five kinds in places that look random, one on a half of the usual intensity, or `alone` of all with
/// more than a billionth of it. A floor of rough metal finds the surfaces among them by its own samples, too.
fn room(alone: Option<usize>) -> Scene {
    let mut text = format!(
        "[image]\ntransport = 'path'\n\
         [[camera]]\nposition = [-1.8, 0.3, 1.7]\nlook_at = [0.5, -0.4, -0.5]\nvertical_fov = 70\n\
         [material.wall]\ncolour = '#d0b8a0'\n\
         [material.metal]\ncolour = '#e0c070'\nmetallic = 1\nroughness = 0.3\n\
         [[mesh]]\nmaterial = 'wall'\nfile = '{}'\n\
         [[triangles]]\nmaterial = 'metal'\nvertices = [[-1.9, -1.8, -1.9], [1.9, -1.8, -1.9], [1.9, -1.8, 1.9], [-1.9, -1.8, 1.9]]\n\
         indices = [[0, 2, 1], [0, 3, 2]]\n",
        room_file()
    );
    for lamp in 0..EACH * KINDS {
        let random = |k: usize| ((lamp * 7919 + k * 104_729 + 31) % 997) as f64 / 498.5 - 1.0;
        let [x, y, z] = [1.6 * random(1), 0.6 + random(2), 1.6 * random(3)];
        let usual = 0.3 + random(4).abs();
        let intensity = if alone.is_none_or(|alone| alone == lamp) { usual } else { 1e-9 * usual };
        let at = format!("position = [{x}, {y}, {z}]\nintensity = {intensity}");
        let [across, along] = [x + 0.2, z + 0.2];
        let emission = 5.0 * intensity;
        let lamp = match lamp % KINDS {
            0 => format!("[[light]]\ntype = 'point'\nfalloff = 'inverse-square'\n{at}\n"),
            1 => format!("[[light]]\ntype = 'sphere'\nradius = 0.1\n{at}\n"),
            2 => format!(
                "[[light]]\ntype = 'rectangle'\nsize = [0.3, 0.2]\ndirection = [0.2, -1, 0.1]\n{at}\n"
            ),
            3 => format!("[[light]]\ntype = 'disk'\nradius = 0.12\ndirection = [0.1, -1, 0.3]\n{at}\n"),
            _ => format!(
                "[material.lamp{lamp}]\ncolour = '#000000'\nemission = '#ffffff'\nemission_intensity = {emission}\n\
                 [[triangles]]\nmaterial = 'lamp{lamp}'\nvertices = [[{x}, {y}, {z}], [{across}, {y}, {z}], [{x}, {y}, {along}]]\n\
                 indices = [[0, 1, 2]]\n"
            ),
        };
        let _ = write!(text, "{lamp}");
    }
    parse(&text)
}

/// The light of all lamps is the sum of that of each, whose picture hardly depends on how lamps are chosen: 3.5 standard
/// errors, which differ by chance once in 2,000 tests.
#[test]
fn light_of_many_lamps_adds_up() {
    let (size, seeds) = ([24, 18], 16);
    let sampling = Sampling { samples: Some(64), ..Sampling::default() };
    let all = mean_of(&room(None), size, sampling, 1..seeds + 1);
    let each = (0..EACH * KINDS).map(|lamp| mean_of(&room(Some(lamp)), size, sampling, 101..101 + seeds / 2));
    let sum = each.fold(Mean { value: 0.0, error: 0.0 }, |sum, one| Mean {
        value: sum.value + one.value,
        error: sum.error.hypot(one.error),
    });
    let error = all.error.hypot(sum.error);
    println!("{} +- {}, {} +- {}", all.value, all.error, sum.value, sum.error);
    assert!((all.value - sum.value).abs() < 3.5 * error, "{} and {}, +- {error}", all.value, sum.value);
    assert!(error < 0.005 * sum.value, "{error}");
}
