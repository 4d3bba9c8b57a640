//! What the autopilot says of itself.

use mavlink::MavHeader;
use mavlink::dialects::common::{
    EstimatorStatusFlags, HEARTBEAT_DATA, MavAutopilot, MavLandedState, MavMessage, MavModeFlag, MavType,
};
use nalgebra::{Isometry3, Point3, Quaternion, UnitQuaternion, Vector3};
use paint_planner::onboard::{Watched, WatchedPose};
use paint_sim::flight::LocalisedPose;

use super::error::AutopilotError;
use super::frames;
use super::stamps::{StampGuard, Verdict};

/// Who flies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Identity {
    /// MAVLink system.
    pub system: u8,
    /// MAVLink component.
    pub component: u8,
    /// Kind of vehicle.
    pub vehicle: MavType,
    /// Whose firmware.
    pub firmware: MavAutopilot,
}

impl Default for Identity {
    /// A quadrotor of PX4.
    fn default() -> Self {
        let (vehicle, firmware) = (MavType::MAV_TYPE_QUADROTOR, MavAutopilot::MAV_AUTOPILOT_PX4);
        Self { system: 1, component: 1, vehicle, firmware }
    }
}

impl Identity {
    /// Whether its modes and its motions are known here: those of a multirotor on PX4.
    ///
    /// # Errors
    /// [`AutopilotError::Airframe`].
    pub fn check(&self) -> Result<(), AutopilotError> {
        let multirotor = matches!(
            self.vehicle,
            MavType::MAV_TYPE_QUADROTOR
                | MavType::MAV_TYPE_HEXAROTOR
                | MavType::MAV_TYPE_OCTOROTOR
                | MavType::MAV_TYPE_TRICOPTER
                | MavType::MAV_TYPE_DODECAROTOR
                | MavType::MAV_TYPE_DECAROTOR
        );
        if multirotor && self.firmware == MavAutopilot::MAV_AUTOPILOT_PX4 {
            return Ok(());
        }
        Err(AutopilotError::Airframe { found: format!("{:?} on {:?}", self.vehicle, self.firmware) })
    }
}

/// The flight mode, in PX4's terms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Follows our set-points.
    Offboard,
    /// Lands by itself.
    Land,
    /// Anything else: main and sub mode.
    Other(u8, u8),
}

impl Mode {
    /// PX4 packs main and sub mode into the upper half of the custom mode.
    fn of(custom: u32) -> Self {
        match ((custom >> 16) as u8, (custom >> 24) as u8) {
            (6, _) => Self::Offboard,
            (4, 6) => Self::Land,
            (main, sub) => Self::Other(main, sub),
        }
    }
}

/// What an autopilot's position controller asks of its attitude controller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttitudeTarget {
    /// When it has come, our clock, s.
    pub at: f64,
    /// Our frames.
    pub attitude: UnitQuaternion<f64>,
    /// Thrust, 0 to 1 of what the rotors can give.
    pub thrust: f64,
}

/// What the autopilot takes for its state, and when it was heard.
#[derive(Debug, Clone, Default)]
pub struct Telemetry {
    /// Who flies, once a heartbeat has come.
    pub identity: Option<Identity>,
    /// Mode at the last heartbeat.
    pub mode: Option<Mode>,
    /// Whether its motors may turn.
    pub armed: bool,
    /// When the last message of it has come, our clock, s.
    pub heard: Option<f64>,
    /// When its last heartbeat has come, s.
    pub heartbeat: Option<f64>,
    /// Its attitude, our frames.
    pub attitude: Option<UnitQuaternion<f64>>,
    /// The attitude that it aims for.
    pub attitude_target: Option<AttitudeTarget>,
    /// Its position, our frames, m.
    pub position: Option<Point3<f64>>,
    /// Its velocity, our frames, m/s.
    pub velocity: Option<Vector3<f64>>,
    /// Charge of its battery, 0 to 1; `None` where it does not know.
    pub battery: Option<f64>,
    /// Whether it takes itself to be on the ground.
    pub landed: Option<bool>,
    /// Whether its estimator has attitude, velocity and position.
    pub estimator: Option<bool>,
    /// The last thing that it said in words.
    pub text: Option<String>,
    /// Whether its clock has jumped and does not yet run steadily again.
    pub clock_jumped: bool,
    /// How often it was started anew.
    pub restarts: u32,
    pub(super) stamps: StampGuard,
}

