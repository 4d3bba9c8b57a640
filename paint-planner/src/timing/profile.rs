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
    /// Edges whose time is given by stamps and may only be stretched all together, except for starting and halting.
    stamped: Vec<bool>,
    /// The factor by which the stamps are stretched already.
    pub(crate) factor: f64,
}

impl Profile {
    pub(crate) fn new(route: &[Stop], targets: &[Target], settings: &TimingSettings) -> Self {
        let mut profile = Self { way: vec![], turn: vec![], least: vec![], cap: vec![], stamped: vec![], factor: 1.0 };
        let mut stamps = Vec::with_capacity(route.len());
        for pair in route.windows(2) {
            let way = (pair[1].state.position - pair[0].state.position).norm();
            let turn = (pair[1].state.heading - pair[0].state.heading).abs();
            let (length, dose) = stroke(pair, targets);
            let vehicle = (way / settings.max_speed).max(turn / settings.max_heading_rate);
            let stamp = stamp(pair, targets, settings);
            let spot = match settings.policy {
                TimingPolicy::Uniform { speed } => length / speed,
                TimingPolicy::GradientPreserving => 0.0,
            };
            let least = vehicle.max(spot).max(length * dose / settings.max_flow).max(SHORTEST);
            // Thesis, section 7.5: the factor of the segment that needs most is the factor of all.
            profile.factor = profile.factor.max(stamp.map_or(1.0, |stamp| least / stamp));
            profile.least.push(least);
            profile.way.push(way);
            profile.turn.push(turn);
            profile.stamped.push(stamp.is_some());
            stamps.push(stamp);
        }
        for (least, stamp) in profile.least.iter_mut().zip(&stamps) {
            *least = stamp.map_or(*least, |stamp| stamp * profile.factor);
        }
        profile.cap = (0..route.len())
            .map(|i| {
                if route[i].rest || i == 0 || i + 1 == route.len() {
                    0.0
                } else if profile.stamped[i - 1] && profile.stamped[i] {
                    f64::INFINITY
                } else {
                    let bend = curvature(route, i, settings.knot_spacing);
                    (NORMAL * settings.max_acceleration / bend.max(1e-9)).sqrt()
                }
            })
            .collect();
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
        let mut lowered: Vec<bool> = self.cap.iter().map(|cap| *cap == 0.0).collect();
        self.pass(0..edges, 0, &mut speed, &mut lowered, settings);
        self.pass((0..edges).rev(), 1, &mut speed, &mut lowered, settings);
        (0..edges)
            .map(|i| {
                let least = self.least[i] * slow[i];
                if self.stamped[i] && !lowered[i] && !lowered[i + 1] {
                    return least;
                }
                let sum = speed[i] + speed[i + 1];
                let moving = if sum > 1e-6 { 2.0 * self.way[i] / sum } else { self.halt_to_halt(i, settings) };
                moving.max(least)
            })
            .collect()
    }

    /// Limits speeds by what can be gained since the stop before, in the order of `edges`; `from` is 0 when edges are
    /// entered at their first stop. On stamped edges only until the speed they ask for is reached.
    fn pass(
        &self,
        edges: impl Iterator<Item = usize>,
        from: usize,
        speed: &mut [f64],
        lowered: &mut [bool],
        settings: &TimingSettings,
    ) {
        let gain = 2.0 * TANGENTIAL * settings.max_acceleration;
        let mut ramp = true;
        for i in edges {
            let (enter, leave) = (i + from, i + 1 - from);
            ramp |= self.cap[enter] == 0.0 || !self.stamped[i];
            if !ramp {
                continue;
            }
            let reach = (speed[enter] * speed[enter] + gain * self.way[i]).sqrt();
            if reach < speed[leave] {
                speed[leave] = reach;
                lowered[leave] = true;
            } else if self.stamped[i] {
                ramp = false;
            }
        }
    }

    /// Time of an edge between two halts: the closed form of the minimum-snap polynomial.
    fn halt_to_halt(&self, i: usize, settings: &TimingSettings) -> f64 {
        let by_speed = PEAK_SPEED * self.way[i] / settings.max_speed;
        let by_turn = PEAK_SPEED * self.turn[i] / settings.max_heading_rate;
        let by_acceleration = (PEAK_ACCELERATION * self.way[i] / settings.max_acceleration).sqrt();
        // The certificate may exceed the closed form in the last digits.
        1.001 * by_speed.max(by_turn).max(by_acceleration)
    }
}

/// Length of stroke on the surface between two stops, m, and the dose on it; zero on flights.
pub(crate) fn stroke(pair: &[Stop], targets: &[Target]) -> (f64, f64) {
    match (pair[0].target, pair[1].target) {
        (Some(a), Some(b)) if b == a + 1 => ((targets[b].point - targets[a].point).norm(), targets[a].dose),
        _ => (0.0, 0.0),
    }
}

/// Time the person took for this edge, s, where that is to be preserved.
fn stamp(pair: &[Stop], targets: &[Target], settings: &TimingSettings) -> Option<f64> {
    match (settings.policy, pair[0].target, pair[1].target) {
        (TimingPolicy::GradientPreserving, Some(a), Some(b)) if b == a + 1 => {
            targets[b].time.zip(targets[a].time).map(|(after, before)| after - before)
        }
        _ => None,
    }
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
