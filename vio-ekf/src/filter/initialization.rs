//! Initialization at rest and in motion.

pub(crate) mod dynamic;
pub(crate) mod dynamic_initializer;
pub(crate) mod from_initialization;
pub(crate) mod static_initializer;
