//! What the filter's states mean to who runs it.

use vio_ekf::{Excess, Status, Waiting};

/// Why the filter gave up.
pub(super) fn divergence_text(excess: Excess) -> String {
    match excess {
        Excess::Speed => "the speed ran away",
        Excess::Bias => "a bias grew beyond what a sensor has",
        Excess::Uncertainty => "nothing was seen for too long",
        Excess::Contradiction => {
            "images and inertial samples contradict each other: check axes, calibration and clocks of both"
        }
    }
    .into()
}

/// Why it has not started.
pub(super) fn initialization_text(status: Status) -> String {
    match status {
        Status::Uninitialised(Waiting::ForSteadiness) => {
            "there was no second of rest to start from, and no motion that tells the scale"
        }
        Status::Uninitialised(Waiting::ForStillImages) => "the images show nothing to hold on to, or move at rest",
        Status::Uninitialised(Waiting::ForGravity) => {
            "gravity test: at rest the accelerometer does not read gravity; check its axes, unit and calibration"
        }
        Status::Tracking | Status::Diverged(_) => "no image came after the start",
    }
    .into()
}
