//! Speed along the route: limits per edge and route point, then one pass forward and one backward for the acceleration.

use crate::route::RoutePoint;
use crate::settings::{TimingPolicy, TimingSettings};
use crate::target::Target;
use crate::world::VehicleState;

/// Share of the acceleration limit left to speeding up and slowing down; the rest is for curves and for the overshoot
/// of polynomials.
const TANGENTIAL: f64 = 0.45;
/// Share of the acceleration limit that curves are planned with.
const NORMAL: f64 = 0.7;
/// Peak speed and acceleration of the rest-to-rest polynomial of unit length and duration.
const PEAK_SPEED: f64 = 2.1875;
const PEAK_ACCELERATION: f64 = 7.513_188_404;
/// Planned joints are linear in time between route points, so the time of an edge certifies their rate; times are sums, and this covers
/// what a sum rounds.
const ROUNDING: f64 = 1.0 + 1e-9;
/// No edge takes less, s.
const MIN_DURATION: f64 = 1e-3;

/// What the route asks of the times of its edges (edge i leads from route point i to i+1).
pub(crate) struct SpeedProfile {
    /// Distance that the body travels, m.
    travel: Vec<f64>,
    /// Turn of the body, rad.
    turn: Vec<f64>,
    /// Least duration by spot speed, flow, speed, heading rate and joint rate, s.
    min_duration: Vec<f64>,
    /// Greatest acceleration, m/s^2: less where paint is sprayed.
    acceleration: Vec<f64>,
    /// Greatest speed at a route point by curvature, m/s; 0 where the vehicle halts.
    speed_limit: Vec<f64>,
    /// Edges whose time is given by stamps and may only be stretched all together, except for starting and halting.
    stamped: Vec<bool>,
    /// The factor by which the stamps are stretched already.
    pub(crate) factor: f64,
}

