//! Noise settings from recordings: what is run, what it costs, and the report.

mod data;
mod output;
mod report;
mod search;
mod settings;
mod trial_log;

pub use data::TuningData;
pub use report::TuningReport;
pub use search::tune_noise;
pub use settings::Tuning;
