//! Four triangles side by side, so that one instruction works on all of them.

use super::Corner;

/// How many triangles a [`Quad`] holds.
pub const LANES: usize = 4;

/// Up to four triangles: `corners[k][axis][lane]`. Lanes that hold none are not numbers, and no ray hits them.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
pub struct Quad<C: Corner> {
    /// First, second and third corners.
    pub corners: [[[C::Scalar; LANES]; 3]; 3],
}

impl<C: Corner> Quad<C> {
    /// Of none.
    pub const EMPTY: Self = Quad { corners: [[[C::NONE; LANES]; 3]; 3] };

    /// Puts a triangle, or nothing, into a lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, triangle: Option<&[C; 3]>) {
        for k in 0..3 {
            let [x, y, z] = triangle.map_or([C::NONE; 3], |corners| corners[k].to_array());
            let corner = &mut self.corners[k];
            (corner[0][lane], corner[1][lane], corner[2][lane]) = (x, y, z);
        }
    }

    /// The triangle in a lane.
    #[inline(always)]
    pub fn triangle(&self, lane: usize) -> [C; 3] {
        [self.corner(0, lane), self.corner(1, lane), self.corner(2, lane)]
    }

    /// Its corners as f64 numbers.
    #[inline(always)]
    pub fn raised(&self, lane: usize) -> [[f64; 3]; 3] {
        let [a, b, c] = self.triangle(lane);
        [a.raise().to_array(), b.raise().to_array(), c.raise().to_array()]
    }

    // Without the standard library's map over arrays, which does not always become part of what calls it.
    #[inline(always)]
    fn corner(&self, k: usize, lane: usize) -> C {
        let [x, y, z] = &self.corners[k];
        C::from_array([x[lane], y[lane], z[lane]])
    }
}
