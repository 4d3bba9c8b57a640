//! Shortest path through (state x heading bin): the global optimum of VR paper, Eq. (7), on the grid.

use super::graph::{HeadingGraph, Node};
use crate::settings::HeadingSettings;
use std::f64::consts::TAU;
use std::ops::Range;

/// Keeps the quotient of Eq. (7) finite where the body stands still, m^2.
const MIN_SQUARED_STEP: f64 = 1e-6;
const NO_PARENT: u32 = u32::MAX;

/// The best bins and where the vehicle has to be carried over a break.
pub(crate) struct Path {
    /// Bin per state; `None` where no heading is possible.
    pub(crate) bins: Vec<Option<usize>>,
    /// `joined[i]`: the search went from state i to i+1 inside the window.
    pub(crate) joined: Vec<bool>,
    pub(crate) cost: f64,
}

impl Path {
    /// Maximal ranges of states joined to each other.
    pub(crate) fn runs(&self) -> Vec<Range<usize>> {
        let mut runs: Vec<Range<usize>> = Vec::new();
        for i in 0..self.bins.len() {
            if self.bins[i].is_none() {
                continue;
            }
            match runs.last_mut() {
                Some(run) if run.end == i && self.joined[i - 1] => run.end = i + 1,
                _ => runs.push(i..i + 1),
            }
        }
        runs
    }
}

/// Cost of one edge, Eq. (7) with the squared distance the text asks for: `dpsi^2 / D^2 + c_e D^2`.
pub(super) fn edge(from: &Node, to: &Node, turn: f64, ce: f64) -> f64 {
    let distance = (to.position - from.position).norm_squared();
    turn * turn / (distance + MIN_SQUARED_STEP) + ce * distance
}

/// Viterbi over the graph. Equal costs go to the lowest bin. Where no bin of a layer can be reached inside the window,
/// or the strokes are not linked, any bin may follow any other: the flight between is planned separately.
pub(crate) fn search(graph: &HeadingGraph, linked: &[bool], settings: &HeadingSettings) -> Path {
    let bins = graph.bins;
    let least: Vec<f64> = (0..=bins / 2).map(|k| least_edge(k as f64 * TAU / bins as f64, settings.ce)).collect();
    let window = &least[..=settings.window.min(bins / 2 - 1)];
    let mut parents = vec![NO_PARENT; graph.nodes.len()];
    let mut joined = vec![false; graph.len().saturating_sub(1)];
    let (mut best, mut next) = (vec![f64::INFINITY; bins], vec![0.0; bins]);
    let mut previous: Option<usize> = None;
    for i in 0..graph.len() {
        let layer = graph.layer(i);
        if layer.iter().all(Option::is_none) {
            continue;
        }
        next.fill(0.0);
        if let Some(before) = previous {
            let parent = &mut parents[i * bins..(i + 1) * bins];
            let old = graph.layer(before);
            next.fill(f64::INFINITY);
            if before + 1 == i && linked[before] {
                relax((old, &best), (layer, &mut next), parent, window, settings.ce);
                joined[before] = next.iter().any(|cost| cost.is_finite());
            }
            if next.iter().all(|cost| cost.is_infinite()) {
                relax((old, &best), (layer, &mut next), parent, &least, settings.ce);
            }
        }
        for (cost, node) in next.iter_mut().zip(layer) {
            *cost += node.map_or(f64::INFINITY, |node| settings.pan * node.pan * node.pan);
        }
        std::mem::swap(&mut best, &mut next);
        previous = Some(i);
    }
    trace(graph, &parents, joined, &best, previous)
}

/// The least that a turn costs, whatever the distance flown meanwhile.
fn least_edge(turn: f64, ce: f64) -> f64 {
    // The minimum over D^2 lies at D^2 + MIN_SQUARED_STEP = turn / sqrt(ce). Rounding must not make it too large.
    let root = ce.sqrt();
    let least = if turn > root * MIN_SQUARED_STEP {
        2.0 * turn * root - ce * MIN_SQUARED_STEP
    } else {
        turn * turn / MIN_SQUARED_STEP
    };
    (1.0 - 1e-9) * least
}

