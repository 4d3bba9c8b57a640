//! Numerical optimisation.

mod projected_lbfgs;

pub(crate) use projected_lbfgs::{StoppingRule, minimise};
