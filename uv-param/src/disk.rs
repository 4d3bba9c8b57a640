//! The checked input: one orientable, manifold, genus-0 surface with a boundary.

mod repair;
mod surface;

pub use repair::{Repair, RepairReport, largest_disk, largest_disk_with};
pub use surface::Disk;
