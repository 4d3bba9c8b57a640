//! The robot below the autopilot: rigid body, motors, air, hose, pan-tilt unit, valve and sensors, 1,000 steps a second.

use std::collections::VecDeque;

use nalgebra::{Isometry3, Point3, Vector3};
use paint_sim::FlightSettings;
use paint_sim::flight::multirotor::{
    Barometer, BarometerSettings, Imu, ImuSettings, Load, Magnetometer, MagnetometerSettings, Multirotor,
    MultirotorSettings, Surroundings,
};
use paint_sim::flight::{FlightSample, HoseModel, LocalisedPose, PanTilt, PoseSource, WindModel};

use crate::adapters::ServoPanTilt;
use crate::appearance::DENSITY;
use crate::autopilot::{MavMessage, simulator};

/// Time of a step, s.
pub(super) const STEP: f64 = 1e-3;
/// Steps between two samples of the autopilot's sensors.
pub(super) const SENSOR_STEPS: u64 = 4;
/// Steps of a control step.
pub(super) const CONTROL_STEPS: u64 = 10;
/// Height of the body's centre on its legs, m.
const LEGS: f64 = 0.3;
/// Speed of the paint out of the nozzle, m/s: the middle of what airless guns have.
const EXIT_SPEED: f64 = 40.0;
/// The station is so far behind the place where the plan starts, m.
const STATION_DISTANCE: f64 = 1.5;
/// Half the width of the stand under a station above the ground, m.
const STAND: f64 = 0.3;

/// The vehicle and all that it carries.
pub struct SimulatedRobot<'a> {
    body: Multirotor,
    ptu: ServoPanTilt,
    pan_tilt: [f64; 2],
    wind: WindModel,
    hose: Option<HoseModel>,
    hose_force: Vector3<f64>,
    localisation: &'a mut dyn PoseSource,
    station: Point3<f64>,
    imu: Imu,
    barometer: Barometer,
    magnetometer: Magnetometer,
    aim: [f64; 2],
    /// The flow that is commanded for the control step that begins.
    commanded: Option<f64>,
    last_command: f64,
    /// Whether pan and tilt stay where they are.
    stuck: bool,
    /// Flows that were commanded and have not reached the nozzle yet.
    valve: VecDeque<f64>,
    flow: f64,
    steps: u64,
}

impl<'a> SimulatedRobot<'a> {
    /// At rest at a place, on a stand if that is above the ground. `conditions` hold wind, hose, valve and seed.
    pub fn new(
        settings: MultirotorSettings,
        station: &Isometry3<f64>,
        ptu: ServoPanTilt,
        localisation: &'a mut dyn PoseSource,
        conditions: &FlightSettings,
    ) -> Result<Self, paint_sim::Error> {
        let seed = conditions.seed;
        let (place, heading) = (station.translation.vector, station.rotation.euler_angles().2);
        let control_step = CONTROL_STEPS as f64 * STEP;
        let delay = (conditions.valve.dead_time / control_step).round() as usize;
        Ok(Self {
            body: Multirotor::new(settings, place.into(), heading)?,
            ptu,
            pan_tilt: [0.0; 2],
            wind: WindModel::new(&conditions.wind, STEP, seed),
            hose: conditions.hose,
            hose_force: Vector3::zeros(),
            localisation,
            station: place.into(),
            imu: Imu::new(ImuSettings::default(), seed)?,
            barometer: Barometer::new(BarometerSettings::default(), seed)?,
            magnetometer: Magnetometer::new(MagnetometerSettings::default(), seed)?,
            aim: [0.0; 2],
            commanded: None,
            last_command: 0.0,
            stuck: false,
            valve: std::iter::repeat_n(0.0, delay).collect(),
            flow: 0.0,
            steps: 0,
        })
    }

    /// Time since it was switched on, s.
    pub fn time(&self) -> f64 {
        self.steps as f64 * STEP
    }

    /// Steps since it was switched on.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// The vehicle itself.
    pub fn body(&self) -> &Multirotor {
        &self.body
    }

    /// Where the joints are, rad.
    pub fn pan_tilt(&self) -> [f64; 2] {
        self.pan_tilt
    }

    /// The pan-tilt unit.
    pub fn ptu(&self) -> &ServoPanTilt {
        &self.ptu
    }

    /// Flow that leaves the nozzle, m^3/s.
    pub fn flow(&self) -> f64 {
        self.flow
    }

    /// Whether the last command of the valve was for paint.
    pub fn valve_is_commanded_open(&self) -> bool {
        self.last_command > 0.0
    }

    /// What the autopilot's sensors say; asked once for every fourth step.
    pub fn sensors(&mut self) -> [MavMessage; 1] {
        let imu = self.imu.measure(&self.body.velocity(), &self.body.rotation(), SENSOR_STEPS as f64 * STEP);
        let field = self.magnetometer.measure(&self.body.rotation());
        let barometer = self.barometer.measure(self.body.position().z);
        [simulator::hil_sensor(self.steps * 1000, &imu, &field, &barometer)]
    }

    /// What the localisation reports; asked once for every control step.
    ///
    /// # Errors
    /// Of the localisation.
    pub fn pose(&mut self) -> Result<Option<LocalisedPose>, paint_sim::Error> {
        self.localisation.pose(self.time(), &self.body.as_vehicle())
    }

