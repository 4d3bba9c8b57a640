//! The simulated vehicle: flies what it is given on the session's clock.

use nalgebra::{Isometry3, Point3};
use paint_planner::VehicleState;
use paint_planner::teleop::{Flight, Vehicle};
use paint_sim::flight::{FlightLog, FlightSample, Localisation};
use paint_sim::{FlightSettings, Shot};
use ptu_kinematics::{Hover, Joints, ServoSettings};

use super::error::VrError;
use super::run_up::{RUN_UP, RunUp};
use super::world::VrWorld;
use crate::adapters::{PlanReference, ServoPanTilt};

/// Motion of the nozzle that one shot stands for, m.
const SHOT_STEP: f64 = 0.005;

/// The robot as it is seen.
#[derive(Debug, Clone, Copy)]
pub(super) struct VehicleView {
    pub(super) world_from_body: Isometry3<f64>,
    pub(super) pan_tilt: [f64; 2],
    pub(super) nozzle: Point3<f64>,
    pub(super) aim: Point3<f64>,
    pub(super) flow: f64,
}

/// A flight as it was simulated.
struct SimulatedFlight {
    begin: f64,
    end: f64,
    colour: u8,
    log: FlightLog,
    /// Samples whose paint has landed.
    landed: usize,
}

impl SimulatedFlight {
    /// Flies on until `now`, the samples at `now` themselves left out where another flight takes over there.
    fn advance(&mut self, now: f64, inclusive: bool) -> Vec<FlightSample> {
        let elapsed = (now - self.begin) / self.log.interval;
        let reached = if inclusive { elapsed.floor() + 1.0 } else { elapsed.ceil() };
        let reached = (reached.max(0.0) as usize).min(self.log.samples.len());
        let passed = self.log.samples[self.landed.min(reached)..reached].to_vec();
        self.landed = self.landed.max(reached);
        passed
    }
}

/// The vehicle.
pub(super) struct SimulatedVehicle {
    seed: u64,
    view: VehicleView,
    /// Taken, and not simulated yet.
    taken: Option<Flight>,
    flight: Option<SimulatedFlight>,
    /// What takes over from it.
    successor: Option<SimulatedFlight>,
}

impl Vehicle for SimulatedVehicle {
    type Error = VrError;

    fn position(&self) -> Point3<f64> {
        Point3::from(self.view.world_from_body.translation.vector)
    }

    fn fly(&mut self, flight: &Flight) -> Result<(), VrError> {
        self.taken = Some(flight.clone());
        Ok(())
    }
}

impl SimulatedVehicle {
    /// At rest before the surface. Wind and errors follow from the seed.
    pub(super) fn new(world: &VrWorld, seed: u64) -> Self {
        Self { seed, view: at_rest(&world.home, world), taken: None, flight: None, successor: None }
    }

    pub(super) fn view(&self) -> &VehicleView {
        &self.view
    }

    /// Flies on until `now`; the paint that has left the nozzle since, and which.
    pub(super) fn advance(&mut self, now: f64, world: &VrWorld) -> Result<(u8, Vec<Shot>), VrError> {
        if let Some(taken) = self.taken.take() {
            let simulated = self.simulate(&taken, world)?;
            *(if taken.takes_over { &mut self.successor } else { &mut self.flight }) = Some(simulated);
        }
        let Some(flight) = &mut self.flight else { return Ok((0, Vec::new())) };
        let (colour, interval) = (flight.colour, flight.log.interval);
        let takes_over = self.successor.take_if(|next| next.begin <= now);
        let mut passed = flight.advance(takes_over.as_ref().map_or(now, |next| next.begin), takes_over.is_none());
        if let Some(next) = takes_over {
            *flight = next;
            passed.extend(flight.advance(now, true));
        }
        if let Some(sample) = passed.last() {
            self.view = seen(sample);
        }
        if now >= flight.end {
            self.flight = None;
        }
        Ok((colour, FlightLog { samples: passed, interval }.shots(SHOT_STEP)))
    }

