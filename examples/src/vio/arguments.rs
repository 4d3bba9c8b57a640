//! What `vio` can be told.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::worker_threads;

/// Runs the visual-inertial filter over a recording: trajectory, figures and pictures.
#[derive(Parser)]
#[command(
    version,
    args_conflicts_with_subcommands = true,
    after_help = "Examples:\n  vio --euroc recordings/MH_01_easy --out out/MH_01\n  vio sim --flight wall --mcap --out out/sim\n  \
                  vio eval truth.tum estimate.tum"
)]
pub struct Arguments {
    #[command(subcommand)]
    pub(super) command: Option<Command>,
    #[command(flatten)]
    pub(super) track: Track,
}

#[derive(Subcommand)]
pub(super) enum Command {
    /// Renders a flight as an EuRoC folder that any odometry can run, and as MCAP
    Sim(Sim),
    /// Dead reckoning: inertial samples alone, no images, from a state that is given
    Inertial(Inertial),
    /// Compares an estimated trajectory with a reference
    Eval(Eval),
    /// Finds the noise settings with which recordings are followed best
    Tune(Tune),
}

#[derive(Args)]
pub(super) struct Track {
    /// Folder in the layout of EuRoC/ASL: mav0/cam0, mav0/imu0 and, if known, the truth
    #[arg(long, value_name = "DIR", conflicts_with = "mcap")]
    pub(super) euroc: Option<PathBuf>,
    /// MCAP file with images, inertial samples and, unless given by files of Kalibr, calibration
    #[arg(long, value_name = "FILE")]
    pub(super) mcap: Option<PathBuf>,
    /// Topic of the images in the MCAP file, with --stereo given twice [default: the first that are no depth and fit the calibration]
    #[arg(long, value_name = "TOPIC", requires = "mcap")]
    pub(super) camera_topic: Vec<String>,
    /// Topic of the inertial samples in the MCAP file [default: the first with rates and forces]
    #[arg(long, value_name = "TOPIC", requires = "mcap")]
    pub(super) imu_topic: Option<String>,
    /// Kalibr's camera chain, instead of the recording's own calibration
    #[arg(long, value_name = "YAML")]
    pub(super) cameras: Option<PathBuf>,
    /// Kalibr's file of the inertial sensor, instead of the recording's own
    #[arg(long, value_name = "YAML")]
    pub(super) imu: Option<PathBuf>,
    /// True poses, TUM or EuRoC text, instead of the recording's own
    #[arg(long, value_name = "FILE")]
    pub(super) truth: Option<PathBuf>,
    /// With the second camera: mav0/cam1 of a folder, the second topic with images of an MCAP file
    #[arg(long)]
    pub(super) stereo: bool,
    /// Image of the size of the first camera's; nothing is tracked where it is black: propellers, legs
    #[arg(long, value_name = "PNG")]
    pub(super) mask: Option<PathBuf>,
    /// Settings of the filter as TOML: any of those that a run writes to settings.toml; the others keep their defaults
    #[arg(long, value_name = "TOML")]
    pub(super) settings: Option<PathBuf>,
    /// Landmarks that are followed at once [default: 25, or that of the settings]
    #[arg(long, value_name = "NUMBER")]
    pub(super) features: Option<usize>,
    /// Estimate the calibration as well, starting from the one given: lenses, places of the cameras, their clock, the accelerometer's
    /// scale; runs twice
    #[arg(long)]
    pub(super) calibrate: bool,
    /// Take the inertial samples as they are, though the test of gravity, axes or rate refuses them
    #[arg(long)]
    pub(super) accept_imu: bool,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/vio")]
    pub(super) out: PathBuf,
    /// Worker threads [default: all cores]; results do not depend on it
    #[arg(long, value_parser = worker_threads::parse)]
    pub(super) threads: Option<usize>,
}

#[derive(Args)]
pub(super) struct Sim {
    /// The motion
    #[arg(long, default_value = "room")]
    pub(super) flight: FlightName,
    /// Fly along these poses instead, TUM or EuRoC text, smoothed
    #[arg(long, value_name = "FILE", conflicts_with = "flight")]
    pub(super) trajectory: Option<PathBuf>,
    /// Seconds of it at most
    #[arg(long, default_value_t = 30.0)]
    pub(super) seconds: f64,
    /// Write recording.mcap as well
    #[arg(long)]
    pub(super) mcap: bool,
    /// With pixels as they are, not as PNG
    #[arg(long, requires = "mcap")]
    pub(super) raw: bool,
    /// With a second camera, 0.11 m beside the first, in the folder
    #[arg(long)]
    pub(super) stereo: bool,
    /// Kalibr's camera chain with the lenses to see through, instead of EuRoC's: one camera, with --stereo two
    #[arg(long, value_name = "YAML")]
    pub(super) cameras: Option<PathBuf>,
    /// Rolling shutter: seconds from the first row of an image until the last
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = 0.0,
        allow_negative_numbers = true,
        conflicts_with = "stereo"
    )]
    pub(super) readout: f64,
    /// Seed of the room, the biases and the noise
    #[arg(long, default_value_t = 1)]
    pub(super) seed: u64,
    /// Folder for the recording
    #[arg(long, value_name = "DIR", default_value = "out/vio-sim")]
    pub(super) out: PathBuf,
    /// Worker threads [default: all cores]; results do not depend on it
    #[arg(long, value_parser = worker_threads::parse)]
    pub(super) threads: Option<usize>,
}

