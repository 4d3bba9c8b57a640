//! Times for the route, and the trajectory within limits that results.

pub(crate) mod speed_profile;

use crate::error::Error;
use crate::minimum_snap::KnotDerivatives;
use crate::route::RoutePoint;
pub use crate::settings::{TimingPolicy, TimingSettings};
use crate::target::Target;
use crate::trajectory::{Extrema, Trajectory};
use nalgebra::Vector4;
use speed_profile::SpeedProfile;
pub(crate) use speed_profile::rest_to_rest;

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
}

/// Finds times such that all limits hold, certified. `dense` makes every route point a knot.
///
/// Rounds of: speed profile, minimum snap through the knots, exact extrema. Route points that the curve misses become knots,
/// segments that break a limit are slowed. Whatever is left is repaired by one global stretch, which is exact because
/// the path does not depend on it. A route that is entered with the motion `start` cannot be stretched: it is refused.
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
    let mut knots = first_knots(route, settings, dense);
    let mut slowdown = vec![1.0; route.len() - 1];
    let mut best: Option<TimedTrajectory> = None;
    for round in 0..=settings.rounds {
        let durations = profile.durations(&slowdown, settings);
        let attempt = fit(start, route, &knots, &durations)?;
        let mut most = Extrema::default();
        let mut ratios = vec![1.0; knots.len() - 1];
        for (i, worst) in ratios.iter_mut().enumerate() {
            let extrema = attempt.segment_extrema(i);
            most = most.max(extrema);
            *worst = limit_ratio(&extrema, settings);
        }
        let times = cumulative(&durations);
        let (deviation, missed) = missed_points(route, &knots, &attempt, &times, settings.tolerance);
        let stretch = limit_ratio(&most, settings).max(1.0);
        let better = |other: &TimedTrajectory| {
            let (now, then) = (deviation <= settings.tolerance, other.deviation <= settings.tolerance);
            (now && !then) || (now == then && attempt.duration() * stretch < other.trajectory.duration())
        };
        // Before the curve follows the route points, the latest attempt is the one to keep.
        let possible = !moving || stretch == 1.0;
        if possible && best.as_ref().is_none_or(|other| better(other) || other.deviation > settings.tolerance) {
            best = Some(stretched(attempt, times, most, deviation, stretch));
        }
        let done = missed.is_empty() && (stretch == 1.0 || !local);
        if done || round == settings.rounds {
            break;
        }
        if local {
            slow_down(&mut slowdown, &knots, &ratios);
        }
        knots.extend(missed);
        knots.sort_unstable();
    }
    let usable = |timed: &TimedTrajectory| !moving || timed.deviation <= settings.tolerance;
    let mut timed = best.filter(usable).ok_or(Error::Numerical { stage: "the time allocation" })?;
    timed.stretch *= profile.factor;
    Ok(timed)
}

fn stretched(
    trajectory: Trajectory,
    mut times: Vec<f64>,
    most: Extrema,
    deviation: f64,
    mut k: f64,
) -> TimedTrajectory {
    if k > 1.0 {
        // The certificate is an upper bound; one more part in 1e9 covers the rounding of the division.
        k *= 1.0 + 1e-9;
        for time in &mut times {
            *time *= k;
        }
    }
    let extrema = Extrema {
        speed: most.speed / k,
        acceleration: most.acceleration / (k * k),
        heading_rate: most.heading_rate / k,
    };
    TimedTrajectory { trajectory: trajectory.stretched(k), times, extrema, deviation, stretch: k }
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
