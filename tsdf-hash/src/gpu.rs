//! The map on a GPU.

mod cast;
mod device;
mod fuse;
pub(crate) mod gpu_map;
pub(crate) mod options;
mod pool;
mod probe;
mod scratch;
mod split;
mod stream;
#[cfg(test)]
mod test_adapter;
mod tiers;

pub use gpu_map::GpuMap;
pub use options::GpuOptions;
