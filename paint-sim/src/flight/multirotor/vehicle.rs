//! The vehicle in time: motors, motion, paint on board, ground.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::derivative::Motion;
use super::settings::MultirotorSettings;
use super::surroundings::Surroundings;
use crate::error::{Error, check_not_negative, check_positive};
use crate::flight::airframe::GRAVITY;
use crate::flight::vehicle::Vehicle;

/// The vehicle and its state of motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Multirotor {
    settings: MultirotorSettings,
    motion: Motion,
    motors: Vec<f64>,
    paint: f64,
    acceleration: Vector3<f64>,
    on_ground: bool,
    impact: f64,
}

impl Multirotor {
    /// At rest with motors at rest.
    ///
    /// # Errors
    /// Settings out of range, or rotors that cannot turn the vehicle about every axis.
    pub fn new(settings: MultirotorSettings, position: Point3<f64>, heading: f64) -> Result<Self, Error> {
        settings.check()?;
        if !(position.iter().all(|v| v.is_finite()) && heading.is_finite()) {
            return Err(Error::NotFinite { what: "start of the multirotor", index: 0 });
        }
        let attitude = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading).into_inner();
        let zero = Vector3::zeros();
        Ok(Self {
            motion: Motion { position: position.coords, velocity: zero, attitude, rate: zero },
            motors: vec![0.0; settings.rotors.len()],
            paint: settings.paint,
            acceleration: zero,
            on_ground: false,
            impact: 0.0,
            settings,
        })
    }

    /// Sets the state of motion: velocity in the world, angular velocity in the body.
    #[must_use]
    pub fn with_motion(mut self, attitude: UnitQuaternion<f64>, velocity: Vector3<f64>, rate: Vector3<f64>) -> Self {
        self.motion = Motion { attitude: attitude.into_inner(), velocity, rate, ..self.motion };
        self
    }

    /// Sets the motors to where a constant command would bring them.
    #[must_use]
    pub fn with_motors(mut self, command: f64) -> Self {
        self.motors.fill(command.clamp(0.0, 1.0));
        self
    }

    /// Lets `dt` seconds pass under motor commands of 0 to 1, one for each rotor, by the classical Runge-Kutta method of order four;
    /// the motors' lag is solved exactly, the quaternion normalised after each step.
    ///
    /// # Errors
    /// Commands that are not finite or not as many as rotors, a step that is not positive, an outflow that is negative, or a state
    /// that is no longer finite.
    pub fn step(&mut self, commands: &[f64], surroundings: &Surroundings, dt: f64) -> Result<(), Error> {
        if commands.len() != self.motors.len() {
            let [expected, found] = [self.motors.len(), commands.len()];
            return Err(Error::WrongLength { what: "motor commands", expected, found });
        }
        if let Some(index) = commands.iter().position(|c| !c.is_finite()) {
            return Err(Error::NotFinite { what: "motor command", index });
        }
        check_positive("step of the multirotor", dt)?;
        check_not_negative("outflow of paint", surroundings.outflow)?;
        let outflow = surroundings.outflow.min(self.paint / dt);
        let before = self.motion;
        let at = |share: f64, motion: &Motion| {
            let motors = self.motors_after(commands, share * dt);
            let mass = self.settings.mass + self.paint - outflow * share * dt;
            motion.derivative(&self.settings, motors, mass, surroundings)
        };
        let k1 = at(0.0, &before);
        let k2 = at(0.5, &before.moved(&k1, 0.5 * dt));
        let k3 = at(0.5, &before.moved(&k2, 0.5 * dt));
        let k4 = at(1.0, &before.moved(&k3, dt));
        let after =
            before.moved(&k1, dt / 6.0).moved(&k2, dt / 3.0).moved(&k3, dt / 3.0).moved(&k4, dt / 6.0).normalised();
        self.motors = self.motors_after(commands, dt).collect();
        self.paint = (self.paint - outflow * dt).max(0.0);
        self.motion = after;
        self.rest_on(surroundings.ground, &before);
        self.acceleration = (self.motion.velocity - before.velocity) / dt;
        if self.motion.is_finite() {
            Ok(())
        } else {
            Err(Error::NotFinite { what: "state of the multirotor", index: 0 })
        }
    }

    fn motors_after(&self, commands: &[f64], dt: f64) -> impl Iterator<Item = f64> {
        self.settings.rotors.iter().zip(&self.motors).zip(commands).map(move |((rotor, now), command)| {
            let command = command.clamp(0.0, 1.0);
            command + (now - command) * (-dt / rotor.time_constant).exp()
        })
    }

    /// The ground takes all motion: legs that neither bounce nor slide.
    fn rest_on(&mut self, ground: Option<f64>, before: &Motion) {
        let touches = ground.filter(|ground| self.motion.position.z <= *ground && self.motion.velocity.z <= 0.0);
        if let Some(ground) = touches {
            if !self.on_ground {
                self.impact = self.impact.max(-self.motion.velocity.z);
            }
            let zero = Vector3::zeros();
            let heading = UnitQuaternion::new_normalize(self.motion.attitude).euler_angles().2;
            let attitude = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading).into_inner();
            let position = Vector3::new(before.position.x, before.position.y, ground);
            self.motion = Motion { position, velocity: zero, attitude, rate: zero };
        }
        self.on_ground = touches.is_some();
    }

    /// What it was made of.
    pub fn settings(&self) -> &MultirotorSettings {
        &self.settings
    }

    /// Pose of the body.
    pub fn world_from_body(&self) -> Isometry3<f64> {
        Isometry3::from_parts(Translation3::from(self.motion.position), self.rotation())
    }

    /// Attitude of the body.
    pub fn rotation(&self) -> UnitQuaternion<f64> {
        UnitQuaternion::new_unchecked(self.motion.attitude)
    }

    /// Position of the body's centre, m.
    pub fn position(&self) -> Point3<f64> {
        self.motion.position.into()
    }

    /// Its velocity, world frame, m/s.
    pub fn velocity(&self) -> Vector3<f64> {
        self.motion.velocity
    }

    /// Its mean acceleration over the last step, world frame, m/s^2.
    pub fn acceleration(&self) -> Vector3<f64> {
        self.acceleration
    }

    /// Angular velocity, body frame, rad/s.
    pub fn angular_velocity(&self) -> Vector3<f64> {
        self.motion.rate
    }

    /// The same motion without motors and angular velocity.
    pub fn as_vehicle(&self) -> Vehicle {
        let (roll, pitch, yaw) = self.rotation().euler_angles();
        Vehicle {
            position: self.position(),
            velocity: self.motion.velocity,
            attitude: [roll, pitch, yaw],
            yaw_rate: self.motion.rate.z,
            acceleration: self.acceleration,
        }
    }

    /// Where each motor is between 0 and 1.
    pub fn motors(&self) -> &[f64] {
        &self.motors
    }

    /// Mass with the paint that is left, kg.
    pub fn mass(&self) -> f64 {
        self.settings.mass + self.paint
    }

    /// Paint that is left on board, kg.
    pub fn paint(&self) -> f64 {
        self.paint
    }

    /// Whether it stands on the ground.
    pub fn on_ground(&self) -> bool {
        self.on_ground
    }

    /// Largest speed downwards at which it has touched the ground, m/s.
    pub fn impact_speed(&self) -> f64 {
        self.impact
    }

    /// The motor command at which the rotors carry its weight, 0 to 1; above 1 where they cannot.
    pub fn hover_command(&self) -> f64 {
        let most: f64 = self.settings.rotors.iter().map(|rotor| rotor.max_thrust).sum();
        self.settings.command_for(self.mass() * GRAVITY / most)
    }
}