impl SpeedProfile {
    pub(crate) fn new(route: &[RoutePoint], targets: &[Target], settings: &TimingSettings) -> Self {
        let mut profile = Self {
            travel: vec![],
            turn: vec![],
            min_duration: vec![],
            acceleration: vec![],
            speed_limit: vec![],
            stamped: vec![],
            factor: 1.0,
        };
        let mut stamps = Vec::with_capacity(route.len());
        for pair in route.windows(2) {
            let travel = (pair[1].state.position - pair[0].state.position).norm();
            let turn = (pair[1].state.heading - pair[0].state.heading).abs();
            let (length, dose) = stroke_between(pair, targets);
            let joints = joint_motion(&pair[0].state, &pair[1].state) * ROUNDING;
            let vehicle = (travel / settings.max_speed)
                .max(turn / settings.max_heading_rate)
                .max(joints / settings.max_joint_rate);
            let stamp = stamp(pair, targets, settings);
            let spot = match settings.policy {
                TimingPolicy::Uniform { speed } => length / speed,
                TimingPolicy::GradientPreserving => 0.0,
            };
            let min_duration = vehicle.max(spot).max(length * dose / settings.max_flow).max(MIN_DURATION);
            // Thesis, section 7.5: the factor of the segment that needs most is the factor of all.
            profile.factor = profile.factor.max(stamp.map_or(1.0, |stamp| min_duration / stamp));
            profile.min_duration.push(min_duration);
            profile.travel.push(travel);
            profile.turn.push(turn);
            let spraying = if dose > 0.0 { settings.max_spray_acceleration } else { f64::INFINITY };
            profile.acceleration.push(settings.max_acceleration.min(spraying));
            profile.stamped.push(stamp.is_some());
            stamps.push(stamp);
        }
        for (min_duration, stamp) in profile.min_duration.iter_mut().zip(&stamps) {
            *min_duration = stamp.map_or(*min_duration, |stamp| stamp * profile.factor);
        }
        profile.speed_limit = (0..route.len())
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

    /// Lets the route begin at a speed, m/s, instead of at rest.
    pub(crate) fn enter_with(&mut self, speed: f64) {
        self.speed_limit[0] = speed;
    }

    /// Durations of all edges; `slowdown[i] >= 1` lowers the speed of edge i.
    pub(crate) fn durations(&self, slowdown: &[f64], settings: &TimingSettings) -> Vec<f64> {
        let edges = self.travel.len();
        let edge_speed = |i: usize| self.travel[i] / (self.min_duration[i] * slowdown[i]);
        let mut speed: Vec<f64> = (0..=edges)
            .map(|i| {
                let before = if i > 0 { edge_speed(i - 1) } else { f64::INFINITY };
                let after = if i < edges { edge_speed(i) } else { f64::INFINITY };
                let drag = if i > 0 { slowdown[i - 1] } else { 1.0 }.max(if i < edges { slowdown[i] } else { 1.0 });
                (self.speed_limit[i] / drag).min(before).min(after)
            })
            .collect();
        let mut lowered: Vec<bool> = self.speed_limit.iter().map(|speed_limit| *speed_limit == 0.0).collect();
        self.pass(0..edges, 0, &mut speed, &mut lowered, settings);
        self.pass((0..edges).rev(), 1, &mut speed, &mut lowered, settings);
        (0..edges)
            .map(|i| {
                let min_duration = self.min_duration[i] * slowdown[i];
                if self.stamped[i] && !lowered[i] && !lowered[i + 1] {
                    return min_duration;
                }
                let sum = speed[i] + speed[i + 1];
                let moving = if sum > 1e-6 {
                    2.0 * self.travel[i] / sum
                } else {
                    RestToRest::new(settings).duration(self.travel[i], self.turn[i])
                };
                moving.max(min_duration)
            })
            .collect()
    }

    /// Least duration of edge `i` by all that limits a rate, s.
    pub(crate) fn min_duration(&self, i: usize) -> f64 {
        self.min_duration[i]
    }

    /// Greatest acceleration on edge `i`, m/s^2.
    pub(crate) fn acceleration(&self, i: usize) -> f64 {
        self.acceleration[i]
    }

    /// Limits speeds by what can be gained since the route point before, in the order of `edges`; `from` is 0 when edges are
    /// entered at their first point. On stamped edges only until the speed they ask for is reached.
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
            ramp |= self.speed_limit[enter] == 0.0 || !self.stamped[i];
            if !ramp {
                continue;
            }
            let reach = (speed[enter] * speed[enter] + gain * self.travel[i]).sqrt();
            if reach < speed[leave] {
                speed[leave] = reach;
                lowered[leave] = true;
            } else if self.stamped[i] {
                ramp = false;
            }
        }
    }
}

/// How far the joint that moves more of pan and tilt has to move, rad.
pub(crate) fn joint_motion(from: &VehicleState, to: &VehicleState) -> f64 {
    (to.pan - from.pan).abs().max((to.tilt - from.tilt).abs())
}

/// Time between two halts, s: the closed form of the minimum-snap polynomial.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RestToRest {
    /// s/m, s/√m and s/rad: of speed, acceleration and heading rate.
    way: f64,
    root: f64,
    turn: f64,
}

impl RestToRest {
    pub(crate) fn new(settings: &TimingSettings) -> Self {
        // The certificate may exceed the closed form in the last digits.
        Self {
            way: 1.001 * PEAK_SPEED / settings.max_speed,
            root: 1.001 * (PEAK_ACCELERATION / settings.max_acceleration).sqrt(),
            turn: 1.001 * PEAK_SPEED / settings.max_heading_rate,
        }
    }

    /// Over `travel` metres and `turn` radians.
    pub(crate) fn duration(&self, travel: f64, turn: f64) -> f64 {
        (self.way * travel).max(self.root * travel.sqrt()).max(self.turn * turn)
    }
}

/// Length of stroke on the surface between two route points, m, and the dose on it; zero on flights.
pub(crate) fn stroke_between(pair: &[RoutePoint], targets: &[Target]) -> (f64, f64) {
    match (pair[0].target, pair[1].target) {
        (Some(a), Some(b)) if b == a + 1 => ((targets[b].point - targets[a].point).norm(), targets[a].dose),
        _ => (0.0, 0.0),
    }
}

