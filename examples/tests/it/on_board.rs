//! The on-board program without an autopilot: another one is played, message by message.

use mavlink::dialects::common::{
    ATTITUDE_QUATERNION_DATA, ESTIMATOR_STATUS_DATA, EstimatorStatusFlags, HEARTBEAT_DATA, LOCAL_POSITION_NED_DATA,
    MavAutopilot, MavCmd, MavMessage, MavModeFlag, MavType, SYS_STATUS_DATA,
};
use mavlink::{MavHeader, MavlinkVersion, Message};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use paint_planner::onboard::{Cause, FailsafeSettings, Phase};
use paint_sim::flight::{Airframe, LocalisedPose, Reference, ReferenceState, Valve};
use paintcopter::adapters::ServoPanTilt;
use paintcopter::autopilot::OffboardSettings;
use paintcopter::robot::{Commanded, OnBoard, OnBoardSettings, SetpointKind};
use ptu_kinematics::{Ptu, PtuSettings, ServoSettings};

const STEP: f64 = 0.01;
const OFFBOARD: u32 = 6 << 16;
const LAND: u32 = (4 << 16) | (6 << 24);

/// A metre along y in five seconds, painted all the way.
struct Line;

impl Reference for Line {
    fn duration(&self) -> f64 {
        5.0
    }

    fn at(&self, t: f64) -> ReferenceState {
        let moves = (0.0..=5.0).contains(&t);
        let position = Point3::new(1.0, 0.2 * t.clamp(0.0, 5.0), 1.5);
        ReferenceState {
            position,
            velocity: if moves { Vector3::y() * 0.2 } else { Vector3::zeros() },
            acceleration: Vector3::zeros(),
            heading: 0.0,
            heading_rate: 0.0,
            lever: Vector3::zeros(),
            aim: Some(position + Vector3::x()),
            nozzle_distance: 0.1,
            flow: 1e-6,
        }
    }
}

fn pan_tilt() -> ServoPanTilt {
    ServoPanTilt::new(Ptu::new(PtuSettings::default()).unwrap(), ServoSettings::default()).unwrap()
}

/// An autopilot that is where it is told to be, and the program that tells it.
struct Flight {
    on_board: OnBoard<'static>,
    now: f64,
    /// North, east, down.
    place: [f32; 3],
    armed: bool,
    mode: u32,
    estimator: EstimatorStatusFlags,
    battery: i8,
    /// Of its clock, against ours, s.
    late: f64,
    silent: bool,
    pose: Option<LocalisedPose>,
}

const HEADER: MavHeader = MavHeader { system_id: 1, component_id: 1, sequence: 0 };

impl Flight {
    fn new() -> Self {
        let settings = OnBoardSettings {
            setpoints: SetpointKind::Trajectory,
            arms: true,
            airframe: Airframe::default(),
            hover_thrust: 0.5,
            sends_odometry: true,
            valve: Valve::default(),
            failsafe: FailsafeSettings::default(),
            offboard: OffboardSettings::default(),
            seconds: 60.0,
        };
        let on_board = OnBoard::new(&Line, pan_tilt(), settings);
        let estimator = EstimatorStatusFlags::all();
        let (place, late, pose) = ([0.0; 3], 0.0, None);
        let mut flight = Self {
            on_board,
            now: 0.0,
            place,
            armed: false,
            mode: 0,
            estimator,
            battery: 80,
            late,
            silent: false,
            pose,
        };
        flight.stand();
        flight
    }

    /// The pose is the autopilot's.
    fn stand(&mut self) {
        let [north, east, down] = self.place.map(f64::from);
        let world_from_body = Isometry3::translation(east, north, -down);
        self.pose = Some(LocalisedPose { world_from_body, trusted: true, sigma: [1e-3; 2] });
    }

