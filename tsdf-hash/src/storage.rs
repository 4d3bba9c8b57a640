//! Where the blocks of a map are: active, reloaded and waiting for a decision, or evicted.

pub(crate) mod block_file;
pub(crate) mod block_storage;
mod evicted_block;
pub(crate) mod evicted_blocks;
pub(crate) mod frame_update;
pub(crate) mod merge_policy;
pub(crate) mod reloaded;
mod sorted_pages;
pub(crate) mod summary;
pub(crate) mod swap_file;
pub(crate) mod victims;
pub(crate) mod view_reload;

pub use crate::file::map_file::MapFile;
pub use crate::report::MemoryUsage;
pub use crate::settings::MemoryLimits;
pub use merge_policy::{MergeDecision, MergeImmediately, MergePolicy};
pub use reloaded::ReloadedBlocks;