#[derive(Clone, Copy, ValueEnum)]
pub(super) enum FlightName {
    /// Swaying and turning through a room
    Room,
    /// Rows along a wall, as a painting robot flies
    Wall,
}

#[derive(Args)]
pub(super) struct Inertial {
    /// Folder in the layout of EuRoC/ASL; mav0/imu0 is all that is needed of it
    #[arg(long, value_name = "DIR")]
    pub(super) euroc: PathBuf,
    /// The state to start from, EuRoC text: time, position, quaternion (scalar first), velocity in the world and, if known, biases of
    /// gyroscope and accelerometer; the first row that the samples cover counts [default: the recording's truth]
    #[arg(long, value_name = "CSV")]
    pub(super) start: Option<PathBuf>,
    /// Kalibr's file of the inertial sensor, instead of the recording's own
    #[arg(long, value_name = "YAML")]
    pub(super) imu: Option<PathBuf>,
    /// Seconds after the start
    #[arg(long, default_value_t = 10.0)]
    pub(super) seconds: f64,
    /// Magnitude of gravity, m/s²
    #[arg(long, default_value_t = 9.81)]
    pub(super) gravity: f64,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/vio-inertial")]
    pub(super) out: PathBuf,
}

#[derive(Args)]
pub(super) struct Eval {
    /// Reference, TUM or EuRoC text
    pub(super) reference: PathBuf,
    /// Estimate, TUM or EuRoC text
    pub(super) estimate: PathBuf,
    /// Largest time difference of a pair of poses, s
    #[arg(long, value_name = "SECONDS", default_value_t = 0.01)]
    pub(super) max_difference: f64,
    /// With the error after alignment of the scale as well
    #[arg(long)]
    pub(super) sim3: bool,
    /// Lengths of path over which the relative error is taken, m
    #[arg(long, value_name = "METRES", value_delimiter = ',', default_value = "8,16,24,32,40")]
    pub(super) rpe: Vec<f64>,
    /// Folder for report.json as well
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
}

#[derive(Args)]
pub(super) struct Tune {
    /// A recording with its truth, EuRoC/ASL; may be given again. Without any: simulated flights
    #[arg(long, value_name = "DIR")]
    pub(super) euroc: Vec<PathBuf>,
    /// Simulated flights
    #[arg(long, default_value_t = 4, conflicts_with = "euroc")]
    pub(super) flights: usize,
    /// Seconds of each
    #[arg(long, default_value_t = 12.0, conflicts_with = "euroc")]
    pub(super) seconds: f64,
    /// Factors on the noise to start from: the gyroscope's white noise and walk, the accelerometer's, and the images'
    #[arg(long, value_name = "FACTORS", value_delimiter = ',', default_value = "1,1,1,1,1")]
    pub(super) start: Vec<f64>,
    /// Evaluations at most
    #[arg(long, default_value_t = 200)]
    pub(super) evaluations: usize,
    /// Weight of inconsistent covariances (NEES off 3) beside position errors
    #[arg(long, value_name = "WEIGHT", default_value_t = 0.5)]
    pub(super) consistency: f64,
    /// Cost of a factor of ten away from the data sheet, as a share of the error; a factor of a hundred costs four times as much
    #[arg(long, value_name = "WEIGHT", default_value_t = 0.03)]
    pub(super) regularization: f64,
    /// Compare with so many points drawn at random
    #[arg(long, value_name = "NUMBER", default_value_t = 0)]
    pub(super) random: usize,
    /// Go on from trials.csv in the folder
    #[arg(long)]
    pub(super) resume: bool,
    /// Seed of the flights and the random points
    #[arg(long, default_value_t = 1)]
    pub(super) seed: u64,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "out/vio-tune")]
    pub(super) out: PathBuf,
    /// Worker threads [default: all cores]; results do not depend on it
    #[arg(long, value_parser = worker_threads::parse)]
    pub(super) threads: Option<usize>,
}
