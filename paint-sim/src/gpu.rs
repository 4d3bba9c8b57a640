//! What all programs on a GPU share: the adapter, its buffers, and what becomes of faults.

mod device;
mod options;

pub(crate) use device::{Input, MOST_GROUPS, Program, floats, words};
pub use options::GpuOptions;