impl Telemetry {
    /// Takes in a message that arrives at `now`, s; those of others than the autopilot are passed over.
    pub fn receive(&mut self, now: f64, header: &MavHeader, message: &MavMessage) {
        if let MavMessage::HEARTBEAT(heartbeat) = message {
            self.heartbeat(now, *header, heartbeat);
        }
        let from_autopilot = self.identity.is_some_and(|identity| {
            u32::from(identity.system) == header.system_id && identity.component == header.component_id
        });
        if !from_autopilot {
            return;
        }
        self.heard = Some(now);
        match message {
            MavMessage::ATTITUDE_QUATERNION(m) => {
                self.stamp(now, f64::from(m.time_boot_ms) * 1e-3);
                if let Some(attitude) = attitude([m.q1, m.q2, m.q3, m.q4]) {
                    self.attitude = Some(attitude);
                }
            }
            MavMessage::ATTITUDE_TARGET(m) => {
                let thrust = f64::from(m.thrust);
                if let Some(attitude) = attitude(m.q).filter(|_| (0.0..=1.0).contains(&thrust)) {
                    self.attitude_target = Some(AttitudeTarget { at: now, attitude, thrust });
                }
            }
            MavMessage::LOCAL_POSITION_NED(m) => {
                self.stamp(now, f64::from(m.time_boot_ms) * 1e-3);
                let [p, v] = [[m.x, m.y, m.z], [m.vx, m.vy, m.vz]].map(|v| frames::world(&Vector3::from(v).cast()));
                if p.iter().chain(&v).all(|value| value.is_finite()) {
                    (self.position, self.velocity) = (Some(p.into()), Some(v));
                }
            }
            MavMessage::SYS_STATUS(m) if m.battery_remaining >= 0 => {
                self.battery = Some(f64::from(m.battery_remaining) / 100.0);
            }
            MavMessage::EXTENDED_SYS_STATE(m) => {
                self.landed = match m.landed_state {
                    MavLandedState::MAV_LANDED_STATE_UNDEFINED => None,
                    state => Some(state == MavLandedState::MAV_LANDED_STATE_ON_GROUND),
                };
            }
            MavMessage::ESTIMATOR_STATUS(m) => {
                let needed = EstimatorStatusFlags::ESTIMATOR_ATTITUDE
                    | EstimatorStatusFlags::ESTIMATOR_VELOCITY_HORIZ
                    | EstimatorStatusFlags::ESTIMATOR_VELOCITY_VERT
                    | EstimatorStatusFlags::ESTIMATOR_POS_HORIZ_REL
                    | EstimatorStatusFlags::ESTIMATOR_POS_VERT_ABS;
                self.estimator = Some(m.flags.contains(needed));
            }
            MavMessage::STATUSTEXT(m) => self.text = Some(m.text.to_str().unwrap_or_default().to_owned()),
            _ => {}
        }
    }

    /// What failsafes look at, with our own pose.
    pub fn watched(&self, pose: Option<&LocalisedPose>) -> Watched {
        let apart = |pose: &Isometry3<f64>| {
            let distance = self.position.map_or(0.0, |position| (position.coords - pose.translation.vector).norm());
            [distance, self.attitude.map_or(0.0, |attitude| attitude.angle_to(&pose.rotation))]
        };
        Watched {
            heard: self.heard,
            heartbeat: self.heartbeat,
            restarted: self.restarts > 0,
            armed: self.armed,
            follows: self.mode == Some(Mode::Offboard),
            estimator: self.estimator,
            clock_jumped: self.clock_jumped,
            battery: self.battery,
            pose: pose.map(|pose| WatchedPose { trusted: pose.trusted, apart: apart(&pose.world_from_body) }),
        }
    }

