//! The painter of the thesis (Paper IV, section 3.3): a recurrent network that looks at a small picture through a movable
//! window and sets one spray after the other, until it has done enough.
//!
//! ```text
//! while S ≤ Δ_stop and t ≤ T                                        (algorithm 3; repairs in the book)
//!     x̂ = x - tanh c,   r = read(x, x̂, h_dec)                       attention: N x N Gaussian filters
//!     h_enc = RNN([r, h_dec]),   z ~ Q(Z | h_enc),   h_dec = RNN(z)
//!     z_paint ~ Q(Z_paint | h_dec),   c += σ(z_paint) v exp(-|p - μ|² / 2σ²),   S += 1 - σ(z_paint)
//! ```
//!
//! [`ThesisPainter`] is the painter, [`Network`] its weights, [`Architecture`] the rows of Table 8.1. Training is in `paint_net::train`.

mod activations;
#[cfg(any(test, feature = "train"))]
mod adjoint;
mod architecture;
mod dense;
#[cfg(any(test, feature = "train"))]
mod loss;
mod lstm;
mod matrix;
mod network;
mod nonlinearities;
mod painter;
mod read_attention;
#[cfg(test)]
mod reference;
mod rollout;
mod spray;
mod step;
mod stop;
#[cfg(test)]
mod tests;

#[cfg(feature = "train")]
pub(crate) use adjoint::{ModelAdjoint, backward};
pub use architecture::Architecture;
#[cfg(feature = "train")]
pub(crate) use loss::{LossTerms, loss_terms};
pub use network::Network;
pub use painter::ThesisPainter;
pub use rollout::Objective;
#[cfg(feature = "train")]
pub(crate) use rollout::{Model, Noise, Rollout};
pub use step::{AttentionWindow, Step};
