//! Pictures of the surface as somebody standing before it sees it.

use nalgebra::{Point3, UnitVector3, Vector3};
use paint_sim::render::{Frame, Lights, Shading};
use paint_sim::surface::Hit;
use paint_sim::{Camera, Surface, render};

use super::error::MissionError;
use super::painting_task::PaintingTask;
use crate::pictures::Rgb;

/// Width and height of the rendered views, pixels.
const VIEW: (u32, u32) = (1500, 940);
/// Share of the view that the surface fills.
const FILL: f64 = 0.86;
/// Directions of the camera beside the usual one, in lengths to the side and up for one forward.
const OTHER_SIDES: [[f64; 2]; 8] =
    [[-0.45, 0.28], [0.0, 0.28], [0.9, 0.28], [-0.9, 0.28], [0.0, 0.8], [0.6, 0.8], [-0.6, 0.8], [0.0, 0.0]];
/// Places on the surface that are asked whether they are seen.
const LOOKED_AT: usize = 500;
/// Depth before the eye below which nothing can be drawn, metres.
const NEAREST: f64 = 0.1;
/// Hits as near as this to a place are the place itself, metres.
const OWN_SURFACE: f64 = 0.01;

/// The surface in the light that is asked for; without one, of a sun behind the camera's shoulder.
pub(super) fn view(
    task: &PaintingTask,
    camera: &Camera,
    shade: &(dyn Fn(&Hit) -> Shading + Sync),
) -> Result<Frame, MissionError> {
    view_of(&task.surface.world, task, camera, shade)
}

/// The same of the task's surface as a device has it.
pub(super) fn view_of(
    surface: &dyn Surface,
    task: &PaintingTask,
    camera: &Camera,
    shade: &(dyn Fn(&Hit) -> Shading + Sync),
) -> Result<Frame, MissionError> {
    Ok(render(surface, camera, shade, &lights(task, camera)?, 2, task.settings.threads)?)
}

fn lights(task: &PaintingTask, camera: &Camera) -> Result<Lights, MissionError> {
    if let Some(light) = task.settings.show.light {
        return Ok(light.lights(&front(task), task.surface.corners())?);
    }
    let away = -(camera.world_from_camera.rotation * Vector3::z());
    let side = Vector3::z().cross(&away);
    Ok(Lights {
        towards_sun: UnitVector3::new_normalize(away + 0.75 * Vector3::z() + 0.35 * side),
        sun: [0.95, 0.9, 0.8],
        ambient: [0.28, 0.30, 0.34],
        ..Lights::default()
    })
}

/// The level direction of the surface's mean side.
pub(super) fn front(task: &PaintingTask) -> Vector3<f64> {
    let facing = task.surface.facing();
    Vector3::new(facing.x, facing.y, 0.0).try_normalize(0.1).unwrap_or(-Vector3::x())
}

pub(super) fn extent(points: &[Point3<f64>]) -> (Vector3<f64>, Vector3<f64>) {
    let none = (Vector3::repeat(f64::MAX), Vector3::repeat(f64::MIN));
    points.iter().fold(none, |(l, h), p| (l.inf(&p.coords), h.sup(&p.coords)))
}

/// A camera on the surface's mean side that has all the points in view.
pub(super) fn camera(task: &PaintingTask, points: &[Point3<f64>]) -> Result<Camera, MissionError> {
    let (low, high) = extent(points);
    let centre = (low + high) / 2.0;
    let front = front(task);
    let side: Vector3<f64> = Vector3::z().cross(&front);
    let from =
        |to_side: f64, above: f64| fitted(points, centre, (front + side * to_side + Vector3::z() * above).normalize());
    let usual = from(0.45, 0.28)?;
    // In a room a wall may stand between: then from where most is seen.
    let seen = |camera: &Camera| visible(task, camera);
    let mut best = (2 * seen(&usual), usual);
    for [to_side, above] in OTHER_SIDES {
        let camera = from(to_side, above)?;
        let count = seen(&camera);
        if count > best.0 {
            best = (count, camera);
        }
    }
    Ok(best.1)
}

/// How many of some points of the surface the camera sees.
fn visible(task: &PaintingTask, camera: &Camera) -> usize {
    let disk = task.surface.disk();
    let eye = Point3::from(camera.world_from_camera.translation.vector);
    let sees = |face: &usize| {
        let corners = disk.faces()[*face].map(|v| Vector3::from(disk.positions()[v as usize]));
        let way = corners.iter().sum::<Vector3<f64>>() / 3.0 - eye.coords;
        let Some(direction) = UnitVector3::try_new(way, 1e-9) else { return false };
        let hit = task.surface.world.cast(&eye, &direction, way.norm() + OWN_SURFACE);
        hit.is_some_and(|hit| hit.distance > way.norm() - OWN_SURFACE)
    };
    (0..disk.faces().len()).step_by((disk.faces().len() / LOOKED_AT).max(1)).filter(sees).count()
}

