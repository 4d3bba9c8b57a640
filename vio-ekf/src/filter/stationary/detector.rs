//! Detection of a stationary body by inertial samples and images.

use nalgebra::{Matrix2, Vector2, Vector3};

use super::block_noise::BlockNoise;
use super::parallax_check::{ParallaxCheck, ParallaxResult};
use crate::camera::model::CameraModel;
use crate::filter::frontend::corner_detector::DetectionCriteria;
use crate::filter::frontend::image_frontend::ImageFrontend;
use crate::filter::frontend::patch::Patch;
use crate::filter::point_observation::PointObservation;
use crate::filter::settings::{PatchSettings, StationarySettings};
use crate::samples::Imu;
use crate::stamp::Stamp;

/// Patches that are compared for parallax.
const MAX_PATCHES: usize = 8;
/// Fewer are replaced by new ones.
const MIN_PATCHES: usize = 5;
/// Samples are averaged over this before they are compared, s: the motors of a vehicle that stands shake it by several m/s²,
/// but do not move it.
const BLOCK_S: f64 = 0.1;

/// Mean readings over a part of a stationary period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StationaryMean {
    since: Stamp,
    count: u32,
    pub(crate) rate: Vector3<f64>,
    pub(crate) force: Vector3<f64>,
    /// Length, s.
    pub(crate) duration: f64,
    /// Density of the noise of the period so far, of gyroscope and accelerometer.
    pub(crate) noise: [f64; 2],
}

impl StationaryMean {
    fn new(sample: &Imu) -> Self {
        Self { since: sample.stamp, count: 1, rate: sample.gyro, force: sample.accel, duration: 0.0, noise: [0.0; 2] }
    }

    fn add(&mut self, sample: &Imu) {
        self.count += 1;
        self.duration = sample.stamp.secs_since(self.since);
        self.rate += (sample.gyro - self.rate) / f64::from(self.count);
        self.force += (sample.accel - self.force) / f64::from(self.count);
    }
}

/// Compares inertial samples and images with those at the beginning of the stationary period.
#[derive(Debug, Clone)]
pub(crate) struct StationaryDetector {
    settings: StationarySettings,
    /// The mean of the first block of this period, at the time of its first sample.
    reference: Option<Imu>,
    /// The block that is being averaged.
    block: Option<StationaryMean>,
    noise: BlockNoise,
    /// Means that have not been used yet. Each sample is used once.
    current: Option<StationaryMean>,
    /// Those of a part that has ended, until it is certain that nothing moved before its end.
    pending: Option<StationaryMean>,
    patches: Vec<(Vector2<f64>, Patch)>,
    /// The same for points of a caller's own.
    parallax_check: ParallaxCheck,
    images_stationary: bool,
    /// Parallax that is not told from noise, pixels.
    tolerance: f64,
}

impl StationaryDetector {
    pub(crate) fn new(settings: StationarySettings) -> Self {
        Self {
            settings,
            reference: None,
            block: None,
            noise: BlockNoise::default(),
            current: None,
            pending: None,
            patches: Vec::with_capacity(MAX_PATCHES),
            parallax_check: ParallaxCheck::new(),
            images_stationary: false,
            tolerance: settings.max_parallax_px,
        }
    }

    /// Takes a sample; a block that departs from the reference begins a new period.
    pub(crate) fn imu(&mut self, sample: &Imu) {
        let block = match &mut self.block {
            Some(block) => {
                block.add(sample);
                *block
            }
            None => *self.block.insert(StationaryMean::new(sample)),
        };
        if block.duration >= BLOCK_S {
            self.block = None;
            let same = |reference: &Imu| {
                (block.rate - reference.gyro).amax() <= self.settings.max_rate_change
                    && (block.force - reference.accel).amax() <= self.settings.max_force_change
            };
            if !self.reference.as_ref().is_some_and(same) {
                self.reference = Some(Imu { stamp: block.since, gyro: block.rate, accel: block.force });
                (self.current, self.pending) = (None, None);
                self.noise = BlockNoise::default();
                self.patches.clear();
                self.parallax_check.clear();
                self.images_stationary = false;
            }
            self.noise.add([block.rate, block.force], block.duration);
        }
        match &mut self.current {
            Some(current) => current.add(sample),
            None => self.current = Some(StationaryMean::new(sample)),
        }
    }

    /// Compares the current image with the first one of this period.
    pub(crate) fn image(&mut self, frontend: &mut ImageFrontend, settings: &PatchSettings) {
        let ImageFrontend { pyramid, detector, .. } = frontend;
        if self.patches.len() < MIN_PATCHES {
            self.patches.clear();
            self.images_stationary = false;
            let criteria = DetectionCriteria::from(settings);
            detector.detect(pyramid, &std::iter::empty(), &criteria);
            while self.patches.len() < MAX_PATCHES {
                let Some(found) = detector.take_best(pyramid, &criteria) else { break };
                self.patches.push(found);
            }
            return;
        }
        let unmoved = |(pixel, patch): &(Vector2<f64>, Patch)| {
            let comparison = patch.compare(pyramid, pixel, &Matrix2::identity())?;
            let shift = comparison.information.try_inverse()? * comparison.gradient;
            (shift.norm() < self.settings.max_parallax_px).then_some(())
        };
        let count = self.patches.iter().filter_map(unmoved).count();
        // A majority: some patches may lie on things that move by themselves.
        let stationary = 2 * count > self.patches.len();
        self.set_images(ParallaxResult { stationary, tolerance: self.settings.max_parallax_px });
    }

