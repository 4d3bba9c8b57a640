//! Everything that updates the filter, behind one trait.

pub(crate) mod inverse_distance;
pub(crate) mod measurement;
pub(crate) mod patch;
pub(crate) mod pixel;
pub(crate) mod pose;
pub(crate) mod stationary;
pub(crate) mod stereo_pixel;
pub(crate) mod update;
