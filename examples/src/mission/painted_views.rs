//! The painted surface as somebody standing before it sees it, and from several places in the light that is asked for.

use std::path::Path;

use nalgebra::{Point3, Rotation3, Vector3};
use paint_sim::render::{Frame, Shading};
use paint_sim::surface::Hit;
use paint_sim::{Camera, Surface};

use super::error::MissionError;
use super::painting_task::PaintingTask;
use super::view::{camera, extent, farther, fitted, front, picture_of, smaller, view_of};
use crate::pictures::{Tile, save_contact_sheet};
use crate::say;

/// Longer side of the pictures on the sheets, pixels.
const SIDE: u32 = 560;
const TURNTABLE_SIDE: u32 = 360;
/// Height of the eye over the middle of the surface, in lengths for one forward.
const RAISED: f64 = 0.15;
/// To the sides, radians from the front.
const ASIDE: f64 = 55.0 * std::f64::consts::PI / 180.0;
/// How far a turntable goes to both sides of a surface with a front.
const SWING: f64 = 70.0 * std::f64::consts::PI / 180.0;
/// Mean normals longer than this are those of a surface with a front.
const ONE_SIDED: f64 = 0.5;
/// Times the distance at which all of it is seen.
const NEAR: f64 = 0.45;
const FAR: f64 = 2.2;

/// How a place of the surface looks.
type Shade<'a> = &'a (dyn Fn(&Hit) -> Shading + Sync);

/// What is seen.
#[derive(Clone, Copy)]
struct Seen<'a> {
    task: &'a PaintingTask,
    surface: &'a dyn Surface,
    shade: Shade<'a>,
}

impl Seen<'_> {
    fn from(self, camera: &Camera) -> Result<Frame, MissionError> {
        view_of(self.surface, self.task, camera, self.shade)
    }
}

/// Writes `painted_view.png`; in a light that was asked for also `views.png`; `turntable.png` if that was.
pub(super) fn save_painted_views(task: &PaintingTask, shade: Shade, folder: &Path) -> Result<(), MissionError> {
    save_painted_views_of(&task.surface.world, task, shade, folder)
}

/// The same of the task's surface as a device has it.
pub(super) fn save_painted_views_of(
    surface: &dyn Surface,
    task: &PaintingTask,
    shade: Shade,
    folder: &Path,
) -> Result<(), MissionError> {
    let seen = Seen { task, surface, shade };
    let points: Vec<Point3<f64>> = task.surface.disk().positions().iter().map(|p| Point3::from(*p)).collect();
    let frame = seen.from(&camera(task, &points)?)?;
    picture_of(&frame).save(&folder.join("painted_view.png"))?;
    let show = &task.settings.show;
    if let Some(light) = show.light {
        let percent = 100.0 * frame.clipped as f64 / frame.colour.len() as f64;
        say!("light {light}: {percent:.1} % of painted_view.png is brighter than it can show");
        save_views(seen, &points, folder)?;
    }
    show.turntable.map_or(Ok(()), |count| save_turntable(seen, &points, count, folder))
}

/// From the left, the front and the right; from near and far.
fn save_views(seen: Seen, points: &[Point3<f64>], folder: &Path) -> Result<(), MissionError> {
    let (task, centre) = (seen.task, middle(points));
    let before = turned(task, points, 0.0)?;
    // A positive angle leads to the right of who stands before it.
    let rows = [
        [
            ("from the left", turned(task, points, -ASIDE)?),
            ("from the front", before),
            ("from the right", turned(task, points, ASIDE)?),
        ]
        .to_vec(),
        [("near", farther(&before, &centre, NEAR)), ("far", farther(&before, &centre, FAR))].to_vec(),
    ];
    let tile = |(caption, camera): &(&str, Camera)| -> Result<Tile, MissionError> {
        let picture = picture_of(&seen.from(&smaller(camera, SIDE))?);
        Ok(Tile { caption: (*caption).to_owned(), picture })
    };
    let sheet: Result<Vec<Vec<Tile>>, MissionError> = rows.iter().map(|row| row.iter().map(tile).collect()).collect();
    Ok(save_contact_sheet(&folder.join("views.png"), &sheet?, SIDE)?)
}

/// From places at equal angles: all around, or before a surface that has a front.
fn save_turntable(seen: Seen, points: &[Point3<f64>], count: u16, folder: &Path) -> Result<(), MissionError> {
    let (task, mut tiles) = (seen.task, Vec::new());
    for angle in angles(count, task.surface.facing().norm() > ONE_SIDED) {
        let camera = smaller(&turned(task, points, angle)?, TURNTABLE_SIDE);
        let caption = format!("{:.0}°", angle.to_degrees());
        tiles.push(Tile { caption, picture: picture_of(&seen.from(&camera)?) });
    }
    let columns = (1..=tiles.len()).find(|n| n * n >= tiles.len()).unwrap_or(1);
    let mut tiles = tiles.into_iter().peekable();
    let mut rows = Vec::new();
    while tiles.peek().is_some() {
        rows.push(tiles.by_ref().take(columns).collect());
    }
    Ok(save_contact_sheet(&folder.join("turntable.png"), &rows, TURNTABLE_SIDE)?)
}

/// Angles about the vertical axis from the front, radians, counter-clockwise from above.
fn angles(count: u16, one_sided: bool) -> Vec<f64> {
    let place = |k: u16| match (one_sided, count) {
        (true, 1) => 0.0,
        (true, _) => SWING * (2.0 * f64::from(k) / f64::from(count - 1) - 1.0),
        (false, _) => std::f64::consts::TAU * f64::from(k) / f64::from(count),
    };
    (0..count).map(place).collect()
}

/// A camera so far about the vertical axis from the front that has all points in view.
fn turned(task: &PaintingTask, points: &[Point3<f64>], angle: f64) -> Result<Camera, MissionError> {
    let direction = Rotation3::from_axis_angle(&Vector3::z_axis(), angle) * front(task) + Vector3::z() * RAISED;
    fitted(points, middle(points), direction.normalize())
}

fn middle(points: &[Point3<f64>]) -> Vector3<f64> {
    let (low, high) = extent(points);
    (low + high) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turntable_goes_around_or_swings_before_a_front() {
        assert_eq!(angles(1, true), [0.0]);
        assert_eq!(angles(3, true), [-SWING, 0.0, SWING]);
        assert_eq!(angles(2, false), [0.0, std::f64::consts::PI]);
    }
}
