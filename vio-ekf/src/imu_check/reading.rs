//! A way to read one sensor, and which of several the evidence asks for.

use std::fmt;

use nalgebra::Matrix3;

use crate::imu_check::signed_axes::{RADIANS_PER_DEGREE, axis_names};

/// A reading is wrong if another one leaves less than this share of what it leaves.
const CLEARER: f64 = 0.7;
/// With fewer windows, or pairs, than this chance plays a part, and it must be less than this share.
const FEW: (usize, f64) = (15, 0.4);
/// Readings that leave no more than this many times the least are equally good; of these the one with the fewest changes counts.
const EQUAL: f64 = 1.3;

/// How one sensor has to be read: signed axes, and their unit.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AxesReading {
    /// What is right, from what is given: a signed permutation of the axes.
    pub axes: Matrix3<f64>,
    /// Whether rates are given in degrees per second.
    pub in_degrees: bool,
    /// What is left unexplained as it is given, and with this reading: mean squares of unequal meaning, of which only the ratio counts.
    pub unexplained: [f64; 2],
}

impl fmt::Display for AxesReading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&axis_names(&self.axes))?;
        if self.in_degrees { f.write_str(" in degrees per second") } else { Ok(()) }
    }
}

impl AxesReading {
    pub(super) fn new(axes: Matrix3<f64>, in_degrees: bool) -> Self {
        Self { axes, in_degrees, unexplained: [0.0; 2] }
    }

    pub(super) fn factor(&self) -> f64 {
        if self.in_degrees { RADIANS_PER_DEGREE } else { 1.0 }
    }

    /// Axes that are not where they were, signs that are turned, another unit.
    fn changes(&self) -> usize {
        let moved = (0..3).filter(|&i| self.axes[(i, i)] == 0.0).count();
        let negative = self.axes.iter().filter(|v| **v < 0.0).count();
        // All three negated are one mistake.
        moved + if negative == 3 { 1 } else { negative } + usize::from(self.in_degrees)
    }
}

/// The best reading if it is clearly better than the one given, and how many changes are the fewest among the equally good.
pub(super) fn clearly_better(readings: &[AxesReading], left: &[Vec<f64>]) -> Option<AxesReading> {
    let evidence = left.first()?.len();
    let left: Vec<f64> = left.iter().map(|left| trimmed_mean(left)).collect();
    let given = *left.first()?;
    let least = left.iter().copied().fold(f64::INFINITY, f64::min);
    let clearer = if evidence < FEW.0 { FEW.1 } else { CLEARER };
    // Nothing left by any reading, or by none a number: no evidence.
    if !(given > 0.0 && least.is_finite() && least <= clearer * given) {
        return None;
    }
    let equal = readings.iter().zip(&left).filter(|(_, left)| **left <= EQUAL * least);
    let (best, &left) = equal.min_by(|a, b| a.0.changes().cmp(&b.0.changes()).then(a.1.total_cmp(b.1)))?;
    Some(AxesReading { unexplained: [given, left], ..*best })
}

/// Mean without the largest tenth: images in which a track has slipped.
fn trimmed_mean(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let kept = &sorted[..sorted.len() - sorted.len() / 10];
    kept.iter().sum::<f64>() / kept.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::imu_check::signed_axes::signed_permutations;

    #[test]
    fn without_evidence_nothing_is_said() {
        let readings: Vec<AxesReading> = signed_permutations().map(|axes| AxesReading::new(axes, false)).collect();
        let left = |given: f64, others: f64| -> Vec<Vec<f64>> {
            (0..readings.len()).map(|k| vec![if k == 0 { given } else { others }; 20]).collect()
        };
        for (given, others) in
            [(0.0, 0.0), (f64::INFINITY, f64::INFINITY), (f64::NAN, f64::NAN), (0.0, 1.0), (1.0, 1.0)]
        {
            assert_eq!(clearly_better(&readings, &left(given, others)), None, "{given} {others}");
        }
        assert_eq!(clearly_better(&readings, &[]), None);
        let found = clearly_better(&readings, &left(1.0, 0.125)).unwrap();
        assert_eq!(found.unexplained, [1.0, 0.125]);
    }
}
