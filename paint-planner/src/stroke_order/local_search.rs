//! A tour over oriented strokes: nearest neighbour, then 2-opt and Or-opt until neither helps.

use std::ops::Range;

use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};

use super::stroke::OrderedStroke;
use super::transit_cost::{End, TransitCost, other};

/// Neighbours of every end that improvements are looked for among.
const NEIGHBOURS: usize = 12;
/// Longest run of strokes that Or-opt moves.
const RUN: usize = 3;
/// Most beginnings that are tried, and the number of distances that may cost.
const MAX_BEGINNINGS: usize = 8;
const GREEDY_EFFORT: usize = 4_000_000;
/// Exchanges of stretches that are tried, and over how many strokes one reaches.
const KICKS_PER_STROKE: usize = 10;
const MAX_KICKS: usize = 6000;
const KICK_LENGTH: usize = 50;
/// Gains below this are rounding, s.
const GAIN: f64 = 1e-9;

/// Strokes in flying order, each by the end at which it is entered.
pub(super) struct Tour {
    entries: Vec<End>,
}

impl Tour {
    /// Goes to the nearest end of a stroke that is left, from the best of some beginnings.
    pub(super) fn greedy(cost: &TransitCost) -> Self {
        let ends = 2 * cost.strokes();
        // Every end would be O(n^3): some, spread over all.
        let beginnings = (GREEDY_EFFORT / (ends * ends).max(1)).clamp(1, MAX_BEGINNINGS);
        let stride = ends.div_ceil(beginnings).max(1);
        let tours = (0..ends).step_by(stride).map(|first| Self::nearest_neighbour(first, cost));
        let best = tours.min_by(|a, b| a.duration(cost).total_cmp(&b.duration(cost)));
        best.unwrap_or(Self { entries: Vec::new() })
    }

    fn nearest_neighbour(first: End, cost: &TransitCost) -> Self {
        let mut left: Vec<End> = (0..2 * cost.strokes()).filter(|&end| end / 2 != first / 2).collect();
        let mut entries = vec![first];
        let mut exit = other(first);
        while let Some(&next) = left.iter().min_by(|a, b| cost.between(exit, **a).total_cmp(&cost.between(exit, **b))) {
            entries.push(next);
            exit = other(next);
            left.retain(|end| end / 2 != next / 2);
        }
        Self { entries }
    }

    /// Seconds of all transits.
    pub(super) fn duration(&self, cost: &TransitCost) -> f64 {
        duration(&self.entries, 0..self.entries.len(), cost)
    }

    pub(super) fn into_strokes(self) -> Vec<OrderedStroke> {
        self.entries.iter().map(|end| OrderedStroke { index: end / 2, reversed: end % 2 == 1 }).collect()
    }

    /// Improves until no neighbour offers a gain, then tries exchanges of nearby stretches, each followed by the same and kept
    /// if it gains: iterated local search (Lourenco, Martin and Stutzle 2003).
    pub(super) fn improve(&mut self, cost: &TransitCost) {
        let count = self.entries.len();
        let neighbours = neighbours(cost);
        self.improve_around((0..count).collect(), &neighbours, cost);
        if count < 4 {
            return;
        }
        // Where stretches are exchanged decides only how soon a good order is found.
        let mut random = SplitMix64::seed_from_u64(count as u64);
        let mut before = self.entries.clone();
        for _ in 0..(KICKS_PER_STROKE * count).min(MAX_KICKS) {
            let touched = self.exchange_stretches(&mut random);
            self.improve_around(touched, &neighbours, cost);
            let differs = |at: &usize| before[*at] != self.entries[*at];
            let Some(from) = (0..count).find(differs) else { continue };
            let to = (from..count).rev().find(differs).map_or(from, |last| last + 1);
            if duration(&self.entries, from..to, cost) < duration(&before, from..to, cost) - GAIN {
                before[from..to].copy_from_slice(&self.entries[from..to]);
            } else {
                self.entries[from..to].copy_from_slice(&before[from..to]);
            }
        }
    }

    /// Double bridge over a short stretch of the flight; returns the strokes at its joints.
    fn exchange_stretches(&mut self, random: &mut SplitMix64) -> Vec<usize> {
        let count = self.entries.len();
        let length = count.min(KICK_LENGTH);
        let mut below = |bound: usize| (random.next_u64() % bound as u64) as usize;
        let from = below(count - length + 1);
        let mut cuts = [0; 3].map(|_| from + below(length + 1));
        cuts.sort_unstable();
        let [a, b, c] = cuts;
        self.entries[a..c].rotate_left(b - a);
        let joints = [a, a + (c - b), c];
        let beside = joints.into_iter().flat_map(|joint| [joint.wrapping_sub(1), joint]);
        beside.filter_map(|at| self.entries.get(at)).map(|end| end / 2).collect()
    }

