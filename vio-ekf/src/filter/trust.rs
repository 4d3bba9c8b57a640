use crate::{Imu, ImuNoise};

/// How an inertial sensor may be worse than its data sheet.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct SensorSettings {
    /// The gyroscope reads no more than this on any axis, rad/s; 1000 degrees per second as the ADIS16448.
    pub gyro_range: f64,
    /// The accelerometer reads no more than this on any axis, m/s²; 18 g as the ADIS16448.
    pub accel_range: f64,
    /// Noise that the samples themselves show counts where it exceeds that of the data sheet by this factor; 4, ours. What
    /// shakes the sensor faster than it samples is noise.
    pub roughness: f64,
}

impl Default for SensorSettings {
    fn default() -> Self {
        Self { gyro_range: 17.45, accel_range: 176.5, roughness: 4.0 }
    }
}

/// What is beyond the range is taken to be anywhere within as much again, for as long as this, s: the time between two images.
const SATURATED_S: f64 = 0.05;
/// Share of the range from which on a reading is at its end.
const END: f64 = 0.99;
/// Weight of the latest sample in the mean of the roughness.
const LATEST: f64 = 1.0 / 32.0;

/// What the samples until one of them show about their own noise. It depends on them alone, not on when it is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Trust {
    /// Variance of a reading, mean over the axes of gyroscope and accelerometer.
    variance: [f64; 2],
    /// By axis.
    saturated: [[bool; 3]; 2],
}

impl Trust {
    /// After the next sample; `two` are those before it, the latest first.
    pub(crate) fn after(&self, two: [&Imu; 2], sample: &Imu, settings: &SensorSettings) -> Self {
        // The second difference of white noise has six times its variance; steady motion, and motion that changes steadily, has
        // none.
        let differences = [
            (sample.gyro - two[0].gyro * 2.0 + two[1].gyro).norm_squared() / 18.0,
            (sample.accel - two[0].accel * 2.0 + two[1].accel).norm_squared() / 18.0,
        ];
        let mut variance = self.variance;
        for (mean, latest) in variance.iter_mut().zip(differences) {
            *mean += LATEST * (latest - *mean);
        }
        let saturated = [(sample.gyro, settings.gyro_range), (sample.accel, settings.accel_range)]
            .map(|(reading, range)| std::array::from_fn(|axis| reading[axis].abs() >= END * range));
        Self { variance, saturated }
    }

    /// Densities of the white noise between two samples, `gap` seconds apart, by axis of gyroscope and accelerometer.
    pub(crate) fn densities(
        &self,
        before: &Self,
        noise: &ImuNoise,
        gap: f64,
        settings: &SensorSettings,
    ) -> [[f64; 3]; 2] {
        let density = |k: usize, sheet: f64, range: f64| {
            let shown = (self.variance[k].max(before.variance[k]) * gap).sqrt();
            let density = if shown > settings.roughness * sheet { shown } else { sheet };
            std::array::from_fn(|axis| {
                let saturated = self.saturated[k][axis] || before.saturated[k][axis];
                if saturated { range * SATURATED_S.sqrt() } else { density }
            })
        };
        [density(0, noise.gyro_density, settings.gyro_range), density(1, noise.accel_density, settings.accel_range)]
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::Stamp;

    const SHEET: ImuNoise = ImuNoise { gyro_density: 2e-4, accel_density: 2e-3, ..ImuNoise::ZERO };

    /// Densities after two seconds at 200 Hz of a motion that changes steadily, with readings added to the accelerometer's.
    fn shown(add: impl Fn(usize) -> f64, settings: &SensorSettings) -> [[f64; 3]; 2] {
        let sample = |k: usize| {
            let t = k as f64 * 0.005;
            let gyro = Vector3::new(0.3, 1.2, -0.5) * t;
            let accel = Vector3::new(1.0, 2.0, 9.81) + Vector3::repeat(add(k));
            Imu { stamp: Stamp::from_nanos(k as i64 * 5_000_000), gyro, accel }
        };
        let trusts = (2..400).scan(Trust::default(), |trust, k| {
            *trust = trust.after([&sample(k - 1), &sample(k - 2)], &sample(k), settings);
            Some(*trust)
        });
        let trusts: Vec<Trust> = trusts.collect();
        trusts[397].densities(&trusts[396], &SHEET, 0.005, settings)
    }

    #[test]
    fn steady_motion_shows_no_noise() {
        assert_eq!(shown(|_| 0.0, &SensorSettings::default()), [[2e-4; 3], [2e-3; 3]]);
    }

    #[test]
    fn white_noise_shows_its_own_variance() {
        // Evenly spread over ±1: a variance of a third, a density of √(0.005 / 3).
        let noise = |k: usize| {
            let z = (k as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            ((z ^ (z >> 27)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        let [gyro, accel] = shown(noise, &SensorSettings::default());
        assert_eq!(gyro, [2e-4; 3]);
        let expected = (0.005_f64 / 3.0).sqrt();
        assert!((accel[0] / expected - 1.0).abs() < 0.3, "{} {expected}", accel[0]);
    }

    #[test]
    fn the_axis_at_its_end_is_not_believed() {
        let settings = SensorSettings { gyro_range: 2.0, ..SensorSettings::default() };
        let [gyro, accel] = shown(|_| 0.0, &settings);
        // Only the second axis reads more than 2 rad/s, at the end.
        assert_eq!(gyro, [2e-4, 2.0 * SATURATED_S.sqrt(), 2e-4]);
        assert_eq!(accel, [2e-3; 3]);
    }
}
