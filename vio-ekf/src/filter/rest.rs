use nalgebra::{Vector2, Vector3};

use super::detect::{Demands, Detector};
use super::patch::Patch;
use super::pyramid::Pyramid;
use crate::{Imu, Stamp};

/// Patches that are watched for motion.
const WATCHED: usize = 8;
/// As many must agree.
const ENOUGH: usize = 5;

/// When the body is taken to be at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct RestSettings {
    /// Least time without motion, s; 1 as in ROVIO. Infinite to switch all of it off.
    pub duration_s: f64,
    /// Largest departure of a rate from the mean since the rest began, rad/s; 0.1, ROVIO's limit of the rate itself.
    pub rate: f64,
    /// Largest departure of a specific force from that mean, m/s²; 0.5 as in ROVIO.
    pub force: f64,
    /// Largest motion of the image since the rest began, pixels; 1 as in ROVIO.
    pub pixels: f64,
    /// Velocity that may go unnoticed, m/s per axis; ours.
    pub velocity_sigma: f64,
    /// Uncertainty of the mean force at rest that no white noise explains, m/s²: vibration; ours.
    pub force_sigma: f64,
    /// The same of the mean rate, rad/s; ours.
    pub rate_sigma: f64,
    /// Largest difference between the mean force at rest and gravity, m/s²; ours. More means wrong axes or units.
    pub gravity_tolerance: f64,
}

impl Default for RestSettings {
    fn default() -> Self {
        Self {
            duration_s: 1.0,
            rate: 0.1,
            force: 0.5,
            pixels: 1.0,
            velocity_sigma: 0.01,
            force_sigma: 0.01,
            rate_sigma: 1e-4,
            gravity_tolerance: 0.6,
        }
    }
}

/// Watches inertial samples and images for motion.
#[derive(Debug, Clone)]
pub(crate) struct Rest {
    settings: RestSettings,
    since: Option<Stamp>,
    count: u32,
    rate: Vector3<f64>,
    force: Vector3<f64>,
    watched: Vec<(Vector2<f64>, Patch)>,
    still: bool,
}

impl Rest {
    pub(crate) fn new(settings: RestSettings) -> Self {
        let (zero, watched) = (Vector3::zeros(), Vec::with_capacity(WATCHED));
        Self { settings, since: None, count: 0, rate: zero, force: zero, watched, still: false }
    }

    /// Takes a sample; one that departs from the mean begins a new rest.
    pub(crate) fn imu(&mut self, sample: &Imu) {
        let departs = (sample.gyro - self.rate).amax() > self.settings.rate
            || (sample.accel - self.force).amax() > self.settings.force;
        if self.since.is_none() || departs {
            self.since = Some(sample.stamp);
            (self.count, self.rate, self.force) = (1, sample.gyro, sample.accel);
            self.watched.clear();
            self.still = false;
            return;
        }
        self.count += 1;
        // A long rest forgets slowly, so that the biases may walk.
        let weight = 1.0 / f64::from(self.count.min(MEMORY));
        self.rate += (sample.gyro - self.rate) * weight;
        self.force += (sample.accel - self.force) * weight;
    }

    /// Compares an image with the first one of this rest.
    pub(crate) fn image(&mut self, pyramid: &Pyramid, detector: &mut Detector, demands: &Demands) {
        if self.watched.len() < ENOUGH {
            self.watched.clear();
            self.still = false;
            detector.detect(pyramid, std::iter::empty(), demands);
            while self.watched.len() < WATCHED {
                let Some(found) = detector.pick(demands) else { break };
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
        self.still = 2 * count > self.watched.len();
        if !self.still {
            // From here on something else is seen: the rest, if it is one, begins anew.
            self.since = None;
        }
    }

    /// Whether nothing has moved for long enough.
    pub(crate) fn is_at_rest(&self, now: Stamp) -> bool {
        self.still && self.is_steady(now)
    }

    /// Whether the inertial samples alone would allow a rest of the needed length.
    pub(crate) fn is_steady(&self, now: Stamp) -> bool {
        self.since.is_some_and(|since| now.secs_since(since) >= self.settings.duration_s)
    }

    /// Mean rate and specific force since the rest began.
    pub(crate) fn means(&self) -> [Vector3<f64>; 2] {
        [self.rate, self.force]
    }
}

/// Samples that the means look back.
const MEMORY: u32 = 400;
