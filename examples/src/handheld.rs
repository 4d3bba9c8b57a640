//! `handheld`: shared-control painting with a gantry robot that a person sweeps past an object (handheld paper).

mod arguments;
pub mod cube;
mod error;
mod evaluation;
mod forecast;
mod gpu;
mod motion_file;
mod object;
mod pictures;
mod recorded_motion;
mod recording;
mod report;
mod run;
mod scenario;
mod session;
mod settings;
mod target;
mod views;

pub use arguments::{Arguments, MotionAxes};
pub use error::HandheldError;
pub use evaluation::{Evaluation, evaluate, time_ratio};
pub use forecast::{Forecast, PaintDevice, PaintJob, Processor};
pub use object::{PaintObject, SurfaceSample};
pub use report::HandheldReport;
pub use run::run;
pub use scenario::Scenario;
pub use session::{HandPoses, SessionLog, SessionSettings, Tick, paint};
pub use settings::HandheldSettings;
pub use views::passes;
