//! Loops: the camera is back, the drift is measured, and the poses since then are corrected (thesis Paper I, sections 4.5 and 4.6).

pub(crate) mod closer;
mod error_growth;
mod factors;
pub(crate) mod report;
pub(crate) mod settings;

pub use crate::bundle_adjustment::adjust::{BundleAdjustmentReport, bundle_adjust};
pub use crate::bundle_adjustment::settings::BundleAdjustmentSettings;
pub use closer::LoopCloser;
pub use report::{LoopClosure, LoopReport};
pub use settings::LoopSettings;