    fn telemetry(&self) -> [MavMessage; 5] {
        let time_boot_ms = ((self.now + 1.0 - self.late) * 1e3).round() as u32;
        let base_mode = if self.armed { MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED } else { MavModeFlag::empty() };
        let [x, y, z] = self.place;
        // Facing east.
        let half = std::f32::consts::FRAC_1_SQRT_2;
        [
            MavMessage::HEARTBEAT(HEARTBEAT_DATA {
                custom_mode: self.mode,
                base_mode,
                mavtype: MavType::MAV_TYPE_QUADROTOR,
                autopilot: MavAutopilot::MAV_AUTOPILOT_PX4,
                ..Default::default()
            }),
            MavMessage::ATTITUDE_QUATERNION(ATTITUDE_QUATERNION_DATA {
                time_boot_ms,
                q1: half,
                q4: half,
                ..Default::default()
            }),
            MavMessage::LOCAL_POSITION_NED(LOCAL_POSITION_NED_DATA { time_boot_ms, x, y, z, ..Default::default() }),
            MavMessage::ESTIMATOR_STATUS(ESTIMATOR_STATUS_DATA { flags: self.estimator, ..Default::default() }),
            MavMessage::SYS_STATUS(SYS_STATUS_DATA { battery_remaining: self.battery, ..Default::default() }),
        ]
    }

    /// One control step of both.
    fn step(&mut self) -> Commanded {
        self.now += STEP;
        if !self.silent {
            for message in self.telemetry() {
                self.on_board.link().receive(self.now, &HEADER, &message);
            }
        }
        let commanded = self.on_board.step(self.now, self.pose.as_ref(), [0.0; 2]);
        for message in &commanded.messages {
            match message {
                MavMessage::SET_POSITION_TARGET_LOCAL_NED(target) if self.armed && self.mode == OFFBOARD => {
                    self.place = [target.x, target.y, target.z];
                }
                MavMessage::COMMAND_LONG(c) if c.command == MavCmd::MAV_CMD_DO_SET_MODE => {
                    self.mode = (c.param2 as u32) << 16 | (c.param3 as u32) << 24;
                }
                MavMessage::COMMAND_LONG(c) if c.command == MavCmd::MAV_CMD_COMPONENT_ARM_DISARM => {
                    self.armed = c.param1 == 1.0;
                }
                _ => {}
            }
        }
        if self.mode == LAND {
            self.place[2] = (self.place[2] + 0.02).min(0.0);
            self.armed &= self.place[2] < 0.0;
        }
        self.stand();
        commanded
    }

    /// On to the middle of the plan, where paint flows.
    fn painting() -> Self {
        let mut flight = Self::new();
        while flight.on_board.painted() < 2.0 {
            flight.step();
            assert!(flight.now < 60.0, "{}", flight.on_board.phase());
        }
        assert!(flight.step().flow > 0.0);
        flight
    }
}

#[test]
fn a_flight_by_messages_alone_paints_its_plan() {
    let mut flight = Flight::new();
    let (mut open, mut ways) = (0, 0);
    while flight.on_board.phase() != Phase::Done {
        let flow = flight.step().flow;
        let paints = flight.on_board.phase() == Phase::Paint;
        open += u32::from(paints && flow > 0.0);
        ways += u32::from(!paints && flow > 0.0);
        assert!(flight.now < 90.0, "{}", flight.on_board.phase());
    }
    let names: Vec<_> = flight.on_board.events().iter().map(|(_, phase)| phase.to_string()).collect();
    assert_eq!(names, ["arm", "take off", "approach", "paint", "return", "land", "done"]);
    assert_eq!((flight.on_board.painted(), ways), (5.0, 0));
    // Five seconds, but for the lead of the valve.
    assert!((490..=501).contains(&open), "{open}");
}

/// What happens to a flight.
type Happens = fn(&mut Flight);

#[test]
fn every_cause_shuts_the_valve_in_its_control_step() {
    let hold = Phase::Hold;
    let cases: [(Happens, Phase); 10] = [
        (|f| f.silent = true, hold(Cause::LinkLost)),
        (|f| f.pose = None, hold(Cause::PoseLost)),
        (|f| f.pose = f.pose.map(|pose| LocalisedPose { trusted: false, ..pose }), hold(Cause::PoseUncertain)),
        (|f| f.pose.as_mut().unwrap().world_from_body.translation.x += 0.12, hold(Cause::PoseUncertain)),
        (|f| f.place[0] += 0.4, hold(Cause::EstimateLost)),
        (|f| f.estimator = EstimatorStatusFlags::ESTIMATOR_ATTITUDE, hold(Cause::EstimateLost)),
        (|f| f.mode = 3 << 16, hold(Cause::OffboardLost)),
        (|f| f.late = 3.0, hold(Cause::ClockJumped)),
        (|f| f.armed = false, Phase::Aborted(Cause::Disarmed)),
        (|f| f.battery = 19, Phase::Return),
    ];
    for (happens, phase) in cases {
        let mut flight = Flight::painting();
        happens(&mut flight);
        let commanded = flight.step();
        assert_eq!((commanded.flow, flight.on_board.phase()), (0.0, phase));
    }
    let mut restarted = Flight::painting();
    restarted.late = restarted.now;
    assert_eq!((restarted.step().flow, restarted.on_board.phase()), (0.0, Phase::Aborted(Cause::AutopilotRestarted)));
}

