//! The time law of a path: as fast as the limits allow at every place, the acceleration continuous and all of it certified.

use super::reachability::{Joint, squared_rates};
use crate::bernstein::Bernstein;
use crate::settings::TimingSettings;
use crate::trajectory::{COARSE, Extrema, Segment, TIGHT, Trajectory};
use nalgebra::Vector3;

/// Longest piece of a path with one control point of the time law, s in the path's own time: what a change of the acceleration takes.
const PIECE: f64 = 0.05;
/// Least pieces of a segment that begins or ends at rest.
const PIECES_AT_REST: usize = 4;
/// Greatest rate against the path's own time. A minimum-snap path leaves rest slower than the acceleration allows; more would be a jerk.
const GREATEST_RATE: f64 = 3.0;
/// Pieces in the place of one for the bound.
const FINER: usize = 4;
/// Rounds in which the acceleration is lowered where the spline between two joints exceeds it.
const ROUNDS: usize = 30;
/// Times closer than this are one, s.
const ROUNDING: f64 = 1e-9;
/// Rounds in which only the joints are asked.
const ROUNDS_AT_JOINTS: usize = 10;
/// Part of the limits left to the certificates, which cost the more the nearer they are.
const SLACK: f64 = 1.0 + 1e-3;
/// Overshoot of a correction, so that the rounds end.
const OVERCORRECTION: f64 = 1.003;

/// A stretch of the path with limits of its own.
#[derive(Debug, Clone, Copy)]
pub(super) struct Edge {
    /// Where it ends in the path's own time, s.
    pub(super) end: f64,
    /// Least time per time of the path's own.
    pub(super) slowness: f64,
    /// Greatest acceleration, m/s^2.
    pub(super) acceleration: f64,
}

/// A path in its new time.
pub(super) struct Retimed {
    pub(super) trajectory: Trajectory,
    /// Certified to a thousandth.
    pub(super) extrema: Extrema,
    /// Time of the fastest law, its acceleration free to jump, s.
    pub(super) bound: f64,
    /// Where its segments begin and the last one ends in the path's own time, s.
    begins: Vec<f64>,
}

impl Retimed {
    /// The new time of a moment of the path's own time, s.
    pub(super) fn time(&self, own: f64) -> f64 {
        let segments = self.trajectory.segments();
        let i = self.begins.partition_point(|begin| *begin <= own).clamp(1, segments.len()) - 1;
        let share = ((own - self.begins[i]) / (self.begins[i + 1] - self.begins[i])).clamp(0.0, 1.0);
        self.trajectory.knots()[i] + segments[i].time(share)
    }
}

/// A part of the path's segment, to be flown at about one rate.
struct Piece {
    path: [Bernstein; 4],
    /// Duration in the path's own time, s.
    length: f64,
    /// Least time per time of the path's own, by all that limits a rate.
    slowness: f64,
    /// The mean of what its edges ask for of that.
    asked: f64,
    /// Greatest acceleration, m/s^2.
    acceleration: f64,
}

impl Piece {
    /// Its parts, at the rates that the limits permit on the mean.
    fn finer(&self, settings: &TimingSettings) -> impl Iterator<Item = Self> {
        (0..FINER).map(|k| {
            let [from, to] = [k, k + 1].map(|k| k as f64 / FINER as f64);
            let (path, length) = (self.path.map(|axis| axis.part(from, to)), self.length / FINER as f64);
            let [x, y, z, turn] = path.map(|axis| axis.value(1.0) - axis.value(0.0));
            let by_rate =
                (Vector3::new(x, y, z).norm() / settings.max_speed).max(turn.abs() / settings.max_heading_rate);
            Self { path, length, slowness: self.asked.max(by_rate / length), ..*self }
        })
    }
}

/// Flies a path, given in a time of its own in which no limit need hold, as fast as it can. `rest` tells of each segment whether it is
/// left from rest; `edges` cover the path in order.
pub(super) fn retime(path: &Trajectory, rest: &[bool], edges: &[Edge], settings: &TimingSettings) -> Retimed {
    let pieces = pieces(path, rest, edges, settings);
    let mut begins = vec![0.0];
    let (mut segments, mut own, mut bound) = (Vec::new(), 0.0, 0.0);
    for span in pieces {
        segments.extend(fastest(&span));
        bound += time_bound(&span, settings);
        for piece in &span {
            own += piece.length;
            begins.push(own);
        }
    }
    let trajectory = Trajectory::of_segments(segments);
    let seen = trajectory.bounds(SLACK - 1.0);
    // The limits are certified piece by piece.
    let extrema = Extrema {
        speed: seen.speed.min(settings.max_speed),
        acceleration: seen.acceleration.min(settings.max_acceleration),
        heading_rate: seen.heading_rate.min(settings.max_heading_rate),
    };
    Retimed { trajectory, extrema, bound, begins }
}

