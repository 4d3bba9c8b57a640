//! Numerical optimisation.

mod projected_lbfgs;
#[cfg(test)]
mod tests;

pub(crate) use projected_lbfgs::{StoppingRule, minimise};
