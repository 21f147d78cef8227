//! Helpers shared by the test binaries. Most of them use only a part.
#![allow(dead_code)]

pub mod hard;
pub mod oracle;

pub mod borders;
pub mod gltf;
pub mod oversized_images;
pub mod picture;
pub mod places;

use std::path::{Path, PathBuf};

/// Barycentrics on corners and edges and up to a thousandth from them.
pub fn barycentrics_on_borders(numbers: &mut Numbers) -> [f64; 3] {
    let near = |numbers: &mut Numbers| numbers.one_of(&[0.0, 0.0, 1e-18, 1e-16, 1e-13, 1e-9, 1e-6, 1e-3]);
    let v = if numbers.below(2) == 0 { near(numbers) } else { numbers.fine_unit() * 0.5 };
    let w = near(numbers);
    let mut barycentrics = [1.0 - v - w, v, w];
    barycentrics.rotate_left(numbers.below(3));
    barycentrics
}

/// The origin of a secondary ray that leaves a triangle on or beside its border, on a random side; and that side's
/// normal.
pub fn origin_on_border(
    corners: [glam::DVec3; 3],
    numerics: kiln::bvh::Numerics,
    numbers: &mut Numbers,
) -> Option<(glam::DVec3, glam::DVec3)> {
    let corners = corners.map(|p| p.map(|c| numerics.precision().round(c)));
    let normal = kiln::bvh::Triangle(corners).unit_normal()?;
    let normal = if numbers.below(2) == 0 { normal } else { -normal };
    let point =
        kiln::bvh::detail::SurfacePoint::on_triangle(corners, barycentrics_on_borders(numbers), numerics);
    Some((point.origin_towards(normal, numerics), normal))
}

/// The folder of real models. Tests that call this are ignored by default, and their names begin with `with_models_`.
pub fn models() -> PathBuf {
    std::env::var_os("KILN_MODELS").expect("KILN_MODELS names the folder of the models").into()
}

/// A file of the repository.
pub fn repository(file: &str) -> PathBuf {
    let of_package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let root = of_package.ancestors().find(|folder| folder.join("Cargo.lock").exists());
    root.expect("the root of the workspace").join(file)
}

/// A deterministic sequence of numbers (PCG-XSH-RR 32, O'Neill 2014), so that tests are the same everywhere.
pub struct Numbers(u64);

impl Numbers {
    pub fn new(seed: u64) -> Self {
        Numbers(seed.wrapping_mul(2).wrapping_add(1))
    }

    pub fn next(&mut self) -> u32 {
        let old = self.0;
        self.0 = old.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let shifted = (((old >> 18) ^ old) >> 27) as u32;
        shifted.rotate_right((old >> 59) as u32)
    }

    /// From 0 up to 1.
    pub fn unit(&mut self) -> f64 {
        f64::from(self.next()) / 4_294_967_296.0
    }

    /// From -1 up to 1.
    pub fn signed(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }

    pub fn below(&mut self, n: usize) -> usize {
        ((u64::from(self.next()) * n as u64) >> 32) as usize
    }

    pub fn vector(&mut self) -> glam::DVec3 {
        glam::DVec3::new(self.signed(), self.signed(), self.signed())
    }

    /// From 0 up to 1, with all the digits of f64.
    pub fn fine_unit(&mut self) -> f64 {
        let upper = u64::from(self.next()) << 21;
        (upper | u64::from(self.next() >> 11)) as f64 / (1u64 << 53) as f64
    }

    /// From -1 up to 1 on every axis, with all the digits of f64.
    pub fn fine_vector(&mut self) -> glam::DVec3 {
        glam::DVec3::new(self.fine_unit(), self.fine_unit(), self.fine_unit()) * 2.0 - 1.0
    }

    /// A direction of length 1, every one as likely as every other.
    pub fn direction(&mut self) -> glam::DVec3 {
        loop {
            let v = self.fine_vector();
            if v.length_squared() <= 1.0 && v.length_squared() > 1e-3 {
                return v.normalize();
            }
        }
    }

    /// One of the given.
    pub fn one_of<T: Copy>(&mut self, items: &[T]) -> T {
        items[self.below(items.len())]
    }
}
