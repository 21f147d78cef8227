//! Path tracing by BSDF samples alone, by light samples alone, and by both with multiple importance sampling, depth by depth:
//! t-tests show whether they converge to the same picture.

use crate::common::picture::parse;
use crate::path::room_file;
use crate::t_test::{estimate, settings};
use kiln::effects::{Choices, LightTechnique};
use kiln::error::Warnings;
use kiln::job::prepare;
use kiln::metrics::t_test::{Estimate, TTest};

/// A box of diffuse walls with a lamp of two triangles, a ball of rough metal and a glossy dielectric one.
fn room() -> String {
    format!(
        "[[camera]]\nposition = [-1.8, 0.3, 1.7]\nlook_at = [0.5, -0.4, -0.5]\nvertical_fov = 70\n\
         [material.wall]\ncolour = '#d0b8a0'\n\
         [material.metal]\nbase_colour = '#e0c070'\nmetallic = 1\nroughness = 0.4\n\
         [material.gloss]\nbase_colour = '#4060a0'\nmetallic = 0\nroughness = 0.3\n\
         [material.lamp]\ncolour = '#000000'\nemission = '#fff0d0'\nemission_intensity = 6\n\
         [[mesh]]\nmaterial = 'wall'\nfile = '{}'\n\
         [[sphere]]\nmaterial = 'metal'\ncentre = [0.7, -1.1, -0.6]\nradius = 0.8\n\
         [[sphere]]\nmaterial = 'gloss'\ncentre = [-0.7, -1.4, -0.4]\nradius = 0.5\n\
         [[triangles]]\nmaterial = 'lamp'\nvertices = [[-0.8, 1.1, -0.8], [0.8, 1.1, -0.8], [0.8, 1.1, 0.8]]\n\
         [[triangles]]\nmaterial = 'lamp'\nvertices = [[-0.8, 1.1, -0.8], [0.8, 1.1, 0.8], [-0.8, 1.1, 0.8]]\n",
        room_file()
    )
}

const SAMPLES: u32 = 128;

fn render(technique: LightTechnique, depth: u32, seed: u32) -> Estimate {
    let job =
        prepare(parse(&room()), &settings(SAMPLES, depth, seed), &mut Warnings::default()).expect("a job");
    let choices = Choices { light_technique: technique, ..job.choices.clone() };
    estimate(&job.with_choices(choices).expect("the job with another technique"))
}

#[test]
fn techniques_converge_to_the_same_picture() {
    use LightTechnique::{Both, BsdfSamples, LightSamples};
    for depth in 1..=4 {
        let of = |technique, seed| render(technique, depth, seed);
        let first = [of(Both, 1), of(BsdfSamples, 2), of(LightSamples, 3)];
        let again = [of(Both, 4), of(BsdfSamples, 5), of(LightSamples, 6)];
        for (i, j) in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)] {
            for block in [1, 4, 8] {
                let test = TTest::between(&first[i], &again[j], block).expect("a test");
                let c = &test.channels[1];
                println!(
                    "depth {depth} {i}{j} block {block}: passed {} uniform {:.5} below {:.4} left out {} difference {:+.2e} +- {:.2e} p {:.4} histogram {:?}",
                    test.passed,
                    c.uniform.unwrap_or(-1.0),
                    c.below_low,
                    c.left_out,
                    c.difference,
                    c.standard_error,
                    c.equal_means,
                    c.histogram
                );
            }
        }
    }
}