    /// The simulated flight along a plan; one that begins in motion is entered with a run-up.
    fn simulate(&self, flight: &Flight, world: &VrWorld) -> Result<SimulatedFlight, VrError> {
        let plan = PlanReference {
            plan: &flight.plan,
            chain: &world.robot.chain,
            gun_length: world.ptu.tilt_from_tip.norm(),
            stand_off: flight.stand_off,
        };
        let settings = FlightSettings {
            localisation: Localisation::mocap(),
            seed: self.seed.wrapping_mul(0x9E37_79B9).wrapping_add(flight.number + 1),
            ..FlightSettings::default()
        };
        let mut gun = ServoPanTilt::new(world.robot.chain.clone(), ServoSettings::default())?;
        let entered = RunUp { plan: &plan, seconds: if flight.takes_over { RUN_UP } else { 0.0 } };
        let log = paint_sim::fly(&entered, &mut gun, &world.surface.world, &settings)?;
        let (begin, end) = (flight.begin, flight.end());
        Ok(SimulatedFlight { begin, end, colour: flight.colour, log: entered.without(log), landed: 0 })
    }
}

fn seen(sample: &FlightSample) -> VehicleView {
    let aim = sample.hit.unwrap_or(sample.nozzle + sample.axis.into_inner() * 0.1);
    VehicleView {
        world_from_body: sample.world_from_body,
        pan_tilt: sample.pan_tilt,
        nozzle: sample.nozzle,
        aim,
        flow: sample.flow,
    }
}

fn at_rest(state: &VehicleState, world: &VrWorld) -> VehicleView {
    let joints = Joints { pan: state.pan, tilt: state.tilt };
    let hover = Hover { position: state.position, heading: state.heading, joints };
    let nozzle = world.robot.chain.forward(&hover.world_from_body(), joints);
    VehicleView {
        world_from_body: hover.world_from_body(),
        pan_tilt: [state.pan, state.tilt],
        nozzle: nozzle.tip,
        aim: nozzle.tip + nozzle.direction.into_inner() * 0.1,
        flow: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{UnitVector3, Vector3};

    fn sample(time: f64) -> FlightSample {
        let origin = Point3::origin();
        FlightSample {
            time,
            world_from_body: Isometry3::identity(),
            velocity: Vector3::zeros(),
            acceleration: Vector3::zeros(),
            attitude: [0.0; 3],
            estimated_position: origin,
            reference_position: origin,
            pan_tilt: [0.0; 2],
            desired_pan_tilt: [0.0; 2],
            nozzle: origin,
            axis: UnitVector3::new_unchecked(Vector3::x()),
            aim: None,
            hit: None,
            distance: 1.0,
            wanted_distance: 1.0,
            flow: 1e-7,
            held: false,
        }
    }

    /// Every sample passes once: up to the present one, or up to where another flight begins, which has that moment itself.
    #[test]
    fn every_sample_of_a_flight_passes_once() {
        let log = FlightLog { samples: (0..9).map(|k| sample(0.25 * f64::from(k))).collect(), interval: 0.25 };
        let mut flight = SimulatedFlight { begin: 10.0, end: 12.0, colour: 0, log, landed: 0 };
        let mut passed = |now: f64, inclusive: bool| {
            flight.advance(now, inclusive).iter().map(|sample| sample.time).collect::<Vec<_>>()
        };
        assert_eq!(passed(9.9, true), [] as [f64; 0]);
        assert_eq!(passed(10.0, true), [0.0]);
        assert_eq!(passed(10.6, true), [0.25, 0.5]);
        assert_eq!(passed(10.6, true), [] as [f64; 0]);
        assert_eq!(passed(11.0, false), [0.75]);
        assert_eq!(passed(11.0, true), [1.0]);
        assert_eq!(passed(13.0, true), [1.25, 1.5, 1.75, 2.0]);
    }
}
