//! Collects samples, images and points before an initialization in motion, and tries to solve their window.

use std::collections::VecDeque;

use nalgebra::{UnitQuaternion, Vector3};

use super::dynamic::result::{DynamicOutcome, InitialMotion};
use super::dynamic::solver::{MIN_POINTS, solve};
use super::dynamic::window::{BearingObservation, WindowInput};
use crate::camera::model::CameraModel;
use crate::filter::settings::{DynamicInitializationSettings, Settings};
use crate::inertial::core_state::ImuCorrection;
use crate::inertial::imu_buffer::ImuBuffer;
use crate::inertial::imu_noise_estimator::{ImuNoiseEstimator, ImuSettings};
use crate::inertial::preintegration::ImuPreintegration;
use crate::samples::{Imu, ImuNoise};
use crate::stamp::Stamp;

/// Least number of observations of a point.
const MIN_OBSERVATIONS: usize = 5;
/// Images from one attempt to the next.
const ATTEMPT_INTERVAL: usize = 2;

/// A sliding window of images, their points and the inertial samples.
#[derive(Debug, Clone)]
pub(crate) struct DynamicInitializer {
    settings: DynamicInitializationSettings,
    /// From the last one before the first image on.
    samples: VecDeque<Imu>,
    images: VecDeque<Stamp>,
    points: Vec<Point>,
    /// Images dropped from the beginning of the window.
    dropped: usize,
    since_attempt: usize,
}

/// One point: its id, and where it was seen, images counted from the very first.
#[derive(Debug, Clone)]
struct Point {
    id: u64,
    observations: VecDeque<BearingObservation>,
}

impl DynamicInitializer {
    pub(crate) fn new(settings: DynamicInitializationSettings) -> Self {
        Self {
            settings,
            samples: VecDeque::new(),
            images: VecDeque::new(),
            points: Vec::new(),
            dropped: 0,
            since_attempt: 0,
        }
    }

    pub(crate) fn imu(&mut self, sample: &Imu) {
        self.samples.push_back(*sample);
        let from = sample.stamp.nanos().saturating_sub((self.settings.max_window_s * 1.2e9) as i64);
        let from = self.images.front().map_or(from, |image| image.nanos().max(from));
        while self.samples.len() > 2 && self.samples[1].stamp.nanos() <= from {
            self.samples.pop_front();
        }
    }

    /// The samples around a time and after it.
    pub(crate) fn samples(&self) -> impl Iterator<Item = &Imu> {
        self.samples.iter()
    }

    /// Rotation of the body from the last image until a time: its attitude then in the axes of that image.
    pub(crate) fn rotation_since_image(&self, until: Stamp) -> Option<UnitQuaternion<f64>> {
        let (&from, sample) = (self.images.back()?, *self.samples.front()?);
        let mut preintegration = ImuPreintegration::default();
        let mut buffer = ImuBuffer::new(sample, from, self.samples.len());
        self.samples.iter().skip(1).for_each(|sample| buffer.push(*sample));
        let correction = ImuCorrection::default();
        buffer.continue_preintegration(&mut preintegration, (from, until), &correction, &ImuNoise::ZERO);
        Some(preintegration.rotation)
    }

    /// Takes the observations of an image: ids and directions in camera axes. Returns the motion at that image once it is known; its
    /// landmarks have the ids of the points.
    pub(crate) fn image(
        &mut self,
        stamp: Stamp,
        observed: impl Iterator<Item = (u64, Vector3<f64>)>,
        camera: &dyn CameraModel,
        known: (&ImuNoise, &Settings),
    ) -> Option<Box<InitialMotion>> {
        let first = self.samples.front()?;
        if self.images.back().is_some_and(|last| stamp <= *last) || stamp < first.stamp {
            return None;
        }
        self.images.push_back(stamp);
        let image = self.dropped + self.images.len() - 1;
        for (id, direction) in observed {
            match self.points.iter_mut().find(|point| point.id == id) {
                Some(point) => point.observations.push_back((image, direction)),
                None => self.points.push(Point { id, observations: VecDeque::from([(image, direction)]) }),
            }
        }
        self.slide(stamp);
        self.since_attempt += 1;
        if self.since_attempt < ATTEMPT_INTERVAL || stamp.secs_since(self.images[0]) < self.settings.min_window_s {
            return None;
        }
        self.since_attempt = 0;
        self.attempt(camera, known)
    }

    /// Drops images that are too old, and points that no image of the window sees any more.
    fn slide(&mut self, now: Stamp) {
        while now.secs_since(self.images[0]) > self.settings.max_window_s {
            self.images.pop_front();
            self.dropped += 1;
        }
        for point in &mut self.points {
            while point.observations.front().is_some_and(|observation| observation.0 < self.dropped) {
                point.observations.pop_front();
            }
        }
        self.points.retain(|point| !point.observations.is_empty());
    }

    fn attempt(
        &mut self,
        camera: &dyn CameraModel,
        (noise, settings): (&ImuNoise, &Settings),
    ) -> Option<Box<InitialMotion>> {
        let long_enough = |point: &&Point| point.observations.len() >= MIN_OBSERVATIONS;
        let ids: Vec<u64> = self.points.iter().filter(long_enough).map(|point| point.id).collect();
        if ids.len() < MIN_POINTS {
            return None;
        }
        let dropped = self.dropped;
        let local = |point: &Point| point.observations.iter().map(|(image, d)| (image - dropped, *d)).collect();
        let points: Vec<Vec<BearingObservation>> = self.points.iter().filter(long_enough).map(local).collect();
        let input = WindowInput {
            points: &points,
            camera: (camera.body_from_camera().translation.vector, camera.body_from_camera().rotation),
            focal_length: camera.focal_length(),
            gravity: settings.gravity,
            densities: self.densities(noise, &settings.imu),
        };
        let buffer = self.buffer();
        let DynamicOutcome::Converged(mut motion) =
            solve(|bias| self.preintegrations(&buffer, bias), &input, &self.settings)
        else {
            return None;
        };
        for landmark in &mut motion.landmarks {
            landmark.id = ids[landmark.point];
        }
        Some(motion)
    }

    /// White noise of gyroscope and accelerometer at the end of the window.
    fn densities(&self, sheet: &ImuNoise, settings: &ImuSettings) -> [f64; 2] {
        let mut estimator = ImuNoiseEstimator::new(self.samples[0]);
        let noise = self.samples.iter().skip(1).map(|sample| estimator.sample(sample, settings)).last();
        noise.unwrap_or_default().within_range(sheet, settings)
    }

    /// The samples from the first image on; there must be one of each.
    fn buffer(&self) -> ImuBuffer {
        let mut buffer = ImuBuffer::new(self.samples[0], self.images[0], self.samples.len());
        self.samples.iter().skip(1).for_each(|sample| buffer.push(*sample));
        buffer
    }

    /// Preintegrates from the first image to each.
    fn preintegrations(&self, buffer: &ImuBuffer, gyro_bias: &Vector3<f64>) -> Vec<ImuPreintegration> {
        let correction = ImuCorrection { gyro_bias: *gyro_bias, ..ImuCorrection::default() };
        let (mut preintegration, mut from) = (ImuPreintegration::default(), self.images[0]);
        let each = self.images.iter().map(|&until| {
            buffer.continue_preintegration(&mut preintegration, (from, until), &correction, &ImuNoise::ZERO);
            from = until;
            preintegration.clone()
        });
        each.collect()
    }
}
