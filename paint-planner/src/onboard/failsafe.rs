//! Why the valve must be shut and the flight not go on.

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

/// What is known of the autopilot and of the own pose.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[allow(clippy::struct_excessive_bools, reason = "each is a report of its own")]
pub struct Watched {
    /// When the last message of the autopilot has come, and its last heartbeat, s.
    pub heard: Option<f64>,
    /// As above.
    pub heartbeat: Option<f64>,
    /// Whether it was started anew.
    pub restarted: bool,
    /// Whether its motors may turn.
    pub armed: bool,
    /// Whether it follows our set-points.
    pub follows: bool,
    /// Whether its estimator knows where it is; `None` where it has not said.
    pub estimator: Option<bool>,
    /// Whether its clock jumps.
    pub clock_jumped: bool,
    /// Charge of its battery, 0 to 1; `None` where it does not know.
    pub battery: Option<f64>,
    /// The own pose, if there is one.
    pub pose: Option<WatchedPose>,
}

/// The own pose as failsafes see it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WatchedPose {
    /// Whether it is known well enough to paint by.
    pub trusted: bool,
    /// How far the autopilot's own is from it, m and rad; zero where it has said nothing.
    pub apart: [f64; 2],
}

impl FailsafeSettings {
    /// The gravest cause at a time (s) of a flight under our control.
    pub fn cause(&self, now: f64, watched: &Watched) -> Option<Cause> {
        // A microsecond of rounding.
        let silent = |since: Option<f64>, limit: f64| since.is_none_or(|at| now - at > limit - 1e-6);
        let Watched { heard, heartbeat, estimator, pose, .. } = *watched;
        let causes = [
            (Cause::AutopilotRestarted, watched.restarted),
            (Cause::LinkLost, silent(heard, self.silence) || silent(heartbeat, self.heartbeat_silence)),
            (Cause::Disarmed, !watched.armed),
            (Cause::OffboardLost, !watched.follows),
            (Cause::PoseLost, pose.is_none()),
            (Cause::EstimateLost, estimator == Some(false) || pose.is_some_and(|pose| self.apart(&pose, 1.0))),
            (Cause::ClockJumped, watched.clock_jumped),
            (Cause::BatteryLow, watched.battery.is_some_and(|charge| charge < self.battery)),
            (Cause::PoseUncertain, pose.is_some_and(|pose| !pose.trusted)),
        ];
        causes.into_iter().filter(|(_, holds)| *holds).map(|(cause, _)| cause).min()
    }

    /// Whether both know where they are, and take themselves to be at the same place, to half of what is permitted in flight.
    pub fn ready(&self, watched: &Watched) -> bool {
        watched.estimator == Some(true) && watched.pose.is_some_and(|pose| pose.trusted && !self.apart(&pose, 0.5))
    }

    fn apart(&self, pose: &WatchedPose, share: f64) -> bool {
        let [distance, angle] = pose.apart;
        distance > share * self.disagreement || angle > share * self.turn
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flying(now: f64) -> Watched {
        Watched {
            heard: Some(now),
            heartbeat: Some(now),
            armed: true,
            follows: true,
            estimator: Some(true),
            battery: Some(0.8),
            pose: Some(WatchedPose { trusted: true, apart: [0.0; 2] }),
            ..Watched::default()
        }
    }

    #[test]
    fn each_cause_is_told_and_the_gravest_first() {
        let settings = FailsafeSettings::default();
        let cause = |watched: Watched| settings.cause(5.0, &watched);
        let usual = flying(5.0);
        let posed = |trusted, apart| Watched { pose: Some(WatchedPose { trusted, apart }), ..usual };
        assert_eq!(cause(usual), None);
        assert_eq!(cause(Watched { pose: None, ..usual }), Some(Cause::PoseLost));
        assert_eq!(cause(posed(false, [0.0; 2])), Some(Cause::PoseUncertain));
        assert_eq!(settings.cause(5.008, &usual), None);
        assert_eq!(settings.cause(5.01, &usual), Some(Cause::LinkLost));
        assert_eq!(cause(Watched { heartbeat: Some(1.9), ..usual }), Some(Cause::LinkLost));
        assert_eq!(cause(Watched { restarted: true, armed: false, ..usual }), Some(Cause::AutopilotRestarted));
        assert_eq!(cause(Watched { armed: false, follows: false, ..usual }), Some(Cause::Disarmed));
        assert_eq!(cause(Watched { follows: false, ..usual }), Some(Cause::OffboardLost));
        assert_eq!(cause(Watched { estimator: Some(false), ..usual }), Some(Cause::EstimateLost));
        assert_eq!(cause(Watched { clock_jumped: true, ..usual }), Some(Cause::ClockJumped));
        assert_eq!(cause(Watched { battery: Some(0.1), ..usual }), Some(Cause::BatteryLow));
        for (apart, ready) in [([0.4, 0.0], false), ([0.0, 0.4], false)] {
            assert_eq!(cause(posed(true, apart)), Some(Cause::EstimateLost));
            assert_eq!(settings.ready(&posed(true, apart)), ready);
        }
        // It takes off with half of what it flies with.
        assert!(cause(posed(true, [0.2, 0.0])).is_none() && !settings.ready(&posed(true, [0.2, 0.0])));
        assert!(settings.ready(&usual) && !settings.ready(&Watched { estimator: None, ..usual }));
    }
}
