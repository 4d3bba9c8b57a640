//! Which headings are possible at every nozzle state, and where they put the body.

use crate::angle::wrap;
use crate::clearance::{ClearanceChecker, DistanceCache};
use crate::target::NozzleState;
use nalgebra::Point3;
use std::f64::consts::TAU;

/// A possible heading of one state.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Node {
    /// Body position in the world, m.
    pub(crate) position: Point3<f64>,
    /// Pan angle, rad.
    pub(crate) pan: f64,
}

/// States x heading bins; `None` where joint limits or collisions forbid the heading.
pub(crate) struct HeadingGraph {
    pub(crate) bins: usize,
    pub(crate) nodes: Vec<Option<Node>>,
    /// Heading of bin 0: the azimuth of the first spray axis, so that a plan turns with the world it is made in.
    origin: f64,
}

impl HeadingGraph {
    /// Asks for every pair; state `i` has to keep `clearance[i]` from the surface, m. Neighbouring states of one bin share their distance queries.
    pub(crate) fn build(
        nozzles: &[Option<NozzleState>],
        checker: &mut ClearanceChecker<'_>,
        clearance: &[f64],
        bins: usize,
    ) -> Self {
        let first = nozzles.iter().flatten().next();
        let origin = first.map_or(0.0, |nozzle| nozzle.direction.y.atan2(nozzle.direction.x));
        let mut graph = Self { bins, nodes: vec![None; nozzles.len() * bins], origin };
        for bin in 0..bins {
            let heading = graph.heading(bin);
            let mut cache = DistanceCache::default();
            for (i, nozzle) in nozzles.iter().enumerate() {
                let Some(vehicle) = nozzle.as_ref().and_then(|nozzle| checker.vehicle(nozzle, heading)) else {
                    continue;
                };
                if checker.is_clear(&vehicle, clearance[i], &mut cache) {
                    graph.nodes[i * bins + bin] = Some(Node { position: vehicle.position, pan: vehicle.pan });
                }
            }
        }
        graph
    }

    /// States in the graph.
    pub(crate) fn len(&self) -> usize {
        self.nodes.len() / self.bins
    }

    /// The nodes of state `i`, by bin.
    pub(crate) fn layer(&self, i: usize) -> &[Option<Node>] {
        &self.nodes[i * self.bins..(i + 1) * self.bins]
    }

    /// Heading of a bin in (-pi, pi].
    pub(crate) fn heading(&self, bin: usize) -> f64 {
        wrap(self.origin + TAU * bin as f64 / self.bins as f64)
    }

    #[cfg(test)]
    pub(crate) fn from_nodes(bins: usize, nodes: Vec<Option<Node>>) -> Self {
        Self { bins, nodes, origin: 0.0 }
    }
}
