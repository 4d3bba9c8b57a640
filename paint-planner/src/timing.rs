//! Times for the route, and the trajectory within limits that results.

mod reachability;
pub(crate) mod speed_profile;
mod time_law;

use crate::error::Error;
use crate::minimum_snap::KnotDerivatives;
use crate::route::RoutePoint;
pub use crate::settings::{TimingPolicy, TimingSettings};
use crate::target::Target;
use crate::trajectory::{Extrema, TIGHT, Trajectory};
use crate::transit::between;
use crate::world::VehicleState;
use nalgebra::Vector4;
pub(crate) use speed_profile::RestToRest;
use speed_profile::SpeedProfile;
use time_law::{Edge, Retimed, retime};

/// Metres of deviation that a radian of heading error counts as: about the lever of an arm.
const HEADING_LEVER: f64 = 0.5;
/// Overshoot of a correction, so that the loop ends.
const OVERCORRECTION: f64 = 1.01;

/// A trajectory with the time of every route point.
#[derive(Debug, Clone)]
pub(crate) struct TimedTrajectory {
    pub(crate) trajectory: Trajectory,
    /// Time of each route point, s.
    pub(crate) times: Vec<f64>,
    pub(crate) extrema: Extrema,
    /// Greatest distance between the trajectory and a route point at its time, m.
    pub(crate) deviation: f64,
    /// Final global stretch factor.
    pub(crate) stretch: f64,
    /// Time of the fastest law along the path, its acceleration free to jump, s; the duration where the polynomials keep their own.
    pub(crate) time_bound: f64,
}

impl TimedTrajectory {
    /// The vehicle on the way between two states that are passed at `times`: on the trajectory, its joints linear in time.
    pub(crate) fn state(&self, from: &VehicleState, to: &VehicleState, times: [f64; 2], share: f64) -> VehicleState {
        let sample = self.trajectory.sample(times[0] + (times[1] - times[0]) * share);
        VehicleState { position: sample.position, heading: sample.heading, ..between(from, to, share) }
    }
}

/// Finds times such that all limits hold, certified. `dense` makes every route point a knot.
///
/// Rounds of: speed profile, minimum snap through the knots; route points that the curve misses become knots. The path that results is
/// flown as fast as the limits allow at each place, from stop to stop.
///
/// Two kinds of route keep the time of their polynomials. What stamps time is stretched as a whole; a route that is entered with the
/// motion `start` is slowed where it breaks a limit, and refused if it still does after the last round.
pub(crate) fn schedule(
    start: &KnotDerivatives,
    route: &[RoutePoint],
    targets: &[Target],
    settings: &TimingSettings,
    dense: bool,
) -> Result<TimedTrajectory, Error> {
    let moving = *start != KnotDerivatives::zeros();
    let mut profile = SpeedProfile::new(route, targets, settings);
    profile.enter_with(start.fixed_view::<1, 3>(0, 0).norm());
    let local = matches!(settings.policy, TimingPolicy::Uniform { .. });
    let own_time = moving || !local;
    let mut knots = first_knots(route, settings, dense);
    let mut slowdown = vec![1.0; route.len() - 1];
    let mut best: Option<Attempt> = None;
    for _ in 0..=settings.rounds {
        let durations = profile.durations(&slowdown, settings);
        let trajectory = fit(start, route, &knots, &durations)?;
        let times = cumulative(&durations);
        let (deviation, missed) = missed_points(route, &knots, &trajectory, &times, settings.tolerance);
        let certified = trajectory.segments().iter().filter(|_| own_time);
        let ratios: Vec<f64> =
            certified.map(|segment| limit_ratio(&segment.extrema(&Extrema::default(), TIGHT), settings)).collect();
        let stretch = ratios.iter().fold(1.0_f64, |most, ratio| most.max(*ratio));
        let attempt = Attempt { trajectory, times, deviation, stretch, knots: knots.clone() };
        let done = missed.is_empty() && (stretch == 1.0 || !local);
        // A route that is entered in motion cannot be stretched.
        let possible = !moving || stretch == 1.0;
        if possible && best.as_ref().is_none_or(|best| attempt.better_than(best, settings.tolerance)) {
            best = Some(attempt);
        }
        if done {
            break;
        }
        if moving {
            slow_down(&mut slowdown, &knots, &ratios);
        }
        knots.extend(missed);
        knots.sort_unstable();
    }
    let usable = |attempt: &Attempt| !moving || attempt.deviation <= settings.tolerance;
    let best = best.filter(usable).ok_or(Error::Numerical { stage: "the time allocation" })?;
    let mut timed = if own_time { best.stretched() } else { best.retimed(route, &profile, settings) };
    timed.stretch *= profile.factor;
    Ok(timed)
}

/// A minimum-snap curve through some of the route points.
struct Attempt {
    trajectory: Trajectory,
    /// Time of each route point, s.
    times: Vec<f64>,
    /// Greatest distance from a route point, m.
    deviation: f64,
    /// How much slower it has to be flown for all limits to hold.
    stretch: f64,
    /// The route points that are knots.
    knots: Vec<usize>,
}

impl Attempt {
    /// The sooner one of those that follow the route points; before there is one, the latest.
    fn better_than(&self, other: &Self, tolerance: f64) -> bool {
        let time = |attempt: &Self| attempt.trajectory.duration() * attempt.stretch;
        other.deviation > tolerance || self.deviation <= tolerance && time(self) < time(other)
    }

    /// All of it slowed by one factor: exact, as the path does not depend on it.
    fn stretched(self) -> TimedTrajectory {
        // The certificate is an upper bound; one more part in 1e9 covers the rounding of the division.
        let k = if self.stretch > 1.0 { self.stretch * (1.0 + 1e-9) } else { 1.0 };
        let trajectory = self.trajectory.stretched(k);
        let times = self.times.iter().map(|time| time * k).collect();
        let extrema = trajectory.extrema();
        let time_bound = trajectory.duration();
        TimedTrajectory { trajectory, times, extrema, deviation: self.deviation, stretch: k, time_bound }
    }

