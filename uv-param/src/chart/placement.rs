//! Turns a layout into its smallest box.

use std::f64::consts::FRAC_PI_2;

use nalgebra::Vector3;

use crate::disk::Disk;
use crate::error::Error;
use crate::min_area_rectangle::min_area_rectangle;
use crate::triangle::Frame;

/// Rotates and shifts `uv` so that its box of smallest area has its corner at the origin and its long side along u;
/// returns the box.
pub(super) fn place(disk: &Disk, uv: &mut [[f64; 2]], up: Option<[f64; 3]>) -> Result<[f64; 2], Error> {
    let rectangle = min_area_rectangle(uv)?;
    let mut angle = rectangle.angle;
    if rectangle.height > rectangle.width {
        angle += if angle > 0.0 { -FRAC_PI_2 } else { FRAC_PI_2 };
    }
    let (sin, cos) = angle.sin_cos();
    for at in uv.iter_mut() {
        let [x, y] = [at[0] - rectangle.corner[0], at[1] - rectangle.corner[1]];
        *at = [cos * x + sin * y, cos * y - sin * x];
    }
    if up.is_some_and(|up| upward(disk, uv).dot(&Vector3::from(up)) < 0.0) {
        for at in uv.iter_mut().flatten() {
            *at = -*at;
        }
    }
    // The extremes are taken from the turned points: then the box holds them exactly.
    let mut size = [0.0; 2];
    for k in 0..2 {
        let low = uv.iter().map(|at| at[k]).fold(f64::INFINITY, f64::min);
        for at in uv.iter_mut() {
            at[k] -= low;
        }
        size[k] = uv.iter().map(|at| at[k]).fold(0.0, f64::max);
    }
    Ok(size)
}

/// Direction in space in which v grows: the mean gradient of v over the surface.
fn upward(disk: &Disk, uv: &[[f64; 2]]) -> Vector3<f64> {
    (0..disk.faces.len())
        .map(|f| {
            let corners = disk.corners(f);
            let frame = Frame::new(corners);
            let jacobian = frame.jacobian(disk.faces[f].map(|v| uv[v as usize]));
            let [p0, p1, p2] = corners.map(Vector3::from);
            let x = (p1 - p0).normalize();
            let y = (p1 - p0).cross(&(p2 - p0)).cross(&x).normalize();
            frame.area * (jacobian.c * x + jacobian.d * y)
        })
        .sum()
}
