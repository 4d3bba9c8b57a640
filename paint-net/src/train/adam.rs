//! Adam, and the clipping of gradients.

/// Adam (Kingma and Ba 2015) with its published constants.
#[derive(Debug, Clone)]
pub(crate) struct Adam {
    mean: Vec<f32>,
    square: Vec<f32>,
    updates: usize,
}

const MEAN_DECAY: f64 = 0.9;
const SQUARE_DECAY: f64 = 0.999;

impl Adam {
    pub(crate) fn new(parameters: usize) -> Self {
        Self { mean: vec![0.0; parameters], square: vec![0.0; parameters], updates: 0 }
    }

    /// Goes on from means, squares and the number of updates.
    pub(crate) fn from_state(mean: Vec<f32>, square: Vec<f32>, updates: usize) -> Self {
        Self { mean, square, updates }
    }

    pub(crate) fn state(&self) -> (&[f32], &[f32], usize) {
        (&self.mean, &self.square, self.updates)
    }

    pub(crate) fn step(&mut self, parameters: &mut [f32], gradient: &[f32], rate: f64) {
        self.updates += 1;
        // Long before the count leaves this range, its powers are zero.
        let count = self.updates.min(1_000_000) as i32;
        let mean_gain = 1.0 / (1.0 - MEAN_DECAY.powi(count));
        let square_gain = 1.0 / (1.0 - SQUARE_DECAY.powi(count));
        for (((p, &g), m), s) in parameters.iter_mut().zip(gradient).zip(&mut self.mean).zip(&mut self.square) {
            let g = f64::from(g);
            *m = (MEAN_DECAY * f64::from(*m) + (1.0 - MEAN_DECAY) * g) as f32;
            *s = (SQUARE_DECAY * f64::from(*s) + (1.0 - SQUARE_DECAY) * g * g) as f32;
            let step = f64::from(*m) * mean_gain / ((f64::from(*s) * square_gain).sqrt() + 1e-8);
            *p = (f64::from(*p) - rate * step) as f32;
        }
    }
}

/// Clips a gradient to the largest norm allowed; false if it is no number, which teaches nothing.
pub(super) fn clip_norm(gradient: &mut [f32], max_norm: f64) -> bool {
    let length = gradient.iter().map(|&g| f64::from(g).powi(2)).sum::<f64>().sqrt();
    let factor = (max_norm / length.max(1e-12)).min(1.0) as f32;
    for g in gradient {
        *g *= factor;
    }
    length.is_finite()
}