    /// As fast as the limits allow at every place.
    fn retimed(self, route: &[RoutePoint], profile: &SpeedProfile, settings: &TimingSettings) -> TimedTrajectory {
        let edge = |i: usize| Edge {
            end: self.times[i + 1],
            slowness: profile.min_duration(i) / (self.times[i + 1] - self.times[i]),
            acceleration: profile.acceleration(i),
        };
        let edges: Vec<Edge> = (0..route.len() - 1).map(edge).collect();
        let rest: Vec<bool> = self.knots[..self.knots.len() - 1].iter().map(|&i| i == 0 || route[i].rest).collect();
        let retimed = retime(&self.trajectory, &rest, &edges, settings);
        let times = self.times.iter().map(|time| retimed.time(*time)).collect();
        let Retimed { trajectory, extrema, bound, .. } = retimed;
        TimedTrajectory { trajectory, times, extrema, deviation: self.deviation, stretch: 1.0, time_bound: bound }
    }
}

/// How much slower a segment has to be flown; at most 1 where it is within limits.
fn limit_ratio(extrema: &Extrema, settings: &TimingSettings) -> f64 {
    (extrema.speed / settings.max_speed)
        .max((extrema.acceleration / settings.max_acceleration).sqrt())
        .max(extrema.heading_rate / settings.max_heading_rate)
}

/// Halts, ends and flights are knots, and one route point per spacing or per bend.
fn first_knots(route: &[RoutePoint], settings: &TimingSettings, dense: bool) -> Vec<usize> {
    let mut knots = vec![0];
    let (mut travelled, mut turn) = (0.0, 0.0);
    for i in 1..route.len() {
        travelled += (route[i].state.position - route[i - 1].state.position).norm();
        turn += (route[i].state.heading - route[i - 1].state.heading).abs();
        let edge = |j: usize| route[j].target.is_none() || route[j].rest;
        let must = dense || i + 1 == route.len() || edge(i) || edge(i + 1) || edge(i - 1);
        if must || travelled >= settings.knot_spacing * 0.999 || turn > 0.3 {
            knots.push(i);
            (travelled, turn) = (0.0, 0.0);
        }
    }
    knots
}

fn fit(start: &KnotDerivatives, route: &[RoutePoint], knots: &[usize], durations: &[f64]) -> Result<Trajectory, Error> {
    let points: Vec<Vector4<f64>> = knots.iter().map(|&i| coordinates(&route[i])).collect();
    let rest: Vec<bool> = knots.iter().map(|&i| route[i].rest).collect();
    let own: Vec<f64> = knots.windows(2).map(|pair| durations[pair[0]..pair[1]].iter().sum()).collect();
    Trajectory::minimum_snap_from(start, &points, &own, &rest)
}

fn coordinates(point: &RoutePoint) -> Vector4<f64> {
    let p = point.state.position;
    Vector4::new(p.x, p.y, p.z, point.state.heading)
}

fn cumulative(durations: &[f64]) -> Vec<f64> {
    let mut times = vec![0.0];
    let mut sum = 0.0;
    for t in durations {
        sum += t;
        times.push(sum);
    }
    times
}

/// Greatest deviation from any route point, and per segment the one missed most beyond the tolerance.
fn missed_points(
    route: &[RoutePoint],
    knots: &[usize],
    curve: &Trajectory,
    times: &[f64],
    tolerance: f64,
) -> (f64, Vec<usize>) {
    let mut greatest = 0.0_f64;
    let mut result = Vec::new();
    for pair in knots.windows(2) {
        let (mut worst, mut at) = (tolerance, None);
        for i in pair[0] + 1..pair[1] {
            let sample = curve.sample(times[i]);
            let place = (sample.position - route[i].state.position).norm();
            let error = place.max(HEADING_LEVER * (sample.heading - route[i].state.heading).abs());
            greatest = greatest.max(error);
            if error > worst {
                (worst, at) = (error, Some(i));
            }
        }
        result.extend(at);
    }
    (greatest, result)
}

/// Slows the edges of segments beyond the limits, and half as much those next to them: the curve is stiff.
fn slow_down(slowdown: &mut [f64], knots: &[usize], ratios: &[f64]) {
    for (i, pair) in knots.windows(2).enumerate() {
        let beside = ratios[i.saturating_sub(1)].max(ratios[(i + 1).min(ratios.len() - 1)]);
        let factor = ratios[i].max(1.0 + 0.5 * (beside - 1.0)).min(1.5);
        if factor > 1.0 {
            for edge in &mut slowdown[pair[0]..pair[1]] {
                *edge *= factor * OVERCORRECTION;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    /// A millimetre and 0.08 rad from point to point, to either side: a knot where more than 0.3 rad have come together.
    #[test]
    fn a_bend_has_knots_where_its_turn_asks_for_them() {
        for side in [1.0, -1.0] {
            let point = |i: usize| {
                let position = Point3::new(0.0, 1e-3 * i as f64, 1.0);
                let state = VehicleState { position, heading: side * 0.08 * i as f64, pan: 0.0, tilt: 0.0 };
                RoutePoint { state, target: Some(i), rest: false }
            };
            let route: Vec<RoutePoint> = (0..=20).map(point).collect();
            let settings = TimingSettings::default();
            assert_eq!(first_knots(&route, &settings, false), [0, 4, 8, 12, 16, 20]);
            assert_eq!(first_knots(&route, &settings, true).len(), 21);
        }
    }
}
