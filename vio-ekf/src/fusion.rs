//! Fusion of inertial sensors and of poses that others have measured: loosely coupled, with the odometry in one estimator, and in a
//! stored map.

mod contradiction;
mod fault_isolation;
mod filter_state;
mod imu_pair;
mod inertial_check;
mod map_aided;
mod map_pose;
mod pose_fusion;
mod pose_measurement;
mod pose_model;
#[cfg(test)]
mod pose_model_tests;
mod settings;
mod state_buffer;
mod unified;

pub use imu_pair::{ImuPair, ImuPairSettings};
pub use map_aided::{AidedPose, MapAidedSettings, MapAidedVio};
pub use pose_fusion::{PoseFusion, SourceEstimate};
pub use pose_measurement::PoseMeasurement;
pub use settings::{AlignmentSettings, ExtrinsicsSettings, FusionSettings, PoseSource};
pub use unified::{MeasurementCounts, UnifiedSettings, UnifiedVio};
