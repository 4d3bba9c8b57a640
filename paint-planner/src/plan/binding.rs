//! Which limit makes a plan as slow as it is.

use super::solution::Plan;
use crate::settings::{TimingPolicy, TimingSettings};
use crate::timing::speed_profile::joint_motion;

/// Time between two looks, s.
const LOOK: f64 = 0.02;
/// Part of a limit from which on it counts as binding.
const BINDING: f64 = 0.9;

/// Shares of a plan's time in which each limit binds: it is used by 90 % and more than any other. With `none` they add up to 1.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BindingLimits {
    /// The vehicle's speed.
    pub speed: f64,
    /// Its acceleration.
    pub acceleration: f64,
    /// Its heading rate.
    pub heading_rate: f64,
    /// The rates of pan and tilt.
    pub joint_rate: f64,
    /// The speed of the spot, which the painter or the person asks for.
    pub spot_speed: f64,
    /// The flow that the valve gives.
    pub flow: f64,
    /// None of them.
    pub none: f64,
    /// Longest time of spraying in which none binds, s.
    pub longest_spraying_without: f64,
}

impl Plan {
    /// Which limits bind, by time.
    pub fn binding_limits(&self, limits: &TimingSettings) -> BindingLimits {
        let mut counts = [0_usize; 7];
        let spot_limit = match limits.policy {
            TimingPolicy::Uniform { speed } => speed,
            TimingPolicy::GradientPreserving => f64::INFINITY,
        };
        let (mut waypoint, mut without, mut longest) = (0, 0_usize, 0);
        for (time, setpoint) in self.setpoints(LOOK) {
            while waypoint + 2 < self.waypoints.len() && self.waypoints[waypoint + 1].time <= time {
                waypoint += 1;
            }
            let (from, to) = (&self.waypoints[waypoint], &self.waypoints[waypoint + 1]);
            let spot = match self.targets_about(waypoint) {
                [Some(a), Some(b)] if !setpoint.transit && b == a + 1 => {
                    (self.points[b] - self.points[a]).norm() / (self.target_time[b] - self.target_time[a])
                }
                _ => 0.0,
            };
            let duration = to.time - from.time;
            let (sample, spraying) = (&setpoint.sample, setpoint.flow > 0.0);
            let acceleration = if spraying { limits.max_spray_acceleration } else { f64::INFINITY };
            let used = [
                sample.velocity.norm() / limits.max_speed,
                sample.acceleration.norm() / acceleration.min(limits.max_acceleration),
                sample.heading_rate.abs() / limits.max_heading_rate,
                joint_motion(&from.state, &to.state) / duration / limits.max_joint_rate,
                spot / spot_limit,
                setpoint.flow / limits.max_flow,
                BINDING,
            ];
            let most = used.iter().fold(0.0_f64, |most, used| most.max(*used));
            let binding = used.iter().position(|used| *used == most).unwrap_or(6);
            counts[binding] += 1;
            without = if spraying && binding == 6 { without + 1 } else { 0 };
            longest = longest.max(without);
        }
        let total = counts.iter().sum::<usize>().max(1) as f64;
        let [speed, acceleration, heading_rate, joint_rate, spot_speed, flow, none] =
            counts.map(|count| count as f64 / total);
        let longest_spraying_without = longest as f64 * LOOK;
        BindingLimits {
            speed,
            acceleration,
            heading_rate,
            joint_rate,
            spot_speed,
            flow,
            none,
            longest_spraying_without,
        }
    }
}
