//! Rays of cameras.

use kiln::bvh::detail::{Precision, RayBuffer};
use kiln::film::{TILE, Window};
use kiln::import::inline_camera;
use kiln::world::View;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::{any, zeros};
use crate::raised;

/// The rays through the pixel centres of a picture by an inline camera: origins and directions, each (height, width, 3).
#[pyfunction]
pub(crate) fn camera_rays<'py>(
    py: Python<'py>,
    camera: &str,
    size: [u32; 2],
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let [width, height] = size;
    if width == 0 || height == 0 {
        return Err(PyValueError::new_err("size: width and height must be 1 or more"));
    }
    let camera = inline_camera(camera, Some(size)).map_err(|e| raised(&e))?;
    let view = View::new(&camera, camera.projection, size).map_err(|e| raised(&e))?;
    let shape = [height as usize, width as usize, 3];
    let (mut origins, mut directions) = (zeros::<f64, 3>(py, shape)?, zeros::<f64, 3>(py, shape)?);
    let [origin, direction] = [&mut origins, &mut directions].map(|array| array.as_slice_mut());
    let (origin, direction) = (origin?.as_chunks_mut::<3>().0, direction?.as_chunks_mut::<3>().0);
    py.detach(|| {
        let mut rays = RayBuffer::default();
        for y in 0..height {
            for x in (0..width).step_by(TILE as usize) {
                let window = Window { x, y, width: TILE.min(width - x), height: 1 };
                view.rays(window, Precision::Double, &mut rays);
                let first = y as usize * width as usize + x as usize;
                for (i, ray) in rays.rays().iter().enumerate() {
                    origin[first + i] = ray.origin().to_array();
                    direction[first + i] = ray.direction().to_array();
                }
            }
        }
    });
    Ok((any(&origins), any(&directions)))
}
