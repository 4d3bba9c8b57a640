//! `spray`: a recorded motion of a nozzle becomes paint on a mesh.

mod arguments;
mod error;
mod motion;
mod read_csv;
mod read_mcap;
mod run;

pub use arguments::Arguments;
pub use error::SprayError;
pub use motion::{NozzleMotion, NozzleSample};
pub use read_csv::read_csv;
pub use run::{SprayReport, run};
