//! What the filter's states mean to who runs it.

use vio_ekf::{DivergenceCause, InitializationStatus, Status};

/// Why the filter gave up.
pub(super) fn divergence_text(excess: DivergenceCause) -> String {
    match excess {
        DivergenceCause::Speed => "the speed ran away",
        DivergenceCause::Bias => "a bias grew beyond what a sensor has",
        DivergenceCause::Uncertainty => "nothing was seen for too long",
        DivergenceCause::ConsecutiveOutliers => {
            "images and inertial samples contradict each other: check axes, calibration and clocks of both"
        }
    }
    .into()
}

/// Why it has not started.
pub(super) fn initialization_text(status: Status) -> String {
    match status {
        Status::Uninitialised(InitializationStatus::WaitingForSteadyImu) => {
            "there was no second of rest to start from, and no motion that tells the scale"
        }
        Status::Uninitialised(InitializationStatus::WaitingForStationaryImages) => {
            "the images move while the inertial sensor is at rest: check that both are of the same flight and clock"
        }
        Status::Uninitialised(InitializationStatus::WaitingForFeatures) => {
            "the images show nothing to track: they are dark, blurred or bare"
        }
        Status::Uninitialised(InitializationStatus::GravityMismatch) => {
            "gravity test: at rest the accelerometer does not read gravity; check its axes, unit and calibration"
        }
        Status::Tracking | Status::DeadReckoning | Status::Diverged(_) => "no image came after the start",
    }
    .into()
}
