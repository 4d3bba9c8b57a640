//! The tracking controller: at every step the inputs that follow the reference best over the next fraction of a second.

use nalgebra::{Rotation3, RowVector3, Vector3};

use super::axis::{AxisModel, AxisProgram, AxisStage, AxisWeights};
use super::vehicle::{ControlCommand, ControlReference, ControlState, VehicleModel};
use crate::angle::wrap;
use crate::error::Error;
use crate::gravity::GRAVITY;

/// Settings of [`TrackingMpc`]. The seeds print none; all are ours.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct MpcSettings {
    /// Steps of the horizon. Default 40.
    pub steps: usize,
    /// Time between two commands, and length of a step, s. Default 0.01.
    pub step: f64,
    /// Weight of the velocity error against that of the position, s². Default 0.01.
    pub velocity: f64,
    /// Weight of the horizontal force per mass beside that of an exact flight along the reference, s⁴. Default 1e-5.
    pub tilt: f64,
    /// Weight of the thrust per mass, s⁴. Default 1e-4.
    pub thrust: f64,
    /// Yaw rate per heading error, 1/s. Default 3.
    pub heading: f64,
    /// Most changes of the set of active bounds for each axis and command. Default 6.
    pub iterations: usize,
}

impl Default for MpcSettings {
    fn default() -> Self {
        Self { steps: 40, step: 0.01, velocity: 0.01, tilt: 1e-5, thrust: 1e-4, heading: 3.0, iterations: 6 }
    }
}

/// Model predictive control along a trajectory.
///
/// In the frame that turns with the heading, forward, left and up are three linear programs: position, velocity and, forward and
/// left, the force of the tilted thrust, which follows its command with the lag of the attitude. What is tracked is not the
/// centre of the body but the end of [`ControlReference::lever`], which moves as the body tilts; its displacement is linearised
/// about the attitudes that the last solution predicts. Each axis is solved exactly within its bounds from the active set of the
/// solution before; beyond the horizon counts the cost of the endless one without bounds. No allocation in a step.
#[derive(Debug, Clone)]
pub struct TrackingMpc {
    vehicle: VehicleModel,
    settings: MpcSettings,
    forward: AxisProgram,
    left: AxisProgram,
    up: AxisProgram,
    /// Roll and pitch that the last solution expects after each step from now on.
    expected: Vec<[f64; 2]>,
    references: Vec<ControlReference>,
    stages: Vec<AxisStage>,
    last_time: Option<f64>,
    unsettled: u64,
}

impl TrackingMpc {
    /// A controller at rest.
    ///
    /// # Errors
    /// Numbers out of range.
    pub fn new(vehicle: VehicleModel, settings: MpcSettings) -> Result<Self, Error> {
        vehicle.check()?;
        settings.check()?;
        let MpcSettings { steps, step, velocity, tilt, thrust, .. } = settings;
        let axis = |drag, lag, input| {
            let weights = AxisWeights { output: 1.0, velocity, input };
            AxisProgram::new(AxisModel::new(drag, lag, step), weights, steps)
        };
        let [across, upright] = vehicle.drag;
        Ok(Self {
            vehicle,
            settings,
            forward: axis(across, Some(vehicle.pitch.time_constant), tilt),
            left: axis(across, Some(vehicle.roll.time_constant), tilt),
            up: axis(upright, None, thrust),
            expected: vec![[0.0; 2]; steps],
            references: Vec::with_capacity(steps + 2),
            stages: Vec::with_capacity(steps),
            last_time: None,
            unsettled: 0,
        })
    }

    /// Commands so far in which the active bounds of an axis were not settled within [`MpcSettings::iterations`].
    pub fn unsettled(&self) -> u64 {
        self.unsettled
    }

