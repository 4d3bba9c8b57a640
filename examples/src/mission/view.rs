//! Pictures of the surface as somebody standing before it sees it.

use nalgebra::{Point3, UnitVector3, Vector3};
use paint_sim::{Camera, Frame, Hit, Lights, Shading, render};

use super::decision::Decision;
use super::error::MissionError;
use crate::pictures::Rgb;

/// Width and height of the rendered views, pixels.
const VIEW: (u32, u32) = (1500, 940);
/// Share of the view that the surface fills.
const FILL: f64 = 0.86;

/// The surface in the light of a sun behind the camera's shoulder.
pub(super) fn view(
    decision: &Decision,
    camera: &Camera,
    shade: &(dyn Fn(&Hit) -> Shading + Sync),
) -> Result<Frame, MissionError> {
    let away = -(camera.world_from_camera.rotation * Vector3::z());
    let side = Vector3::z().cross(&away);
    let lights = Lights {
        towards_sun: UnitVector3::new_normalize(away + 0.75 * Vector3::z() + 0.35 * side),
        sun: [0.95, 0.9, 0.8],
        ambient: [0.28, 0.30, 0.34],
        ..Lights::default()
    };
    Ok(render(&decision.surface.world, camera, shade, &lights, 2, decision.settings.threads)?)
}

/// A camera on the surface's mean side that has all the points in view.
pub(super) fn camera(decision: &Decision, points: &[Point3<f64>]) -> Result<Camera, MissionError> {
    let (low, high) = points
        .iter()
        .fold((Vector3::repeat(f64::MAX), Vector3::repeat(f64::MIN)), |(l, h), p| (l.inf(&p.coords), h.sup(&p.coords)));
    let centre = (low + high) / 2.0;
    let facing = decision.surface.facing();
    let flat = Vector3::new(facing.x, facing.y, 0.0);
    let front: Vector3<f64> = flat.try_normalize(0.1).unwrap_or(-Vector3::x());
    let side: Vector3<f64> = Vector3::z().cross(&front);
    let direction = (front + side * 0.45 + Vector3::z() * 0.28).normalize();
    let up = Vector3::z();
    // Step back until everything fits, then look at the middle of what is seen.
    let (mut target, mut distance) = (centre, 0.8 * (high - low).norm());
    for _ in 0..40 {
        let eye = Point3::from(target + direction * distance);
        let camera = Camera::looking_at(&eye, &Point3::from(target), &up, 0.8, VIEW)?;
        let seen = points.iter().map(|p| camera.world_from_camera.inverse_transform_point(p));
        let (mut left, mut right, mut top, mut bottom) = (f64::MAX, f64::MIN, f64::MAX, f64::MIN);
        for p in seen {
            let (u, v) = (p.x / p.z.max(0.1), p.y / p.z.max(0.1));
            (left, right) = (left.min(u), right.max(u));
            (top, bottom) = (top.min(v), bottom.max(v));
        }
        let (half_width, half_height) = (camera.cx / camera.fx, camera.cy / camera.fy);
        let fill = ((right - left) / (2.0 * half_width)).max((bottom - top) / (2.0 * half_height));
        let shift = Vector3::new(0.5 * (left + right), 0.5 * (top + bottom), 0.0) * distance;
        target += camera.world_from_camera.rotation * shift;
        distance *= 1.0 + 0.7 * (fill / FILL - 1.0).clamp(-0.5, 0.5);
    }
    Ok(Camera::looking_at(&Point3::from(target + direction * distance), &Point3::from(target), &up, 0.8, VIEW)?)
}

pub(super) fn picture_of(frame: &Frame) -> Rgb {
    Rgb::from_pixels(frame.width as usize, frame.height as usize, frame.colour.iter().copied())
}
