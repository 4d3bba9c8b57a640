//! What a picture in colour will look like, and how long its paints take: planned, but neither rehearsed nor flown.

use std::path::Path;

use serde::Serialize;

use super::coats::{CoatTasks, Look};
use super::coats_estimate::estimate_coats;
use super::error::MissionError;
use super::picture_figures::{save_out_of_gamut, wanted_looks};
use crate::pictures::Rgb;
use crate::progress::Stage;
use crate::report::save_figures;

/// The figures of a preview. Flat, SI units in the names.
#[derive(Debug, Clone, Serialize)]
pub struct PicturePreview {
    /// Version of the program.
    pub version: &'static str,
    /// Surface that is to be painted.
    pub surface: String,
    /// Seed of everything random.
    pub seed: u64,
    /// The paints in flying order.
    pub paints: Vec<String>,
    /// Paint that leaves the nozzle, of each.
    pub paint_kg_by_paint: Vec<f64>,
    /// Estimated time in the air of each.
    pub flight_time_s_by_paint: Vec<f64>,
    /// Of all of them.
    pub flight_time_s: f64,
    /// With tool changes and drying.
    pub mission_time_s: f64,
    /// Mean CIEDE2000 between the best that sprays of this size leave and the picture, where paints show it and the robot paints.
    pub ciede2000_optimum_mean: f64,
    /// Share of the picture that these paints do not show on this wall.
    pub out_of_gamut_share: f64,
}

impl PicturePreview {
    /// One line for people.
    pub fn summary(&self) -> String {
        format!(
            "about {:.0} min in the air in {} paints, {:.2} kg, CIEDE2000 {:.2} at best, {:.1} % out of gamut",
            self.flight_time_s / 60.0,
            self.paints.len(),
            self.paint_kg_by_paint.iter().sum::<f64>(),
            self.ciede2000_optimum_mean,
            100.0 * self.out_of_gamut_share
        )
    }
}

/// Writes `wanted.png`, `expected.png`, `out_of_gamut.png` and `report.json` into an existing folder; `None` where there is no picture in colour.
///
/// # Errors
/// As planning and writing.
pub fn preview_picture(tasks: &CoatTasks, folder: &Path) -> Result<Option<PicturePreview>, MissionError> {
    let (Some(picture), Some(first)) = (&tasks.picture, tasks.coats.first()) else { return Ok(None) };
    let stage = Stage::start("preview");
    let estimate = estimate_coats(tasks, &|share| stage.share(share))?;
    let (task, expected) = (&first.task, &estimate.expected);
    let wanted = wanted_looks(picture, expected.len());
    let (width, height) = (task.surface.width(), task.surface.height());
    for (looks, name) in [(&wanted, "wanted.png"), (expected, "expected.png")] {
        let page = looks.iter().map(|look| look.as_ref().map(Look::srgb8));
        Rgb::of_page(width, height, page).save(&folder.join(name))?;
    }
    save_out_of_gamut(picture, &wanted, [width, height], folder)?;
    let figures = PicturePreview {
        version: env!("CARGO_PKG_VERSION"),
        surface: task.name.clone(),
        seed: task.settings.seed,
        paints: estimate.paints.iter().map(|paint| paint.name.clone()).collect(),
        flight_time_s: estimate.flight_time_s,
        flight_time_s_by_paint: estimate.paints.iter().map(|paint| paint.flight_time_s).collect(),
        paint_kg_by_paint: estimate.paints.iter().map(|paint| paint.kilograms).collect(),
        mission_time_s: estimate.mission_time_s,
        ciede2000_optimum_mean: picture.difference_in_gamut(&task.in_reach, |k| Some(picture.optimum[k])),
        out_of_gamut_share: picture.out_of_gamut_share(),
    };
    save_figures(&figures, folder)?;
    stage.done(&folder.join("expected.png").display().to_string());
    Ok(Some(figures))
}
