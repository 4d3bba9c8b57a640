//! Rows of sprays for the paints of a picture.

use paint_net::colour::FootprintSet;
use paint_net::model::{MonotoneCurve, Saturation};
use paint_net::painters::AdaptiveRows;
use paint_net::path::{Stroke, StrokeSettings, in_order};
use paint_net::{Image, PaintProblem, Spray};
use paint_sim::Substrate;
use paint_sim::colour::BANDS;

use super::error::MissionError;
use super::footprints::Footprints;
use super::nozzle::kernel;
use super::painting_task::PaintingTask;
use super::picture_task::PictureTask;
use super::settings::MissionSettings;
use crate::appearance::{Appearance, DEEPEST};

/// Similarity that a block may lose for wide rows, more than in one paint: what one loses here the others mend.
const TOLERANCE: f64 = 0.2;
/// Reflectance of the darkest that may lie below a paint.
const DARK: f64 = 0.05;
/// Knots of the curve of what a depth looks like.
const KNOTS: u32 = 64;
/// Rows whose footprints are found at a time.
const ROWS: usize = 16;
/// Turn at which a row ends and another begins, radians.
const BESIDE: f64 = 0.1;

/// The rows over which the nozzle may spray one paint.
pub(super) struct PaintRows {
    rows: Vec<Stroke>,
    /// What a unit of each spray leaves on the texels of the film.
    pub(super) footprints: FootprintSet,
    /// Whether the rows are flown as they are, or anew by what is left of their sprays.
    own_strokes: bool,
}

impl PaintRows {
    /// Equal rows, those of the settings.
    pub(super) fn equal(task: &PaintingTask) -> Result<Self, MissionError> {
        let rows = rows_of_cells(task);
        Ok(Self { footprints: on_texels(task, &rows)?, rows, own_strokes: false })
    }

    /// Rows as wide as the part of the picture allows that this paint shows.
    pub(super) fn adaptive(
        task: &PaintingTask,
        picture: &PictureTask,
        paint: usize,
        progress: &dyn Fn(f64),
    ) -> Result<Self, MissionError> {
        let rows = adaptive_rows(task, picture, paint, progress)?;
        Ok(Self { footprints: on_texels(task, &rows)?, rows, own_strokes: true })
    }

    pub(super) fn rows(&self) -> &[Stroke] {
        &self.rows
    }

    pub(super) fn sprays(&self) -> impl Iterator<Item = &Spray> {
        self.rows.iter().flat_map(|row| &row.sprays)
    }

    /// The strokes of what is left of the sprays; none where they are joined by their places.
    pub(super) fn strokes(&self, sprays: &[Spray]) -> Result<Vec<Stroke>, paint_net::Error> {
        if !self.own_strokes {
            return Ok(Vec::new());
        }
        in_order(sprays, &StrokeSettings { min_gap: 0.0, max_turn: BESIDE, ..StrokeSettings::default() })
    }
}

/// What sprays leave on the texels of the film.
fn on_texels(task: &PaintingTask, rows: &[Stroke]) -> Result<FootprintSet, MissionError> {
    let footprints = Footprints::new(&task.surface, &task.settings)?;
    let mut set = FootprintSet::default();
    // Some at a time: as lists they take many times the room.
    for rows in rows.chunks(ROWS) {
        footprints.on_texels(rows).into_iter().try_for_each(|footprint| set.push(footprint))?;
    }
    footprints.checked(Ok(set))
}

/// The cells over which the nozzle may spray, as runs along the rows.
fn rows_of_cells(task: &PaintingTask) -> Vec<Stroke> {
    let (width, height) = (task.surface.width(), task.surface.height());
    let MissionSettings { limits, spot, texel, .. } = &task.settings;
    let first = |stride: usize| (stride - 1) / 2;
    let mut strokes = Vec::new();
    for y in (first(limits.row_spacing)..height).step_by(limits.row_spacing) {
        let free = |x: &usize| task.in_reach[y * width + x];
        let columns: Vec<usize> =
            (first(limits.spray_spacing)..width).step_by(limits.spray_spacing).filter(free).collect();
        for run in columns.chunk_by(|a, b| b - a == limits.spray_spacing) {
            let spray = |&x: &usize| Spray { x: x as f64, y: y as f64, volume: 1.0, sigma: spot / texel };
            strokes.push(Stroke { sprays: run.iter().map(spray).collect() });
        }
    }
    strokes
}

fn adaptive_rows(
    task: &PaintingTask,
    picture: &PictureTask,
    paint: usize,
    progress: &dyn Fn(f64),
) -> Result<Vec<Stroke>, MissionError> {
    let settings = &task.settings;
    let film = &picture.paints[paint].paint;
    let mut below = vec![Appearance::new(film, &picture.mean_wall()?)?];
    if paint > 0 {
        // White hardly shows on a white wall, and well on what lies there already.
        below.push(Appearance::new(film, &Substrate::new([DARK; BANDS])?)?);
    }
    let seen = visible(&below)?;
    let depths = on_page(&task.coverage.map(|_| 0.0), &picture.pixels, &picture.separated[paint]);
    let wanted = depths.map(|depth| seen.forward(depth).clamp(0.0, 1.0));
    let weight = task.canvas().weights();
    let kernel = kernel(settings)?;
    let problem = PaintProblem::new(&wanted)
        .with_weight(&weight)
        .with_paintable(&task.in_reach)
        .with_ghosts(&task.surface.beyond_seams)
        .with_kernel(&kernel)
        .with_saturation(&seen)
        .with_limits(&settings.limits);
    let painter = AdaptiveRows { tolerance: TOLERANCE, ..AdaptiveRows::default() };
    Ok(painter.rows(&problem, &mut |share: f64| progress(share))?)
}

