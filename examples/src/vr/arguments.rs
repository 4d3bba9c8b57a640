//! The command line of `vr`.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Parser, ValueEnum};

use super::hand::Way;
use super::settings::{Timing, VrSettings};
use super::watch::WatchSource;
use crate::mesh_frame::MeshScale;
use crate::mesh_placement::UpAxis;
use crate::mission::MissionSettings;
use crate::mission_file::MissionFile;
use crate::socket_address;

/// Serves a page on which a person paints a surface by hand, in a headset or with mouse, keyboard or touch; the simulated robot
/// follows at once or flies the session later. Without a mesh: the built-in rock wall.
#[derive(Debug, Clone, Parser)]
#[command(
    version,
    after_help = "Examples:\n  vr\n  vr --mesh bust.obj --offline --out out/bust\n  vr --listen 0.0.0.0:8090\n  vr --watch 127.0.0.1:8765\n  vr --watch out/paintcopter/mission.mcap\n  vr --design-page --mesh facade.ply --out out/facade\n  vr --replay out/vr/session.mcap --out out/again"
)]
pub struct Arguments {
    /// Surface to paint, OBJ, glTF, PLY, STL or OFF; the built-in rock wall if not given
    #[arg(long, value_name = "FILE", conflicts_with_all = ["map", "replay"])]
    mesh: Option<PathBuf>,
    /// A stored map of `scan` instead of a mesh
    #[arg(long, value_name = "FILE", conflicts_with = "replay")]
    map: Option<PathBuf>,
    /// Metres per unit of the mesh file, or m, cm, mm, ft, in, or fit (the longest side becomes 3 m) [default: what the file says, else what its
    /// size tells]
    #[arg(long, requires = "mesh", value_name = "METRES|UNIT|fit")]
    scale: Option<MeshScale>,
    /// Axis of the mesh file that points up [default: what the file or its base says, else y for OBJ and OFF, z for
    /// PLY and STL]
    #[arg(long, requires = "mesh")]
    up: Option<Up>,
    /// Size of a texel, metres
    #[arg(long, value_name = "METRES", default_value_t = 0.005)]
    texel: f64,
    /// Standard deviation of a spray spot from 10 cm, metres
    #[arg(long, value_name = "METRES", default_value_t = 0.015)]
    spot: f64,
    /// Length of the segments that the robot flies live, metres, cut as in the paper [default: 0.1, and up to 1 where the robot is behind]
    #[arg(long, value_name = "METRES")]
    segment: Option<f64>,
    /// How fast the robot paints what the hand has painted
    #[arg(long, default_value = "dose")]
    timing: Timing,
    /// The robot's own speed along what it paints, metres per second [default: that of missions, 0.4]
    #[arg(long, value_name = "M_PER_S")]
    robot_speed: Option<f64>,
    /// The robot does not follow at once: it flies when it is told to
    #[arg(long)]
    offline: bool,
    /// Address to serve; anything but loopback is served only to who knows the token that is printed
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8090", value_parser = socket_address::parse)]
    pub(super) listen: SocketAddr,
    /// Paint a recorded session again, serve nothing, and check that the plans are the same
    #[arg(long, value_name = "FILE")]
    pub(super) replay: Option<PathBuf>,
    /// Show on the page what others do: host and port of a running `scan --live`, or a recording (mission.mcap of `paintcopter`, scan.mcap)
    #[arg(long, value_name = "ADDRESS|FILE", conflicts_with_all = ["mesh", "map", "offline", "replay", "experiment"])]
    pub(super) watch: Option<WatchSource>,
    /// Serve a page on which a mission is designed: a picture is placed on the surface, parts of it are chosen or kept clean, and what would come out, its
    /// time and its paint are shown; it writes mission.toml, which `paintcopter` flies
    #[arg(long, conflicts_with_all = ["map", "offline", "replay", "experiment", "watch", "segment", "robot_speed", "texel", "spot", "timing"])]
    pub(super) design_page: bool,
    /// Serve nothing, make an experiment of the VR paper: a simulated hand paints, or layers of paint are compared
    #[arg(long, conflicts_with = "replay")]
    pub(super) experiment: Option<Experiment>,
    /// Folder of measured pigments, for `--experiment layers`
    #[arg(long, value_name = "DIR", required_if_eq("experiment", "layers"), requires = "experiment")]
    pub(super) pigments: Option<PathBuf>,
    /// Speed of that hand, metres per second
    #[arg(long, value_name = "M_PER_S", default_value_t = 0.08, requires = "experiment")]
    pub(super) hand_speed: f64,
    /// Seed of the rock, the wind and the errors
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/vr")]
    pub(super) out: PathBuf,
}

/// An experiment of the VR paper.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Experiment {
    /// Rows of 7.75 m in all (VR paper, Section VI-B)
    AreaFill,
    /// A closed contour with a trembling hand (VR paper, Section VI-A)
    Contour,
    /// Layers of one paint, predicted and measured; needs `--pigments` (VR paper, Section VI-D)
    Layers,
}

impl Experiment {
    /// What the hand paints; `None` where none is needed.
    pub(super) fn way(self) -> Option<Way> {
        match self {
            Self::AreaFill => Some(Way::AreaFill),
            Self::Contour => Some(Way::Contour),
            Self::Layers => None,
        }
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Up {
    X,
    Y,
    Z,
}

impl Arguments {
    /// The mission that a design begins with: the surface, and nothing on it.
    pub(super) fn mission(&self) -> MissionFile {
        let VrSettings { mesh, scale, up, seed, .. } = self.settings();
        let settings = MissionSettings { seed, ..MissionSettings::default() };
        MissionFile { mesh, scale, up, settings, ..MissionFile::default() }
    }

    /// What a new session is made with.
    pub(super) fn settings(&self) -> VrSettings {
        let mut settings = VrSettings {
            mesh: self.mesh.clone(),
            scale: self.scale,
            up: self.up.map(|up| match up {
                Up::X => UpAxis::X,
                Up::Y => UpAxis::Y,
                Up::Z => UpAxis::Z,
            }),
            map: self.map.clone(),
            seed: self.seed,
            texel: self.texel,
            spot: self.spot,
            timing: self.timing,
            robot_speed: self.robot_speed,
            live: !self.offline,
            ..VrSettings::default()
        };
        if let Some(length) = self.segment {
            (settings.session.segment, settings.session.longest) = (length, length);
        }
        settings
    }
}
