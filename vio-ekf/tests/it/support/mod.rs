//! What the tests share: random numbers, flights, and recordings that may be absent.

pub(crate) mod abuse;
pub(crate) mod double_sphere;
pub(crate) mod flight;
pub(crate) mod imus;
pub(crate) mod recorded;
pub(crate) mod rng;
pub(crate) mod sequences;
pub(crate) mod tracker;
