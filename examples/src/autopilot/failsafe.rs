//! Why the valve must be shut and the flight not go on.

use paint_sim::flight::LocalisedPose;

use super::telemetry::{Mode, Telemetry};

/// The causes, the gravest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cause {
    /// The autopilot was started anew: it knows nothing of the flight.
    AutopilotRestarted,
    /// Its motors are off.
    Disarmed,
    /// Nothing is heard of it.
    LinkLost,
    /// It does not follow our set-points: the pilot or a failsafe of its own has taken over.
    OffboardLost,
    /// We do not know where we are.
    PoseLost,
    /// It does not know where it is, or takes itself to be elsewhere.
    EstimateLost,
    /// Its stamps jump.
    ClockJumped,
    /// The battery is low.
    BatteryLow,
    /// Whoever runs the program wants its end.
    Interrupted,
    /// It is far from where it is told to be.
    NotFollowed,
    /// Our pose is not known well enough to paint by, or has jumped.
    PoseUncertain,
}

impl Cause {
    /// In words.
    pub fn text(self) -> &'static str {
        match self {
            Self::AutopilotRestarted => "the autopilot was restarted",
            Self::Disarmed => "the autopilot has disarmed",
            Self::LinkLost => "nothing is heard of the autopilot",
            Self::OffboardLost => "the autopilot has left off-board mode",
            Self::PoseLost => "there is no pose",
            Self::EstimateLost => "the autopilot's estimate is lost or elsewhere",
            Self::ClockJumped => "the autopilot's stamps jump",
            Self::BatteryLow => "the battery is low",
            Self::Interrupted => "interrupted",
            Self::NotFollowed => "the autopilot does not follow",
            Self::PoseUncertain => "the pose is uncertain",
        }
    }

    /// Whether the flight may go on when the cause is gone. After the others it ends.
    pub fn passes(self) -> bool {
        !matches!(self, Self::AutopilotRestarted | Self::Disarmed) && !self.brings_home()
    }

    /// Whether the flight ends where it began.
    pub fn brings_home(self) -> bool {
        matches!(self, Self::BatteryLow | Self::Interrupted)
    }
}

/// From when on something is a cause.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FailsafeSettings {
    /// Silence of the autopilot, s. Default 10 ms, one control step: it is asked for telemetry at 125 Hz or more.
    pub silence: f64,
    /// Silence of its heartbeat, s. Default 3 s, three of the slowest.
    pub heartbeat_silence: f64,
    /// Distance between its position and ours, m. Default 0.3.
    pub disagreement: f64,
    /// Angle between its attitude and ours, rad. Default 0.3.
    pub turn: f64,
    /// Charge of the battery, 0 to 1. Default 0.2.
    pub battery: f64,
}

impl Default for FailsafeSettings {
    fn default() -> Self {
        Self { silence: 0.01, heartbeat_silence: 3.0, disagreement: 0.3, turn: 0.3, battery: 0.2 }
    }
}

impl FailsafeSettings {
    /// The gravest cause at a time (s) of a flight under off-board control. `pose`: ours, `None` while there is none.
    pub fn cause(&self, now: f64, telemetry: &Telemetry, pose: Option<&LocalisedPose>) -> Option<Cause> {
        // A microsecond of rounding.
        let silent = |since: Option<f64>, limit: f64| since.is_none_or(|at| now - at > limit - 1e-6);
        let apart = |pose: &LocalisedPose| telemetry.disagrees(&pose.world_from_body, self.disagreement, self.turn);
        let causes = [
            (Cause::AutopilotRestarted, telemetry.restarts > 0),
            (
                Cause::LinkLost,
                silent(telemetry.heard, self.silence) || silent(telemetry.heartbeat, self.heartbeat_silence),
            ),
            (Cause::Disarmed, !telemetry.armed),
            (Cause::OffboardLost, telemetry.mode != Some(Mode::Offboard)),
            (Cause::PoseLost, pose.is_none()),
            (Cause::EstimateLost, telemetry.estimator == Some(false) || pose.is_some_and(apart)),
            (Cause::ClockJumped, telemetry.clock_jumped),
            (Cause::BatteryLow, telemetry.battery.is_some_and(|charge| charge < self.battery)),
            (Cause::PoseUncertain, pose.is_some_and(|pose| !pose.trusted)),
        ];
        causes.into_iter().filter(|(_, holds)| *holds).map(|(cause, _)| cause).min()
    }
}