#[test]
fn after_a_hold_nothing_is_painted_twice_and_nothing_is_left_out() {
    let mut flight = Flight::painting();
    let before = flight.on_board.painted();
    flight.estimator = EstimatorStatusFlags::empty();
    for _ in 0..50 {
        assert_eq!(flight.step().flow, 0.0);
    }
    flight.estimator = EstimatorStatusFlags::all();
    let mut open = Vec::new();
    while flight.on_board.phase() != Phase::Land {
        if flight.step().flow > 0.0 {
            open.push(flight.on_board.plan_time(flight.now).unwrap());
        }
        assert!(flight.now < 90.0, "{}", flight.on_board.phase());
    }
    // The paint of a command of now leaves 50 ms later.
    let lead = Valve::default().lead;
    assert!((open[0] - before).abs() < 2.1 * STEP, "{} {before}", open[0]);
    assert!((open.last().unwrap() + lead - 5.0).abs() < 1.1 * STEP, "{open:?}");
}

/// A pose that jumps is counted for the autopilot's estimator; one that moves is not.
#[test]
fn jumps_of_the_pose_are_counted() {
    let mut flight = Flight::painting();
    let resets = |flight: &mut Flight| {
        let sent = [flight.step().messages, flight.step().messages].concat();
        let counter = |message: &MavMessage| match message {
            MavMessage::ODOMETRY(odometry) => Some(odometry.reset_counter),
            _ => None,
        };
        sent.iter().find_map(counter).unwrap()
    };
    assert_eq!(resets(&mut flight), 0);
    flight.place[1] += 0.2;
    flight.stand();
    assert_eq!(resets(&mut flight), 1);
}

/// Messages whose frames are right and whose content makes no sense: any bits.
#[test]
fn nonsense_moves_nothing_that_is_not_finite() {
    let known = [0, 1, 30, 31, 32, 76, 111, 230, 245, 253, 331];
    let mut state = 1_u64;
    let mut random = move |below: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % below
    };
    let mut fed = 0;
    for _ in 0..30 {
        let mut flight = Flight::painting();
        for _ in 0..200 {
            let id = known[random(known.len() as u64) as usize];
            // Bits of NaN and of infinity among them.
            let payload: Vec<u8> =
                (0..255).map(|_| [0x00, 0x7F, 0x80, 0xFF, random(256) as u8][random(5) as usize]).collect();
            if let Ok(message) = MavMessage::parse(MavlinkVersion::V2, id, &payload) {
                assert_eq!(message.message_id(), id);
                flight.on_board.link().receive(flight.now, &HEADER, &message);
                let attitude = flight.on_board.link().telemetry().attitude;
                assert!(attitude.is_none_or(|q: UnitQuaternion<f64>| (q.norm() - 1.0).abs() < 1e-9), "{message:?}");
                fed += 1;
            }
            let commanded = flight.step();
            assert!((0.0..=1e-6).contains(&commanded.flow));
            assert!(commanded.pan_tilt.iter().all(|angle| angle.is_finite()));
            for message in &commanded.messages {
                if let MavMessage::SET_POSITION_TARGET_LOCAL_NED(t) = message {
                    let values = [t.x, t.y, t.z, t.vx, t.vy, t.vz, t.afx, t.afy, t.afz, t.yaw];
                    assert!(values.iter().all(|value| value.is_finite() && value.abs() < 10.0), "{t:?}");
                }
            }
        }
    }
    assert!(fed > 2000, "{fed}");
}
