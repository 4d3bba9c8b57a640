//! The robot as plans move it: level in hover, or pitched where its tilt joint ends.

use nalgebra::Isometry3;
use paint_planner::Tool;
use ptu_kinematics::{KinematicChain, PitchingJoints, PitchingPtu, Ptu, PtuSettings, Range};

use super::error::MissionError;
use super::settings::MissionSettings;
use crate::adapters::Robot;

/// How far a spray may rise, radians: at 90 degrees the pan joint turns it about itself.
pub(super) const STEEPEST: f64 = 80.0 * std::f64::consts::PI / 180.0;
/// What a vehicle that pitches keeps of the tilt joint's range, radians, as a level one does: the body leans against the wind.
const KEPT: f64 = 5.0 * std::f64::consts::PI / 180.0;

/// The robot as plans move it.
#[derive(Debug, Clone)]
pub(super) enum PlannedRobot {
    /// It hovers level.
    Level(Robot),
    /// Its thrust is vectored: it hovers pitched where the tilt joint ends.
    Pitching(Robot<PitchingPtu>),
}

impl PlannedRobot {
    /// The robot that the settings describe.
    pub(super) fn new(settings: &MissionSettings) -> Result<Self, MissionError> {
        let tether = settings.constraints.tether;
        if settings.pitch == 0.0 {
            return Ok(Self::Level(Robot { tether, ..Robot::new(Ptu::new(settings.ptu)?) }));
        }
        let Range { min, max } = settings.ptu.tilt_limits;
        // What the body gives, the joint leaves to it: a pitched body lies farther below an underside than a raised gun holds it.
        let left = STEEPEST - settings.pitch + KEPT;
        let tilt_limits = Range { min: (min + KEPT).max(-left), max: (max - KEPT).min(left) };
        let ptu = PtuSettings { tilt_limits, ..settings.ptu };
        let chain = PitchingPtu::new(Ptu::new(ptu)?, Range::symmetric(settings.pitch))?;
        Ok(Self::Pitching(Robot { tether, ..Robot::new(chain) }))
    }

    /// As the planner knows it.
    pub(super) fn tool(&self) -> &dyn Tool {
        match self {
            Self::Level(robot) => robot,
            Self::Pitching(robot) => robot,
        }
    }

    /// The joints of a planned pan and tilt, which are azimuth and elevation of the spray.
    pub(super) fn joints(&self, pan: f64, tilt: f64) -> PitchingJoints {
        match self {
            Self::Level(_) => PitchingJoints { pitch: 0.0, pan, tilt },
            Self::Pitching(robot) => robot.chain.point(pan, tilt),
        }
    }

    /// Pose of the body at a planned one, which is level.
    pub(super) fn body(world_from_level: &Isometry3<f64>, joints: &PitchingJoints) -> Isometry3<f64> {
        PitchingPtu::body(world_from_level, joints.pitch)
    }
}

/// The settings with a tilt joint of this range, radians to both sides, and a spray that rises by as much more.
pub fn with_tilt(settings: &MissionSettings, tilt: f64) -> MissionSettings {
    let mut changed = settings.clone();
    changed.ptu.tilt_limits = Range::symmetric(tilt);
    changed.planner.nozzle.max_elevation += elevation(&changed) - elevation(settings);
    changed
}

/// The settings with a vehicle that hovers pitched by so much, radians up and down, and a spray that rises by as much more.
pub fn with_pitch(settings: &MissionSettings, pitch: f64) -> MissionSettings {
    let mut changed = MissionSettings { pitch, ..settings.clone() };
    changed.planner.nozzle.max_elevation += elevation(&changed) - elevation(settings);
    changed
}

/// How far joint and body raise and lower a spray, radians.
pub(super) fn elevation(settings: &MissionSettings) -> f64 {
    let Range { min, max } = settings.ptu.tilt_limits;
    (min.abs().min(max) + settings.pitch).min(STEEPEST)
}
