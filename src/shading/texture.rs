//! Looking pictures up: bilinear, at full size.

use glam::{DVec2, DVec3};

use crate::scene::Wrap;
use crate::world::{Image, LoweredTexture, World};

/// The colour of a picture at `uv`, in the numbers of the pipeline.
pub fn colour_at(world: &World, texture: &LoweredTexture, uv: DVec2) -> DVec3 {
    let image = &world.images[texture.image as usize];
    bilinear(image, texture, uv, |c| f64::from(image.colours[c as usize]))
}

/// The plain numbers of a picture at `uv`, 0 to 1.
pub fn numbers_at(world: &World, texture: &LoweredTexture, uv: DVec2) -> DVec3 {
    bilinear(&world.images[texture.image as usize], texture, uv, |c| f64::from(c) / 255.0)
}

fn bilinear(image: &Image, texture: &LoweredTexture, uv: DVec2, meaning: impl Fn(u8) -> f64) -> DVec3 {
    let (w, h) = (i64::from(image.width), i64::from(image.height));
    // Pixel centres lie at half-integers.
    let place = uv * DVec2::new(w as f64, h as f64) - 0.5;
    let (corner, share) = (place.floor(), place - place.floor());
    // Saturates where coordinates are absurd; wrapping then still gives a pixel of the picture.
    let (x, y) = (corner.x as i64, corner.y as i64);
    let pixel = |dx: i64, dy: i64| {
        let column = wrap(x.saturating_add(dx), w, texture.sampler.wrap_u);
        let row = wrap(y.saturating_add(dy), h, texture.sampler.wrap_v);
        DVec3::from(image.pixels[(row * w + column) as usize].map(&meaning))
    };
    let top = pixel(0, 0).lerp(pixel(1, 0), share.x);
    let bottom = pixel(0, 1).lerp(pixel(1, 1), share.x);
    top.lerp(bottom, share.y)
}

fn wrap(i: i64, size: i64, mode: Wrap) -> i64 {
    match mode {
        Wrap::Repeat => i.rem_euclid(size),
        Wrap::ClampToEdge => i.clamp(0, size - 1),
        Wrap::MirroredRepeat => {
            let i = i.rem_euclid(2 * size);
            i.min(2 * size - 1 - i)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrapping() {
        let row = |mode| (-3..6).map(|i| wrap(i, 3, mode)).collect::<Vec<_>>();
        assert_eq!(row(Wrap::Repeat), [0, 1, 2, 0, 1, 2, 0, 1, 2]);
        assert_eq!(row(Wrap::ClampToEdge), [0, 0, 0, 0, 1, 2, 2, 2, 2]);
        assert_eq!(row(Wrap::MirroredRepeat), [2, 1, 0, 0, 1, 2, 2, 1, 0]);
        assert_eq!(wrap(i64::MAX, 3, Wrap::Repeat), i64::MAX % 3);
    }
}