    /// The first autopilot that is heard is ours.
    fn heartbeat(&mut self, now: f64, header: MavHeader, heartbeat: &HEARTBEAT_DATA) {
        let Ok(system) = u8::try_from(header.system_id) else { return };
        if heartbeat.autopilot == MavAutopilot::MAV_AUTOPILOT_INVALID {
            return;
        }
        let (vehicle, firmware) = (heartbeat.mavtype, heartbeat.autopilot);
        let found = Identity { system, component: header.component_id, vehicle, firmware };
        let ours = *self.identity.get_or_insert(found);
        if (ours.system, ours.component) == (found.system, found.component) {
            self.identity = Some(found);
            self.heartbeat = Some(now);
            self.mode = Some(Mode::of(heartbeat.custom_mode));
            self.armed = heartbeat.base_mode.contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED);
        }
    }

    fn stamp(&mut self, now: f64, stamp: f64) {
        let verdict = self.stamps.judge(now, stamp);
        self.clock_jumped = verdict == Verdict::Jumped;
        if verdict == Verdict::Restarted {
            self.restarts += 1;
        }
    }
}

/// From a quaternion of MAVLink, w first; anything far from unit length, NaN too, is none.
fn attitude([w, x, y, z]: [f32; 4]) -> Option<UnitQuaternion<f64>> {
    let q = Quaternion::new(w, x, y, z).cast::<f64>();
    ((q.norm() - 1.0).abs() < 0.1).then(|| frames::attitude(&UnitQuaternion::from_quaternion(q)))
}

#[cfg(test)]
mod tests {
    use super::super::codec::{Decoder, Encoder};
    use super::super::offboard::{OffboardLink, OffboardSettings};
    use super::*;
    use mavlink::dialects::common::{ATTITUDE_QUATERNION_DATA, ATTITUDE_TARGET_DATA, ESTIMATOR_STATUS_DATA};
    use paint_planner::onboard::{Cause, FailsafeSettings};

    #[test]
    fn the_own_pose_is_watched_beside_the_autopilots() {
        let telemetry = Telemetry {
            position: Some(Point3::new(1.0, 2.0, 3.0)),
            attitude: Some(UnitQuaternion::identity()),
            mode: Some(Mode::Other(4, 3)),
            ..Telemetry::default()
        };
        let ours = Isometry3::new(Vector3::new(1.0, 2.3, 2.6), Vector3::z() * 0.25);
        let watched =
            telemetry.watched(Some(&LocalisedPose { world_from_body: ours, trusted: false, sigma: [0.0; 2] }));
        let WatchedPose { trusted, apart: [distance, angle] } = watched.pose.unwrap();
        assert!(!trusted && (distance - 0.5).abs() < 1e-12 && (angle - 0.25).abs() < 1e-12, "{watched:?}");
        assert!(!watched.follows && telemetry.watched(None).pose.is_none());
        assert!(Telemetry { mode: Some(Mode::Offboard), ..telemetry }.watched(None).follows);
    }

    #[test]
    fn an_estimate_must_have_all_of_its_parts() {
        let parts = [
            EstimatorStatusFlags::ESTIMATOR_ATTITUDE,
            EstimatorStatusFlags::ESTIMATOR_VELOCITY_HORIZ,
            EstimatorStatusFlags::ESTIMATOR_VELOCITY_VERT,
            EstimatorStatusFlags::ESTIMATOR_POS_HORIZ_REL,
            EstimatorStatusFlags::ESTIMATOR_POS_VERT_ABS,
        ];
        let all = parts.iter().fold(EstimatorStatusFlags::empty(), |all, part| all | *part);
        let told = |flags: EstimatorStatusFlags| {
            let (mut telemetry, header) =
                (Telemetry::default(), MavHeader { system_id: 1, component_id: 1, sequence: 0 });
            let autopilot = HEARTBEAT_DATA { autopilot: MavAutopilot::MAV_AUTOPILOT_PX4, ..HEARTBEAT_DATA::default() };
            let status = ESTIMATOR_STATUS_DATA { flags, ..ESTIMATOR_STATUS_DATA::default() };
            for message in [MavMessage::HEARTBEAT(autopilot), MavMessage::ESTIMATOR_STATUS(status)] {
                telemetry.receive(1.0, &header, &message);
            }
            telemetry.estimator
        };
        assert_eq!(told(all), Some(true));
        assert!(parts.iter().all(|part| told(all - *part) == Some(false)));
    }

