//! A pan-tilt unit of one's own, with servos that lag.

use std::collections::VecDeque;

use nalgebra::{Isometry3, Point3, UnitVector3};
use paint_sim::flight::*;
use paint_sim::{FlightSettings, fly};

use crate::flight_scene::{outdoors, wall};
use crate::own_reference::Ellipse;

/// The ideal unit behind servos with a dead time of 20 ms, a first-order lag of 30 ms and steps of `resolution` rad.
pub(crate) struct LaggingPanTilt {
    unit: IdealPanTilt,
    resolution: f64,
    pending: VecDeque<[f64; 2]>,
    angles: [f64; 2],
}

const DEAD_STEPS: usize = 20;
const SERVO_TIME_CONSTANT: f64 = 0.03;

impl LaggingPanTilt {
    pub(crate) fn new(resolution: f64) -> Self {
        Self { unit: IdealPanTilt::default(), resolution, pending: VecDeque::new(), angles: [0.0; 2] }
    }
}

impl PanTilt for LaggingPanTilt {
    fn command(&self, world_from_body: &Isometry3<f64>, aim: &Point3<f64>) -> [f64; 2] {
        self.unit.command(world_from_body, aim)
    }

    fn reset(&mut self, angles: [f64; 2]) {
        self.angles = angles;
        self.pending = VecDeque::from(vec![angles; DEAD_STEPS]);
    }

    /// Steps of one millisecond, as the flight makes them.
    fn step(&mut self, command: [f64; 2], dt: f64) -> [f64; 2] {
        let step = self.resolution;
        self.pending.push_back(command.map(|c| if step > 0.0 { (c / step).round() * step } else { c }));
        let due = self.pending.pop_front().unwrap_or(command);
        for (angle, goal) in self.angles.iter_mut().zip(due) {
            *angle += (goal - *angle) * (1.0 - (-dt / SERVO_TIME_CONSTANT).exp());
        }
        self.angles
    }

    fn nozzle(&self, world_from_body: &Isometry3<f64>, angles: [f64; 2]) -> (Point3<f64>, UnitVector3<f64>) {
        self.unit.nozzle(world_from_body, angles)
    }

    fn delay(&self) -> f64 {
        DEAD_STEPS as f64 * 1e-3 + SERVO_TIME_CONSTANT
    }
}

/// Servos with steps of 300/1023 degrees.
pub(crate) fn arm() -> LaggingPanTilt {
    LaggingPanTilt::new((300.0_f64 / 1023.0).to_radians())
}

/// The same unit, which does not say that it lags.
struct Silent(LaggingPanTilt);

impl PanTilt for Silent {
    fn command(&self, world_from_body: &Isometry3<f64>, aim: &Point3<f64>) -> [f64; 2] {
        self.0.command(world_from_body, aim)
    }

    fn reset(&mut self, angles: [f64; 2]) {
        self.0.reset(angles);
    }

    fn step(&mut self, command: [f64; 2], dt: f64) -> [f64; 2] {
        self.0.step(command, dt)
    }

    fn nozzle(&self, world_from_body: &Isometry3<f64>, angles: [f64; 2]) -> (Point3<f64>, UnitVector3<f64>) {
        self.0.nozzle(world_from_body, angles)
    }

    fn delay(&self) -> f64 {
        0.0
    }
}

#[test]
fn a_unit_that_says_how_long_it_takes_hits_better() {
    let reference = Ellipse { duration: 20.0 };
    let settings: FlightSettings = outdoors(1);
    let missed = |unit: &mut dyn PanTilt| fly(&reference, unit, &wall(), &settings).unwrap().statistics().hit_error_rms;
    let (said, silent) = (missed(&mut arm()), missed(&mut Silent(arm())));
    assert!(silent > 1.2 * said, "{said} m, {silent} m");
}
