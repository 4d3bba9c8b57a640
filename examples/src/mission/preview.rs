//! What a mission will look like, how long it takes and what it cannot reach: planned, but neither rehearsed nor flown.

use std::path::Path;

use nalgebra::Point3;
use paint_net::Image;
use paint_sim::render::Shading;
use paint_sim::surface::Hit;
use serde::Serialize;

use super::error::MissionError;
use super::painting_task::PaintingTask;
use super::path_view::save_lines;
use super::plan::unrehearsed;
use super::seams::deposit_error;
use super::shading::{shading, texel_at};
use super::view::{camera, view};
use crate::progress::Stage;
use crate::report::{ReachNeeds, save_figures};

/// Albedo of what the robot cannot paint, mixed in by half.
const OUT_OF_REACH: [f32; 3] = [0.75, 0.05, 0.35];
/// The same for what only keep-out volumes and tether keep it from.
const CONSTRAINED: [f32; 3] = [0.9, 0.45, 0.0];

/// The figures of a preview. Flat, SI units in the names.
#[derive(Debug, Clone, Serialize)]
pub struct Preview {
    /// Version of the program.
    pub version: &'static str,
    /// Surface that is to be painted.
    pub surface: String,
    /// Seed of everything random.
    pub seed: u64,
    /// Area of the painted chart.
    pub surface_area_m2: f64,
    /// Share of it that the robot can paint.
    pub reach_share: f64,
    /// What the rest would need, where it is more than 3 % of the surface.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub reach_needs: Option<ReachNeeds>,
    /// Share of it that the robot could paint but for keep-out volumes and tether.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lost_to_constraints_share: Option<f64>,
    /// Share of the wanted paint that lies there.
    pub wanted_in_reach_share: f64,
    /// Paint that leaves the nozzle.
    pub paint_kg: f64,
    /// Estimated time in the air: that of the plan before its rehearsal in wind.
    pub flight_time_s: f64,
    /// Strokes over all layers.
    pub strokes: usize,
    /// Expected thickness beside what the simulated spray deposits along the strokes when it stands upright and hits, mean difference over mean
    /// thickness, within 3 cm of a seam.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deposit_error_at_seams: Option<f64>,
    /// There, if what falls beyond a seam counted as lost.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deposit_error_at_seams_naive: Option<f64>,
    /// The same farther from the seams.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deposit_error_off_seams: Option<f64>,
    /// Wall-clock time of the preview.
    pub wall_s: f64,
}

/// Writes `preview.png` and `report.json` into an existing folder.
pub fn preview(task: &PaintingTask, folder: &Path) -> Result<Preview, MissionError> {
    let stage = Stage::start("preview");
    let estimate = estimate(task)?;
    stage.share(0.5);
    let painted = expected_depth(task);
    let shade = |hit: &Hit| -> Shading {
        let plain = shading(task, &painted, hit);
        let bare = texel_at(task, hit).filter(|&texel| !task.in_reach[texel]);
        let why = bare.map(|texel| if task.lost_to_constraints[texel] { CONSTRAINED } else { OUT_OF_REACH });
        let mixed = |c: usize| why.map_or(plain.albedo[c], |why| 0.5 * (plain.albedo[c] + why[c]));
        Shading { albedo: [mixed(0), mixed(1), mixed(2)], ..plain }
    };
    let corners: Vec<Point3<f64>> = task.surface.disk().positions().iter().map(|p| Point3::from(*p)).collect();
    let camera = camera(task, &corners)?;
    save_lines(task, &camera, &view(task, &camera, &shade)?, Vec::new(), &folder.join("preview.png"))?;
    save_figures(&estimate, folder)?;
    stage.done(&folder.join("preview.png").display().to_string());
    Ok(estimate)
}

impl Preview {
    /// One line for people.
    pub fn summary(&self) -> String {
        format!(
            "about {:.0} min in the air, {:.2} kg of paint, {:.1} % of the surface and {:.1} % of the wanted paint in reach",
            self.flight_time_s / 60.0,
            self.paint_kg,
            100.0 * self.reach_share,
            100.0 * self.wanted_in_reach_share
        )
    }
}

fn estimate(task: &PaintingTask) -> Result<Preview, MissionError> {
    let mission = unrehearsed(task)?;
    let flights = &mission.flights;
    let strokes = flights.iter().map(|flight| flight.route.strokes).sum();
    let volume: f64 = flights.iter().map(|flight| flight.route.volume()).sum();
    let seams = deposit_error(task)?;
    let depth = task.wanted.map(|ink| task.appearance.ink().inverse(ink));
    let wanted = |weight: &Image| depth.data().iter().zip(weight.data()).map(|(d, w)| d * w).sum::<f64>();
    Ok(Preview {
        version: env!("CARGO_PKG_VERSION"),
        surface: task.name.clone(),
        seed: task.settings.seed,
        surface_area_m2: task.surface.disk().area(),
        reach_share: task.share_in_reach(),
        reach_needs: task.reach_needs,
        lost_to_constraints_share: task.share_lost_to_constraints(),
        wanted_in_reach_share: wanted(&task.coverage_in_reach()) / wanted(&task.coverage).max(f64::MIN_POSITIVE),
        paint_kg: volume * task.paint.liquid.density,
        flight_time_s: mission.duration(),
        strokes,
        deposit_error_at_seams: seams.map(|s| s.near),
        deposit_error_at_seams_naive: seams.map(|s| s.naive),
        deposit_error_off_seams: seams.map(|s| s.far),
        wall_s: task.started.elapsed().as_secs_f64(),
    })
}

/// Depth of paint on every texel when every spray lands where it is meant to.
pub(super) fn expected_depth(task: &PaintingTask) -> Image {
    let ink = task.layers.last().map_or(&task.wanted, |layer| &layer.ink);
    ink.map(|ink| task.appearance.ink().inverse(ink))
}
