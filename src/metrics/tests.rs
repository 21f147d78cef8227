//! Figures with values in closed form.

use super::*;

const WIDTH: u32 = 40;
const HEIGHT: u32 = 20;
const PIXELS: f64 = 800.0;

fn uniform(value: f32, values: Values) -> ComparedImage {
    let pixels = vec![[value; 3]; (WIDTH * HEIGHT) as usize];
    ComparedImage { width: WIDTH, height: HEIGHT, values, pixels, alpha: None }
}

fn figures(a: &ComparedImage, b: &ComparedImage) -> Figures {
    Errors::between(a, b).unwrap().figures.unwrap()
}

fn worst(a: &ComparedImage, b: &ComparedImage) -> Vec<Worst> {
    Errors::between(a, b).unwrap().worst
}

#[test]
fn identical_images_have_no_error() {
    let a = uniform(0.25, Values::Linear);
    let errors = Errors::between(&a, &a).unwrap();
    let expected = Figures {
        max: 0.0,
        rmse: 0.0,
        rel_mse: 0.0,
        psnr: None,
        flip: 0.0,
        differing: 0.0,
        beyond_step: 0.0,
    };
    assert!(errors.same && errors.worst.is_empty());
    assert_eq!(errors.figures, Some(expected));
}

#[test]
fn an_offset_is_the_error_of_every_pixel() {
    // 1/4 and 3/4 are exact: the difference is 1/2, its square 1/4, and 10 log10 4 = 6.0206 dB.
    let (a, b) = (uniform(0.25, Values::Display), uniform(0.75, Values::Display));
    let figures = figures(&a, &b);
    assert_eq!((figures.max, figures.rmse, figures.differing), (0.5, 0.5, 1.0));
    assert!((figures.rel_mse - 0.25 / (0.0625 + 0.01)).abs() < 1e-12);
    assert!((figures.psnr.unwrap() - 10.0 * 4f64.log10()).abs() < 1e-12);
    // One pixel per square: the first five of 3 x 2 squares.
    assert_eq!(worst(&a, &b).len(), WORST);
}

#[test]
fn one_pixel_off_is_found_where_it_is() {
    let a = uniform(0.5, Values::Display);
    let mut b = a.clone();
    b.pixels[(7 * WIDTH + 23) as usize][1] = 1.0;
    let figures = figures(&a, &b);
    assert_eq!(figures.max, 0.5);
    // One channel of 3 * 800 is off by 1/2.
    assert!((figures.rmse - (0.25 / (3.0 * PIXELS)).sqrt()).abs() < 1e-15);
    assert_eq!(figures.differing, 1.0 / PIXELS);
    let expected =
        Worst { x: 23, y: 7, difference: 0.5, reference: [0.5; 3], test: [0.5, 1.0, 0.5], alpha: None };
    assert_eq!(worst(&a, &b), [expected]);
    assert!(figures.flip > 0.0 && figures.flip < 0.5, "{}", figures.flip);
}

/// Of 800 pixels one is a step of 255 off, one two steps.
#[test]
fn pixels_more_than_a_step_apart_are_counted() {
    let a = uniform(0.5, Values::Display);
    let mut b = a.clone();
    for (pixel, steps) in [(3, 1.0), (5, 2.0)] {
        b.pixels[pixel][2] = 0.5 + steps / 255.0;
    }
    let figures = figures(&a, &b);
    assert_eq!((figures.differing, figures.beyond_step), (2.0 / PIXELS, 1.0 / PIXELS));
}

/// Linear values are compared unclamped; FLIP and PSNR use display values, which are clamped at 1.
#[test]
fn linear_values_above_1_do_not_change_display_metrics() {
    let figures = figures(&uniform(1.0, Values::Linear), &uniform(3.0, Values::Linear));
    assert_eq!((figures.max, figures.rmse, figures.psnr, figures.flip), (2.0, 2.0, None, 0.0));
    assert!((figures.rel_mse - 4.0 / 1.01).abs() < 1e-12);
}

#[test]
fn black_and_white_are_the_extremes() {
    let figures = figures(&uniform(0.0, Values::Display), &uniform(1.0, Values::Display));
    assert_eq!((figures.max, figures.rmse, figures.psnr), (1.0, 1.0, Some(0.0)));
    assert!((figures.rel_mse - 100.0).abs() < 1e-9, "1 / 0.01");
}

#[test]
fn different_encodings_are_compared_as_display_values() {
    // sRGB encodes 0.5 as 0.7354 (IEC 61966-2-1).
    let errors = Errors::between(&uniform(0.5, Values::Linear), &uniform(0.5, Values::Display)).unwrap();
    assert_eq!(errors.values, Values::Display);
    assert!((errors.figures.unwrap().max - 0.235_357).abs() < 1e-6);
    let white = Errors::between(&uniform(1.0, Values::Linear), &uniform(1.0, Values::Display)).unwrap();
    assert!(!white.same && white.figures.unwrap().max == 0.0);
}
