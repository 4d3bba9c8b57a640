//! Stage 2: the heading of the vehicle, globally optimal on a grid and then smoothed off it (VR paper, Eq. (7)).

mod graph;
mod smooth;
mod viterbi;

use crate::clearance::{ClearanceChecker, DistanceCache};
use crate::settings::HeadingSettings;
use crate::target::NozzleState;
use crate::world::VehicleState;

pub(crate) use graph::HeadingGraph;

/// Vehicle states of the nozzle states that have an admissible heading.
pub(crate) struct Headings {
    /// One per nozzle state.
    pub(crate) vehicle: Vec<Option<VehicleState>>,
    /// `joined[i]`: the vehicle may fly straight from the state i to the state i+1.
    pub(crate) joined: Vec<bool>,
    /// Optimal cost on the grid.
    pub(crate) cost: f64,
}

/// Chooses headings for `nozzles` (in path order) from their `graph`, each keeping its own `clearance` from the surface. `linked[i]`:
/// i and i+1 belong to one stroke.
pub(crate) fn choose_headings(
    graph: &HeadingGraph,
    nozzles: &[Option<NozzleState>],
    linked: &[bool],
    checker: &mut ClearanceChecker<'_>,
    clearance: &[f64],
    settings: &HeadingSettings,
) -> Headings {
    let path = viterbi::search(graph, linked, settings);
    let mut vehicle: Vec<Option<VehicleState>> = vec![None; nozzles.len()];
    let mut joined = vec![false; nozzles.len().saturating_sub(1)];
    for run in path.runs() {
        let on_grid: Vec<f64> = run.clone().map(|i| graph.heading(path.bins[i].unwrap_or(0))).collect();
        let states: Vec<NozzleState> = run.clone().filter_map(|i| nozzles[i]).collect();
        let smoothed = smooth_off_grid(&states, &on_grid, checker, &clearance[run.clone()], settings);
        for (i, state) in run.clone().zip(smoothed) {
            vehicle[i] = state;
        }
        joined[run.start..run.end - 1].fill(true);
    }
    Headings { vehicle, joined, cost: path.cost }
}

/// Smooths the headings of one run; states that become inadmissible are pulled back to the grid, in the end all of them.
fn smooth_off_grid(
    states: &[NozzleState],
    on_grid: &[f64],
    checker: &mut ClearanceChecker<'_>,
    clearance: &[f64],
    settings: &HeadingSettings,
) -> Vec<Option<VehicleState>> {
    let grid = smooth::unwrap(on_grid);
    let length: f64 = states.windows(2).map(|pair| (pair[1].position - pair[0].position).norm()).sum();
    let spacing = length / (states.len().max(2) - 1) as f64;
    let stiffness = if spacing > 1e-6 { (settings.smoothing / spacing).powi(4).min(1e8) } else { 0.0 };
    let mut weights = vec![1.0; states.len()];
    for _ in 0..6 {
        let headings = smooth::whittaker(&grid, &weights, stiffness);
        let mut cache = DistanceCache::default();
        let vehicles: Vec<Option<VehicleState>> = states
            .iter()
            .zip(&headings)
            .zip(clearance)
            .map(|((nozzle, &heading), &clearance)| {
                checker.vehicle(nozzle, heading).filter(|v| checker.is_clear(v, clearance, &mut cache))
            })
            .collect();
        if vehicles.iter().all(Option::is_some) {
            return vehicles;
        }
        for (weight, vehicle) in weights.iter_mut().zip(&vehicles) {
            if vehicle.is_none() {
                *weight *= 30.0 * stiffness.max(1.0).sqrt();
            }
        }
    }
    states.iter().zip(&grid).map(|(nozzle, &heading)| checker.vehicle(nozzle, heading)).collect()
}
