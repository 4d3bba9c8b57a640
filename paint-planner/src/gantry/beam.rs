//! Candidates simulated, the best one taken: what the density map cannot know is that paint changes what is needed.

use super::model::PaintModel;
use super::plan::GantryPlan;
use crate::error::Error;

/// How much is simulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct BeamSettings {
    /// Beginnings that are kept at each layer (default 8).
    pub width: usize,
}

impl Default for BeamSettings {
    fn default() -> Self {
        Self { width: 8 }
    }
}

/// Replaces the plan's path by the best one that a beam search finds, and returns the paint that it places, m^3.
///
/// Each beginning is completed by the best path of the graph and simulated as a whole (the pilot method of Duin and Voss, 1999), so
/// that the result is never worse than the path it starts from.
///
/// # Errors
/// A beam of no width.
pub fn refine(plan: &mut GantryPlan, model: &mut dyn PaintModel, settings: &BeamSettings) -> Result<f64, Error> {
    if settings.width == 0 {
        let requirement = "at least 1";
        return Err(Error::Setting { name: "beam.width", value: 0.0, requirement });
    }
    let lattice = &plan.lattice;
    let mut best = (model.simulate(&lattice.path(&plan.speeds)), plan.speeds.clone());
    let mut beam: Vec<(f64, Vec<i32>)> = vec![(best.0, Vec::new())];
    for _ in 0..lattice.horizon {
        let mut candidates = Vec::with_capacity(beam.len() * 3);
        for (_, prefix) in &beam {
            let speed = prefix.last().copied().unwrap_or(lattice.start_speed());
            for next in lattice.next_speeds(prefix.iter().sum(), speed) {
                let mut longer = prefix.clone();
                longer.push(next);
                let whole = plan.values.complete(&longer, lattice.start_speed());
                let paint = model.simulate(&lattice.path(&whole));
                if paint > best.0 {
                    best = (paint, whole);
                }
                candidates.push((paint, longer));
            }
        }
        // Stable: of equal ones the first stays.
        candidates.sort_by(|a, b| b.0.total_cmp(&a.0));
        candidates.truncate(settings.width);
        beam = candidates;
    }
    let (paint, speeds) = best;
    plan.speeds = speeds;
    Ok(paint)
}
