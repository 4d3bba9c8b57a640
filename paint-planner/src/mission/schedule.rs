//! When the robots of a team fly: as soon as none comes too near to another.

use nalgebra::Point3;

use super::team::{Team, Turn};
use crate::trajectory::Trajectory;

/// Time between two looks at a flight, s: the vehicle moves by a decimetre.
const STEP: f64 = 0.2;
/// A flight that comes too near another begins so much later, s.
const DELAY: f64 = 1.0;
/// Planned distances are larger than those asked for by this, m: wind, and what is between two looks.
const MARGIN: f64 = 0.25;

/// Where one robot is while it flies; a robot that waits is on the ground.
#[derive(Debug, Clone, Default)]
pub struct Track {
    pieces: Vec<TrackPiece>,
}

#[derive(Debug, Clone)]
struct TrackPiece {
    start: f64,
    step: f64,
    positions: Vec<Point3<f64>>,
}

impl TrackPiece {
    fn end(&self) -> f64 {
        self.start + self.step * (self.positions.len() - 1) as f64
    }

    /// On the ground from half a step after its end on.
    fn at(&self, time: f64) -> Option<Point3<f64>> {
        self.positions.get(((time - self.start) / self.step).round().max(0.0) as usize).copied()
    }
}

impl Track {
    /// Adds a flight that follows: positions every `step` seconds from `start` on, m, world frame. Without any nothing is added.
    pub fn push(&mut self, start: f64, step: f64, positions: Vec<Point3<f64>>) {
        if !positions.is_empty() {
            self.pieces.push(TrackPiece { start, step, positions });
        }
    }

    /// When the last flight ends, s.
    fn end(&self) -> f64 {
        self.pieces.last().map_or(0.0, TrackPiece::end)
    }

    fn at(&self, time: f64) -> Option<Point3<f64>> {
        let begun = self.pieces.partition_point(|piece| piece.start <= time);
        self.pieces[..begun].last()?.at(time)
    }
}

/// Least distance between two of some robots while both fly, m; `None` if that never is.
pub fn nearest_approach(tracks: &[Track]) -> Option<f64> {
    let until = tracks.iter().map(Track::end).fold(0.0, f64::max);
    let pairs = (0..tracks.len()).flat_map(|a| (0..a).map(move |b| (a, b)));
    let apart = |(a, b): (usize, usize)| {
        let times = (0..=(until / STEP).ceil() as usize).map(|k| STEP * k as f64);
        let distance = |time| tracks[a].at(time).zip(tracks[b].at(time)).map(|(p, q)| (p - q).norm());
        times.filter_map(distance).reduce(f64::min)
    };
    pairs.filter_map(apart).reduce(f64::min)
}

/// Flights that follow each other without a pause: those of a robot in one cell.
struct Block {
    turn: Turn,
    flights: std::ops::Range<usize>,
}

/// The start of every flight, s. Each begins as soon as its robot is free and none comes too near to another:
/// first cells from the first robot on, second cells from the last, so that each moves on into a cell that has been left.
pub(super) fn schedule(flights: &[(Turn, &Trajectory)], team: &Team) -> Vec<f64> {
    let mut blocks: Vec<Block> = Vec::new();
    for (k, (turn, _)) in flights.iter().enumerate() {
        match blocks.last_mut() {
            Some(block) if block.turn == *turn => block.flights.end = k + 1,
            _ => blocks.push(Block { turn: *turn, flights: k..k + 1 }),
        }
    }
    let order = |Turn { layer, robot, shift }: Turn| {
        (layer, shift, if shift % 2 == 0 { robot } else { team.robots.saturating_sub(1 + robot) })
    };
    blocks.sort_by_key(|block| order(block.turn));
    let mut tracks = vec![Track::default(); team.robots];
    let mut starts = vec![0.0; flights.len()];
    let (mut free, mut layer, mut begun, mut end) = (vec![0.0; team.robots], 0, 0.0, 0.0_f64);
    for Block { turn, flights: range } in blocks {
        if turn.layer != layer {
            (layer, begun) = (turn.layer, end);
        }
        let robot = turn.robot;
        let mut start = f64::max(free[robot], begun);
        if team.robots > 1 {
            let positions = positions(&flights[range.clone()]);
            start = conflict_free(&tracks, robot, &positions, start, team.apart + MARGIN);
            tracks[robot].push(start, STEP, positions);
        }
        for k in range {
            starts[k] = start;
            start += flights[k].1.duration();
        }
        free[robot] = start;
        end = end.max(start);
    }
    starts
}

