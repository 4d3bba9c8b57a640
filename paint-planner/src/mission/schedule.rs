//! When the robots of a team fly: as soon as none comes too near to another.

use nalgebra::Point3;

use super::team::{Team, Turn};
use crate::error::Error;
use crate::trajectory::Trajectory;

/// Time between two looks at a flight, s: the vehicle moves by a decimetre.
const STEP: f64 = 0.2;
/// A flight that comes too near another begins so much later, s.
const DELAY: f64 = 1.0;
/// Planned distances are larger than those asked for by this, m: wind, and what is between two looks.
const MARGIN: f64 = 0.25;

/// Where one robot is at any time: it waits where a flight begins or has ended.
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

    fn at(&self, time: f64) -> Point3<f64> {
        let index = ((time - self.start) / self.step).round().max(0.0) as usize;
        self.positions[index.min(self.positions.len() - 1)]
    }
}

impl Track {
    /// Adds what follows: positions every `step` seconds from `start` on, m, world frame. Without any nothing is added.
    pub fn push(&mut self, start: f64, step: f64, positions: Vec<Point3<f64>>) {
        if !positions.is_empty() {
            self.pieces.push(TrackPiece { start, step, positions });
        }
    }

    /// When the last piece ends, s.
    fn end(&self) -> f64 {
        self.pieces.last().map_or(0.0, TrackPiece::end)
    }

    fn at(&self, time: f64) -> Option<Point3<f64>> {
        let begun = self.pieces.partition_point(|piece| piece.start <= time);
        self.pieces.get(begun.saturating_sub(1)).map(|piece| piece.at(time))
    }
}

/// Least distance between two of some robots from their first to their last motion, m; `None` for fewer than two.
pub fn nearest_approach(tracks: &[Track]) -> Option<f64> {
    let until = tracks.iter().map(Track::end).fold(0.0, f64::max);
    let tracks: Vec<&Track> = tracks.iter().filter(|track| !track.pieces.is_empty()).collect();
    let times = || (0..=(until / STEP).ceil() as usize).map(|k| STEP * k as f64);
    let pairs = (0..tracks.len()).flat_map(|a| (0..a).map(move |b| (a, b)));
    let apart = |(a, b): (usize, usize)| {
        let distance = |time| tracks[a].at(time).zip(tracks[b].at(time)).map(|(p, q)| (p - q).norm());
        times().filter_map(distance).fold(f64::INFINITY, f64::min)
    };
    pairs.map(apart).reduce(f64::min)
}

/// Flights that follow each other without a pause: those of a robot in one cell.
struct Block {
    turn: Turn,
    flights: std::ops::Range<usize>,
}

/// The start of every flight, s. Each begins as soon as its robot is free and none comes too near to another:
/// first cells from the first robot on, second cells from the last, so that each moves on into a cell that has been left.
pub(super) fn schedule(flights: &[(Turn, &Trajectory)], team: &Team) -> Result<Vec<f64>, Error> {
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
        let soonest = f64::max(free[robot], begun);
        let mut start = soonest;
        if team.robots > 1 {
            let positions = positions(&flights[range.clone()]);
            start = conflict_free(&tracks, robot, positions.clone(), soonest, team.apart + MARGIN)
                .ok_or(Error::TeamTooNear { robot, apart: team.apart })?;
            tracks[robot].push(start, STEP, positions);
        }
        for k in range {
            starts[k] = start;
            start += flights[k].1.duration();
        }
        free[robot] = start;
        end = end.max(start);
    }
    Ok(starts)
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

/// The soonest start of what a robot flies at which it stays `apart` from the others, m, waiting and flying; `None` if it never does.
fn conflict_free(tracks: &[Track], robot: usize, positions: Vec<Point3<f64>>, soonest: f64, apart: f64) -> Option<f64> {
    let others: Vec<&Track> = tracks.iter().enumerate().filter(|(k, _)| *k != robot).map(|(_, track)| track).collect();
    // From then on the others wait.
    let quiet = others.iter().map(|track| track.end()).fold(soonest, f64::max);
    let waits_from = if tracks[robot].pieces.is_empty() { 0.0 } else { tracks[robot].end() };
    let mut track = tracks[robot].clone();
    track.push(soonest, STEP, positions);
    let last = track.pieces.len() - 1;
    let too_near = |track: &Track, time: f64| {
        let here = track.at(time);
        let near = |other: &&Track| here.zip(other.at(time)).is_some_and(|(p, q)| (p - q).norm() < apart);
        others.iter().any(near)
    };
    for attempt in 0.. {
        let start = soonest + DELAY * f64::from(attempt);
        if start > quiet + DELAY {
            break;
        }
        track.pieces[last].start = start;
        let until = quiet.max(track.end());
        let looks = ((until - waits_from) / STEP).ceil() as usize;
        let conflict = (0..=looks).map(|k| waits_from + STEP * k as f64).find(|time| too_near(&track, *time));
        match conflict {
            None => return Some(start),
            // Where it waits it is in the way of another, which no later start changes.
            Some(time) if time < start && last > 0 => return None,
            Some(_) => {}
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From a place along y to another at 1 m/s.
    fn way(from: f64, to: f64) -> Vec<Point3<f64>> {
        let steps = ((to - from).abs() / STEP).round() as usize;
        (0..=steps).map(|k| Point3::new(0.0, from + (to - from) * k as f64 / steps as f64, 1.0)).collect()
    }

    /// Another waits at 7 m until 20 s, and goes on to 13 m then. Who comes from 0 to 8 m may be at 5 m at 20 s: he starts at 15 s.
    #[test]
    fn a_robot_starts_when_another_has_left() {
        let mut other = Track::default();
        other.push(20.0, STEP, way(7.0, 13.0));
        let tracks = [Track::default(), other];
        let start = conflict_free(&tracks, 0, way(0.0, 8.0), 0.0, 2.0).unwrap();
        assert!((14.9..=16.1).contains(&start), "{start}");
        assert_eq!(conflict_free(&tracks, 0, way(0.0, 4.0), 3.0, 2.0), Some(3.0), "it is in nobody's way");
        assert_eq!(conflict_free(&tracks, 0, way(0.0, 12.0), 0.0, 2.0), None, "the other stays at 13 m");
    }

    /// One that waits at 6 m after its first flight is in the way of another that comes to 5 m at 10 s, whenever it goes on to 0 m.
    #[test]
    fn a_robot_that_waits_in_the_way_is_told_of() {
        let (mut own, mut other) = (Track::default(), Track::default());
        own.push(0.0, STEP, way(8.0, 6.0));
        other.push(0.0, STEP, way(15.0, 5.0));
        assert_eq!(conflict_free(&[own, other], 0, way(6.0, 0.0), 9.0, 2.0), None);
    }
}
