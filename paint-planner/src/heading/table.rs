//! The headings by themselves: the table of what is possible, the optimum over it, and the paper's choice one after the other.

use super::graph::HeadingGraph;
use super::viterbi::{edge, search};
use crate::clearance::ClearanceChecker;
use crate::error::Error;
use crate::not_served::NotServed;
use crate::settings::HeadingSettings;
use crate::target::NozzleState;
use crate::world::{Surface, Tool};
use std::f64::consts::TAU;

/// Headings of the states of one stroke on the grid.
#[derive(Debug, Clone, PartialEq)]
pub struct HeadingPath {
    /// Heading of every state in (-pi, pi]; `None` where none is possible.
    pub headings: Vec<Option<f64>>,
    /// Cost of VR paper, Eq. (7), summed over the states; `c_e d` where it prints `c_e d^2` of a distance `d` that is squared already.
    pub cost: f64,
}

/// Which headings every nozzle state of one stroke has, by joints and collisions: what [`OptimalPlanner`](crate::OptimalPlanner) searches, to be
/// looked at or measured by itself.
pub struct HeadingTable {
    graph: HeadingGraph,
    linked: Vec<bool>,
}

impl HeadingTable {
    /// Asks tool and surface about every pair of state and heading.
    ///
    /// # Errors
    /// [`Error::World`] if surface or tool answer what cannot be.
    pub fn new(
        nozzles: &[NozzleState],
        surface: &dyn Surface,
        tool: &dyn Tool,
        clearance: f64,
        bins: usize,
    ) -> Result<Self, Error> {
        let nozzles: Vec<Result<NozzleState, NotServed>> = nozzles.iter().copied().map(Ok).collect();
        let mut checker = ClearanceChecker::new(surface, tool);
        let mut graph = HeadingGraph::build(&nozzles, &mut checker, bins);
        let all = (0..bins).flat_map(|bin| (0..nozzles.len()).map(move |i| (i, bin)));
        graph.check(all, &nozzles, &mut checker, &vec![clearance; nozzles.len()]);
        checker.check_answers()?;
        Ok(Self { graph, linked: vec![true; nozzles.len().saturating_sub(1)] })
    }

    /// The optimum over all paths through the table.
    pub fn optimum(&self, settings: &HeadingSettings) -> HeadingPath {
        let path = search(&self.graph, &self.linked, settings);
        let headings = path.bins.iter().map(|bin| bin.map(|bin| self.graph.heading(bin))).collect();
        HeadingPath { headings, cost: path.cost }
    }

    /// Eq. (7) as the paper solves it: every state in turn takes the heading that is cheapest after the one before, by brute force over the
    /// grid.
    pub fn one_after_the_other(&self, settings: &HeadingSettings) -> HeadingPath {
        let (bins, mut cost) = (self.graph.bins, 0.0);
        let mut before = None;
        let mut headings = Vec::with_capacity(self.graph.len());
        for i in 0..self.graph.len() {
            let price = |bin: usize| {
                let node = self.graph.layer(i)[bin]?;
                let way = before.map_or(0.0, |(last, from): (usize, _)| {
                    let shift = (bin + bins - last) % bins;
                    let turns = shift.min(bins - shift) as f64;
                    edge(&from, &node, turns * TAU / bins as f64, settings.ce)
                });
                Some((way + settings.pan * node.pan * node.pan, bin, node))
            };
            let cheapest = (0..bins).filter_map(price).min_by(|a, b| a.0.total_cmp(&b.0));
            headings.push(cheapest.map(|(_, bin, _)| self.graph.heading(bin)));
            if let Some((price, bin, node)) = cheapest {
                cost += price;
                before = Some((bin, node));
            }
        }
        HeadingPath { headings, cost }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::super::graph::Node;
    use super::*;

    /// Two states a metre apart, four headings. The cheapest heading of the first leads to a dear second one.
    #[test]
    fn one_after_the_other_takes_what_is_cheapest_now() {
        let node = |y: f64, pan: f64| Some(Node { position: Point3::new(0.0, y, 1.0), pan });
        let nodes = vec![node(0.0, 0.1), None, node(0.0, 0.2), None, None, None, node(1.0, 0.3), node(1.0, 0.9)];
        let table = HeadingTable { graph: HeadingGraph::from_nodes(4, nodes), linked: vec![true] };
        let settings = HeadingSettings { window: 2, pan: 5.0, ce: 0.5, ..HeadingSettings::default() };
        // Eq. (7): from bin 0 the turns are half a circle to bin 2, a quarter to bin 3; from bin 2, none and a quarter.
        let edge = |quarters: f64| (quarters * TAU / 4.0).powi(2) / (1.0 + 1e-6) + 0.5;
        let pan = |pan: f64| 5.0 * pan * pan;
        let greedy = table.one_after_the_other(&settings);
        let dear = (edge(2.0) + pan(0.3)).min(edge(1.0) + pan(0.9));
        assert!((greedy.cost - (pan(0.1) + dear)).abs() < 1e-12, "{greedy:?}");
        let best = table.optimum(&settings);
        assert!((best.cost - (pan(0.2) + edge(0.0) + pan(0.3))).abs() < 1e-12, "{best:?}");
        let turned =
            |path: &HeadingPath| path.headings.iter().map(|h| h.unwrap().to_degrees().round()).collect::<Vec<_>>();
        assert_eq!((turned(&greedy), turned(&best)), (vec![0.0, -90.0], vec![180.0, 180.0]));
    }
}
