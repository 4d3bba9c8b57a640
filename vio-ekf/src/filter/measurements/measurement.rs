//! The measurement model that all sensors share.

use nalgebra::{SVector, Vector3};

use crate::eval::chi2;
use crate::filter::state::vio_state::VioState;
use crate::inertial::core_state::CoreState;
use crate::inertial::error_state::CORE;
use crate::inertial::iterated_update::Linearization;

/// A measurement `z = h(x) + n` of `M` values that depends on `C` rows of the error state: what a sensor must be able to say to
/// update the filter through [`Vio::update`](crate::Vio::update). Patches, pixels, stereo depths, poses and the stationary body
/// are implementations.
///
/// Rows are numbered as in [`error_state`](crate::filter::error_state). Angles of the attitude are on the world's side,
/// `R_true = Exp(δθ) R`, and the velocity is in body axes.
///
/// A barometer that reads the height of the body, with standard deviation `sigma`:
///
/// ```
/// use vio_ekf::nalgebra::{Matrix1, Vector1};
/// use vio_ekf::filter::{error_state, Measurement, Trial};
/// use vio_ekf::inertial::Linearization;
///
/// struct Height {
///     height: f64,
///     sigma: f64,
/// }
///
/// impl Measurement<1, 1> for Height {
///     fn rows(&self) -> [usize; 1] {
///         [error_state::POSITION + 2]
///     }
///
///     fn linearize(&self, trial: &Trial<'_, 1>) -> Option<Linearization<1, 1>> {
///         Some(Linearization {
///             residual: Vector1::new(self.height - trial.core().position.z),
///             jacobian: Matrix1::new(1.0),
///             noise: Matrix1::new(self.sigma * self.sigma),
///         })
///     }
/// }
/// ```
pub trait Measurement<const M: usize, const C: usize> {
    /// The rows of the error state that the measurement depends on, each below the number of rows and named once.
    fn rows(&self) -> [usize; C];

    /// Residual `z − h(x ⊞ δ)`, derivative of `h` by the rows at `x ⊞ δ`, and covariance of the noise. `None` if the
    /// measurement cannot be had from there; it is then refused.
    fn linearize(&self, trial: &Trial<'_, C>) -> Option<Linearization<M, C>>;

    /// Largest number of linearisations: 1, the default, is the extended Kalman filter, more iterate its update (Bell and Cathey
    /// 1993), for an `h` that is not nearly linear over the prior's deviation.
    fn max_iterations(&self) -> usize {
        1
    }

    /// The gate: a measurement whose squared Mahalanobis distance is larger is refused; 99.9 % of chi-square with `M` degrees of
    /// freedom.
    fn gate(&self) -> f64 {
        chi2::quantile(0.999, M).unwrap_or(f64::INFINITY)
    }

    /// What errors call it.
    fn name(&self) -> &'static str {
        "measurement"
    }
}

/// Where a measurement is linearised: a state and a trial step `δ` of the measurement's rows.
#[derive(Debug, Clone, Copy)]
pub struct Trial<'a, const C: usize> {
    pub(crate) state: &'a VioState,
    pub(crate) rate_in_body: &'a Vector3<f64>,
    pub(crate) rows: &'a [usize; C],
    pub(crate) delta: &'a SVector<f64, C>,
}

impl<const C: usize> Trial<'_, C> {
    /// The step `δ`, in the order of the measurement's rows.
    pub fn delta(&self) -> &SVector<f64, C> {
        self.delta
    }

    /// The state before the step.
    pub fn state(&self) -> &VioState {
        self.state
    }

    /// Pose, velocity and biases after the step.
    pub fn core(&self) -> CoreState {
        let core = self.state.core();
        // Without a step the state stays as it is to the last bit: renormalising the attitude could change it.
        if self.delta.iter().all(|d| *d == 0.0) {
            return *core;
        }
        let mut delta = [0.0; CORE];
        for (row, d) in self.rows.iter().zip(self.delta) {
            if let Some(entry) = delta.get_mut(*row) {
                *entry = *d;
            }
        }
        core.corrected(&delta)
    }

    /// Angular rate of the body at the time of the measurement, rad/s: what the gyroscope read, less its estimated bias.
    pub fn rate_in_body(&self) -> &Vector3<f64> {
        self.rate_in_body
    }
}