    /// Improves about some strokes, and about what that changes.
    fn improve_around(&mut self, mut strokes: Vec<usize>, neighbours: &[Vec<End>], cost: &TransitCost) {
        let mut position = vec![0; self.entries.len()];
        locate(&self.entries, &mut position);
        while let Some(stroke) = strokes.pop() {
            while let Some(joined) = self.improve_at(position[stroke], neighbours, &position, cost) {
                locate(&self.entries, &mut position);
                for at in [position[stroke], position[joined]] {
                    let about = self.entries[at.saturating_sub(1)..].iter().take(3);
                    strokes.extend(about.map(|end| end / 2));
                }
            }
        }
    }

    /// Tries the moves that make the transit into the stroke at a position shorter, or the one out of it; returns the stroke
    /// that it was joined to.
    fn improve_at(
        &mut self,
        at: usize,
        neighbours: &[Vec<End>],
        position: &[usize],
        cost: &TransitCost,
    ) -> Option<usize> {
        let (entry, exit) = (self.entries[at], other(self.entries[at]));
        let transits = [(entry, self.way_into(at, entry, cost)), (exit, self.way_out_of(at, exit, cost))];
        for (end, transit) in transits {
            // A gain needs a new transit that is shorter than the one it replaces (Lin and Kernighan 1973).
            for &near in neighbours[end].iter().take_while(|&&near| cost.between(end, near) < transit) {
                let there = position[near / 2];
                if self.reverse_to_join(at, there, cost) || self.move_run(at, there, cost) {
                    return Some(near / 2);
                }
            }
        }
        None
    }

    /// 2-opt: reverses what lies between two positions, or from the one to an end of the flight, if that gains.
    fn reverse_to_join(&mut self, a: usize, b: usize, cost: &TransitCost) -> bool {
        let (low, high) = (a.min(b), a.max(b));
        let last = self.entries.len() - 1;
        let between = [(low, high), (low + 1, high), (low, high.saturating_sub(1))];
        let to_an_end = [(low + 1, last), (high, last), (0, low), (0, high.saturating_sub(1))];
        for (from, to) in between.into_iter().chain(to_an_end) {
            if from > to || to > last {
                continue;
            }
            let before =
                self.way_into(from, self.entries[from], cost) + self.way_out_of(to, other(self.entries[to]), cost);
            let into = self.way_into(from, other(self.entries[to]), cost);
            if into < before - GAIN && into + self.way_out_of(to, self.entries[from], cost) < before - GAIN {
                reverse(&mut self.entries[from..=to]);
                return true;
            }
        }
        false
    }

    /// Or-opt: moves a run of strokes that begins or ends at `at` to before or behind `there`, either way round, if that gains.
    fn move_run(&mut self, at: usize, there: usize, cost: &TransitCost) -> bool {
        let count = self.entries.len();
        for length in 1..=RUN.min(count.saturating_sub(1)) {
            for from in [at, (at + 1).saturating_sub(length)] {
                let to = from + length;
                if to > count {
                    continue;
                }
                let (first, last) = (self.entries[from], other(self.entries[to - 1]));
                let closed = self.entries.get(to).map_or(0.0, |&next| self.way_into(from, next, cost));
                let removed = self.way_into(from, first, cost) + self.way_out_of(to - 1, last, cost) - closed;
                for slot in [there, there + 1].into_iter().filter(|slot| !(from..=to).contains(slot)) {
                    let open = removed + self.gap(slot, cost) - GAIN;
                    for (turned, first, last) in [(false, first, last), (true, last, first)] {
                        let into = self.way_into(slot, first, cost);
                        let out = || self.entries.get(slot).map_or(0.0, |&next| cost.between(last, next));
                        if into < open && into + out() < open {
                            self.shift(from, to, slot, turned);
                            return true;
                        }
                    }
                }
            }
        }
        false
    }

    /// Moves the strokes `from..to` to before the one that is at `slot` now.
    fn shift(&mut self, from: usize, to: usize, slot: usize, turned: bool) {
        let length = to - from;
        let at = if slot < from {
            self.entries[slot..to].rotate_right(length);
            slot
        } else {
            self.entries[from..slot].rotate_left(length);
            slot - length
        };
        if turned {
            reverse(&mut self.entries[at..at + length]);
        }
    }

    /// Seconds of the transit before position `slot`; 0 behind the last stroke.
    fn gap(&self, slot: usize, cost: &TransitCost) -> f64 {
        self.entries.get(slot).map_or(0.0, |&entry| self.way_into(slot, entry, cost))
    }

