//! Which headings are possible at every nozzle state, and where they put the body.

use crate::angle::wrap;
use crate::clearance::{ClearanceChecker, DistanceCache};
use crate::not_served::NotServed;
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

/// States x heading bins; `None` where joint limits or collisions forbid the heading. Collisions cost most and most nodes lie on no path
/// worth taking, so they are looked for where a search has led: until then a node that the joints allow counts as possible.
pub(crate) struct HeadingGraph {
    pub(crate) bins: usize,
    pub(crate) nodes: Vec<Option<Node>>,
    /// Whether collisions were looked for at each node.
    checked: Vec<bool>,
    /// Heading of bin 0: the azimuth of the first spray axis, so that a plan turns with the world it is made in.
    origin: f64,
}

impl HeadingGraph {
    /// Asks the joints about every pair.
    pub(crate) fn build(
        nozzles: &[Result<NozzleState, NotServed>],
        checker: &mut ClearanceChecker<'_>,
        bins: usize,
    ) -> Self {
        let first = nozzles.iter().flatten().next();
        let origin = first.map_or(0.0, |nozzle| nozzle.direction.y.atan2(nozzle.direction.x));
        let count = nozzles.len() * bins;
        let mut graph = Self { bins, nodes: vec![None; count], checked: vec![false; count], origin };
        graph.update(nozzles, checker, &(0..nozzles.len()).collect::<Vec<usize>>());
        graph
    }

    /// Asks again about some states, whose nozzle or clearance is another.
    pub(crate) fn update(
        &mut self,
        nozzles: &[Result<NozzleState, NotServed>],
        checker: &mut ClearanceChecker<'_>,
        states: &[usize],
    ) {
        for bin in 0..self.bins {
            let heading = self.heading(bin);
            for &i in states {
                let vehicle = nozzles[i].ok().and_then(|nozzle| checker.vehicle(&nozzle, heading));
                self.nodes[i * self.bins + bin] =
                    vehicle.map(|vehicle| Node { position: vehicle.position, pan: vehicle.pan });
                self.checked[i * self.bins + bin] = false;
            }
        }
    }

    /// Looks for collisions at some nodes, given as (state, bin); state `i` has to keep `clearance[i]` from the surface, m. Returns the
    /// states that lost one. Neighbours in the list share their distance queries.
    pub(crate) fn check(
        &mut self,
        nodes: impl Iterator<Item = (usize, usize)>,
        nozzles: &[Result<NozzleState, NotServed>],
        checker: &mut ClearanceChecker<'_>,
        clearance: &[f64],
    ) -> Vec<usize> {
        let (mut cache, mut lost) = (DistanceCache::default(), Vec::new());
        for (i, bin) in nodes {
            let node = i * self.bins + bin;
            if std::mem::replace(&mut self.checked[node], true) || self.nodes[node].is_none() {
                continue;
            }
            let vehicle = nozzles[i].ok().and_then(|nozzle| checker.vehicle(&nozzle, self.heading(bin)));
            if !vehicle.is_some_and(|vehicle| checker.is_clear(&vehicle, clearance[i], &mut cache)) {
                self.nodes[node] = None;
                lost.push(i);
            }
        }
        lost
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
        Self { bins, checked: vec![true; nodes.len()], nodes, origin: 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitVector3, Vector3};

    use super::*;
    use crate::world::{Hit, Surface, Tool, VehicleState};

    /// The plane x = 0.
    struct Plane;

    impl Surface for Plane {
        fn cast(&self, _: &Point3<f64>, _: &UnitVector3<f64>, _: f64) -> Option<Hit> {
            None
        }

        fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
            point.x.abs().min(max)
        }
    }

    /// A body half a metre behind the nozzle, turned about it.
    struct Boom;

    impl Tool for Boom {
        fn vehicle(&self, nozzle: &NozzleState, heading: f64) -> Option<VehicleState> {
            let back = Vector3::new(heading.cos(), heading.sin(), 0.0) * 0.5;
            Some(VehicleState { position: nozzle.position - back, heading, pan: -heading, tilt: 0.0 })
        }

        fn spheres(&self, vehicle: &VehicleState, out: &mut Vec<(Point3<f64>, f64)>) {
            out.push((vehicle.position, 0.3));
        }
    }

    #[test]
    fn an_update_is_as_good_as_a_new_graph() {
        let nozzle = |k: usize| {
            let position = Point3::new(-0.1 - 0.01 * (k % 7) as f64, 0.02 * k as f64, 1.0);
            Ok(NozzleState { position, direction: Vector3::x_axis() })
        };
        let mut nozzles: Vec<Result<NozzleState, NotServed>> = (0..40).map(nozzle).collect();
        let mut clearance = vec![0.03; 40];
        let mut checker = ClearanceChecker::new(&Plane, &Boom);
        let mut graph = HeadingGraph::build(&nozzles, &mut checker, 72);
        let possible = |graph: &mut HeadingGraph, nozzles: &[Result<NozzleState, NotServed>], clearance: &[f64]| {
            let all = (0..72).flat_map(|bin| (0..40).map(move |i| (i, bin)));
            graph.check(all, nozzles, &mut ClearanceChecker::new(&Plane, &Boom), clearance);
            graph.nodes.iter().map(Option::is_some).collect::<Vec<bool>>()
        };
        let before = possible(&mut graph, &nozzles, &clearance);
        let changed = [3, 4, 5, 20, 33];
        for &k in &changed {
            clearance[k] = 0.15;
        }
        nozzles[20] = Err(NotServed::TooNear);
        graph.update(&nozzles, &mut checker, &changed);
        let mut again = HeadingGraph::build(&nozzles, &mut checker, 72);
        let after = possible(&mut graph, &nozzles, &clearance);
        assert_eq!(after, possible(&mut again, &nozzles, &clearance));
        assert_ne!(after, before);
    }
}