/// Cheapest ways from one layer to the next over turns of at most `least.len() - 1` bins, `least` being the least cost of each. Turns
/// that cost too much at any distance are not looked at.
fn relax(
    (old, best): (&[Option<Node>], &[f64]),
    (layer, next): (&[Option<Node>], &mut [f64]),
    parent: &mut [u32],
    least: &[f64],
    ce: f64,
) {
    let bins = layer.len();
    let cheapest = best.iter().copied().fold(f64::INFINITY, f64::min);
    for (bin, node) in layer.iter().enumerate() {
        let Some(node) = node else { continue };
        for (shift, least) in least.iter().enumerate() {
            if cheapest + least > next[bin] {
                break;
            }
            let turn = shift as f64 * TAU / bins as f64;
            let (left, right) = ((bin + bins - shift) % bins, (bin + shift) % bins);
            for from in [left, right].into_iter().take(if left == right { 1 } else { 2 }) {
                if !best[from].is_finite() || best[from] + least > next[bin] {
                    continue;
                }
                let Some(start) = &old[from] else { continue };
                let cost = best[from] + edge(start, node, turn, ce);
                if cost < next[bin] || (cost == next[bin] && (from as u32) < parent[bin]) {
                    next[bin] = cost;
                    parent[bin] = from as u32;
                }
            }
        }
    }
}

fn trace(graph: &HeadingGraph, parents: &[u32], joined: Vec<bool>, best: &[f64], last: Option<usize>) -> Path {
    let mut path = Path { bins: vec![None; graph.len()], joined, cost: 0.0 };
    let Some(last) = last else { return path };
    let mut bin = 0;
    for (candidate, cost) in best.iter().enumerate() {
        if *cost < best[bin] {
            bin = candidate;
        }
    }
    path.cost = best[bin];
    for i in (0..=last).rev() {
        if graph.layer(i).iter().all(Option::is_none) {
            continue;
        }
        path.bins[i] = Some(bin);
        match parents[i * graph.bins + bin] {
            NO_PARENT => break,
            parent => bin = parent as usize,
        }
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    /// Every path through a small random graph, by counting in base `bins`.
    fn brute_force(graph: &HeadingGraph, settings: &HeadingSettings) -> f64 {
        let (bins, layers) = (graph.bins, graph.len());
        let mut least = f64::INFINITY;
        'paths: for code in 0..bins.pow(layers as u32) {
            let choice: Vec<usize> = (0..layers).map(|i| code / bins.pow(i as u32) % bins).collect();
            let mut cost = 0.0;
            for i in 0..layers {
                let Some(node) = graph.layer(i)[choice[i]] else { continue 'paths };
                cost += settings.pan * node.pan * node.pan;
                if i == 0 {
                    continue;
                }
                let Some(before) = graph.layer(i - 1)[choice[i - 1]] else { continue 'paths };
                let shift = (choice[i] + bins - choice[i - 1]) % bins;
                let turns = shift.min(bins - shift);
                if turns > settings.window {
                    continue 'paths;
                }
                // Eq. (7), written out again.
                let [x, y, z]: [f64; 3] = (node.position - before.position).into();
                let (turn, square) = (turns as f64 * TAU / bins as f64, x * x + y * y + z * z);
                cost += turn.powi(2) / (square + 1e-6) + settings.ce * square;
            }
            least = least.min(cost);
        }
        least
    }

    #[test]
    fn the_search_equals_brute_force() {
        let mut state = 7_u64;
        let mut random = move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) as f64 / f64::from(1_u32 << 31)
        };
        let settings = HeadingSettings { window: 1, ..HeadingSettings::default() };
        let mut solvable = 0;
        for _ in 0..60 {
            let (bins, layers) = (6, 5);
            let nodes = (0..bins * layers)
                .map(|_| {
                    let position = Point3::new(random(), random(), random()) * 0.15;
                    (random() < 0.7).then(|| Node { position, pan: random() - 0.5 })
                })
                .collect();
            let graph = HeadingGraph::from_nodes(bins, nodes);
            let expected = brute_force(&graph, &settings);
            let path = search(&graph, &[true; 4], &settings);
            if expected.is_finite() {
                solvable += 1;
                assert!((path.cost - expected).abs() < 1e-9 * expected);
                assert_eq!(path.runs(), vec![0..layers]);
            } else {
                assert_ne!(path.runs(), vec![0..layers]);
            }
        }
        assert!(solvable > 20);
    }

    #[test]
    fn ties_go_to_the_lowest_bin() {
        let node = Node { position: Point3::origin(), pan: 0.0 };
        let graph = HeadingGraph::from_nodes(4, vec![Some(node); 12]);
        let path = search(&graph, &[true; 2], &HeadingSettings::default());
        assert_eq!(path.bins, vec![Some(0); 3]);
    }
}
