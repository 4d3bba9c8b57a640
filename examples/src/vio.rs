//! Runs the odometry over recordings, judges what comes out, and makes recordings to run it on.

mod cdr;
mod command_line;
mod compare;
mod error;
mod euroc_folder;
mod job;
mod judge;
mod mcap_in;
mod mcap_out;
mod picture;
mod plots;
mod recording;
mod report;
mod run;
mod second;
mod simulate;
mod tuning;

pub use command_line::Arguments;
pub use compare::{Comparison, compare};
pub use error::VioError;
pub use euroc_folder::{Overrides, open_euroc};
pub use job::execute;
pub use judge::{AlignedPair, ErrorAt, Judgement, judge};
pub use mcap_in::open_mcap;
pub use picture::Grey;
pub use recording::{Images, Recording, Shot, Truth};
pub use report::{VioReport, save};
pub use run::{Run, RunSettings, Segment, run};
pub use second::{Second, open_euroc_pair};
pub use simulate::{Flight, Simulated, SimulationSettings, simulate};
pub use tuning::{Lessons, Tuning, TuningReport, tune_noise};
