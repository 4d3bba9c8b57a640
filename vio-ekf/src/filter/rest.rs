mod watch;

use nalgebra::{Vector2, Vector3};

use super::PointObservation;
use super::detect::{Demands, Detector};
use super::patch::Patch;
use super::pyramid::Pyramid;
use crate::{Camera, Imu, Stamp};
use watch::{Verdict, Watch};

/// Patches that are watched for motion.
const WATCHED: usize = 8;
/// As many must agree.
const ENOUGH: usize = 5;
/// Samples are averaged over this before they are compared, s: the motors of a vehicle that stands shake it by several m/s²,
/// but do not move it.
const BLOCK_S: f64 = 0.1;

/// When the body is taken to be at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct RestSettings {
    /// Least time without motion, s; 1 as in ROVIO. Infinite to switch all of it off.
    pub duration_s: f64,
    /// Largest departure of a rate, averaged over a tenth of a second, from the first one since the rest began, rad/s; ours
    /// (ROVIO limits the rate itself, to 0.1).
    pub rate: f64,
    /// Largest departure of a specific force, averaged likewise, from the first one, m/s²; 0.5 as in ROVIO.
    pub force: f64,
    /// Largest motion of the image since the rest began, pixels; ours. Half of it is taken as the standard deviation of what
    /// goes unnoticed, in the pose and in the mean rate.
    pub pixels: f64,
    /// A body is only seen to have set off some time after it did. What it was doing this long ago is certain, s; ours. A rest that
    /// ends is taken to have ended then, and the samples since tell the motion.
    pub delay_s: f64,
    /// Velocity that may go unnoticed, m/s per axis; ours.
    pub velocity_sigma: f64,
    /// Uncertainty of the mean force over [`duration_s`](Self::duration_s) that no white noise explains, m/s²: vibration,
    /// and motion that goes unnoticed; ours.
    pub force_sigma: f64,
    /// Largest difference between the mean force at rest and gravity, m/s²; ours. More means wrong axes or units.
    pub gravity_tolerance: f64,
}

impl Default for RestSettings {
    fn default() -> Self {
        Self {
            duration_s: 1.0,
            rate: 0.05,
            force: 0.5,
            pixels: 0.5,
            delay_s: 0.5,
            velocity_sigma: 0.003,
            force_sigma: 0.02,
            gravity_tolerance: 0.6,
        }
    }
}

/// Means over a part of a rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Window {
    since: Stamp,
    count: u32,
    pub(crate) rate: Vector3<f64>,
    pub(crate) force: Vector3<f64>,
    /// Length, s.
    pub(crate) duration: f64,
}

impl Window {
    fn new(sample: &Imu) -> Self {
        Self { since: sample.stamp, count: 1, rate: sample.gyro, force: sample.accel, duration: 0.0 }
    }

    fn add(&mut self, sample: &Imu) {
        self.count += 1;
        self.duration = sample.stamp.secs_since(self.since);
        self.rate += (sample.gyro - self.rate) / f64::from(self.count);
        self.force += (sample.accel - self.force) / f64::from(self.count);
    }
}

/// Watches inertial samples and images for motion.
#[derive(Debug, Clone)]
pub(crate) struct Rest {
    settings: RestSettings,
    /// The mean of the first block of this rest, at the time of its first sample.
    first: Option<Imu>,
    /// The block that is being averaged.
    block: Option<Window>,
    /// Means that have not been used yet. Each sample is used once.
    window: Option<Window>,
    /// Those of a window that has ended, until it is certain that nothing moved before its end.
    held: Option<Window>,
    watched: Vec<(Vector2<f64>, Patch)>,
    /// The same for points of a caller's own.
    watch: Watch,
    still: bool,
    /// Motion of the image that is not told from noise, pixels.
    tolerance: f64,
}

impl Rest {
    pub(crate) fn new(settings: RestSettings) -> Self {
        Self {
            settings,
            first: None,
            block: None,
            window: None,
            held: None,
            watched: Vec::with_capacity(WATCHED),
            watch: Watch::new(),
            still: false,
            tolerance: settings.pixels,
        }
    }

