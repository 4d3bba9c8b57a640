//! The flight controller: from an estimate and the reference to attitude and thrust.

use nalgebra::{Rotation3, Vector3};

use super::airframe::{Airframe, Command, GRAVITY};
use super::estimator::{Estimate, wrap};
use super::pose_source::LocalisedPose;
use super::reference::Reference;

/// Something that flies the vehicle along a reference, asked every 10 ms. It may look ahead in the reference.
pub trait Controller {
    /// The pose that was reported for this control step, before its command: for controllers that estimate by themselves. Default: nothing.
    fn reported(&mut self, _time: f64, _pose: &LocalisedPose) {}

    /// The command for the time `time` (s of the reference).
    fn command(&mut self, time: f64, estimate: &Estimate, reference: &dyn Reference) -> Command;
}

/// Gains of [`CascadedController`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct ControllerSettings {
    /// Acceleration per position error, 1/s^2. Default 16.
    pub position: f64,
    /// Acceleration per velocity error, 1/s. Default 8.
    pub velocity: f64,
    /// How fast roll and pitch shall approach their targets, 1/s: the known lag is inverted down to this one. Default 16.
    pub attitude: f64,
    /// Yaw rate per heading error, 1/s. Default 3.
    pub heading: f64,
    /// Bandwidth with which the body moves so that the end of [`ReferenceState::lever`](super::ReferenceState::lever) stays in its
    /// place when it tilts, 1/s. Default 3; 0 leaves it.
    pub lever_rate: f64,
    /// The reference's jerk is the difference of its acceleration over this time, s. Default 0.1.
    pub jerk_window: f64,
}

impl Default for ControllerSettings {
    fn default() -> Self {
        Self { position: 16.0, velocity: 8.0, attitude: 16.0, heading: 3.0, lever_rate: 3.0, jerk_window: 0.1 }
    }
}

/// Cascaded PD control with feed-forward of velocity, acceleration and jerk, rejection of the observed disturbance, and
/// inversion of the known first-order attitude lag.
#[derive(Debug, Clone)]
pub struct CascadedController {
    airframe: Airframe,
    settings: ControllerSettings,
    /// Where the body is wanted beside its reference, world frame, m, and since when.
    shift: Vector3<f64>,
    shift_time: Option<f64>,
}

impl CascadedController {
    /// A controller for a vehicle whose responses are known.
    pub fn new(airframe: Airframe, settings: ControllerSettings) -> Self {
        Self { airframe, settings, shift: Vector3::zeros(), shift_time: None }
    }

    /// Follows the displacement of the gun by roll and pitch with a lag: attitude is what the controller itself acts with, and
    /// only its slow part, against wind and hose, must be made good.
    fn compensate_lever(&mut self, time: f64, lever: &Vector3<f64>, estimate: &Estimate) -> Vector3<f64> {
        let [roll, pitch, yaw] = estimate.attitude;
        let level = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw);
        let displaced = Rotation3::from_euler_angles(roll, pitch, yaw) * level.inverse_transform_vector(lever) - lever;
        let dt = self.shift_time.map_or(0.0, |before| (time - before).max(0.0));
        self.shift_time = Some(time);
        self.shift += (-displaced - self.shift) * -(-self.settings.lever_rate * dt).exp_m1();
        self.shift
    }
}

impl Controller for CascadedController {
    fn command(&mut self, time: f64, estimate: &Estimate, reference: &dyn Reference) -> Command {
        let wanted = reference.at(time);
        let shift = self.compensate_lever(time, &wanted.lever, estimate);
        let (frame, gains) = (&self.airframe, &self.settings);
        let half = 0.5 * gains.jerk_window;
        let jerk = (reference.at(time + half).acceleration - reference.at(time - half).acceleration)
            / gains.jerk_window.max(1e-3);

        let position_error = wanted.position + shift - estimate.position;
        let velocity_error = wanted.velocity - estimate.velocity;
        let acceleration = wanted.acceleration + gains.velocity * velocity_error + gains.position * position_error;
        // What the rotors have to give: the estimate's disturbance holds wind and hose, the drag of the own motion is
        // known.
        let rotation = estimate.as_vehicle().rotation();
        let drag = frame.drag_acceleration(&rotation, &estimate.velocity);
        let force = acceleration + Vector3::new(0.0, 0.0, GRAVITY) - estimate.disturbance - drag;

        let yaw_frame = Rotation3::from_axis_angle(&Vector3::z_axis(), -estimate.attitude[2]);
        let (force, jerk) = (yaw_frame * force, yaw_frame * jerk);
        let lift = force.z.max(0.2 * GRAVITY);
        let pitch = (force.x / lift).atan();
        let roll = (-force.y / force.x.hypot(lift)).atan();
        let invert_lag = |target: f64, rate: f64, now: f64, lag: f64, gain: f64| {
            let command = (now + lag * (rate + gains.attitude * (target - now))) / gain;
            command.clamp(-frame.tilt_limit, frame.tilt_limit)
        };
        let [roll_now, pitch_now, yaw] = estimate.attitude;
        let upright = (roll_now.cos() * pitch_now.cos()).max(0.5);
        Command {
            roll: invert_lag(roll, -jerk.y / lift, roll_now, frame.roll_time_constant, frame.roll_gain),
            pitch: invert_lag(pitch, jerk.x / lift, pitch_now, frame.pitch_time_constant, frame.pitch_gain),
            yaw_rate: wanted.heading_rate + gains.heading * wrap(wanted.heading - yaw),
            thrust: frame.mass * (force.z / upright).clamp(0.2 * GRAVITY, 2.0 * GRAVITY),
        }
    }
}
