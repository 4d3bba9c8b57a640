//! Voxel blocks and the tables that find them.

pub(crate) mod active_blocks;
pub(crate) mod block_history;
pub(crate) mod block_key;
pub(crate) mod block_table;
pub(crate) mod hash_table;
pub(crate) mod sign_bits;
pub(crate) mod total_order;
pub(crate) mod trilinear;
pub(crate) mod voxel_block;
