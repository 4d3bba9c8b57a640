//! Loops: the camera is back, the drift is measured, and the poses since then are corrected (thesis Paper I, sections 4.5 and 4.6).

pub(crate) mod closer;
mod error_growth;
mod factors;
pub(crate) mod report;
pub(crate) mod settings;
