//! Pose graphs on SE(3): poses, measured motions between them, and the poses that fit them best (thesis Paper I, section 4.6).

pub(crate) mod block_cholesky;
pub(crate) mod chordal;
pub(crate) mod factors;
pub(crate) mod g2o;
pub(crate) mod graph;
pub(crate) mod levenberg_marquardt;
pub(crate) mod normal_equations;
pub(crate) mod robust_kernel;
pub(crate) mod se3;

pub use factors::{BetweenFactor, PriorFactor};
pub use graph::PoseGraph;
pub use levenberg_marquardt::{PoseGraphReport, PoseGraphSettings};
pub use robust_kernel::RobustKernel;