    #[test]
    fn what_the_autopilot_aims_for_is_taken_in_our_frames_or_not_at_all() {
        let told = |q: [f32; 4], thrust: f32| {
            let (mut telemetry, header) =
                (Telemetry::default(), MavHeader { system_id: 1, component_id: 1, sequence: 0 });
            let autopilot = HEARTBEAT_DATA { autopilot: MavAutopilot::MAV_AUTOPILOT_PX4, ..HEARTBEAT_DATA::default() };
            let target = ATTITUDE_TARGET_DATA { q, thrust, ..ATTITUDE_TARGET_DATA::default() };
            for message in [MavMessage::HEARTBEAT(autopilot), MavMessage::ATTITUDE_TARGET(target)] {
                telemetry.receive(1.5, &header, &message);
            }
            telemetry.attitude_target
        };
        // Facing north, nose down by 20 degrees: positive pitch here, negative there.
        let half = 10.0_f32.to_radians();
        let AttitudeTarget { at, attitude, thrust } = told([half.cos(), 0.0, -half.sin(), 0.0], 0.625).unwrap();
        let (roll, pitch, yaw) = attitude.euler_angles();
        assert!(at == 1.5 && thrust == 0.625);
        assert!(roll.abs() < 1e-6 && (pitch - 20.0_f64.to_radians()).abs() < 1e-6, "{roll} {pitch}");
        assert!((yaw - std::f64::consts::FRAC_PI_2).abs() < 1e-6, "{yaw}");
        for (q, thrust) in [([0.0; 4], 0.5), ([f32::NAN, 0.0, 0.0, 0.0], 0.5), ([1.0, 0.0, 0.0, 0.0], f32::NAN)] {
            assert_eq!(told(q, thrust), None);
        }
    }

    /// Restart and jump, from the messages themselves.
    #[test]
    fn a_restart_and_a_jump_are_seen_in_the_stamps() {
        let mut link = OffboardLink::new(OffboardSettings::default());
        let mut encoder = Encoder::new(1, 1);
        let heartbeat = MavMessage::HEARTBEAT(HEARTBEAT_DATA {
            autopilot: MavAutopilot::MAV_AUTOPILOT_PX4,
            custom_mode: 6 << 16,
            base_mode: MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED,
            ..Default::default()
        });
        let mut decoder = Decoder::default();
        let mut feed = |now: f64, stamp: f64| {
            let attitude =
                ATTITUDE_QUATERNION_DATA { q1: 1.0, time_boot_ms: (stamp * 1e3) as u32, ..Default::default() };
            for message in [heartbeat.clone(), MavMessage::ATTITUDE_QUATERNION(attitude)] {
                decoder.push(&encoder.frame(&message));
                let (header, message) = decoder.next_message().unwrap();
                link.receive(now, &header, &message);
            }
            // Facing north.
            let world_from_body = Isometry3::rotation(Vector3::z() * std::f64::consts::FRAC_PI_2);
            let watched =
                link.telemetry().watched(Some(&LocalisedPose { world_from_body, trusted: true, sigma: [0.0; 2] }));
            FailsafeSettings::default().cause(now, &watched)
        };
        assert_eq!(feed(40.0, 40.0), None);
        assert_eq!(feed(40.01, 43.01), Some(Cause::ClockJumped));
        assert_eq!(feed(40.02, 40.02), None);
        assert_eq!(feed(40.03, 0.5), Some(Cause::AutopilotRestarted));
    }
}
