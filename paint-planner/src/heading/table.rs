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