/// Time the person took for this edge, s, where that is to be preserved.
fn stamp(pair: &[RoutePoint], targets: &[Target], settings: &TimingSettings) -> Option<f64> {
    match (settings.policy, pair[0].target, pair[1].target) {
        (TimingPolicy::GradientPreserving, Some(a), Some(b)) if b == a + 1 => {
            targets[b].time.zip(targets[a].time).map(|(after, before)| after - before)
        }
        _ => None,
    }
}

/// Curvature of the route at a point, 1/m, seen over about `scale` metres so that the noise of close waypoints does not
/// count as curves.
fn curvature(route: &[RoutePoint], i: usize, scale: f64) -> f64 {
    let here = route[i].state.position;
    let far = |j: &usize| (route[*j].state.position - here).norm() >= scale;
    let before = (0..i).rev().take_while(|&j| i - j < 64).find(far).unwrap_or(i - 1);
    let after = (i + 1..route.len()).take_while(|&j| j - i < 64).find(far).unwrap_or(i + 1);
    let (a, b) = (here - route[before].state.position, route[after].state.position - here);
    let (la, lb) = (a.norm(), b.norm());
    if la < 1e-9 || lb < 1e-9 { 0.0 } else { (b / lb - a / la).norm() / (0.5 * (la + lb)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Vector3};

    /// A metre of straight stroke in steps of 0.1 m that turns by `turn` radians per step.
    fn stroke(turn: f64, dose: f64) -> (Vec<RoutePoint>, Vec<Target>) {
        let point = |i: usize| Point3::new(0.0, 0.1 * i as f64, 1.0);
        let targets = (0..=10)
            .map(|i| Target { point: point(i), normal: -Vector3::x_axis(), dose, time: None, stand_off: None })
            .collect();
        let state = |i: usize| VehicleState { position: point(i), heading: turn * i as f64, pan: 0.0, tilt: 0.0 };
        let route = (0..=10).map(|i| RoutePoint { state: state(i), target: Some(i), rest: false }).collect();
        (route, targets)
    }

    /// Duration of an edge in the middle, where neither start nor end slows it.
    fn middle(turn: f64, dose: f64, settings: &TimingSettings) -> f64 {
        let (route, targets) = stroke(turn, dose);
        SpeedProfile::new(&route, &targets, settings).durations(&[1.0; 10], settings)[5]
    }

    #[test]
    fn an_edge_takes_what_its_slowest_limit_asks_for() {
        let settings = TimingSettings {
            policy: TimingPolicy::Uniform { speed: 0.4 },
            max_speed: 0.5,
            max_acceleration: 100.0,
            max_heading_rate: 1.0,
            max_flow: 2e-6,
            ..TimingSettings::default()
        };
        // 0.1 m at the wanted speed; at the speed of the vehicle; a turn of 0.5 rad; a dose of 1e-5 m^3/m.
        assert!((middle(0.0, 0.0, &settings) - 0.25).abs() < 1e-12);
        let racing = TimingSettings { policy: TimingPolicy::Uniform { speed: 2.0 }, ..settings.clone() };
        assert!((middle(0.0, 0.0, &racing) - 0.2).abs() < 1e-12);
        assert!((middle(0.5, 0.0, &settings) - 0.5).abs() < 1e-12);
        assert!((middle(-0.5, 0.0, &settings) - 0.5).abs() < 1e-12);
        assert!((middle(0.0, 1e-5, &settings) - 0.5).abs() < 1e-12);
        // Either joint: 0.2 rad at 0.25 rad/s.
        for (pan, tilt) in [(0.2, 0.0), (0.1, -0.2)] {
            let (mut route, targets) = stroke(0.0, 0.0);
            for (i, point) in route.iter_mut().enumerate() {
                (point.state.pan, point.state.tilt) = (pan * i as f64, tilt * i as f64);
            }
            let slow = TimingSettings { max_joint_rate: 0.25, ..settings.clone() };
            let duration = SpeedProfile::new(&route, &targets, &slow).durations(&[1.0; 10], &slow)[5];
            assert!((duration - 0.8).abs() < 1e-8, "{duration}");
        }
        // `slowdown` stretches.
        let (route, targets) = stroke(0.0, 0.0);
        let slowed = SpeedProfile::new(&route, &targets, &settings).durations(&[2.0; 10], &settings);
        assert!((slowed[5] - 0.5).abs() < 1e-12);
    }

    #[test]
    fn starts_and_halts_ramp_within_the_tangential_share() {
        let settings = TimingSettings::default();
        let (route, targets) = stroke(0.0, 0.0);
        let durations = SpeedProfile::new(&route, &targets, &settings).durations(&[1.0; 10], &settings);
        // From rest with 0.45 m/s^2 over 0.1 m: v = 0.3 m/s, t = 2 s / v.
        assert!((durations[0] - 0.2 / 0.3).abs() < 1e-12, "{}", durations[0]);
        assert!((durations[9] - durations[0]).abs() < 1e-12);
        assert!(durations[4] < durations[1] && durations[1] < durations[0]);
        // A halt in the middle ramps on both sides.
        let mut halting = route;
        halting[5].rest = true;
        let halted = SpeedProfile::new(&halting, &targets, &settings).durations(&[1.0; 10], &settings);
        assert!((halted[4] - durations[0]).abs() < 1e-12 && (halted[5] - durations[0]).abs() < 1e-12);
    }

    #[test]
    fn two_halts_are_joined_by_the_closed_form() {
        let settings = TimingSettings::default();
        let (mut route, targets) = stroke(0.0, 0.0);
        route.truncate(2);
        let only =
            |settings: &TimingSettings| SpeedProfile::new(&route, &targets, settings).durations(&[1.0], settings)[0];
        // Rest to rest over 0.1 m: peak acceleration 7.5132 L / T^2, peak speed 2.1875 L / T.
        assert!((only(&settings) - 1.001 * (7.513_188_404_f64 * 0.1).sqrt()).abs() < 1e-9);
        let crawling = TimingSettings { max_speed: 0.05, ..settings.clone() };
        assert!((only(&crawling) - 1.001 * 2.1875 * 0.1 / 0.05).abs() < 1e-9);
        route[1].state.heading = 1.0;
        let only =
            |settings: &TimingSettings| SpeedProfile::new(&route, &targets, settings).durations(&[1.0], settings)[0];
        assert!((only(&settings) - 1.001 * 2.1875).abs() < 1e-9);
    }

    #[test]
    fn corners_are_taken_at_the_speed_that_their_curvature_allows() {
        let settings = TimingSettings { max_acceleration: 0.2, knot_spacing: 0.09, ..TimingSettings::default() };
        let (mut route, targets) = stroke(0.0, 0.0);
        // A right angle at point 5: |b - a| / mean length = sqrt(2) / 0.1.
        for (i, point) in route.iter_mut().enumerate().skip(6) {
            point.state.position = Point3::new(0.1 * (i as f64 - 5.0), 0.5, 1.0);
        }
        let profile = SpeedProfile::new(&route, &targets, &settings);
        let expected = (NORMAL * 0.2 / (2.0_f64.sqrt() / 0.1)).sqrt();
        assert!((profile.speed_limit[5] - expected).abs() < 1e-9, "{} {expected}", profile.speed_limit[5]);
        assert_eq!((profile.speed_limit[0], profile.speed_limit[10]), (0.0, 0.0));
        assert!(profile.speed_limit[3] > 10.0);
    }

    #[test]
    fn stamps_are_stretched_by_one_factor() {
        let settings = TimingSettings { policy: TimingPolicy::GradientPreserving, ..TimingSettings::default() };
        let (route, mut targets) = stroke(0.0, 0.0);
        for (i, target) in targets.iter_mut().enumerate() {
            // 0.1 m in 0.1 s where 0.2 s is the least; one edge takes three times as long.
            target.time = Some(0.1 * i as f64 + if i > 5 { 0.2 } else { 0.0 });
        }
        let profile = SpeedProfile::new(&route, &targets, &settings);
        assert!((profile.factor - 2.0).abs() < 1e-9, "{}", profile.factor);
        let durations = profile.durations(&[1.0; 10], &settings);
        assert!((durations[5] - 0.6).abs() < 1e-9 && (durations[4] - 0.2).abs() < 1e-9, "{durations:?}");
        assert_eq!(profile.speed_limit[4], f64::INFINITY);
    }
}
