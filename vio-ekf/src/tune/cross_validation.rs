//! What a search is worth on recordings that it has not seen.

use super::{NoisePoint, Score, cost};

/// Cost of a point that is far from the data sheet: `weight` times the squared powers of ten. Without it a search follows what is
/// particular to a few recordings wherever it leads.
pub fn penalty(point: &NoisePoint, weight: f64) -> f64 {
    weight * point.iter().map(|power| power * power).sum::<f64>()
}

/// Costs of recordings that were left out of a search, mean over all.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldOut {
    /// With the noise of the data sheet.
    pub data_sheet: f64,
    /// With the noise that is best for the others.
    pub tuned: f64,
    /// The part of position errors alone in the first: what counts where the covariance is not used.
    pub data_sheet_position: f64,
    /// And in the second.
    pub tuned_position: f64,
}

impl HeldOut {
    /// Whether the noise that was found is worth more than the data sheet on what it has not seen, and positions are no worse: accuracy is not
    /// sold for consistency.
    pub fn is_gain(&self) -> bool {
        self.tuned < self.data_sheet && self.tuned_position <= self.data_sheet_position
    }

    /// Leave-one-out cross-validation (Stone 1974) over points that were tried: each recording in turn is judged with the point that
    /// costs least on the others, penalty included. `None` with fewer than two recordings, or if the data sheet, the point of zeros,
    /// was not tried.
    ///
    /// All points must have the scores of the same recordings.
    pub fn of(trials: &[(NoisePoint, Vec<Score>)], consistency_weight: f64, regularization: f64) -> Option<Self> {
        let (_, data_sheet) = trials.iter().find(|(point, _)| point.iter().all(|power| *power == 0.0))?;
        let count = data_sheet.len();
        if count < 2 || trials.iter().any(|(_, scores)| scores.len() != count) {
            return None;
        }
        let alone = |scores: &[Score], k: usize| cost(&scores[k..=k], consistency_weight);
        let position = |scores: &[Score], k: usize| cost(&scores[k..=k], 0.0);
        let mut sums = [0.0; 4];
        for k in 0..count {
            let of_others = |(point, scores): &&(NoisePoint, Vec<Score>)| {
                let sum: f64 = (0..count).filter(|other| *other != k).map(|other| alone(scores, other)).sum();
                sum / (count - 1) as f64 + penalty(point, regularization)
            };
            let best = trials.iter().min_by(|a, b| of_others(a).total_cmp(&of_others(b)))?;
            sums[0] += alone(data_sheet, k);
            sums[1] += alone(&best.1, k);
            sums[2] += position(data_sheet, k);
            sums[3] += position(&best.1, k);
        }
        let [data_sheet, tuned, data_sheet_position, tuned_position] = sums.map(|sum| sum / count as f64);
        Some(Self { data_sheet, tuned, data_sheet_position, tuned_position })
    }
}
