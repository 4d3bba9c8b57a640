//! PAINT: one spray, a round Gaussian of free position, spread and volume, and its adjoint.

use super::architecture::Architecture;
use super::nonlinearities::{sigmoid, softplus};
use crate::network::Real;

/// A spray, before the gate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SprayParameters<T> {
    pub(crate) x: T,
    pub(crate) y: T,
    pub(crate) sigma: T,
    pub(crate) volume: T,
}

impl<T: Real> SprayParameters<T> {
    /// From PAINT's four raw outputs: position, each from -1 to 1 over the picture, spread, volume. The thesis does
    /// not print these links; ours keep σ within a factor of three, and volumes above zero.
    pub(crate) fn new(architecture: &Architecture, raw: &[T]) -> Self {
        let (half, one) = (T::of(0.5 * (architecture.side + 1) as f64), T::of(1.0));
        Self {
            x: half * (raw[0] + one) - one,
            y: half * (raw[1] + one) - one,
            sigma: T::of(0.5 * architecture.radius) * (T::of(0.5) + sigmoid(raw[2])),
            volume: softplus(raw[3]),
        }
    }

    #[cfg(any(test, feature = "train"))]
    /// From derivatives by place, spread and volume to those by the raw outputs.
    pub(crate) fn backward(architecture: &Architecture, raw: &[T], [x, y, sigma, volume]: [T; 4], d_raw: &mut [T]) {
        let half = T::of(0.5 * (architecture.side + 1) as f64);
        let s = sigmoid(raw[2]);
        d_raw[0] = half * x;
        d_raw[1] = half * y;
        d_raw[2] = T::of(0.5 * architecture.radius) * s * (T::of(1.0) - s) * sigma;
        d_raw[3] = sigmoid(raw[3]) * volume;
    }
}

/// Profiles of a spray along both axes.
#[derive(Debug, Clone)]
pub(crate) struct SprayStamp<T> {
    across: Vec<T>,
    down: Vec<T>,
}

impl<T: Real> SprayStamp<T> {
    pub(crate) fn new(architecture: &Architecture) -> Self {
        Self { across: vec![T::default(); architecture.side], down: vec![T::default(); architecture.side] }
    }

    fn fill(&mut self, spray: &SprayParameters<T>) {
        let steepness = T::of(-0.5) / (spray.sigma * spray.sigma);
        for (profile, centre) in [(&mut self.across, spray.x), (&mut self.down, spray.y)] {
            for (i, g) in profile.iter_mut().enumerate() {
                let d = T::of(i as f64) - centre;
                *g = (steepness * d * d).exp();
            }
        }
    }

    /// Adds `v exp(-|p - μ|² / 2σ²)` to the depths.
    pub(crate) fn add(&mut self, spray: &SprayParameters<T>, volume: T, depth: &mut [T]) {
        self.fill(spray);
        for (row, &g) in depth.chunks_exact_mut(self.across.len()).zip(&self.down) {
            let share = volume * g;
            for (c, &g) in row.iter_mut().zip(&self.across) {
                *c += share * g;
            }
        }
    }

    #[cfg(any(test, feature = "train"))]
    /// From the derivative by the depths to those by place, spread and volume.
    pub(crate) fn backward(&mut self, spray: &SprayParameters<T>, volume: T, d_depth: &[T]) -> [T; 4] {
        self.fill(spray);
        // Moments of a row around the spray's column: first all lanes of a row, then their sum.
        let (mut zeroth, mut first, mut second) = (T::default(), T::default(), T::default());
        let (mut down_first, mut down_second) = (T::default(), T::default());
        for (i, (row, &g)) in d_depth.chunks_exact(self.across.len()).zip(&self.down).enumerate() {
            let [m0, m1, m2] = moments(row, &self.across, spray.x);
            let d = T::of(i as f64) - spray.y;
            zeroth += g * m0;
            first += g * m1;
            second += g * m2;
            down_first += g * m0 * d;
            down_second += g * m0 * d * d;
        }
        let per_area = volume / (spray.sigma * spray.sigma);
        [per_area * first, per_area * down_first, per_area / spray.sigma * (second + down_second), zeroth]
    }
}

#[cfg(any(test, feature = "train"))]
/// Sums of `row · profile · dᵏ`, `d` the distance from the centre, in eight lanes.
fn moments<T: Real>(row: &[T], profile: &[T], centre: T) -> [T; 3] {
    let mut lanes = [[T::default(); 8]; 3];
    for (k, (r, g)) in row.chunks(8).zip(profile.chunks(8)).enumerate() {
        let start = T::of(8.0 * k as f64) - centre;
        for (j, (&r, &g)) in r.iter().zip(g).enumerate() {
            let d = start + T::of(j as f64);
            let weight = r * g;
            lanes[0][j] += weight;
            lanes[1][j] += weight * d;
            lanes[2][j] += weight * d * d;
        }
    }
    lanes.map(|lanes| {
        let mut sum = T::default();
        for lane in lanes {
            sum += lane;
        }
        sum
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_spray_has_the_derivatives_of_the_reference() {
        // Mean squared error of tanh against ½ on 4 x 3 pixels; figures from an outside program.
        let spray = SprayParameters { x: 1.25, y: 0.5, sigma: 1.5, volume: 0.8 };
        let mut stamp = SprayStamp { across: vec![0.0; 4], down: vec![0.0; 3] };
        let mut depth = [0.0; 12];
        stamp.add(&spray, spray.volume, &mut depth);
        let loss: f64 = depth.iter().map(|c: &f64| (c.tanh() - 0.5).powi(2) / 12.0).sum();
        let slope = depth.map(|c: f64| 2.0 * (c.tanh() - 0.5) * (1.0 - c.tanh().powi(2)) / 12.0);
        let [x, y, sigma, volume] = stamp.backward(&spray, spray.volume, &slope);
        for (value, expected) in [
            (loss, 0.0161719841564),
            (x, -0.0133571458169),
            (y, -0.0186052217846),
            (sigma, -0.0433283841556),
            (volume, -0.0152426822073),
        ] {
            assert!((value - expected).abs() < 1e-12, "{value} is not {expected}");
        }
    }
}