/// The pieces of the path, stop by stop.
fn pieces(path: &Trajectory, rest: &[bool], edges: &[Edge], settings: &TimingSettings) -> Vec<Vec<Piece>> {
    let mut spans: Vec<Vec<Piece>> = Vec::new();
    let (mut edge, mut begin) = (0, 0.0);
    for (i, segment) in path.segments().iter().enumerate() {
        if rest[i] {
            spans.push(Vec::new());
        }
        let duration = segment.duration();
        let at_rest = rest[i] || rest.get(i + 1).is_none_or(|rest| *rest);
        let count = ((duration / PIECE).ceil().max(1.0) as usize).max(if at_rest { PIECES_AT_REST } else { 1 });
        for k in 0..count {
            let [from, to] = [k, k + 1].map(|k| k as f64 / count as f64);
            // Ends of edges are ends of segments, but for the rounding of sums.
            while edge + 1 < edges.len() && edges[edge].end <= begin + from * duration + ROUNDING {
                edge += 1;
            }
            let about = edges[edge..].iter().take_while(|e| e.end < begin + to * duration - ROUNDING).count();
            let own = &edges[edge..(edge + about + 1).min(edges.len())];
            let asked = own.iter().fold(1.0 / GREATEST_RATE, |most, e| most.max(e.slowness));
            let (mut mean, mut since) = (0.0, begin + from * duration);
            for edge in own {
                let until = edge.end.min(begin + to * duration);
                mean += edge.slowness * (until - since) / (duration * (to - from));
                since = until;
            }
            let acceleration = own.iter().fold(settings.max_acceleration, |least, e| least.min(e.acceleration));
            let (path, length) = (segment.path().map(|axis| axis.part(from, to)), duration * (to - from));
            let extrema = Segment::new(&path, &Bernstein::new(&[length])).extrema(&Extrema::default(), COARSE);
            let by_rate = (extrema.speed / settings.max_speed).max(extrema.heading_rate / settings.max_heading_rate);
            let piece = Piece { path, length, slowness: asked.max(by_rate), asked: mean, acceleration };
            if let Some(span) = spans.last_mut() {
                span.push(piece);
            }
        }
        begin += duration;
    }
    spans
}

/// The time law from stop to stop.
fn fastest(span: &[Piece]) -> Vec<Segment> {
    // The spline of a piece lies between its control point and those beside it.
    let mut caps: Vec<f64> = (0..span.len())
        .map(|i| {
            let about = &span[i.saturating_sub(1)..(i + 2).min(span.len())];
            about.iter().fold(f64::INFINITY, |least, piece| least.min(piece.slowness.powi(-2)))
        })
        .collect();
    let mut joints: Vec<Joint> = span.windows(2).map(|pair| joint(&pair[0], &pair[1])).collect();
    // Rates hold by the caps already.
    let free = f64::MAX.sqrt();
    let allowed = Extrema { speed: free, heading_rate: free, acceleration: 0.0 };
    let mut round = 0;
    loop {
        let rates = squared_rates(&caps, &joints);
        let slowness: Vec<f64> = rates.iter().map(|b| b.sqrt().recip()).collect();
        let segments = spline(span, &slowness);
        let mut worst = 1.0_f64;
        for (i, segment) in segments.iter().enumerate() {
            let limit = span[i].acceleration;
            let ratio = segment.extrema(&Extrema { acceleration: limit, ..allowed }, TIGHT).acceleration / limit;
            if ratio > 1.0 {
                worst = worst.max(ratio);
                for k in i.saturating_sub(1)..(i + 1).min(joints.len()) {
                    joints[k].limit /= ratio * OVERCORRECTION;
                }
                // What does not give way at the joints is slowed itself.
                if round >= ROUNDS_AT_JOINTS {
                    for k in i.saturating_sub(1)..(i + 2).min(span.len()) {
                        caps[k] = caps[k].min(rates[k] / ratio);
                    }
                }
            }
        }
        if worst == 1.0 {
            return segments;
        }
        if round == ROUNDS {
            // Exact, as the path does not depend on it.
            return segments.iter().map(|segment| segment.stretched(worst.sqrt() * SLACK)).collect();
        }
        round += 1;
    }
}

/// The time of the fastest law along a span on finer pieces, its acceleration free to jump (TOPP-RA), s: a lower bound as far as these pieces are
/// fine, and as none flies faster than [`GREATEST_RATE`].
fn time_bound(span: &[Piece], settings: &TimingSettings) -> f64 {
    let fine: Vec<Piece> = span.iter().flat_map(|piece| piece.finer(settings)).collect();
    let caps: Vec<f64> = fine.iter().map(|piece| piece.slowness.powi(-2)).collect();
    let joints: Vec<Joint> = fine.windows(2).map(|pair| joint(&pair[0], &pair[1])).collect();
    squared_rates(&caps, &joints).iter().zip(&fine).map(|(rate, piece)| piece.length / rate.sqrt()).sum()
}

