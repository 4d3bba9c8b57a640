//! Detection of a stationary body by inertial samples and images.

use nalgebra::{Matrix2, Vector2, Vector3};

use super::block_noise::BlockNoise;
use super::parallax_check::{ParallaxCheck, ParallaxResult};
use crate::camera::model::CameraModel;
use crate::filter::frontend::corner_detector::DetectionCriteria;
use crate::filter::frontend::image_frontend::ImageFrontend;
use crate::filter::frontend::patch::Patch;
use crate::filter::frontend::pyramid::Pyramid;
use crate::filter::point_observation::PointObservation;
use crate::filter::settings::{PatchSettings, StationarySettings};
use crate::samples::Imu;
use crate::stamp::Stamp;

/// Patches that are compared for parallax.
const MAX_PATCHES: usize = 8;
/// Steps of Gauss and Newton by which each is found.
const STEPS: usize = 3;
/// Fewer tell nothing.
const MIN_PATCHES: usize = 5;
/// Share of the least duration after which patches are taken, and over which they must then stand: a body that glides slowly stands
/// still from one image to the next.
const WATCHED_SHARE: f64 = 0.5;
/// A patch that is not found is taken to have moved by this, pixels.
const LOST_PX: f64 = 100.0;
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
    /// Where the current image shows them.
    seen: Vec<PointObservation>,
    /// Of patches, or of points of a caller's own.
    parallax_check: ParallaxCheck,
    images_stationary: bool,
    /// Seconds over which that was seen.
    watched_s: f64,
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
            seen: Vec::with_capacity(MAX_PATCHES),
            parallax_check: ParallaxCheck::new(),
            images_stationary: false,
            watched_s: 0.0,
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

    /// Compares the current image with one of the first half of this period, if the inertial samples make it one.
    pub(crate) fn image(&mut self, now: Stamp, frontend: &mut ImageFrontend, settings: &PatchSettings) {
        if !self.is_imu_stationary_for(now, WATCHED_SHARE) {
            return;
        }
        let ImageFrontend { pyramid, detector, .. } = frontend;
        if self.patches.is_empty() {
            let criteria = DetectionCriteria::from(settings);
            detector.detect(pyramid, &std::iter::empty(), &criteria);
            while self.patches.len() < MAX_PATCHES {
                let Some(found) = detector.take_best(pyramid, &criteria) else { break };
                self.patches.push(found);
            }
            self.parallax_check.clear();
        }
        if self.patches.len() < MIN_PATCHES {
            self.patches.clear();
            self.images_stationary = false;
            return;
        }
        self.seen.clear();
        let (mut variance, mut count) = (0.0, 0.0);
        for ((place, patch), id) in self.patches.iter().zip(0..) {
            let found = find(patch, place, pyramid);
            if let Some((_, covariance)) = found {
                variance += 0.5 * settings.intensity_sigma.powi(2) * covariance.trace();
                count += 1.0;
            }
            let pixel = found.map_or(place + Vector2::repeat(LOST_PX), |(pixel, _)| pixel);
            self.seen.push(PointObservation { id, pixel });
        }
        let sigma = (variance / f64::max(count, 1.0)).sqrt();
        let result = self.parallax_check.check(now, &self.seen, (sigma, self.settings.max_parallax_px));
        self.set_images(now, result);
    }

    /// Compares points, each with noise of `sigma` pixels, with those at the beginning of this period.
    pub(crate) fn points(&mut self, now: Stamp, points: &[PointObservation], sigma: f64) {
        let result = self.parallax_check.check(now, points, (sigma, self.settings.max_parallax_px));
        self.set_images(now, result);
        // Slow motion takes its time to stand out from the noise.
        self.images_stationary &= self.watched_s >= self.settings.min_duration_s;
    }

    fn set_images(&mut self, now: Stamp, result: Option<ParallaxResult>) {
        let Some(ParallaxResult { stationary, tolerance }) = result else {
            self.images_stationary = false;
            return;
        };
        (self.watched_s, self.tolerance) = (self.parallax_check.age(now), tolerance);
        // Two images between the same samples tell nothing of time.
        self.images_stationary = stationary && self.watched_s > 0.0;
        if !stationary {
            // From here on something else is seen. What the inertial samples have read so far is no rest if it would count as one.
            self.reference.take_if(|reference| now.secs_since(reference.stamp) >= self.settings.min_duration_s);
            self.patches.clear();
            self.parallax_check.clear();
        }
    }

    /// Standard deviation of a rotation that is not detected, rad.
    pub(crate) fn undetected_angle(&self, camera: &dyn CameraModel) -> f64 {
        0.5 * self.tolerance / camera.focal_length()
    }

    /// Standard deviation of a velocity that is not detected before points of this inverse distance (1/m), m/s.
    pub(crate) fn undetected_speed(&self, camera: &dyn CameraModel, inverse_distance: f64) -> f64 {
        self.undetected_angle(camera) / (inverse_distance * self.watched_s)
    }

    /// Whether nothing has moved for long enough.
    pub(crate) fn is_stationary(&self, now: Stamp) -> bool {
        self.watched_s >= WATCHED_SHARE * self.settings.min_duration_s && self.may_be_stationary(now)
    }

    /// Whether the inertial samples have been stationary for long enough, and the last images contradict that no more than by
    /// [`undetected_speed`](Self::undetected_speed).
    pub(crate) fn may_be_stationary(&self, now: Stamp) -> bool {
        self.images_stationary && self.is_imu_stationary(now)
    }

    /// Whether the inertial samples alone have been stationary for long enough.
    pub(crate) fn is_imu_stationary(&self, now: Stamp) -> bool {
        self.is_imu_stationary_for(now, 1.0)
    }

    fn is_imu_stationary_for(&self, now: Stamp, share: f64) -> bool {
        self.reference.is_some_and(|reference| now.secs_since(reference.stamp) >= share * self.settings.min_duration_s)
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

/// Where a patch is, if it is near its place; and the covariance of that by unit noise of the grey levels.
fn find(patch: &Patch, place: &Vector2<f64>, pyramid: &Pyramid) -> Option<(Vector2<f64>, Matrix2<f64>)> {
    let (mut pixel, mut covariance) = (*place, Matrix2::zeros());
    for _ in 0..STEPS {
        let comparison = patch.compare(pyramid, &pixel, &Matrix2::identity())?;
        covariance = comparison.information.try_inverse()?;
        pixel += covariance * comparison.gradient;
    }
    Some((pixel, covariance))
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

    /// A picture of squares of 16 pixels, each with a brightness of its own; those near some places stand, all others are moved.
    fn picture(moved: usize, standing: &[Vector2<f64>]) -> Vec<u8> {
        let (width, height) = camera_ahead().image_size();
        let brightness = |x: usize, y: usize| {
            let square = (x / 16 + 100 * (y / 16)) as u32;
            40 + (square.wrapping_mul(2_654_435_761) >> 25) as u8
        };
        let stands =
            |x: usize, y: usize| standing.iter().any(|place| (place - Vector2::new(x as f64, y as f64)).amax() < 14.0);
        let at = |x: usize, y: usize| if stands(x, y) { (x, y) } else { (x + moved, y + moved) };
        (0..width * height).map(|k| at(k % width, k / width)).map(|(x, y)| brightness(x, y)).collect()
    }

    /// When a detector that reads rest says that nothing moves, ms, if it is shown a picture each 50 ms, moved by so many pixels by the
    /// time except at so many of its patches.
    fn standstill(moved: impl Fn(i64) -> usize, still: usize) -> Vec<i64> {
        let settings = PatchSettings::default();
        let (width, height) = camera_ahead().image_size();
        let mut frontend = ImageFrontend::new(&camera_ahead(), &settings);
        let mut detector = StationaryDetector::new(StationarySettings::default());
        let mut found = Vec::new();
        for milliseconds in (0..2000).step_by(5) {
            let sample = sample(milliseconds, 9.81);
            detector.imu(&sample);
            if milliseconds % 50 == 0 {
                let places: Vec<Vector2<f64>> = detector.patches.iter().map(|(pixel, _)| *pixel).take(still).collect();
                let data = picture(moved(milliseconds), &places);
                frontend.set_image(&ImageView { width, height, data: &data });
                detector.image(sample.stamp, &mut frontend, &settings);
                found.extend(detector.is_stationary(sample.stamp).then_some(milliseconds));
            }
        }
        found
    }

    #[test]
    fn most_patches_must_stand() {
        let jumps = |milliseconds| if milliseconds < 1200 { 0 } else { 2 };
        let stands = |still| standstill(jumps, still).contains(&1200);
        assert_eq!([0, 1, 3, 5, MAX_PATCHES].map(stands), [false, false, false, true, true]);
    }

    /// A body that glides stands from one image to the next, but not over half a second.
    #[test]
    fn images_must_stand_for_half_a_second() {
        let expected: Vec<i64> = (1000..2000).step_by(50).collect();
        let resting = standstill(|_| 0, 0);
        assert!(resting.ends_with(&expected[3..]) && resting.iter().all(|at| *at >= 1000), "{resting:?}");
        assert_eq!(standstill(|milliseconds| milliseconds as usize / 200, 0), [0; 0]);
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