/// How far each depth of a paint lies from what is below it, in hundreds of CIELAB: what hardly shows may be coarse. `below`: the paint on what it may
/// lie on; what shows most counts.
fn visible(below: &[Appearance]) -> Result<Saturation, paint_net::Error> {
    let distance = |appearance: &Appearance, depth: f64| {
        let bare = appearance.lab(0.0);
        appearance.lab(depth).into_iter().zip(bare).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
    };
    let mut farthest = 0.0;
    let mut knots = Vec::with_capacity(KNOTS as usize + 1);
    for k in 0..=KNOTS {
        let depth = DEEPEST * f64::from(k) / f64::from(KNOTS);
        let shown = below.iter().map(|appearance| 0.01 * distance(appearance, depth)).fold(0.0, f64::max);
        // A paint may come back towards the colour below as it thickens; the curve has to rise.
        farthest = if k == 0 { 0.0 } else { shown.max(farthest + 1e-6) };
        knots.push((depth, farthest));
    }
    let scale = 1.0 / farthest.max(1.0);
    let knots: Vec<(f64, f64)> = knots.into_iter().map(|(depth, shown)| (depth, scale * shown)).collect();
    Ok(Saturation::Curve(MonotoneCurve::new(&knots)?))
}

/// Values of texels on the page, 0 beside them.
pub(super) fn on_page(blank: &Image, pixels: &[usize], values: &[f64]) -> Image {
    let mut image = blank.clone();
    pixels.iter().zip(values).for_each(|(&pixel, &value)| image.data_mut()[pixel] = value);
    image
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::appearance::UNIT_THICKNESS;
    use crate::design::Design;
    use crate::mesh_io::TriangleMesh;
    use crate::region::Scene;
    use paint_sim::Paint;
    use paint_sim::paint::PIGMENTS;

    /// The first cell begins at the border of a wall, the others follow a spacing apart to its other end.
    #[test]
    fn cells_cover_the_wall_from_its_border_on() {
        let corner = |k: u32| [0.0, 0.5 - 0.25 * (k % 5) as f32, 1.0 + 0.25 * (k / 5) as f32];
        let quad = |a: u32| [[a, a + 1, a + 6], [a, a + 6, a + 5]];
        let faces = (0..16).flat_map(|k| quad(5 * (k / 4) + k % 4)).collect();
        let mesh = TriangleMesh { positions: (0..25).map(corner).collect(), faces, ..TriangleMesh::default() };
        let mut settings = MissionSettings::default();
        (settings.limits.spray_spacing, settings.limits.row_spacing) = (3, 5);
        let task = PaintingTask::new("wall", &Scene::whole(mesh), &Design::Gradient, settings).unwrap();
        assert!(task.in_reach.iter().all(|reached| *reached));
        let strokes = rows_of_cells(&task);
        let first = strokes[0].sprays[0];
        assert_eq!((first.x, first.y), (1.0, 2.0));
        let last = strokes[strokes.len() - 1].sprays.last().unwrap();
        let (width, height) = (task.surface.width() as f64, task.surface.height() as f64);
        assert!(width - 1.0 - last.x <= 3.0 && height - 1.0 - last.y <= 5.0, "{last:?} of {width} x {height}");
        let steps = |k: usize| strokes[k].sprays.windows(2).all(|pair| pair[1].x - pair[0].x == 3.0);
        assert!((0..strokes.len()).all(steps));
        assert!(strokes.windows(2).all(|pair| pair[1].sprays[0].y - pair[0].sprays[0].y == 5.0));
    }

    /// White on a white wall shows nothing, on black nearly all; what shows more counts, and the curve stays within 1.
    #[test]
    fn what_shows_of_a_paint_depends_on_what_lies_below() {
        let paint = |name: &str| PIGMENTS.iter().find(|p| p.name == name).unwrap().paint(UNIT_THICKNESS).unwrap();
        let white = paint("titanium white");
        let on =
            |paint: &Paint, ground: f64| Appearance::new(paint, &Substrate::new([ground; BANDS]).unwrap()).unwrap();
        let deep = |below: &[Appearance]| visible(below).unwrap().forward(DEEPEST);
        let opaque = white.over(DEEPEST * UNIT_THICKNESS, &Substrate::new([0.9; BANDS]).unwrap()).unwrap();
        let same = opaque.reflectance()[18];
        assert!(deep(&[on(&white, same)]) < 0.05);
        assert!(deep(&[on(&white, DARK)]) > 0.5);
        assert_eq!(deep(&[on(&white, same), on(&white, DARK)]), deep(&[on(&white, DARK)]));
        for pigment in PIGMENTS {
            let paint = pigment.paint(UNIT_THICKNESS).unwrap();
            let shown = visible(&[on(&paint, 0.95), on(&paint, DARK)]).unwrap();
            let curve: Vec<f64> = (0..=40).map(|k| shown.forward(0.1 * f64::from(k))).collect();
            assert!(
                curve.windows(2).all(|pair| pair[0] <= pair[1]) && curve[0] == 0.0 && curve[40] <= 1.0,
                "{curve:?}"
            );
        }
    }
}
