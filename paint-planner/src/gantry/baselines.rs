//! What the planner is compared with: greedy, random, and all paths there are (handheld paper, Section VI-A).

use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};

use super::lattice::{Lattice, Segment};
use super::model::PaintModel;

/// Speeds of the path that takes at each decision the movement which places most, by simulation of everything up to there. Equal ones
/// go to the smallest change of speed, then to the lower position.
pub fn greedy_path(model: &mut dyn PaintModel, lattice: &Lattice) -> Vec<i32> {
    let mut speeds: Vec<i32> = Vec::with_capacity(lattice.horizon);
    for _ in 0..lattice.horizon {
        let speed = speeds.last().copied().unwrap_or(lattice.start_speed());
        let mut best: Option<(f64, i32)> = None;
        for next in lattice.next_speeds(speeds.iter().sum(), speed) {
            speeds.push(next);
            let paint = model.simulate(&lattice.path(&speeds));
            speeds.pop();
            let better = best.is_none_or(|(most, chosen)| {
                paint > most || (paint == most && (next - speed).abs() < (chosen - speed).abs())
            });
            if better {
                best = Some((paint, next));
            }
        }
        speeds.push(best.map_or(0, |(_, next)| next));
    }
    speeds
}

/// Speeds of a path that chooses among the possible movements at random.
pub fn random_path(lattice: &Lattice, seed: u64) -> Vec<i32> {
    let mut random = SplitMix64::seed_from_u64(seed);
    let mut speeds: Vec<i32> = Vec::with_capacity(lattice.horizon);
    for _ in 0..lattice.horizon {
        let speed = speeds.last().copied().unwrap_or(lattice.start_speed());
        let choices: Vec<i32> = lattice.next_speeds(speeds.iter().sum(), speed).collect();
        let choice = (random.next_u64() % choices.len().max(1) as u64) as usize;
        speeds.push(choices.get(choice).copied().unwrap_or(0));
    }
    speeds
}

/// Paint that each path of the lattice places, m^3: 3^7 = 2187 at the paper's setting, fewer near the ends of the slide.
pub fn all_paths(model: &mut dyn PaintModel, lattice: &Lattice) -> Vec<f64> {
    let mut paints = Vec::new();
    extend(model, lattice, &mut Vec::new(), &mut paints);
    paints
}

fn extend(model: &mut dyn PaintModel, lattice: &Lattice, path: &mut Vec<Segment>, paints: &mut Vec<f64>) {
    if path.len() == lattice.horizon {
        paints.push(model.simulate(path));
        return;
    }
    let (cell, speed) = path.last().map_or((0, lattice.start_speed()), |last| (last.cell + last.speed, last.speed));
    for next in lattice.next_speeds(cell, speed) {
        path.push(lattice.segment(path.len(), cell, next));
        extend(model, lattice, path, paints);
        path.pop();
    }
}

/// Rank of a path that places `paint` among all: 1 and one more for each that places strictly more.
pub fn rank(paint: f64, all: &[f64]) -> usize {
    1 + all.iter().filter(|other| **other > paint).count()
}