/// A camera in a direction from the middle of points that has all of them in view.
pub(super) fn fitted(
    points: &[Point3<f64>],
    centre: Vector3<f64>,
    direction: Vector3<f64>,
) -> Result<Camera, MissionError> {
    let (low, high) = extent(points);
    let up = Vector3::z();
    let look = |target: Vector3<f64>, distance: f64| {
        Camera::looking_at(&Point3::from(target + direction * distance), &Point3::from(target), &up, 0.8, VIEW)
    };
    // Left, right, top and bottom of what is seen, tangents of angles; `None` where something lies beside the eye or behind it.
    let bounds = |camera: &Camera| {
        let seen = points.iter().map(|p| camera.world_from_camera.inverse_transform_point(p));
        let (mut left, mut right, mut top, mut bottom) = (f64::MAX, f64::MIN, f64::MAX, f64::MIN);
        for p in seen {
            if p.z < NEAREST {
                return None;
            }
            let (u, v) = (p.x / p.z, p.y / p.z);
            (left, right) = (left.min(u), right.max(u));
            (top, bottom) = (top.min(v), bottom.max(v));
        }
        Some([left, right, top, bottom])
    };
    // Step back until everything fits, then look at the middle of what is seen.
    let (mut target, mut distance) = (centre, 0.8 * (high - low).norm());
    for _ in 0..40 {
        let camera = look(target, distance)?;
        let Some([left, right, top, bottom]) = bounds(&camera) else {
            distance *= 1.5;
            continue;
        };
        let (half_width, half_height) = (camera.cx / camera.fx, camera.cy / camera.fy);
        let fill = ((right - left) / (2.0 * half_width)).max((bottom - top) / (2.0 * half_height));
        let shift = Vector3::new(0.5 * (left + right), 0.5 * (top + bottom), 0.0) * distance;
        target += camera.world_from_camera.rotation * shift;
        distance *= 1.0 + 0.7 * (fill / FILL - 1.0).clamp(-0.5, 0.5);
    }
    // A deep surface may not have settled: nothing of it is cut off.
    let mut camera = look(target, distance)?;
    let whole = |camera: &Camera| {
        let (half_width, half_height) = (camera.cx / camera.fx, camera.cy / camera.fy);
        bounds(camera).is_some_and(|[left, right, top, bottom]| {
            left.abs().max(right.abs()) <= half_width && top.abs().max(bottom.abs()) <= half_height
        })
    };
    for _ in 0..40 {
        if whole(&camera) {
            break;
        }
        distance *= 1.1;
        camera = look(target, distance)?;
    }
    Ok(camera)
}

/// The same camera so many times as far from a place.
pub(super) fn farther(camera: &Camera, place: &Vector3<f64>, times: f64) -> Camera {
    let eye = camera.world_from_camera.translation.vector;
    let ahead = camera.world_from_camera.rotation * Vector3::z();
    let distance = (place - eye).dot(&ahead);
    let mut farther = *camera;
    farther.world_from_camera.translation.vector = eye - ahead * (distance * (times - 1.0));
    farther
}

/// The same camera with so many pixels on its longer side.
pub(super) fn smaller(camera: &Camera, side: u32) -> Camera {
    let scale = f64::from(side) / f64::from(camera.width.max(camera.height));
    let pixels = |count: u32| (scale * f64::from(count)).round() as u32;
    Camera {
        fx: scale * camera.fx,
        fy: scale * camera.fy,
        cx: scale * camera.cx,
        cy: scale * camera.cy,
        width: pixels(camera.width),
        height: pixels(camera.height),
        world_from_camera: camera.world_from_camera,
    }
}

pub(super) fn picture_of(frame: &Frame) -> Rgb {
    Rgb::from_pixels(frame.width as usize, frame.height as usize, frame.colour.iter().copied())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half of a rectangle's width and height against those of the picture, as seen from before it.
    #[test]
    fn a_surface_fills_the_picture_one_way() {
        let direction = Vector3::new(-1.0, -0.3, 0.2).normalize();
        for (width, height) in [(4.0, 1.0), (1.0, 3.0), (0.4, 0.1), (60.0, 20.0)] {
            let centre = Vector3::new(2.0, 1.0, 3.0);
            let corner = |y: f64, z: f64| Point3::from(centre + Vector3::new(0.0, 0.5 * y * width, 0.5 * z * height));
            let points = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            let camera = fitted(&points, centre, direction).unwrap();
            let seen = points.map(|p| camera.world_from_camera.inverse_transform_point(&p));
            let share = |tangent: &dyn Fn(&Point3<f64>) -> f64, half: f64| {
                let (low, high) = seen.iter().map(tangent).fold((f64::MAX, f64::MIN), |(l, h), t| (l.min(t), h.max(t)));
                // Nothing is cut off, and it stands in the middle.
                assert!(-low < half && high < half && (low + high).abs() < 0.02 * half, "{width} x {height}");
                (high - low) / (2.0 * half)
            };
            let fill = share(&|p| p.x / p.z, camera.cx / camera.fx).max(share(&|p| p.y / p.z, camera.cy / camera.fy));
            assert!((fill / FILL - 1.0).abs() < 0.02, "{width} x {height}: {fill}");
        }
    }
}
