//! Stage 2: the heading of the vehicle, globally optimal on a grid and then smoothed off it (VR paper, Eq. (7)).

mod graph;
mod smooth;
mod table;
mod viterbi;

use crate::clearance::{ClearanceChecker, DistanceCache};
use crate::not_served::NotServed;
use crate::target::NozzleState;
use crate::world::VehicleState;

pub use crate::settings::HeadingSettings;
pub(crate) use graph::HeadingGraph;
pub use table::{HeadingPath, HeadingTable};

/// Vehicle states of the nozzle states that have an admissible heading.
pub(crate) struct Headings {
    /// One per nozzle state, or why it has none.
    pub(crate) vehicle: Vec<Result<VehicleState, NotServed>>,
    /// `joined[i]`: the vehicle may fly straight from the state i to the state i+1.
    pub(crate) joined: Vec<bool>,
    /// Optimal cost on the grid.
    pub(crate) cost: f64,
}

/// Searches that look for collisions along their path only; then all of the graph is looked at.
const LAZY_SEARCHES: usize = 8;

/// The best path through a graph on which nothing collides.
///
/// A path that is best among all that the joints allow, and free of collisions, is also best among those free of collisions: so only the
/// nodes of the path are looked at, all headings of the states that collide there, and the search begins anew (lazy shortest path, Dellin
/// and Srinivasa 2016).
fn best_path(
    graph: &mut HeadingGraph,
    nozzles: &[Result<NozzleState, NotServed>],
    linked: &[bool],
    checker: &mut ClearanceChecker<'_>,
    clearance: &[f64],
    settings: &HeadingSettings,
) -> viterbi::Path {
    let (bins, mut searches) = (graph.bins, 0);
    loop {
        let path = viterbi::search(graph, linked, settings);
        let on_path = path.bins.iter().enumerate().filter_map(|(i, bin)| bin.map(|bin| (i, bin)));
        let mut lost = graph.check(on_path, nozzles, checker, clearance);
        if lost.is_empty() {
            return path;
        }
        searches += 1;
        if searches == LAZY_SEARCHES {
            lost = (0..nozzles.len()).collect();
        }
        let headings = (0..bins).flat_map(|bin| lost.iter().map(move |&i| (i, bin)));
        graph.check(headings, nozzles, checker, clearance);
    }
}

/// Chooses headings for `nozzles` (in path order) from their `graph`, each keeping its own `clearance` from the surface. `linked[i]`:
/// i and i+1 belong to one stroke.
pub(crate) fn choose_headings(
    graph: &mut HeadingGraph,
    nozzles: &[Result<NozzleState, NotServed>],
    linked: &[bool],
    checker: &mut ClearanceChecker<'_>,
    clearance: &[f64],
    settings: &HeadingSettings,
) -> Headings {
    let path = best_path(graph, nozzles, linked, checker, clearance, settings);
    let mut vehicle: Vec<Result<VehicleState, NotServed>> =
        nozzles.iter().map(|nozzle| nozzle.and(Err(NotServed::NoHeading))).collect();
    let mut joined = vec![false; nozzles.len().saturating_sub(1)];
    for run in path.runs() {
        let on_grid: Vec<f64> = run.clone().map(|i| graph.heading(path.bins[i].unwrap_or(0))).collect();
        let states: Vec<NozzleState> = run.clone().filter_map(|i| nozzles[i].ok()).collect();
        let smoothed = smooth_off_grid(&states, &on_grid, checker, &clearance[run.clone()], settings);
        for (i, state) in run.clone().zip(smoothed) {
            vehicle[i] = state.ok_or(NotServed::NoHeading);
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

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, UnitVector3, Vector3};

    use super::*;
    use crate::world::{Hit, Surface, Tool};

    /// Posts in a row before the nozzles.
    struct Posts;

    impl Surface for Posts {
        fn cast(&self, _: &Point3<f64>, _: &UnitVector3<f64>, _: f64) -> Option<Hit> {
            None
        }

        fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
            let post = |k: i32| (point.xy() - nalgebra::Point2::new(-0.6, 0.13 + 0.4 * f64::from(k))).norm();
            (-2..6).map(post).fold(max, f64::min)
        }
    }

    /// A body half a metre behind the nozzle, turned about it.
    struct Boom;

    impl Tool for Boom {
        fn vehicle(&self, nozzle: &NozzleState, heading: f64) -> Option<VehicleState> {
            let back = Vector3::new(heading.cos(), heading.sin(), 0.0) * 0.5;
            let within = heading.cos() > 0.2;
            within.then(|| VehicleState { position: nozzle.position - back, heading, pan: -heading, tilt: 0.0 })
        }

        fn spheres(&self, vehicle: &VehicleState, out: &mut Vec<(Point3<f64>, f64)>) {
            out.push((vehicle.position, 0.08));
        }
    }

    #[test]
    fn looking_for_collisions_where_the_path_leads_finds_the_path_of_the_whole_table() {
        let nozzle = |k: usize| NozzleState {
            position: Point3::new(-0.1 - 0.02 * (0.3 * k as f64).sin(), 0.02 * k as f64, 1.0),
            direction: Vector3::x_axis(),
        };
        let nozzles: Vec<Result<NozzleState, NotServed>> =
            (0..80).map(|k| if k == 33 { Err(NotServed::Hidden) } else { Ok(nozzle(k)) }).collect();
        let linked: Vec<bool> = (0..79).map(|k| k != 50).collect();
        for (window, clearance) in [(3, 0.01), (1, 0.01), (3, 0.06), (6, 0.1)] {
            let settings = HeadingSettings { window, ..HeadingSettings::default() };
            let clearance = vec![clearance; 80];
            let mut checker = ClearanceChecker::new(&Posts, &Boom);
            let mut whole = HeadingGraph::build(&nozzles, &mut checker, settings.bins);
            let all = (0..settings.bins).flat_map(|bin| (0..80).map(move |i| (i, bin)));
            whole.check(all, &nozzles, &mut checker, &clearance);
            let expected = viterbi::search(&whole, &linked, &settings);
            let mut lazy = HeadingGraph::build(&nozzles, &mut checker, settings.bins);
            let free = viterbi::search(&lazy, &linked, &settings);
            let found = best_path(&mut lazy, &nozzles, &linked, &mut checker, &clearance, &settings);
            assert_eq!((&found.bins, &found.joined), (&expected.bins, &expected.joined));
            assert_eq!(found.cost, expected.cost);
            assert_ne!(free.bins, expected.bins, "the posts are not in the way");
        }
    }
}