    /// A sample of paint as it lands, for cameras that see it; `interval` seconds before the next.
    pub fn sprayed(&mut self, sample: &FlightSample, interval: f64) {
        self.localisation.sprayed(sample, interval);
    }

    /// Height at which the body's centre rests where it is.
    fn ground(&self) -> f64 {
        let off = self.body.position() - self.station;
        if off.x.abs().max(off.y.abs()) < STAND { self.station.z } else { LEGS }
    }

    /// Commands of a control step: joints (rad), and flow, which follows after the valve's dead time. The joints keep theirs until the
    /// next; the valve's driver shuts it where a control step brings no command, as when the program that commands it dies.
    pub fn command(&mut self, aim: [f64; 2], flow: f64) {
        (self.aim, self.commanded) = (aim, Some(flow));
    }

    /// Lets pan and tilt stay where they are, or go on.
    pub fn stick(&mut self, stuck: bool) {
        self.stuck = stuck;
    }

    /// Lets a step pass.
    pub fn step(&mut self, motors: &[f64]) -> Result<(), paint_sim::Error> {
        if self.steps.is_multiple_of(CONTROL_STEPS) {
            self.last_command = self.commanded.take().unwrap_or(0.0);
            self.valve.push_back(self.last_command);
            self.flow = self.valve.pop_front().unwrap_or(0.0);
            if let Some(hose) = &self.hose {
                self.hose_force = hose.force(&self.body.position())?;
            }
        }
        let wind = self.wind.step();
        let pose = self.body.world_from_body();
        let (nozzle, axis) = self.ptu.nozzle(&pose, self.pan_tilt);
        let nozzle = pose.inverse_transform_point(&nozzle);
        let loads = [
            Load { force: self.hose_force, point: Point3::origin() },
            Load::recoil(self.flow * DENSITY, EXIT_SPEED, &axis, nozzle),
        ];
        let outflow = self.flow * DENSITY;
        self.body.step(motors, &Surroundings { wind, loads: &loads, outflow, ground: Some(self.ground()) }, STEP)?;
        if !self.stuck {
            self.pan_tilt = self.ptu.step(self.aim, STEP);
        }
        self.steps += 1;
        self.localisation.moved(self.time(), &self.body.as_vehicle())
    }
}

/// Where a flight begins and ends whose plan starts at a place with a heading: on the ground behind it.
pub(super) fn station(start: &Point3<f64>, heading: f64) -> Isometry3<f64> {
    let back = STATION_DISTANCE * Vector3::new(heading.cos(), heading.sin(), 0.0);
    Isometry3::new(Vector3::new(start.x - back.x, start.y - back.y, LEGS), Vector3::z() * heading)
}

#[cfg(test)]
mod tests {
    use paint_sim::flight::PoseSensor;
    use ptu_kinematics::{Ptu, PtuSettings, ServoSettings};

    use super::*;

    fn robot(senses: &mut PoseSensor) -> SimulatedRobot<'_> {
        let ptu = ServoPanTilt::new(Ptu::new(PtuSettings::default()).unwrap(), ServoSettings::default()).unwrap();
        let start = station(&Point3::new(0.0, 0.0, 2.0), 0.0);
        SimulatedRobot::new(MultirotorSettings::default(), &start, ptu, senses, &FlightSettings::default()).unwrap()
    }

    /// It stays where it is, and goes on from there.
    #[test]
    fn a_stuck_servo_does_not_move() {
        let mut senses = PoseSensor::new(FlightSettings::default().localisation, 0.01, 1);
        let mut robot = robot(&mut senses);
        let rotors = vec![0.0; robot.body().motors().len()];
        let mut after = |stuck: bool, steps: u64| {
            robot.stick(stuck);
            robot.command([0.3, -0.2], 0.0);
            for _ in 0..steps {
                robot.step(&rotors).unwrap();
            }
            robot.pan_tilt()
        };
        let begun = after(false, 60);
        assert!(begun[0] > 0.01 && begun[0] < 0.29, "{begun:?}");
        assert_eq!(after(true, 500), begun);
        let [pan, tilt] = after(false, 500);
        assert!((pan - 0.3).abs() < 0.01 && (tilt + 0.2).abs() < 0.01, "{pan} {tilt}");
    }

    /// The program that commands it may end at any time.
    #[test]
    fn a_valve_that_is_not_commanded_shuts() {
        let conditions = FlightSettings::default();
        let mut senses = PoseSensor::new(conditions.localisation, 0.01, 1);
        let mut robot = robot(&mut senses);
        let rotors = robot.body().motors().len();
        let mut step = |command: Option<f64>| {
            if let Some(flow) = command {
                robot.command([0.0; 2], flow);
            }
            for _ in 0..CONTROL_STEPS {
                robot.step(&vec![0.0; rotors]).unwrap();
            }
            (robot.valve_is_commanded_open(), robot.flow() > 0.0)
        };
        let dead = (conditions.valve.dead_time / 0.01).round() as usize;
        for k in 0..20 {
            assert_eq!(step(Some(1e-6)), (true, k >= dead), "{k}");
        }
        for k in 0..20 {
            assert_eq!(step(None), (false, k < dead), "{k}");
        }
    }
}
