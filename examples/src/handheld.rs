//! `handheld`: shared-control painting with a gantry robot that a person sweeps past an object (handheld paper).

mod arguments;
pub mod cube;
mod deposit_model;
mod error;
mod evaluation;
mod forecast;
mod gpu;
mod hardware;
mod motion_file;
mod object;
mod painting;
mod pictures;
mod recorded_motion;
mod recording;
mod report;
mod run;
mod scenario;
mod settings;
mod target;
mod views;

pub use arguments::{Arguments, MotionAxes};
pub use deposit_model::SimulatedDeposit;
pub use error::HandheldError;
pub use evaluation::{Evaluation, evaluate, time_ratio};
pub use forecast::{Forecast, PaintDevice, PaintJob, Processor};
pub use hardware::HardwareSettings;
pub use object::{PaintObject, SurfaceSample};
pub use painting::{HandPoses, PaintingLog, Tick, paint};
pub use report::HandheldReport;
pub use run::run;
pub use scenario::Scenario;
pub use settings::HandheldSettings;
pub use views::passes;
