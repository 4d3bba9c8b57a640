//! The flight of a vehicle that is not ours: on the wall clock, at the place that it says itself, before a surface that is imagined
//! where it started. Its pilot arms it and hands over control.

use std::thread::sleep;
use std::time::{Duration, Instant};

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use paint_planner::onboard::FailsafeSettings;
use paint_sim::flight::{LocalisedPose, PanTilt, Reference, ReferenceState, Vehicle};

use super::error::RobotError;
use super::flight::{End, Flown, over};
use super::on_board::{CONTROL_STEP, OnBoard, OnBoardSettings};
use super::recorder::{Recorder, Seen};
use super::simulated_robot::{STEP, station};
use crate::autopilot::{AutopilotError, OffboardLink, OffboardSettings, Telemetry, VehicleLink};
use crate::interruption;
use crate::mission::Flight;

/// Telemetry that is asked for, per second, and its longest silence, s: radios are slower than a simulation.
const TELEMETRY_RATE: f64 = 50.0;
const SILENCE: f64 = 0.2;
/// How well the vehicle knows its place it does not say.
const UNKNOWN: [f64; 2] = [f64::INFINITY; 2];
/// A vehicle is waited for so long.
const LONGEST_WAIT: Duration = Duration::from_secs(10);

/// A plan somewhere else: turned about the vertical and moved.
struct Moved<'a> {
    plan: &'a dyn Reference,
    vehicle_from_world: Isometry3<f64>,
}

impl Reference for Moved<'_> {
    fn duration(&self) -> f64 {
        self.plan.duration()
    }

    fn at(&self, t: f64) -> ReferenceState {
        let state = self.plan.at(t);
        let moved = &self.vehicle_from_world;
        ReferenceState {
            position: moved * state.position,
            velocity: moved * state.velocity,
            acceleration: moved * state.acceleration,
            heading: state.heading + moved.rotation.euler_angles().2,
            lever: moved * state.lever,
            aim: state.aim.map(|aim| moved * aim),
            ..state
        }
    }
}

/// Flies a plan on the vehicle at the other end of a link, until it has landed or is given up.
pub(super) fn fly_vehicle(
    mut link: VehicleLink,
    flight: &Flight,
    settings: OnBoardSettings,
    progress: &mut dyn FnMut(f64),
) -> Result<Flown, RobotError> {
    let clock = Instant::now();
    let plan = flight.reference;
    let start = plan.at(0.0);
    let vehicle_from_station = first_pose(&mut link, &clock)?;
    let world_from_station = station(&start.position, start.heading);
    let vehicle_from_world = vehicle_from_station * world_from_station.inverse();
    let world_from_vehicle = vehicle_from_world.inverse();
    let reference = Moved { plan, vehicle_from_world };
    let settings = OnBoardSettings {
        arms: false,
        sends_odometry: false,
        failsafe: FailsafeSettings { silence: SILENCE, ..settings.failsafe },
        offboard: OffboardSettings { telemetry_rate: TELEMETRY_RATE, ..settings.offboard },
        ..settings
    };
    let mut on_board = OnBoard::new(&reference, flight.pan_tilt()?, settings);
    let mut ptu = flight.pan_tilt()?;
    let mut recorder = Recorder::new(plan, flight.surface());
    let mut pan_tilt = [0.0; 2];
    let failed = loop {
        let now = clock.elapsed().as_secs_f64();
        for (header, message) in link.receive() {
            on_board.link().receive(now, &header, &message);
        }
        let pose = pose(on_board.link().telemetry());
        let localised = pose.map(|world_from_body| LocalisedPose { world_from_body, trusted: true, sigma: UNKNOWN });
        if interruption::is_requested() {
            on_board.interrupt();
        }
        let commanded = on_board.step(now, localised.as_ref(), pan_tilt);
        for message in &commanded.messages {
            link.send(message);
        }
        if let Some(pose) = pose {
            let velocity = on_board.link().telemetry().velocity.unwrap_or_default();
            let vehicle = vehicle(&(world_from_vehicle * pose), world_from_vehicle * velocity);
            let seen = Seen { estimated: vehicle.position, vehicle, ptu: &ptu, pan_tilt, flow: commanded.flow };
            recorder.note(now, &on_board, &seen)?;
        }
        progress(on_board.painted());
        match over(&mut on_board, now)? {
            End::NotYet => {}
            End::Landed => break None,
            End::Failed(reason) => break Some(reason),
        }
        for _ in 0..(CONTROL_STEP / STEP).round() as u32 {
            pan_tilt = ptu.step(commanded.pan_tilt, STEP);
        }
        sleep(
            Duration::from_secs_f64(CONTROL_STEP)
                .saturating_sub(clock.elapsed().saturating_sub(Duration::from_secs_f64(now))),
        );
    };
    Ok(Flown {
        record: recorder.finish(on_board.events()),
        valve_open_late: 0,
        seconds: clock.elapsed().as_secs_f64(),
        px4_cpu: 0.0,
        failed,
        broken: false,
    })
}

/// Where the vehicle stands when it is first heard, level.
fn first_pose(link: &mut VehicleLink, clock: &Instant) -> Result<Isometry3<f64>, AutopilotError> {
    let wait = LONGEST_WAIT;
    let mut on_board =
        OffboardLink::new(OffboardSettings { telemetry_rate: TELEMETRY_RATE, ..OffboardSettings::default() });
    while clock.elapsed() < wait {
        let now = clock.elapsed().as_secs_f64();
        for (header, message) in link.receive() {
            on_board.receive(now, &header, &message);
        }
        for message in on_board.transmit(now, None, None) {
            link.send(&message);
        }
        if let Some(identity) = on_board.telemetry().identity {
            identity.check()?;
        }
        if let Some(pose) = pose(on_board.telemetry()) {
            let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), pose.rotation.euler_angles().2);
            return Ok(Isometry3::from_parts(pose.translation, yaw));
        }
        sleep(Duration::from_millis(10));
    }
    let what = link.to_string();
    let (bytes, _) = link.counts();
    Err(if on_board.telemetry().identity.is_some() {
        AutopilotError::silent(
            &what,
            wait,
            "its heartbeat comes, but neither ATTITUDE_QUATERNION nor LOCAL_POSITION_NED",
        )
    } else if bytes > 0 {
        AutopilotError::Nonsense { what, bytes }
    } else {
        AutopilotError::silent(&what, wait, "let the vehicle send MAVLink there")
    })
}

fn pose(telemetry: &Telemetry) -> Option<Isometry3<f64>> {
    Some(Isometry3::from_parts(telemetry.position?.coords.into(), telemetry.attitude?))
}

fn vehicle(world_from_body: &Isometry3<f64>, velocity: Vector3<f64>) -> Vehicle {
    let (roll, pitch, yaw) = world_from_body.rotation.euler_angles();
    let position = Point3::from(world_from_body.translation.vector);
    Vehicle { velocity, attitude: [roll, pitch, yaw], ..Vehicle::at_rest(position, yaw) }
}
