//! The image side: pyramids, patches, corners, tracking before the initialization and photometric alignment after it.

pub(crate) mod corner_detector;
pub(crate) mod image_frontend;
pub(crate) mod klt_tracker;
pub(crate) mod patch;
pub(crate) mod patch_alignment;
pub(crate) mod patch_slant;
pub(crate) mod point_tracker;
pub(crate) mod pyramid;
#[cfg(test)]
mod tests;
