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
    /// Of at most [`LANES`] triangles.
    pub fn new(triangles: &[[C; 3]]) -> Self {
        let mut corners = [[[C::NONE; LANES]; 3]; 3];
        for (lane, triangle) in triangles.iter().enumerate() {
            for (k, corner) in triangle.iter().enumerate() {
                let [x, y, z] = corner.to_array();
                (corners[k][0][lane], corners[k][1][lane], corners[k][2][lane]) = (x, y, z);
            }
        }
        Quad { corners }
    }

    /// The triangle in a lane.
    #[inline(always)]
    pub fn triangle(&self, lane: usize) -> [C; 3] {
        self.corners.map(|[x, y, z]| C::from_array([x[lane], y[lane], z[lane]]))
    }
}
