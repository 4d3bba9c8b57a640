//! The path of the largest sum of scores (handheld paper, Section IV-D).
//!
//! All paths through the layered graph have equally many edges, so that the paper's Dijkstra, run on the differences to the largest score, and one
//! sweep from the last layer to the first find the same path; the sweep looks at every edge once.

use super::edge_scores::EdgeScores;
use super::lattice::Lattice;

/// Values and decisions of all nodes.
#[derive(Debug)]
pub(super) struct ValueSweep {
    /// For each layer the first cell, and for each cell and incoming speed the best sum from there on and the speed that begins it.
    layers: Vec<(i32, Vec<(f64, i32)>)>,
    fastest: i32,
}

impl ValueSweep {
    pub(super) fn new(lattice: &Lattice, scores: &EdgeScores) -> Self {
        let fastest = lattice.fastest;
        let mut sweep = Self { layers: Vec::with_capacity(lattice.horizon), fastest };
        for layer in (0..lattice.horizon).rev() {
            let [first, last] = lattice.reach(layer);
            let nodes = (first..=last).flat_map(|cell| (-fastest..=fastest).map(move |speed| (cell, speed)));
            let values = nodes.map(|(cell, speed)| sweep.best(lattice, scores, layer, cell, speed)).collect();
            sweep.layers.push((first, values));
        }
        sweep.layers.reverse();
        sweep
    }

    /// The best way on from a node while the layers behind it are in reverse order. Equal values go to the smallest change of speed, then
    /// to the lower position.
    fn best(&self, lattice: &Lattice, scores: &EdgeScores, layer: usize, cell: i32, speed: i32) -> (f64, i32) {
        let behind = lattice.horizon - layer - 1;
        let mut best: Option<(f64, i32)> = None;
        for next in lattice.next_speeds(cell, speed) {
            let onwards = match behind.checked_sub(1) {
                None => 0.0,
                Some(index) => self.node(index, cell + next, next).0,
            };
            let value = scores.of(layer, cell, next) + onwards;
            let better = best.is_none_or(|(most, chosen)| {
                value > most || (value == most && (next - speed).abs() < (chosen - speed).abs())
            });
            if better {
                best = Some((value, next));
            }
        }
        // A cell on the slide can at least be stayed in.
        best.unwrap_or((0.0, 0))
    }

    fn node(&self, index: usize, cell: i32, speed: i32) -> (f64, i32) {
        let (first, values) = &self.layers[index];
        values[((cell - first) * (2 * self.fastest + 1) + speed + self.fastest) as usize]
    }

    /// Best sum from a node on.
    pub(super) fn value(&self, layer: usize, cell: i32, speed: i32) -> f64 {
        self.layers.get(layer).map_or(0.0, |_| self.node(layer, cell, speed).0)
    }

    /// Speeds of the best path that begins with `prefix`.
    pub(super) fn complete(&self, prefix: &[i32], start_speed: i32) -> Vec<i32> {
        let mut speeds = prefix.to_vec();
        let mut cell = speeds.iter().sum();
        for layer in speeds.len()..self.layers.len() {
            let speed = speeds.last().copied().unwrap_or(start_speed);
            let next = self.node(layer, cell, speed).1;
            speeds.push(next);
            cell += next;
        }
        speeds
    }
}
