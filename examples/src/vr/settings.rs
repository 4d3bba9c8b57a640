//! What a session is made with; a recording carries it, so that a replay needs no options.

use std::path::PathBuf;

use clap::ValueEnum;
use paint_planner::nozzle::NozzleSettings;
use paint_planner::teleop::{SessionSettings, TeleopSettings};
use paint_planner::timing::TimingPolicy;
use paint_sim::SprayModel;
use serde::{Deserialize, Serialize};

use super::error::VrError;
use crate::mesh_frame::MeshScale;
use crate::mesh_placement::UpAxis;
use crate::mission::MissionSettings;

/// How fast the robot paints what the hand has painted (VR paper, Section V-A).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Timing {
    /// At the robot's own speed; the valve gives every place what the hand gave it (ours)
    Dose,
    /// At the robot's own speed with an even coat along each segment
    Uniform,
    /// At the hand's speed, slower by one factor where the robot cannot follow
    Gradient,
}

/// Everything that a session is made with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct VrSettings {
    /// Surface, OBJ, glTF, PLY, STL or OFF; the built-in rock wall if there is none.
    pub mesh: Option<PathBuf>,
    /// Metres per unit of the mesh file, or the unit.
    pub scale: Option<MeshScale>,
    /// Axis of the mesh file that points up.
    pub up: Option<UpAxis>,
    /// A stored map of `scan` instead of a mesh file.
    pub map: Option<PathBuf>,
    /// Seed of the rock, the wind and the errors.
    pub seed: u64,
    /// Size of a texel, metres. Default 5 mm.
    pub texel: f64,
    /// Standard deviation of a spray spot at the stand-off, metres. Default 1.5 cm.
    pub spot: f64,
    /// How fast the robot paints.
    pub timing: Timing,
    /// The robot's own speed along what it paints, m/s. Default that of missions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robot_speed: Option<f64>,
    /// Whether the robot follows at once; otherwise it flies when it is told to.
    pub live: bool,
    /// Thresholds of the session.
    pub session: SessionSettings,
}

impl Default for VrSettings {
    fn default() -> Self {
        Self {
            mesh: None,
            scale: None,
            up: None,
            map: None,
            seed: 1,
            texel: 0.005,
            spot: 0.015,
            timing: Timing::Dose,
            robot_speed: None,
            live: true,
            session: SessionSettings::default(),
        }
    }
}

/// Where the cone of the spray ends, in deviations.
const SPRAY_CUT: f64 = 3.5;
/// Paint that has met nothing after this way is overspray, metres.
const SPRAY_RANGE: f64 = 0.35;

impl VrSettings {
    /// Refuses sizes that are none.
    pub(super) fn check(&self) -> Result<(), VrError> {
        let sizes = [
            ("--texel", self.texel, 1e-4..=0.1, "give metres from 0.0001 to 0.1"),
            ("--spot", self.spot, 1e-3..=0.05, "give metres from 0.001 to 0.05"),
            ("--segment", self.session.segment, 0.02..=10.0, "give metres from 0.02 to 10"),
        ];
        let speed =
            self.robot_speed.map(|speed| ("--robot-speed", speed, 0.01..=1.0, "give metres per second from 0.01 to 1"));
        for (option, value, range, must_be) in sizes.into_iter().chain(speed) {
            if !range.contains(&value) {
                return Err(VrError::Option { option, value, must_be });
            }
        }
        if let Some(value) = self.robot_speed.filter(|_| self.timing == Timing::Gradient) {
            return Err(VrError::Option {
                option: "--robot-speed",
                value,
                must_be: "the hand's is flown with --timing gradient",
            });
        }
        Ok(())
    }

    /// The nozzle in the simulation.
    pub(super) fn spray(&self) -> SprayModel {
        let sigma = (self.spot / NozzleSettings::default().stand_off).atan();
        SprayModel { sigma, cut: SPRAY_CUT, range: SPRAY_RANGE, ..SprayModel::default() }
    }

    /// How the robot follows the hand; normals are averaged over the spot.
    pub(super) fn teleop(&self) -> TeleopSettings {
        let mut teleop = TeleopSettings::new(&MissionSettings::default().planner);
        teleop.session = self.session.clone();
        teleop.targets.footprint = self.spot;
        if let Some(speed) = self.robot_speed {
            teleop.painting.timing.policy = TimingPolicy::Uniform { speed };
        }
        match self.timing {
            Timing::Dose => {}
            Timing::Uniform => teleop.even_coat = true,
            Timing::Gradient => teleop.painting.timing.policy = TimingPolicy::GradientPreserving,
        }
        teleop
    }
}
