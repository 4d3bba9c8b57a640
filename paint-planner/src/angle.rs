//! Angles on the circle.

use std::f64::consts::{PI, TAU};

/// Wraps an angle into (-pi, pi].
pub(crate) fn wrap(angle: f64) -> f64 {
    let turned = angle - TAU * (angle / TAU).round();
    if turned <= -PI { turned + TAU } else { turned }
}

/// The representative of `angle` nearest to `reference`.
pub(crate) fn nearest_equivalent(angle: f64, reference: f64) -> f64 {
    reference + wrap(angle - reference)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrapping_keeps_the_half_open_interval() {
        assert_eq!(wrap(-PI), PI);
        assert_eq!(wrap(PI), PI);
        assert!((wrap(5.0 * PI + 0.25) - (0.25 - PI)).abs() < 1e-12);
        assert!((nearest_equivalent(-3.0, 3.0) - (TAU - 3.0)).abs() < 1e-12);
    }
}
