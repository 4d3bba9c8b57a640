//! A measured inverse distance: of a landmark by stereo, or of the shared depth prior by a new landmark.

use nalgebra::{Matrix1, Vector1};

use super::measurement::{Measurement, Trial};
use crate::inertial::iterated_update::Linearization;

/// An inverse distance and its variance.
#[derive(Debug, Clone, Copy)]
pub(crate) struct InverseDistanceMeasurement {
    pub(crate) row: usize,
    /// The value in the state, 1/m.
    pub(crate) predicted: f64,
    pub(crate) measured: f64,
    pub(crate) variance: f64,
    pub(crate) gate: f64,
}

impl Measurement<1, 1> for InverseDistanceMeasurement {
    fn rows(&self) -> [usize; 1] {
        [self.row]
    }

    fn linearize(&self, trial: &Trial<'_, 1>) -> Option<Linearization<1, 1>> {
        Some(Linearization {
            residual: Vector1::new(self.measured - self.predicted - trial.delta[0]),
            jacobian: Matrix1::new(1.0),
            noise: Matrix1::new(self.variance),
        })
    }

    fn gate(&self) -> f64 {
        self.gate
    }
}