    /// Seconds from what lies before a position to an end.
    fn way_into(&self, position: usize, end: End, cost: &TransitCost) -> f64 {
        match position.checked_sub(1) {
            Some(before) => cost.between(other(self.entries[before]), end),
            None => cost.first(end),
        }
    }

    /// Seconds from an end to what lies behind a position.
    fn way_out_of(&self, position: usize, end: End, cost: &TransitCost) -> f64 {
        self.entries.get(position + 1).map_or(0.0, |&next| cost.between(end, next))
    }
}

/// Seconds of the transits into and out of a range of strokes.
fn duration(entries: &[End], range: Range<usize>, cost: &TransitCost) -> f64 {
    let first = if range.start == 0 { entries.first().map_or(0.0, |&end| cost.first(end)) } else { 0.0 };
    let about = &entries[range.start.saturating_sub(1)..entries.len().min(range.end + 1)];
    first + about.windows(2).map(|pair| cost.between(other(pair[0]), pair[1])).sum::<f64>()
}

/// The other way round: last stroke first, each entered where it was left.
fn reverse(run: &mut [End]) {
    run.reverse();
    for end in run {
        *end = other(*end);
    }
}

/// Position of every stroke.
fn locate(entries: &[End], position: &mut [usize]) {
    for (at, end) in entries.iter().enumerate() {
        position[end / 2] = at;
    }
}

/// The nearest ends of other strokes, nearest first.
fn neighbours(cost: &TransitCost) -> Vec<Vec<End>> {
    let ends = 2 * cost.strokes();
    let of = |end: End| {
        let mut near: Vec<(f64, End)> =
            (0..ends).filter(|other| other / 2 != end / 2).map(|other| (cost.between(end, other), other)).collect();
        let order = |a: &(f64, End), b: &(f64, End)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        if near.len() > NEIGHBOURS {
            near.select_nth_unstable_by(NEIGHBOURS, order);
            near.truncate(NEIGHBOURS);
        }
        near.sort_unstable_by(order);
        near.into_iter().map(|(_, end)| end).collect()
    };
    (0..ends).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::super::stroke::StrokeEnds;
    use super::*;
    use crate::settings::Settings;
    use crate::target::Target;
    use nalgebra::{Point3, Vector3};

    /// What changes in a range is what changes in the whole flight.
    #[test]
    fn a_range_has_the_transits_into_it_and_out_of_it() {
        let target = |k: u32| {
            let point = Point3::new(0.0, f64::from(k * 7 % 11), f64::from(k * 5 % 13));
            Target { point, normal: -Vector3::x_axis(), dose: 0.0, time: None, stand_off: None }
        };
        let strokes: Vec<StrokeEnds> =
            (0..8).map(|k| StrokeEnds { first: target(2 * k), last: target(2 * k + 1) }).collect();
        let cost = TransitCost::new(&strokes, Some(&target(40)), &Settings::default());
        let before: Vec<End> = (0..8).map(|stroke| 2 * stroke).collect();
        for range in [0..8, 0..3, 2..5, 4..8] {
            let mut after = before.clone();
            reverse(&mut after[range.clone()]);
            let whole = duration(&after, 0..8, &cost) - duration(&before, 0..8, &cost);
            let part = duration(&after, range.clone(), &cost) - duration(&before, range.clone(), &cost);
            assert!(whole.abs() > 0.1 && (whole - part).abs() < 1e-9, "{range:?}: {whole} {part}");
        }
    }

    /// Dots in a row, flown in another order than they lie in: Or-opt puts the one that is out of place where it belongs.
    #[test]
    fn or_opt_moves_a_dot_to_where_it_lies() {
        let strokes: Vec<StrokeEnds> = (0..5)
            .map(|k| {
                let point = Point3::new(0.0, 0.01 * f64::from(k), 1.0);
                let target = Target { point, normal: -Vector3::x_axis(), dose: 0.0, time: None, stand_off: None };
                StrokeEnds { first: target, last: target }
            })
            .collect();
        let cost = TransitCost::new(&strokes, None, &Settings::default());
        let step = cost.between(0, 2);
        let tour = |order: [usize; 5]| Tour { entries: order.map(|stroke| 2 * stroke).to_vec() };
        let anywhere = |tour: &mut Tour| (0..5).any(|at| (0..5).any(|there| tour.move_run(at, there, &cost)));
        // To before another stroke, and to behind the last.
        for order in [[0, 2, 3, 1, 4], [0, 4, 1, 2, 3]] {
            let mut tour = tour(order);
            while anywhere(&mut tour) {}
            assert!((tour.duration(&cost) - 4.0 * step).abs() < 1e-9, "{order:?}: {}", tour.duration(&cost));
        }
        let mut best = tour([0, 1, 2, 3, 4]);
        assert!(!anywhere(&mut best));
    }
}
