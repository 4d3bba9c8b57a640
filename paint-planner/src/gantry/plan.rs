//! One decision: density, graph, best path (handheld paper, Fig. 3, the green part).

use super::best_path::ValueSweep;
use super::density_map::DensityMap;
use super::edge_scores::EdgeScores;
use super::idle::brake;
use super::lattice::{GantryState, Lattice, Segment};
use super::model::PaintModel;
use super::settings::GantrySettings;
use crate::error::Error;
use crate::trace::{event, span};

/// A decision and what it was made from.
#[derive(Debug)]
pub struct GantryPlan {
    /// The lattice around the start.
    pub lattice: Lattice,
    /// The required density.
    pub density: DensityMap,
    /// Speeds of the path, in steps, one for each interval.
    pub speeds: Vec<i32>,
    /// Sum of its scores; 0 where nothing can be painted within the horizon, and the nozzle comes to rest.
    pub score: f64,
    pub(super) values: ValueSweep,
}

impl GantryPlan {
    /// The path, segment by segment.
    pub fn path(&self) -> Vec<Segment> {
        self.lattice.path(&self.speeds)
    }
}

/// Plans from a state: where the nozzle slides during the next intervals.
///
/// # Errors
/// Settings out of range, a start beside the slide, or a model whose answers are not usable.
pub fn plan_gantry(
    model: &mut dyn PaintModel,
    state: GantryState,
    settings: &GantrySettings,
) -> Result<GantryPlan, Error> {
    span!("plan_gantry");
    let lattice = Lattice::new(state, settings)?;
    let density = DensityMap::sample(model, state.position, settings)?; // IV-A
    let scores = EdgeScores::new(&lattice, &density, model, settings); // IV-B, IV-C
    let values = ValueSweep::new(&lattice, &scores); // IV-D
    let score = values.value(0, 0, lattice.start_speed());
    event!(debug, score, "gantry planned");
    let speeds = if score > 0.0 { values.complete(&[], lattice.start_speed()) } else { brake(&lattice) };
    Ok(GantryPlan { lattice, density, speeds, score, values })
}
