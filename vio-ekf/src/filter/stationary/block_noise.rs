//! White noise of the inertial sensor of a body at rest.

use nalgebra::Vector3;

/// Noise from how the mean readings of blocks of samples differ from one block to the next. A density `d` (per √Hz) gives a block of `T`
/// seconds a variance of `d² / T`, and a difference of two twice that. Vibration, which a mean takes out, counts for what is left of it.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct BlockNoise {
    before: Option<[Vector3<f64>; 2]>,
    /// Sum of squared differences times the length of a block, by sensor.
    squares: [f64; 2],
    count: u32,
}

impl BlockNoise {
    /// Takes the mean rate and force of a block of so many seconds.
    pub(crate) fn add(&mut self, means: [Vector3<f64>; 2], duration: f64) {
        if let Some(before) = self.before.replace(means) {
            for ((square, mean), before) in self.squares.iter_mut().zip(means).zip(before) {
                *square += duration * (mean - before).norm_squared();
            }
            self.count += 1;
        }
    }

    /// Densities of gyroscope and accelerometer; zero before there are two blocks.
    pub(crate) fn densities(&self) -> [f64; 2] {
        // Two blocks, three axes.
        let differences = f64::from(6 * self.count.max(1));
        self.squares.map(|square| (square / differences).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::Rng;

    /// Blocks of 20 samples at 200 Hz, of white noise of a density on a bias.
    #[test]
    fn it_is_the_density_of_the_noise() {
        let (mut rng, mut noise) = (Rng::new(3), BlockNoise::default());
        let (density, root_rate) = ([2e-3, 3e-2], 200.0_f64.sqrt());
        for _ in 0..500 {
            let mut mean = |k: usize| {
                let sum: Vector3<f64> = (0..20).map(|_| rng.normal_vector() * (density[k] * root_rate)).sum();
                sum / 20.0 + Vector3::new(0.1, -0.2, 9.81)
            };
            noise.add([mean(0), mean(1)], 0.1);
        }
        for (found, density) in noise.densities().into_iter().zip(density) {
            assert!((found / density - 1.0).abs() < 0.05, "{found} {density}");
        }
        assert_eq!(BlockNoise::default().densities(), [0.0; 2]);
    }
}