    /// The command for the time `time` (s of the reference). `reference` is asked about the whole horizon.
    ///
    /// Values that are not finite give a command that is not finite.
    pub fn command(
        &mut self,
        time: f64,
        state: &ControlState,
        reference: &dyn Fn(f64) -> ControlReference,
    ) -> ControlCommand {
        let MpcSettings { steps, step, iterations, .. } = self.settings;
        let [roll, pitch, yaw] = state.attitude;
        self.warm_start(time, [roll, pitch]);
        self.references.clear();
        self.references.extend((0..steps + 2).map(|k| reference(time + step * k as f64)));
        let level = Rotation3::from_axis_angle(&Vector3::z_axis(), -yaw);
        let disturbance = level * state.disturbance;
        let velocity = level * state.velocity;

        // Upwards first: its thrust carries the other two.
        self.gather(&level, state, 2, disturbance.z, None);
        for (stage, ([roll, pitch], wanted)) in
            self.stages.iter_mut().zip(self.expected.iter().zip(&self.references[1..]))
        {
            stage.wanted -= displacement(&(level * wanted.lever), *roll, *pitch).z;
        }
        let upright = (roll.cos() * pitch.cos()).max(0.5);
        let bounds = self.vehicle.thrust.map(|thrust| thrust * upright - GRAVITY);
        let raised = Vector3::new(0.0, velocity.z, 0.0);
        let mut settled = self.up.solve(&raised, disturbance.z, &self.stages, bounds, iterations);
        let climb = self.up.inputs[0];
        let lift = (climb + GRAVITY).max(0.2 * GRAVITY);

        let response = self.vehicle.pitch;
        self.gather(&level, state, 0, disturbance.x, Some(response.time_constant));
        self.follow_lever(&level, 0, lift);
        let most = lift * (response.gain * self.vehicle.tilt_limit).tan();
        let start = Vector3::new(0.0, velocity.x, lift * pitch.tan());
        settled &= self.forward.solve(&start, disturbance.x, &self.stages, [-most, most], iterations);
        let pitch_command = (self.forward.inputs[0] / lift).atan() / response.gain;

        let response = self.vehicle.roll;
        // Roll tilts the thrust that pitch has tilted already.
        let inclined = lift / pitch.cos();
        self.gather(&level, state, 1, disturbance.y, Some(response.time_constant));
        self.follow_lever(&level, 1, inclined);
        let most = inclined * (response.gain * self.vehicle.tilt_limit).tan();
        let start = Vector3::new(0.0, velocity.y, -inclined * roll.tan());
        settled &= self.left.solve(&start, disturbance.y, &self.stages, [-most, most], iterations);
        let roll_command = (-self.left.inputs[0] / inclined).atan() / response.gain;

        for ((expected, forward), left) in self.expected.iter_mut().zip(&self.forward.states).zip(&self.left.states) {
            *expected = [(-left.z / inclined).atan(), (forward.z / lift).atan()];
        }
        self.unsettled += u64::from(!settled);
        let now = &self.references[0];
        ControlCommand {
            roll: roll_command,
            pitch: pitch_command,
            yaw_rate: now.heading_rate + self.settings.heading * wrap(now.heading - yaw),
            thrust: (climb + GRAVITY) / upright,
        }
    }

    /// Moves the last solution on by a step, or forgets it where this is not the step after it.
    fn warm_start(&mut self, time: f64, attitude: [f64; 2]) {
        let next =
            self.last_time.is_some_and(|last| (time - last - self.settings.step).abs() < 0.5 * self.settings.step);
        self.last_time = Some(time);
        for axis in [&mut self.forward, &mut self.left, &mut self.up] {
            if next { axis.shift() } else { axis.reset() }
        }
        if next {
            self.expected.rotate_left(1);
            if let [.., before, last] = self.expected.as_mut_slice() {
                *last = *before;
            }
        } else {
            self.expected.fill(attitude);
        }
    }

    /// The stages of an axis for the centre of the body, from its present position.
    fn gather(
        &mut self,
        level: &Rotation3<f64>,
        state: &ControlState,
        axis: usize,
        disturbance: f64,
        lag: Option<f64>,
    ) {
        let drag = self.vehicle.drag[usize::from(axis == 2)];
        // What the thrust must give for an exact flight.
        let force = |wanted: &ControlReference| {
            (level * wanted.acceleration)[axis] + drag * (level * wanted.velocity)[axis] - disturbance
        };
        self.stages.clear();
        for k in 0..self.settings.steps {
            let [before, after] = [&self.references[k], &self.references[k + 1]];
            let rate = (force(after) - force(before)) / self.settings.step;
            self.stages.push(AxisStage {
                output: RowVector3::new(1.0, 0.0, 0.0),
                wanted: (level * (after.position - state.position))[axis],
                velocity: (level * after.velocity)[axis],
                input: force(before) + lag.unwrap_or(0.5 * self.settings.step) * rate,
            });
        }
    }

    /// Tracks the end of the lever instead, forward (0) or left (1).
    fn follow_lever(&mut self, level: &Rotation3<f64>, axis: usize, lift: f64) {
        for (stage, ([roll, pitch], wanted)) in
            self.stages.iter_mut().zip(self.expected.iter().zip(&self.references[1..]))
        {
            let lever = level * wanted.lever;
            // Force and its change with the angle that makes it.
            let (force, slope) = match axis {
                0 => (lift * pitch.tan(), lift / pitch.cos().powi(2)),
                _ => (-lift * roll.tan(), -lift / roll.cos().powi(2)),
            };
            let raised = Rotation3::from_euler_angles(*roll, 0.0, 0.0) * lever;
            let turned = match axis {
                0 => -pitch.sin() * raised.x + pitch.cos() * raised.z,
                _ => -raised.z,
            };
            let gain = turned / slope;
            stage.output.z = gain;
            stage.wanted += gain * force - displacement(&lever, *roll, *pitch)[axis];
        }
    }
}

/// How far the end of a lever moves when the body tilts, both in the frame of the heading.
fn displacement(lever: &Vector3<f64>, roll: f64, pitch: f64) -> Vector3<f64> {
    Rotation3::from_euler_angles(roll, pitch, 0.0) * lever - lever
}

impl MpcSettings {
    fn check(&self) -> Result<(), Error> {
        let positive = [("mpc.step", self.step), ("mpc.tilt", self.tilt), ("mpc.thrust", self.thrust)];
        for (name, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(Error::Setting { name, value, requirement: "positive" });
            }
        }
        for (name, value) in [("mpc.velocity", self.velocity), ("mpc.heading", self.heading)] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(Error::Setting { name, value, requirement: "at least 0" });
            }
        }
        if !(2..=1000).contains(&self.steps) {
            return Err(Error::Setting { name: "mpc.steps", value: self.steps as f64, requirement: "2 to 1000" });
        }
        Ok(())
    }
}
