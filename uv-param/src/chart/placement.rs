//! Turns a layout upright, or into its smallest box.

use std::f64::consts::FRAC_PI_2;

use nalgebra::Vector3;

use crate::disk::Disk;
use crate::error::Error;
use crate::min_area_rectangle::min_area_rectangle;
use crate::triangle::Frame;

/// The mean slope of the chart towards `up`, in [0, 1], below which it lies level and has no upper side.
const MIN_SLOPE: f64 = 0.1;
/// A turn this close to a side of the smallest box is that side's: rounding must not enlarge the box of an upright wall.
const SAME_ANGLE: f64 = 1e-6;

/// Rotates and shifts `uv` into a box with its corner at the origin, and returns the box: with v along `up` where the surface
/// says what that is, else the box of smallest area with its long side along u.
pub(super) fn place(disk: &Disk, uv: &mut [[f64; 2]], up: Option<[f64; 3]>) -> Result<[f64; 2], Error> {
    let rectangle = min_area_rectangle(uv)?;
    let mut angle = rectangle.angle;
    if rectangle.height > rectangle.width {
        angle += if angle > 0.0 { -FRAC_PI_2 } else { FRAC_PI_2 };
    }
    turn(uv, angle, rectangle.corner);
    if let Some(tilt) = up.and_then(|up| tilt(disk, uv, &Vector3::from(up))) {
        let quarter = (tilt / FRAC_PI_2).round();
        if (tilt - quarter * FRAC_PI_2).abs() < SAME_ANGLE {
            quarter_turns(uv, quarter.rem_euclid(4.0) as usize);
        } else {
            turn(uv, tilt, [0.0; 2]);
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

/// Coordinates in axes that are turned by `angle` about `origin`.
fn turn(uv: &mut [[f64; 2]], angle: f64, origin: [f64; 2]) {
    let (sin, cos) = angle.sin_cos();
    for at in uv {
        let [x, y] = [at[0] - origin[0], at[1] - origin[1]];
        *at = [cos * x + sin * y, cos * y - sin * x];
    }
}

/// The same for quarters of a circle, without rounding.
fn quarter_turns(uv: &mut [[f64; 2]], quarters: usize) {
    for at in uv {
        for _ in 0..quarters {
            *at = [at[1], -at[0]];
        }
    }
}

/// Angle by which the axes must be turned so that v grows towards `up`; `None` where the chart lies level on the whole.
fn tilt(disk: &Disk, uv: &[[f64; 2]], up: &Vector3<f64>) -> Option<f64> {
    let (along_u, along_v) = gradients(disk, uv);
    let slope = [along_u.dot(up), along_v.dot(up)];
    let area: f64 = (0..disk.faces.len()).map(|f| disk.face_area(f)).sum();
    (slope[0].hypot(slope[1]) > MIN_SLOPE * area * up.norm()).then(|| (-slope[0]).atan2(slope[1]))
}

/// Directions in space in which u and v grow: their gradients, summed over the surface.
fn gradients(disk: &Disk, uv: &[[f64; 2]]) -> (Vector3<f64>, Vector3<f64>) {
    let mut sums = (Vector3::zeros(), Vector3::zeros());
    for f in 0..disk.faces.len() {
        let corners = disk.corners(f);
        let frame = Frame::new(corners);
        let jacobian = frame.jacobian(disk.faces[f].map(|v| uv[v as usize]));
        let [p0, p1, p2] = corners.map(Vector3::from);
        let x = (p1 - p0).normalize();
        let y = (p1 - p0).cross(&(p2 - p0)).cross(&x).normalize();
        sums.0 += frame.area * (jacobian.a * x + jacobian.b * y);
        sums.1 += frame.area * (jacobian.c * x + jacobian.d * y);
    }
    sums
}
