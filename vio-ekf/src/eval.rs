//! Judging an estimated trajectory against a reference: pair up, align, measure.

pub(crate) mod align;
pub(crate) mod associate;
pub(crate) mod ate;
pub mod chi2;
mod evaluation;
pub(crate) mod nees;
pub(crate) mod rpe;
pub(crate) mod stats;

pub use align::{Alignment, align, apply, heading_onto};
pub use associate::{Association, PosePairs, associate};
pub use ate::{Ate, ate};
pub use evaluation::{Evaluation, EvaluationSettings, Segment, evaluate};
pub use nees::{Nees, PoseCovariance, nees};
pub use rpe::{PairsFrom, Rpe, RpeSettings, Span, Tolerance, rpe};
pub use stats::Stats;
