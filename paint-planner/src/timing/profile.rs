//! Speed along the route: caps per edge and stop, then one pass forward and one backward for the acceleration.

use crate::route::Stop;
use crate::settings::{TimingPolicy, TimingSettings};
use crate::target::Target;

/// Share of the acceleration limit left to speeding up and slowing down; the rest is for curves and for the overshoot
/// of polynomials.
const TANGENTIAL: f64 = 0.45;
/// Share of the acceleration limit that curves are planned with.
const NORMAL: f64 = 0.7;
/// Peak speed and acceleration of the rest-to-rest polynomial of unit length and duration.
const PEAK_SPEED: f64 = 2.1875;
const PEAK_ACCELERATION: f64 = 7.513_188_404;
/// No edge takes less, s.
const SHORTEST: f64 = 1e-3;

/// What the route asks of the times of its edges (edge i leads from stop i to stop i+1).
pub(crate) struct Profile {
    /// Way of the body, m.
    way: Vec<f64>,
    /// Turn of the body, rad.
    turn: Vec<f64>,
    /// Least time by spot speed, flow, speed and heading rate, s.
    least: Vec<f64>,
    /// Greatest speed in a stop by curvature, m/s; 0 where the vehicle halts.
    cap: Vec<f64>,
}

impl Profile {
    pub(crate) fn new(route: &[Stop], targets: &[Target], settings: &TimingSettings) -> Self {
        let mut profile = Self { way: vec![], turn: vec![], least: vec![], cap: vec![] };
        for pair in route.windows(2) {
            let way = (pair[1].state.position - pair[0].state.position).norm();
            let turn = (pair[1].state.heading - pair[0].state.heading).abs();
            let vehicle = (way / settings.max_speed).max(turn / settings.max_heading_rate);
            profile.least.push(vehicle.max(stroke_time(pair, targets, settings)).max(SHORTEST));
            profile.way.push(way);
            profile.turn.push(turn);
        }
        let curved = matches!(settings.policy, TimingPolicy::Uniform { .. });
        profile.cap = (0..route.len())
            .map(|i| if route[i].rest || i == 0 || i + 1 == route.len() { 0.0 } else { f64::INFINITY })
            .collect();
        if curved {
            for i in 1..route.len() - 1 {
                let bend = curvature(route, i, settings.knot_spacing);
                profile.cap[i] = profile.cap[i].min((NORMAL * settings.max_acceleration / bend.max(1e-9)).sqrt());
            }
        }
        profile
    }

    /// Durations of all edges; `slow[i] >= 1` lowers the speed of edge i.
    pub(crate) fn durations(&self, slow: &[f64], settings: &TimingSettings) -> Vec<f64> {
        let edges = self.way.len();
        let edge_speed = |i: usize| self.way[i] / (self.least[i] * slow[i]);
        let mut speed: Vec<f64> = (0..=edges)
            .map(|i| {
                let before = if i > 0 { edge_speed(i - 1) } else { f64::INFINITY };
                let after = if i < edges { edge_speed(i) } else { f64::INFINITY };
                let drag = if i > 0 { slow[i - 1] } else { 1.0 }.max(if i < edges { slow[i] } else { 1.0 });
                (self.cap[i] / drag).min(before).min(after)
            })
            .collect();
        let gain = 2.0 * TANGENTIAL * settings.max_acceleration;
        for i in 0..edges {
            speed[i + 1] = speed[i + 1].min((speed[i] * speed[i] + gain * self.way[i]).sqrt());
        }
        for i in (0..edges).rev() {
            speed[i] = speed[i].min((speed[i + 1] * speed[i + 1] + gain * self.way[i]).sqrt());
        }
        (0..edges)
            .map(|i| {
                let sum = speed[i] + speed[i + 1];
                let moving = if sum > 1e-6 {
                    2.0 * self.way[i] / sum
                } else {
                    // From halt to halt: the closed form of the minimum-snap polynomial.
                    let reach = (PEAK_SPEED * self.way[i] / settings.max_speed)
                        .max(PEAK_SPEED * self.turn[i] / settings.max_heading_rate);
                    1.001 * reach.max((PEAK_ACCELERATION * self.way[i] / settings.max_acceleration).sqrt())
                };
                moving.max(self.least[i] * slow[i])
            })
            .collect()
    }
}

/// Length of stroke on the surface between two stops, m, and the dose on it; zero on flights.
pub(crate) fn stroke(pair: &[Stop], targets: &[Target]) -> (f64, f64) {
    match (pair[0].target, pair[1].target) {
        (Some(a), Some(b)) if b == a + 1 => ((targets[b].point - targets[a].point).norm(), targets[a].dose),
        _ => (0.0, 0.0),
    }
}

/// Least time of an edge by what happens on the surface.
fn stroke_time(pair: &[Stop], targets: &[Target], settings: &TimingSettings) -> f64 {
    let (length, dose) = stroke(pair, targets);
    let by_flow = length * dose / settings.max_flow;
    let by_policy = match (settings.policy, pair[0].target, pair[1].target) {
        (TimingPolicy::Uniform { speed }, ..) => length / speed,
        (TimingPolicy::GradientPreserving, Some(a), Some(b)) if b == a + 1 => {
            targets[b].time.zip(targets[a].time).map_or(0.0, |(after, before)| after - before)
        }
        (TimingPolicy::GradientPreserving, ..) => 0.0,
    };
    by_flow.max(by_policy)
}

/// Curvature of the route at a stop, 1/m, seen over about `scale` metres so that the noise of close waypoints does not
/// count as curves.
fn curvature(route: &[Stop], i: usize, scale: f64) -> f64 {
    let here = route[i].state.position;
    let far = |j: &usize| (route[*j].state.position - here).norm() >= scale;
    let before = (0..i).rev().take_while(|&j| i - j < 64).find(far).unwrap_or(i - 1);
    let after = (i + 1..route.len()).take_while(|&j| j - i < 64).find(far).unwrap_or(i + 1);
    let (a, b) = (here - route[before].state.position, route[after].state.position - here);
    let (la, lb) = (a.norm(), b.norm());
    if la < 1e-9 || lb < 1e-9 { 0.0 } else { (b / lb - a / la).norm() / (0.5 * (la + lb)) }
}