#[cfg(test)]
mod tests {
    use super::super::codec::Encoder;
    use super::super::offboard::{OffboardLink, OffboardSettings};
    use super::*;
    use mavlink::dialects::common::{ATTITUDE_QUATERNION_DATA, HEARTBEAT_DATA, MavAutopilot, MavMessage, MavModeFlag};
    use nalgebra::Isometry3;

    fn at(world_from_body: Isometry3<f64>) -> LocalisedPose {
        LocalisedPose { world_from_body, trusted: true }
    }

    fn flying(now: f64) -> Telemetry {
        Telemetry {
            armed: true,
            mode: Some(Mode::Offboard),
            heard: Some(now),
            heartbeat: Some(now),
            estimator: Some(true),
            battery: Some(0.8),
            position: Some(nalgebra::Point3::origin()),
            attitude: Some(nalgebra::UnitQuaternion::identity()),
            ..Telemetry::default()
        }
    }

    #[test]
    fn each_cause_is_told_and_the_gravest_first() {
        let settings = FailsafeSettings::default();
        let pose = at(Isometry3::identity());
        let cause = |telemetry: &Telemetry| settings.cause(5.0, telemetry, Some(&pose));
        let usual = flying(5.0);
        assert_eq!(cause(&usual), None);
        assert_eq!(settings.cause(5.0, &usual, None), Some(Cause::PoseLost));
        let uncertain = LocalisedPose { trusted: false, ..pose };
        assert_eq!(settings.cause(5.0, &usual, Some(&uncertain)), Some(Cause::PoseUncertain));
        assert_eq!(settings.cause(5.008, &usual, Some(&pose)), None);
        assert_eq!(settings.cause(5.01, &usual, Some(&pose)), Some(Cause::LinkLost));
        assert_eq!(cause(&Telemetry { heartbeat: Some(1.9), ..flying(5.0) }), Some(Cause::LinkLost));
        assert_eq!(cause(&Telemetry { restarts: 1, armed: false, ..flying(5.0) }), Some(Cause::AutopilotRestarted));
        assert_eq!(cause(&Telemetry { armed: false, mode: None, ..flying(5.0) }), Some(Cause::Disarmed));
        assert_eq!(cause(&Telemetry { mode: Some(Mode::Other(4, 3)), ..flying(5.0) }), Some(Cause::OffboardLost));
        assert_eq!(cause(&Telemetry { estimator: Some(false), ..flying(5.0) }), Some(Cause::EstimateLost));
        assert_eq!(cause(&Telemetry { clock_jumped: true, ..flying(5.0) }), Some(Cause::ClockJumped));
        assert_eq!(cause(&Telemetry { battery: Some(0.1), ..flying(5.0) }), Some(Cause::BatteryLow));
        for elsewhere in [Isometry3::translation(0.4, 0.0, 0.0), Isometry3::rotation(nalgebra::Vector3::z() * 0.4)] {
            assert_eq!(settings.cause(5.0, &usual, Some(&at(elsewhere))), Some(Cause::EstimateLost));
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
        let mut decoder = super::super::codec::Decoder::default();
        let mut feed = |now: f64, stamp: f64| {
            let attitude =
                ATTITUDE_QUATERNION_DATA { q1: 1.0, time_boot_ms: (stamp * 1e3) as u32, ..Default::default() };
            for message in [heartbeat.clone(), MavMessage::ATTITUDE_QUATERNION(attitude)] {
                decoder.push(&encoder.frame(&message));
                let (header, message) = decoder.next_message().unwrap();
                link.receive(now, &header, &message);
            }
            // Facing north.
            let pose = at(Isometry3::rotation(nalgebra::Vector3::z() * std::f64::consts::FRAC_PI_2));
            FailsafeSettings::default().cause(now, link.telemetry(), Some(&pose))
        };
        assert_eq!(feed(40.0, 40.0), None);
        assert_eq!(feed(40.01, 43.01), Some(Cause::ClockJumped));
        assert_eq!(feed(40.02, 40.02), None);
        assert_eq!(feed(40.03, 0.5), Some(Cause::AutopilotRestarted));
    }
}
