//! The built-in rock wall, unwrapped, and a stroke on it.

use paint_planner::Target;
use paintcopter::surface::{PaintSurface, SurfaceError};
use paintcopter::world::rock_wall;

/// Side of a texel, metres (Paper IV, section 4).
pub const TEXEL: f64 = 0.0125;
/// Paint per metre of stroke, m³/m (ours).
pub const DOSE: f64 = 2e-6;
/// Texels between two targets of a row, between two rows, and between the rows' ends and the rim: those of the main job.
const ALONG: usize = 2;
const ROW_SPACING: usize = 3;
const RIM: usize = 8;

/// The wall of seed 1: 32,384 faces, unwrapped.
///
/// # Errors
/// None that this wall is known to give; its parts are checked.
pub fn rock() -> Result<PaintSurface, SurfaceError> {
    PaintSurface::new(&rock_wall(1), TEXEL, &|_| ())
}

/// One stroke of `count` targets in rows to and fro, from the middle of the wall downwards; shorter where the wall ends.
pub fn stroke(surface: &PaintSurface, count: usize) -> Vec<Target> {
    let columns: Vec<usize> = (RIM..surface.width() - RIM).step_by(ALONG).collect();
    let rows = (surface.height() / 2..surface.height() - RIM).step_by(ROW_SPACING);
    let places = rows.enumerate().flat_map(|(row, y)| {
        let turn = row % 2 == 1;
        (0..columns.len())
            .map(|k| if turn { columns.len() - 1 - k } else { k })
            .map(|k| (columns[k], y))
            .collect::<Vec<_>>()
    });
    let target = |(x, y): (usize, usize)| {
        let (point, normal) = surface.lift(x as f64, y as f64)?;
        Some(Target { point, normal, dose: DOSE, time: None, stand_off: None })
    };
    places.filter_map(target).take(count).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use paint_planner::Settings;

    #[test]
    fn the_stroke_is_one_and_lies_on_the_wall() {
        let surface = rock().unwrap();
        let targets = stroke(&surface, 1000);
        assert_eq!(targets.len(), 1000);
        for pair in targets.windows(2) {
            let step = (pair[1].point - pair[0].point).norm();
            assert!(step > 0.02 && step < Settings::default().break_length, "{step}");
        }
        for target in &targets {
            assert!(paint_sim::Surface::distance(&surface.world, &target.point, 1.0) < 1e-6);
            assert!(target.normal.x < 0.0, "towards the robot");
        }
    }
}
