//! Before the start in motion: the last seconds of samples, images and points, and whether they tell the motion.

use std::collections::VecDeque;

use nalgebra::{UnitQuaternion, Vector3};

use super::history::History;
use super::interval::Interval;
use super::moving::{Motion, MovingSettings, Scene, Sighting, Verdict, solve};
use crate::{Camera, Imu, ImuNoise, Stamp};

/// Points seen in fewer images than this have nothing to say.
const SHORTEST: usize = 5;
/// Between two trials, images.
const EVERY: usize = 2;

/// Keeps a window of images and what they see, and asks it for the motion.
#[derive(Debug, Clone)]
pub(crate) struct Scout {
    settings: MovingSettings,
    /// From the last one before the first image on.
    samples: VecDeque<Imu>,
    images: VecDeque<Stamp>,
    points: Vec<Point>,
    /// Images that the window has lost at its beginning.
    lost: usize,
    untried: usize,
}

/// One point: who it is to whoever follows it, and where it was seen, images counted from the very first.
#[derive(Debug, Clone)]
struct Point {
    id: u64,
    sightings: VecDeque<Sighting>,
}

impl Scout {
    pub(crate) fn new(settings: MovingSettings) -> Self {
        Self { settings, samples: VecDeque::new(), images: VecDeque::new(), points: Vec::new(), lost: 0, untried: 0 }
    }

    pub(crate) fn imu(&mut self, sample: &Imu) {
        self.samples.push_back(*sample);
        let from = sample.stamp.nanos().saturating_sub((self.settings.outlook_s * 1.2e9) as i64);
        let from = self.images.front().map_or(from, |image| image.nanos().max(from));
        while self.samples.len() > 2 && self.samples[1].stamp.nanos() <= from {
            self.samples.pop_front();
        }
    }

    /// The samples around a time and after it.
    pub(crate) fn samples(&self) -> impl Iterator<Item = &Imu> {
        self.samples.iter()
    }

    /// Turn of the body from the last image until a time: its attitude then in the axes of that image.
    pub(crate) fn turn(&self, until: Stamp) -> Option<UnitQuaternion<f64>> {
        let (&from, sample) = (self.images.back()?, *self.samples.front()?);
        let mut interval = Interval::default();
        let mut history = History::new(sample, from, self.samples.len());
        self.samples.iter().skip(1).for_each(|sample| history.push(*sample));
        history.extend(&mut interval, (from, until), &[Vector3::zeros(); 2], &ImuNoise::ZERO);
        Some(interval.rotation)
    }

    /// Takes what an image sees: names and directions in camera axes. The motion at that image, once it is known; its
    /// landmarks are named as the points are.
    pub(crate) fn image(
        &mut self,
        stamp: Stamp,
        seen: impl Iterator<Item = (u64, Vector3<f64>)>,
        camera: &Camera,
        gravity: f64,
    ) -> Option<Box<Motion>> {
        let first = self.samples.front()?;
        if self.images.back().is_some_and(|last| stamp <= *last) || stamp < first.stamp {
            return None;
        }
        self.images.push_back(stamp);
        let image = self.lost + self.images.len() - 1;
        for (id, direction) in seen {
            match self.points.iter_mut().find(|point| point.id == id) {
                Some(point) => point.sightings.push_back((image, direction)),
                None => self.points.push(Point { id, sightings: VecDeque::from([(image, direction)]) }),
            }
        }
        self.forget(stamp);
        self.untried += 1;
        if self.untried < EVERY || stamp.secs_since(self.images[0]) < self.settings.least_s {
            return None;
        }
        self.untried = 0;
        self.attempt(camera, gravity)
    }

    /// Drops images that are too old, and points that no image of the window sees any more.
    fn forget(&mut self, now: Stamp) {
        while now.secs_since(self.images[0]) > self.settings.outlook_s {
            self.images.pop_front();
            self.lost += 1;
        }
        for point in &mut self.points {
            while point.sightings.front().is_some_and(|sighting| sighting.0 < self.lost) {
                point.sightings.pop_front();
            }
        }
        self.points.retain(|point| !point.sightings.is_empty());
    }

    fn attempt(&mut self, camera: &Camera, gravity: f64) -> Option<Box<Motion>> {
        let worth = |point: &&Point| point.sightings.len() >= SHORTEST;
        let ids: Vec<u64> = self.points.iter().filter(worth).map(|point| point.id).collect();
        if ids.len() < super::moving::ENOUGH {
            return None;
        }
        let lost = self.lost;
        let local = |point: &Point| point.sightings.iter().map(|(image, d)| (image - lost, *d)).collect();
        let points: Vec<Vec<Sighting>> = self.points.iter().filter(worth).map(local).collect();
        let scene = Scene {
            points: &points,
            camera: (camera.body_from_camera.translation.vector, camera.body_from_camera.rotation),
            focal_length: camera.fx.min(camera.fy),
            gravity,
        };
        let history = self.history();
        let Verdict::Known(mut motion) = solve(|bias| self.intervals(&history, bias), &scene, &self.settings) else {
            return None;
        };
        for landmark in &mut motion.landmarks {
            landmark.id = ids[landmark.point];
        }
        Some(motion)
    }

    /// The samples from the first image on; there must be one of each.
    fn history(&self) -> History {
        let mut history = History::new(self.samples[0], self.images[0], self.samples.len());
        self.samples.iter().skip(1).for_each(|sample| history.push(*sample));
        history
    }

    /// From the first image to each.
    fn intervals(&self, history: &History, gyro_bias: &Vector3<f64>) -> Vec<Interval> {
        let (biases, mut interval, mut from) = ([*gyro_bias, Vector3::zeros()], Interval::default(), self.images[0]);
        let each = self.images.iter().map(|&until| {
            history.extend(&mut interval, (from, until), &biases, &ImuNoise::ZERO);
            from = until;
            interval.clone()
        });
        each.collect()
    }
}