    /// Takes a sample; a block that departs from the first begins a new rest.
    pub(crate) fn imu(&mut self, sample: &Imu) {
        let block = match &mut self.block {
            Some(block) => {
                block.add(sample);
                *block
            }
            None => *self.block.insert(Window::new(sample)),
        };
        if block.duration >= BLOCK_S {
            self.block = None;
            let same = |first: &Imu| {
                (block.rate - first.gyro).amax() <= self.settings.rate
                    && (block.force - first.accel).amax() <= self.settings.force
            };
            if !self.first.as_ref().is_some_and(same) {
                self.first = Some(Imu { stamp: block.since, gyro: block.rate, accel: block.force });
                (self.window, self.held) = (None, None);
                self.watched.clear();
                self.watch.clear();
                self.still = false;
            }
        }
        match &mut self.window {
            Some(window) => window.add(sample),
            None => self.window = Some(Window::new(sample)),
        }
    }

    /// Compares an image with the first one of this rest.
    pub(crate) fn image(&mut self, pyramid: &Pyramid, detector: &mut Detector, demands: &Demands) {
        if self.watched.len() < ENOUGH {
            self.watched.clear();
            self.still = false;
            detector.detect(pyramid, &std::iter::empty(), demands);
            while self.watched.len() < WATCHED {
                let Some(found) = detector.pick(pyramid, demands) else { break };
                self.watched.push(found);
            }
            return;
        }
        let unmoved = |(pixel, patch): &(Vector2<f64>, Patch)| {
            let comparison = patch.compare(pyramid, pixel, &nalgebra::Matrix2::identity())?;
            let shift = comparison.information.try_inverse()? * comparison.moment;
            (shift.norm() < self.settings.pixels).then_some(())
        };
        let count = self.watched.iter().filter_map(unmoved).count();
        let still = 2 * count > self.watched.len();
        self.conclude(Verdict { still, tolerance: self.settings.pixels });
    }

    /// Compares points, each with noise of `sigma` pixels, with where they were at the beginning of this rest.
    pub(crate) fn points(&mut self, now: Stamp, points: &[PointObservation], sigma: f64) {
        match self.watch.judge(now, points, (sigma, self.settings.pixels)) {
            Some(verdict) => {
                self.conclude(verdict);
                // Slow motion takes its time to stand out from the noise.
                self.still &= self.watch.age(now) >= self.settings.duration_s;
            }
            None => self.still = false,
        }
    }

    fn conclude(&mut self, Verdict { still, tolerance }: Verdict) {
        (self.still, self.tolerance) = (still, tolerance);
        if !still {
            // From here on something else is seen: the rest, if it is one, begins anew.
            self.first = None;
        }
    }

    /// Standard deviation of an angle that goes unnoticed, rad.
    pub(crate) fn unnoticed(&self, camera: &Camera) -> f64 {
        0.5 * self.tolerance / camera.fx.min(camera.fy)
    }

    /// Whether nothing has moved for long enough.
    pub(crate) fn is_at_rest(&self, now: Stamp) -> bool {
        self.still && self.is_steady(now)
    }

    /// Whether the inertial samples alone would allow a rest of the needed length.
    pub(crate) fn is_steady(&self, now: Stamp) -> bool {
        self.first.is_some_and(|first| now.secs_since(first.stamp) >= self.settings.duration_s)
    }

    /// The means since they were last taken, over at least the duration of the settings.
    pub(crate) fn take_window(&mut self) -> Option<Window> {
        self.window.take_if(|window| window.duration >= self.settings.duration_s)
    }

    /// The same, of a time of which it is certain by now that nothing moved.
    pub(crate) fn take_certain_window(&mut self, now: Stamp) -> Option<Window> {
        let until = |window: &Window| window.duration + self.settings.delay_s;
        let certain = self.held.take_if(|window| now.secs_since(window.since) >= until(window));
        if self.held.is_none() {
            self.held = self.take_window();
        }
        certain
    }

    /// Mean specific force that has not been used yet.
    pub(crate) fn force(&self) -> Option<Vector3<f64>> {
        self.window.map(|window| window.force)
    }
}
