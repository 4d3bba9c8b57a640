//! The spread of residuals, from a histogram: the same whatever the order in which they come.

const BINS: usize = 512;
/// `1 / Φ⁻¹(3/4)`: the median of absolute deviations times this is the standard deviation of a normal distribution.
const FROM_MEDIAN: f64 = 1.482_602_218_505_602;

/// Counts of absolute residuals.
#[derive(Clone, Debug)]
pub(crate) struct ResidualHistogram {
    counts: Vec<u32>,
    /// Width of a bin.
    bin: f32,
    pub(crate) total: u32,
}

impl ResidualHistogram {
    /// For residuals up to `most`; larger ones count in the last bin.
    pub(crate) fn new(most: f32) -> Self {
        Self { counts: vec![0; BINS], bin: most / BINS as f32, total: 0 }
    }

    #[inline(always)]
    pub(crate) fn add(&mut self, residual: f32) {
        let bin = (residual.abs() / self.bin) as usize;
        self.counts[bin.min(BINS - 1)] += 1;
        self.total += 1;
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        self.counts.iter_mut().zip(&other.counts).for_each(|(a, b)| *a += b);
        self.total += other.total;
    }

    /// Standard deviation by the median; 0 of nothing.
    pub(crate) fn deviation(&self) -> f64 {
        let mut below = 0;
        for (bin, &count) in self.counts.iter().enumerate() {
            if 2 * (below + count) >= self.total && count > 0 {
                let inside = (0.5 * f64::from(self.total) - f64::from(below)) / f64::from(count);
                return FROM_MEDIAN * f64::from(self.bin) * (bin as f64 + inside);
            }
            below += count;
        }
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_of_a_ramp_is_its_middle() {
        let mut histogram = ResidualHistogram::new(8.0);
        (0..1000).for_each(|k| histogram.add(if k % 2 == 0 { 1.0 } else { -1.0 } * k as f32 / 250.0));
        assert!((histogram.deviation() - 2.0 * FROM_MEDIAN).abs() < 0.02, "{}", histogram.deviation());
    }
}
