//! Runs the odometry over recordings, evaluates the trajectories, and makes recordings to run it on.

mod arguments;
mod camera_frames;
mod compare;
mod error;
mod euroc_folder;
mod grey_image;
mod inertial;
mod mcap_in;
mod mcap_out;
mod plots;
mod recording;
mod report;
mod run;
mod simulate;
mod states;
mod stereo;
mod subcommands;
mod tuning;

pub use arguments::Arguments;
pub use camera_frames::camera_frames;
pub use compare::{CompareSettings, Comparison, compare};
pub use error::VioError;
pub use euroc_folder::{Overrides, open_euroc};
pub use grey_image::GreyImage;
pub use mcap_in::{open_mcap, open_mcap_stereo};
pub use recording::{Images, Recording, SecondCamera};
pub use report::{VioReport, save};
pub use run::{RunSettings, TimedRun, run};
pub use simulate::{Flight, Simulated, SimulationSettings, simulate};
pub use stereo::open_euroc_stereo;
pub use subcommands::execute;
pub use tuning::{Tuning, TuningData, TuningReport, tune_noise};