    /// Compares points, each with noise of `sigma` pixels, with those at the beginning of this period.
    pub(crate) fn points(&mut self, now: Stamp, points: &[PointObservation], sigma: f64) {
        match self.parallax_check.check(now, points, (sigma, self.settings.max_parallax_px)) {
            Some(result) => {
                self.set_images(result);
                // Slow motion takes its time to stand out from the noise.
                self.images_stationary &= self.parallax_check.age(now) >= self.settings.min_duration_s;
            }
            None => self.images_stationary = false,
        }
    }

    fn set_images(&mut self, ParallaxResult { stationary, tolerance }: ParallaxResult) {
        (self.images_stationary, self.tolerance) = (stationary, tolerance);
        if !stationary {
            // From here on something else is seen: the stationary period, if it is one, begins anew.
            self.reference = None;
        }
    }

    /// Standard deviation of a rotation that is not detected, rad.
    pub(crate) fn undetected_angle(&self, camera: &dyn CameraModel) -> f64 {
        0.5 * self.tolerance / camera.focal_length()
    }

    /// Whether nothing has moved for long enough.
    pub(crate) fn is_stationary(&self, now: Stamp) -> bool {
        self.images_stationary && self.is_imu_stationary(now)
    }

    /// Whether the inertial samples alone have been stationary for long enough.
    pub(crate) fn is_imu_stationary(&self, now: Stamp) -> bool {
        self.reference.is_some_and(|reference| now.secs_since(reference.stamp) >= self.settings.min_duration_s)
    }

    /// The means since they were last taken, over at least the duration of the settings.
    pub(crate) fn take_mean(&mut self) -> Option<StationaryMean> {
        let taken = self.current.take_if(|mean| mean.duration >= self.settings.min_duration_s)?;
        Some(StationaryMean { noise: self.noise.densities(), ..taken })
    }

    /// The same, of a time of which it is certain by now that nothing moved.
    pub(crate) fn take_certain_mean(&mut self, now: Stamp) -> Option<StationaryMean> {
        let until = |mean: &StationaryMean| mean.duration + self.settings.delay_s;
        let certain = self.pending.take_if(|mean| now.secs_since(mean.since) >= until(mean));
        if self.pending.is_none() {
            self.pending = self.take_mean();
        }
        certain
    }

    /// Mean specific force that has not been used yet.
    pub(crate) fn force(&self) -> Option<Vector3<f64>> {
        self.current.map(|mean| mean.force)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::ImageView;
    use crate::sim::camera_ahead;

    fn sample(milliseconds: i64, force: f64) -> Imu {
        let (gyro, accel) = (Vector3::zeros(), Vector3::new(0.0, 0.0, force));
        Imu { stamp: Stamp::from_nanos(1_000_000 * milliseconds), gyro, accel }
    }

    /// Whether a picture that stands at so many of its patches, and moved by two pixels everywhere else, is a standstill.
    fn stands(still: usize) -> bool {
        let (camera, settings) = (camera_ahead(), PatchSettings::default());
        let (width, height) = camera.image_size();
        // Squares of 16 pixels, each with a brightness of its own.
        let brightness = |x: usize, y: usize| {
            let square = (x / 16 + 100 * (y / 16)) as u32;
            40 + (square.wrapping_mul(2_654_435_761) >> 25) as u8
        };
        let picture = |value: &dyn Fn(usize, usize) -> u8| -> Vec<u8> {
            (0..width * height).map(|k| value(k % width, k / width)).collect()
        };
        let mut frontend = ImageFrontend::new(&camera, &settings);
        let mut detector = StationaryDetector::new(StationarySettings::default());
        let mut show = |detector: &mut StationaryDetector, data: &[u8]| {
            frontend.set_image(&ImageView { width, height, data });
            detector.image(&mut frontend, &settings);
        };
        (0..=40).for_each(|k| detector.imu(&sample(5 * k, 9.81)));
        show(&mut detector, &picture(&brightness));
        let places: Vec<Vector2<f64>> = detector.patches.iter().map(|(pixel, _)| *pixel).collect();
        assert_eq!(places.len(), MAX_PATCHES);
        (41..=300).for_each(|k| detector.imu(&sample(5 * k, 9.81)));
        let near = |x: usize, y: usize| {
            places[..still].iter().any(|place| (place - Vector2::new(x as f64, y as f64)).amax() < 14.0)
        };
        show(&mut detector, &picture(&|x, y| if near(x, y) { brightness(x, y) } else { brightness(x + 2, y + 2) }));
        detector.is_stationary(sample(1500, 9.81).stamp)
    }

    #[test]
    fn most_patches_must_stand() {
        let found = [0, 1, 3, 5, MAX_PATCHES].map(stands);
        assert_eq!(found, [false, false, false, true, true]);
    }

    /// A mean over a second counts half a second after its end, and not at all if something moved before that.
    #[test]
    fn what_was_measured_at_rest_is_certain_after_the_delay() {
        for moves_at in [1250, i64::MAX] {
            let mut detector = StationaryDetector::new(StationarySettings::default());
            let mut certain = None;
            for milliseconds in (0..2000).step_by(10) {
                let force = if milliseconds < moves_at { 9.81 } else { 12.0 };
                let sample = sample(milliseconds, force);
                detector.imu(&sample);
                if let Some(mean) = detector.take_certain_mean(sample.stamp) {
                    certain.get_or_insert((milliseconds, mean.duration, mean.force.z));
                }
            }
            if moves_at < 2000 {
                assert_eq!(certain, None);
                continue;
            }
            let (at, duration, force) = certain.unwrap();
            // The first tenth of a second is what the rest is compared with.
            assert!((1600..1630).contains(&at), "{at} ms");
            assert!((duration - 1.0).abs() < 0.015 && (force - 9.81).abs() < 1e-9, "{duration} s, {force} m/s^2");
        }
    }
}
