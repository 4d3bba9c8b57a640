//! What to spray of each paint of a picture: all of them at once.

use paint_net::colour::ColourFit;
use paint_net::painters::SurfaceFootprint;
use paint_net::path::Stroke;
use paint_net::{Painting, Spray};

use super::colour_rows::{adaptive_rows, on_page, rows_of_cells, strokes_of_rows};
use super::decide::UNPAINTABLE_WEIGHT;
use super::error::MissionError;
use super::footprints::Footprints;
use super::painting_task::PaintingTask;
use super::picture_task::PictureTask;
use super::settings::{MissionSettings, PainterChoice};
use crate::progress::Stage;

/// What a unit of depth costs beside the square of a colour difference.
pub(super) const PAINT_WEIGHT: f64 = 0.3;
/// Least volume of a spray: strong paints show at a hundredth of the depth that hides a wall.
pub(super) const LEAST_VOLUME: f64 = 0.0025;
const ITERATIONS: usize = 80;
const TOLERANCE: f64 = 3e-4;

/// Decides the sprays of every paint of a picture, in the rows of the settings or by [`PainterChoice::AdaptiveRows`] in rows of its own; the best
/// colours that they leave are kept with the picture.
pub(super) fn decide_colours(task: &PaintingTask, picture: &mut PictureTask) -> Result<Vec<Painting>, MissionError> {
    let stage = Stage::start("decide");
    let settings = &task.settings;
    let paints = picture.paints.len();
    let adaptive = settings.painter == PainterChoice::AdaptiveRows;
    let rows = if adaptive {
        let seen = |k: usize, share: f64| stage.share(0.5 * (k as f64 + share) / paints as f64);
        (0..paints).map(|k| adaptive_rows(task, picture, k, &|share| seen(k, share))).collect::<Result<_, _>>()?
    } else {
        vec![rows_of_cells(task)]
    };
    let of_rows = rows.iter().map(|rows| on_texels(task, rows)).collect::<Result<Vec<_>, _>>()?;
    // Equal rows are those of every paint.
    let rows_of = |k: usize| if adaptive { k } else { 0 };
    let start = |(k, depths): (usize, &Vec<f64>)| -> Vec<f64> {
        let sprays = rows[rows_of(k)].iter().flat_map(|row| &row.sprays);
        if adaptive { sprays.map(|spray| spray.volume).collect() } else { means(&of_rows[0], depths, settings) }
    };
    let mut volumes: Vec<Vec<f64>> = picture.separated.iter().enumerate().map(start).collect();
    let model = picture.model();
    let fit = ColourFit {
        wanted: &picture.aims(),
        weight: &weights(task, picture),
        model: &model,
        footprints: &(0..paints).map(|k| of_rows[rows_of(k)].as_slice()).collect::<Vec<_>>(),
        min_volume: 0.0,
        max_volume: settings.limits.max_volume,
        paint_weight: PAINT_WEIGHT,
        iterations: ITERATIONS,
        tolerance: TOLERANCE,
        threads: settings.threads,
    };
    let from = if adaptive { 0.5 } else { 0.0 };
    let depths = fit.solve(&mut volumes, &mut |share| stage.share(from + (1.0 - from) * share))?;
    let optimum = looks(picture, &depths);
    let blank = task.coverage.map(|_| 0.0);
    let painting = |(k, (volumes, depths)): (usize, (&Vec<f64>, &Vec<f64>))| {
        let cells = rows[rows_of(k)].iter().flat_map(|row| &row.sprays);
        let worth = cells.zip(volumes).filter(|(_, volume)| **volume >= LEAST_VOLUME);
        let sprays: Vec<Spray> = worth.map(|(cell, &volume)| Spray { volume, ..*cell }).collect();
        let strokes = if adaptive { strokes_of_rows(&sprays)? } else { Vec::new() };
        let painted = on_page(&blank, &picture.pixels, depths);
        Ok(Painting { strokes, ..Painting::new(sprays, painted, task.appearance.ink()) })
    };
    let paintings: Vec<Painting> =
        volumes.iter().zip(&depths).enumerate().map(painting).collect::<Result<_, paint_net::Error>>()?;
    picture.optimum = optimum;
    let sprays: usize = paintings.iter().map(|painting| painting.sprays.len()).sum();
    if sprays == 0 {
        return Err(MissionError::NothingToPaint("every colour of it is that of the wall"));
    }
    stage.done(&format!("{} paints, {sprays} sprays", paintings.len()));
    Ok(paintings)
}

/// What sprays leave on the texels of the film.
fn on_texels(task: &PaintingTask, rows: &[Stroke]) -> Result<Vec<SurfaceFootprint>, MissionError> {
    let footprints = Footprints::new(&task.surface, &task.settings)?;
    let found = footprints.on_texels(rows);
    footprints.checked(Ok(found))
}

/// How much each texel matters.
pub(super) fn weights(task: &PaintingTask, picture: &PictureTask) -> Vec<f64> {
    let weigh = |&pixel: &usize| if task.in_reach[pixel] { 1.0 } else { UNPAINTABLE_WEIGHT };
    picture.pixels.iter().map(weigh).collect()
}

/// CIELAB of every texel with these depths, paint after paint.
pub(super) fn looks(picture: &PictureTask, depths: &[Vec<f64>]) -> Vec<[f64; 3]> {
    use paint_net::colour::MixingModel as _;
    let model = picture.model();
    let look = |k: usize| {
        let of_texel: Vec<f64> = depths.iter().map(|of_paint| of_paint[k]).collect();
        model.lab(k, &of_texel, &mut [])
    };
    (0..picture.pixels.len()).map(look).collect()
}

/// For a start, the mean under each footprint of the depth that its texels would need by themselves.
fn means(footprints: &[SurfaceFootprint], depths: &[f64], settings: &MissionSettings) -> Vec<f64> {
    let sigma = settings.spot / settings.texel;
    let cell = (settings.limits.spray_spacing * settings.limits.row_spacing) as f64;
    let depth_per_volume = std::f64::consts::TAU * sigma * sigma / cell;
    let mean = |footprint: &SurfaceFootprint| {
        let (sum, mass) = footprint.iter().fold((0.0, 0.0), |(sum, mass), &(k, share)| {
            (sum + f64::from(share) * depths[k as usize], mass + f64::from(share))
        });
        if mass > 0.0 { sum / mass / depth_per_volume } else { 0.0 }
    };
    footprints.iter().map(mean).collect()
}