/// Positions of the vehicle through some flights, [`STEP`] apart.
fn positions(flights: &[(Turn, &Trajectory)]) -> Vec<Point3<f64>> {
    let total: f64 = flights.iter().map(|(_, trajectory)| trajectory.duration()).sum();
    let mut positions = Vec::with_capacity((total / STEP) as usize + 2);
    let mut begun = 0.0;
    for (_, trajectory) in flights {
        while STEP * positions.len() as f64 <= begun + trajectory.duration() {
            positions.push(trajectory.sample(STEP * positions.len() as f64 - begun).position);
        }
        begun += trajectory.duration();
    }
    positions.extend(flights.last().map(|(_, trajectory)| trajectory.sample(f64::MAX).position));
    positions
}

/// The soonest start of what a robot flies at which it stays `apart` from the others, m: when all others have landed at the latest.
fn conflict_free(tracks: &[Track], robot: usize, positions: &[Point3<f64>], soonest: f64, apart: f64) -> f64 {
    let others: Vec<&Track> = tracks.iter().enumerate().filter(|(k, _)| *k != robot).map(|(_, track)| track).collect();
    let landed = others.iter().map(|track| track.end()).fold(soonest, f64::max) + STEP;
    let too_near = |place: &Point3<f64>, time: f64| {
        others.iter().any(|other| other.at(time).is_some_and(|there| (place - there).norm() < apart))
    };
    let conflict = |start: &f64| (0..).zip(positions).any(|(k, place)| too_near(place, start + STEP * f64::from(k)));
    let starts = (0..).map(|attempt| soonest + DELAY * f64::from(attempt)).take_while(|start| *start < landed);
    starts.into_iter().find(|start| !conflict(start)).unwrap_or(landed)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From a place along y to another at 1 m/s.
    fn way(from: f64, to: f64) -> Vec<Point3<f64>> {
        let steps = ((to - from).abs() / STEP).round() as usize;
        (0..=steps).map(|k| Point3::new(0.0, from + (to - from) * k as f64 / steps as f64, 1.0)).collect()
    }

    /// Another comes from 7 to 13 m from 20 s on. Who comes from 0 to 8 m may be at 5 m at 20 s, and follows it from then on.
    #[test]
    fn a_robot_starts_when_another_has_left() {
        let mut other = Track::default();
        other.push(20.0, STEP, way(7.0, 13.0));
        let tracks = [Track::default(), other];
        assert_eq!(conflict_free(&tracks, 0, &way(0.0, 4.0), 3.0, 2.0), 3.0, "it is in nobody's way");
        assert_eq!(conflict_free(&tracks, 0, &way(0.0, 8.0), 0.0, 2.0), 0.0, "at 8 m it lands");
        let start = conflict_free(&tracks, 0, &way(0.0, 8.0), 13.0, 2.0);
        assert!((14.9..=16.1).contains(&start), "{start}");
        // The other is at 13 m until 26 s: at 12 m one may be when it has landed.
        let start = conflict_free(&tracks, 0, &way(0.0, 12.0), 14.5, 2.0);
        assert!((14.9..=16.1).contains(&start), "{start}");
    }

    /// Who flies towards another is kept on the ground until that has landed.
    #[test]
    fn a_robot_waits_until_another_has_landed() {
        let mut other = Track::default();
        other.push(0.0, STEP, way(15.0, 5.0));
        let start = conflict_free(&[Track::default(), other], 0, &way(5.0, 15.0), 1.0, 2.0);
        assert!((10.0..=11.0).contains(&start), "{start}");
    }
}
