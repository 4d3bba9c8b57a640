//! Inverse distances that stay positive.

/// An inverse distance `ρ`, 1/m, that stays positive.
///
/// Pixels are linear in `ρ` where the camera moves little, so a correction `δ` that brings a point nearer is added. One that takes it
/// away is `ρ exp(δ/ρ)`: what seems not to move at all may be far away, or the camera stands where it was thought to move, and
/// no number of such images may decide for the former. Both agree to first order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct InverseDistance {
    /// `ρ`, 1/m.
    pub(crate) value: f64,
    /// Its value when its row of the covariance was last rescaled.
    reference: f64,
}

impl InverseDistance {
    pub(crate) fn new(value: f64) -> Self {
        Self { value, reference: value }
    }

    /// `ρ ← ρ ⊞ δ`.
    pub(crate) fn correct(&mut self, delta: f64) {
        self.value = if delta < 0.0 { self.value * (delta / self.value).exp() } else { self.value + delta };
    }

    /// The factor by which the errors have shrunk with the value since this was last called: errors of what is far away are relative
    /// to it, as `d(ρ ⊞ δ)/dδ` says.
    pub(crate) fn take_scale_factor(&mut self) -> f64 {
        let factor = (self.value / self.reference).min(1.0);
        self.reference = self.value;
        factor
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_a_sum_to_first_order_and_stays_positive() {
        let moved = |delta: f64| {
            let mut distance = InverseDistance::new(0.3);
            distance.correct(delta);
            distance
        };
        for delta in [1e-4, -1e-4] {
            assert!((moved(delta).value - (0.3 + delta)).abs() < 2.0 * delta * delta);
        }
        assert_eq!(moved(0.6).value, 0.3 + 0.6);
        assert!(moved(-30.0).value > 0.0);
        // The derivative by the step, at the step.
        let h = 1e-6;
        for delta in [-0.5, -0.1] {
            let slope = (moved(delta + h).value - moved(delta - h).value) / (2.0 * h);
            assert!((moved(delta).take_scale_factor() - slope).abs() < 1e-6);
        }
        assert_eq!(moved(0.6).take_scale_factor(), 1.0);
    }
}
