//! Whether what the gyroscope reads is in proportion to how far the images turn.

use nalgebra::{Matrix3, Vector3};

/// Corrections are summed over so many seconds of motion before they are compared with the rotation: an image corrects a part of the error
/// only, and those after it the rest.
const WINDOW_S: f64 = 2.0;
/// Scales of the axes less one are expected to be of this size.
const PRIOR: f64 = 0.02;
/// The statistic from which on the scales are doubted: sound sensors are below a tenth of it.
const CONTRADICTION: f64 = 40.0;
/// So many deviations must an axis be off, and so much.
const CERTAIN: f64 = 2.0;
const SMALLEST: f64 = 0.002;

/// Sums over the corrections of the attitude by images.
///
/// Scales `1 + ε` of the axes turn the attitude by `U ε` too far between two images, `U = R diag(θ)` with the rotation `θ` (rad, body axes)
/// and the attitude `R` at the first. An image corrects the attitude by `δ` (rad, world axes), whose covariance is `G = P⁻ − P⁺` if all is as modelled: then `s = −Σ Uᵀ G⁻¹ δ` has the mean
/// zero and the covariance `Σ Uᵀ G⁻¹ U` (a score test, Rao 1948). How large `ε` is follows from the sums of windows, in which
/// `Σ δ = −Σ U ε` up to what the last images have not yet corrected.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct GyroscopeScale {
    score: Vector3<f64>,
    variance: Matrix3<f64>,
    window: Window,
    windows: usize,
    /// `Σ Uᵀ U`, `−Σ Uᵀ δ` and `Σ δᵀ δ` over windows.
    normal: Matrix3<f64>,
    moment: Vector3<f64>,
    squares: f64,
}

#[derive(Debug, Clone, Copy, Default)]
struct Window {
    corrected: Vector3<f64>,
    turned: Matrix3<f64>,
    duration: f64,
}

/// What the corrections say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ScaleEstimate {
    /// Scales of the gyroscope's axes less one, and their standard deviations.
    pub(crate) error: Vector3<f64>,
    pub(crate) sigma: Vector3<f64>,
    /// Chi-squared with three degrees of freedom where the scales are one.
    pub(crate) statistic: f64,
}

impl ScaleEstimate {
    /// Whether the scales are not one, by an error that matters.
    pub(crate) fn is_contradicted(&self) -> bool {
        let certain = (0..3).any(|k| self.error[k].abs() > (CERTAIN * self.sigma[k]).max(SMALLEST));
        self.statistic > CONTRADICTION && certain
    }
}

impl GyroscopeScale {
    /// Takes a correction of the attitude with its covariance, and `U` over so many seconds.
    pub(crate) fn add(
        &mut self,
        (correction, gain): &(Vector3<f64>, Matrix3<f64>),
        (turned, duration): (&Matrix3<f64>, f64),
    ) {
        let Some(gain) = gain.cholesky() else { return };
        self.score -= turned.transpose() * gain.solve(correction);
        self.variance += turned.transpose() * gain.solve(turned);
        self.window.corrected += correction;
        self.window.turned += turned;
        self.window.duration += duration;
        if self.window.duration >= WINDOW_S {
            let Window { corrected, turned, .. } = std::mem::take(&mut self.window);
            self.windows += 1;
            self.normal += turned.transpose() * turned;
            self.moment -= turned.transpose() * corrected;
            self.squares += corrected.norm_squared();
        }
    }

    /// `None` where too little has been seen.
    pub(crate) fn estimate(&self) -> Option<ScaleEstimate> {
        let statistic = self.score.dot(&self.variance.cholesky()?.solve(&self.score));
        let freedom = (3 * self.windows).checked_sub(3).filter(|freedom| *freedom > 0)? as f64;
        let free = self.normal.cholesky()?.solve(&self.moment);
        let residual = ((self.squares - free.dot(&self.moment)) / freedom).max(1e-12);
        let information = self.normal / residual + Matrix3::identity() * PRIOR.powi(-2);
        let covariance = information.try_inverse()?;
        let error = covariance * self.moment / residual;
        Some(ScaleEstimate { error, sigma: covariance.diagonal().map(f64::sqrt), statistic })
    }
}
