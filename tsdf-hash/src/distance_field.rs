//! Distances far from surfaces.

pub(crate) mod field;
mod search;
pub(crate) mod settings;
mod sites;
#[cfg(test)]
mod tests;
mod tree;

pub use field::DistanceField;
pub use settings::DistanceSettings;