fn joint(before: &Piece, after: &Piece) -> Joint {
    let slopes = [0, 1, 2].map(|axis| {
        let first = after.path[axis].derivative();
        [first.value(0.0) / after.length, first.derivative().value(0.0) / after.length.powi(2)]
    });
    let [first, second] = [0, 1].map(|order| slopes.map(|slope| slope[order]).into());
    let limit = before.acceleration.min(after.acceleration) / SLACK;
    Joint { first, second, lengths: [before.length, after.length], limit }
}

/// Quadratic B-spline of `dt/ds` with a control point for each piece: its slope is continuous, and zero at both ends.
fn spline(span: &[Piece], slowness: &[f64]) -> Vec<Segment> {
    let between = |i: usize| {
        let (a, b) = (span[i].length, span[i + 1].length);
        (slowness[i] * b + slowness[i + 1] * a) / (a + b)
    };
    let segment = |(i, piece): (usize, &Piece)| {
        let from = if i > 0 { between(i - 1) } else { slowness[i] };
        let to = if i + 1 < span.len() { between(i) } else { slowness[i] };
        let slowness = Bernstein::new(&[from, slowness[i], to].map(|slowness| slowness * piece.length));
        Segment::new(&piece.path, &slowness)
    };
    span.iter().enumerate().map(segment).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector4;

    const RATE: f64 = 1.0;

    /// A zigzag of ten metres in steps of 0.1 m a quarter of a second, and its time law; the heading turns by `turn` at step 50.
    fn flown(turn: f64, settings: &TimingSettings) -> Retimed {
        let bend = |k: usize| 0.02 * (0.8 * k as f64).sin();
        let points: Vec<Vector4<f64>> =
            (0..=100).map(|k| Vector4::new(0.1 * k as f64, bend(k), 1.0, if k > 50 { turn } else { 0.0 })).collect();
        let path = Trajectory::minimum_snap(&points, &[0.25; 100], &[false; 101]).unwrap();
        let edge = |k: usize| Edge { end: 0.25 * (k + 1) as f64, slowness: 0.4, acceleration: 1.0 };
        let rest: Vec<bool> = (0..100).map(|k| k == 0).collect();
        retime(&path, &rest, &(0..100).map(edge).collect::<Vec<_>>(), settings)
    }

    #[test]
    fn one_bad_spot_slows_itself_only() {
        let settings = TimingSettings { max_heading_rate: RATE, ..TimingSettings::default() };
        let (plain, turning) = (flown(0.0, &settings), flown(2.0, &settings));
        let extrema = turning.trajectory.extrema();
        assert!(extrema.speed <= 0.5 * (1.0 + 1e-6) && extrema.acceleration <= 1.0 + 1e-6, "{extrema:?}");
        assert!(extrema.heading_rate <= RATE * (1.0 + 1e-6) && extrema.heading_rate > 0.9 * RATE, "{extrema:?}");
        // A turn of 2 rad at 1 rad/s with its overshoot, and stopping for it.
        let (before, after) = (plain.trajectory.duration(), turning.trajectory.duration());
        assert!(after - before > 1.5 && after - before < 6.0, "{before} {after}");
        assert!(after >= turning.bound && after < 1.2 * turning.bound, "{after} {}", turning.bound);
        // Two metres off nothing has changed.
        assert!((plain.time(7.0) - turning.time(7.0)).abs() < 1e-6);
    }

    #[test]
    fn times_go_over_to_the_new_law_with_the_path() {
        let retimed = flown(0.5, &TimingSettings::default());
        assert_eq!(retimed.time(0.0), 0.0);
        assert!((retimed.time(25.0) - retimed.trajectory.duration()).abs() < 1e-12);
        // Knots of the path are passed at their new times.
        for k in 0..=100 {
            let place = retimed.trajectory.sample(retimed.time(0.25 * f64::from(k))).position;
            assert!((place.x - 0.1 * f64::from(k)).abs() < 1e-9, "{k}: {place}");
        }
        // The acceleration is the slope of the velocity, without jumps.
        for k in 1..2000 {
            let t = retimed.trajectory.duration() * f64::from(k) / 2000.0;
            let at = |t: f64| retimed.trajectory.sample(t);
            let slope = (at(t + 1e-5).velocity - at(t - 1e-5).velocity) / 2e-5;
            assert!((slope - at(t).acceleration).norm() < 2e-3, "{t}");
        }
    }
}
