//! What all programs on a GPU share: the adapter, its buffers, and what becomes of faults.
//!
//! What of each is equal to the processor stands at [`GpuOptions`].

mod device;
mod double;
mod fallback;
mod options;
#[cfg(test)]
pub(crate) mod test_adapter;

pub(crate) use device::{Input, MOST_GROUPS, Program, floats, words};
pub(crate) use double::{DOUBLE, doubles};
pub(crate) use fallback::Fallback;
pub use options::GpuOptions;
