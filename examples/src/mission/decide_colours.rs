//! What to spray of each paint of a picture: all of them at once.

use std::collections::HashMap;
use std::sync::Arc;

use paint_net::colour::{ColourFit, FootprintSet, SparseColourFit};
use paint_net::path::Stroke;
use paint_net::{Painting, Spray};

use super::colour_rows::{PaintRows, on_page};
use super::error::MissionError;
use super::painting_task::PaintingTask;
use super::picture_task::PictureTask;
use super::settings::{MissionSettings, PainterChoice};
use crate::progress::Stage;

/// What a unit of depth costs beside the square of a colour difference.
pub(super) const PAINT_WEIGHT: f64 = 0.3;
/// Least volume of a spray: strong paints show at a hundredth of the depth that hides a wall.
pub(super) const LEAST_VOLUME: f64 = 0.0025;
/// What a pixel of way costs beside half the square of a colour difference on a texel.
const WAY_PRICE: f64 = 1.0;
/// Edge of the blocks in which a paint is kept or left out, pixels.
const BLOCK: f64 = 16.0;
/// Texels on an edge of what is one texel until it is known which paint lies where.
const COARSE: usize = 2;
const ITERATIONS: usize = 80;
const TOLERANCE: f64 = 3e-4;

/// Decides the sprays of every paint of a picture, in the rows of the settings or by [`PainterChoice::AdaptiveRows`] in rows of its own, each paint
/// where the others do not show the picture as well; the best colours that they leave are kept with the picture.
pub(super) fn decide_colours(task: &PaintingTask, picture: &mut PictureTask) -> Result<Vec<Painting>, MissionError> {
    let stage = Stage::start("decide");
    let settings = &task.settings;
    let paints = picture.paints.len();
    let (rows, mut volumes): (Vec<Arc<PaintRows>>, Vec<Vec<f64>>) = if settings.painter == PainterChoice::AdaptiveRows {
        let seen = |k: usize, share: f64| stage.share(0.3 * (k as f64 + share) / paints as f64);
        let of_paint = |k: usize| {
            let rows = PaintRows::adaptive(task, picture, k, &|share| seen(k, share))?;
            let volumes = rows.sprays().map(|spray| spray.volume).collect();
            Ok((Arc::new(rows), volumes))
        };
        (0..paints).map(of_paint).collect::<Result<Vec<_>, MissionError>>()?.into_iter().unzip()
    } else {
        let rows = Arc::new(PaintRows::equal(task)?);
        let of_paint = |depths: &Vec<f64>| (Arc::clone(&rows), means(&rows.footprints, depths, settings));
        picture.separated.iter().map(of_paint).unzip()
    };
    let model = picture.model();
    let fit = ColourFit {
        wanted: &picture.aims(),
        weight: &weights(task, picture),
        model: &model,
        footprints: &rows.iter().map(|rows| &rows.footprints).collect::<Vec<_>>(),
        min_volume: 0.0,
        max_volume: settings.limits.max_volume,
        paint_weight: PAINT_WEIGHT,
        prices: &[],
        iterations: ITERATIONS,
        tolerance: TOLERANCE,
        threads: settings.threads,
    };
    let strokes: Vec<&[Stroke]> = rows.iter().map(|rows| rows.rows()).collect();
    let coarse = coarse_texels(task, picture);
    let sparse = SparseColourFit { fit, rows: &strokes, block: BLOCK, price: WAY_PRICE, coarse: &coarse };
    let depths = sparse.solve(&mut volumes, &mut |share| stage.share(0.3 + 0.7 * share))?;
    let optimum = looks(picture, &depths);
    let blank = task.coverage.map(|_| 0.0);
    let painting = |(rows, (volumes, depths)): (&Arc<PaintRows>, (&Vec<f64>, &Vec<f64>))| {
        let worth = rows.sprays().zip(volumes).filter(|(_, volume)| **volume >= LEAST_VOLUME);
        let sprays: Vec<Spray> = worth.map(|(cell, &volume)| Spray { volume, ..*cell }).collect();
        let painted = on_page(&blank, &picture.pixels, depths);
        Ok(Painting { strokes: rows.strokes(&sprays)?, ..Painting::new(sprays, painted, task.appearance.ink()) })
    };
    let paintings: Vec<Painting> =
        rows.iter().zip(volumes.iter().zip(&depths)).map(painting).collect::<Result<_, paint_net::Error>>()?;
    picture.optimum = optimum;
    let sprays: usize = paintings.iter().map(|painting| painting.sprays.len()).sum();
    if sprays == 0 {
        return Err(MissionError::NothingToPaint("every colour of it is that of the wall"));
    }
    stage.done(&format!("{} paints, {sprays} sprays", paintings.len()));
    Ok(paintings)
}

/// Squares of [`COARSE`] by `COARSE` texels, in the order of their first texels.
fn coarse_texels(task: &PaintingTask, picture: &PictureTask) -> Vec<u32> {
    let width = task.surface.width();
    let mut numbers: HashMap<[usize; 2], u32> = HashMap::new();
    let square = |&pixel: &usize| {
        let next = numbers.len() as u32;
        *numbers.entry([pixel % width / COARSE, pixel / width / COARSE]).or_insert(next)
    };
    picture.pixels.iter().map(square).collect()
}

/// How much each texel matters.
pub(super) fn weights(task: &PaintingTask, picture: &PictureTask) -> Vec<f64> {
    let canvas = task.canvas();
    picture.pixels.iter().map(|&pixel| canvas.weight(pixel)).collect()
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
fn means(footprints: &FootprintSet, depths: &[f64], settings: &MissionSettings) -> Vec<f64> {
    let sigma = settings.spot / settings.texel;
    let cell = (settings.limits.spray_spacing * settings.limits.row_spacing) as f64;
    let depth_per_volume = std::f64::consts::TAU * sigma * sigma / cell;
    let mean = |spray: usize| {
        let (sum, mass) = footprints
            .iter(spray)
            .fold((0.0, 0.0), |(sum, mass), (k, share)| (sum + f64::from(share) * depths[k], mass + f64::from(share)));
        if mass > 0.0 { sum / mass / depth_per_volume } else { 0.0 }
    };
    (0..footprints.len()).map(mean).collect()
}
