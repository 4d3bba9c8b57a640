//! The feedback network: convolutional, recurrent, with its adjoint.

#[cfg(any(test, feature = "train"))]
mod adjoint;
mod architecture;
mod conv;
mod footprint_operator;
pub(crate) mod layout;
mod padded_grid;
mod pass;
mod real;
mod response;
pub(crate) mod safetensors;
mod tile_buffers;
mod tile_problem;
mod tiles;
#[cfg(any(test, feature = "train"))]
mod unrolled;
mod weights;
mod widest;

#[cfg(feature = "train")]
pub(crate) use adjoint::Adjoint;
pub use architecture::Architecture;
pub(crate) use footprint_operator::FootprintOperator;
pub(crate) use padded_grid::{BLOCK, PaddedGrid};
#[cfg(feature = "train")]
pub(crate) use pass::PackedNetwork;
pub(crate) use real::Real;
pub(crate) use response::{Response, ScaledResponse};
#[cfg(feature = "train")]
pub(crate) use tile_problem::TileProblem;
pub(crate) use tiles::{State, Tiles};
#[cfg(feature = "train")]
pub(crate) use unrolled::Unrolled;
pub use weights::Network;
