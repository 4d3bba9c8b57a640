//! What all programs on a GPU share: the adapter, its buffers, and what becomes of faults.

mod device;
mod double;
mod fallback;
mod options;

pub(crate) use device::{Input, MOST_GROUPS, Program, floats, words};
pub(crate) use double::{DOUBLE, doubles};
pub(crate) use fallback::Fallback;
pub use options::GpuOptions;
