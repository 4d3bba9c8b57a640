//! Poses of stretches without interruption, and what was taken back of them.

use crate::error::Error;
use crate::inertial::odometry::Odometry;
use crate::stamp::Stamp;
use crate::trajectory::Trajectory;

/// The estimate after an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Pose, velocity, biases, covariance.
    pub odometry: Odometry,
    /// Landmarks used with the image.
    pub used: usize,
    /// Whether it comes from inertial samples alone.
    pub dead_reckoned: bool,
}

/// A stretch without interruption. After each interruption the filter starts anew, in a world of its own: place and heading of
/// one segment say nothing about those of another.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Segment {
    /// The estimate after each image, stamps strictly increasing.
    pub estimates: Vec<Estimate>,
}

impl Segment {
    /// Its poses, in its own world.
    ///
    /// # Errors
    /// [`Error::NonFinite`] if the filter gave poses that are not finite.
    pub fn trajectory(&self) -> Result<Trajectory, Error> {
        let mut trajectory = Trajectory::default();
        for Estimate { odometry, .. } in &self.estimates {
            trajectory.push(odometry.stamp, odometry.world_from_body)?;
        }
        Ok(trajectory)
    }
}

/// All segments so far, and the one that goes on.
#[derive(Debug, Clone)]
pub(super) struct Segments {
    /// Whether estimates are kept, or only counted.
    keep: bool,
    kept: Vec<Segment>,
    open: Option<OpenSegment>,
    /// Stamp of the first estimate that was not taken back.
    pub(super) first: Option<Stamp>,
    /// Estimates that were not taken back.
    pub(super) poses: usize,
    /// Those that were.
    pub(super) withdrawn: usize,
}

#[derive(Debug, Clone, Copy)]
struct OpenSegment {
    poses: usize,
    last: Stamp,
}

impl Segments {
    pub(super) fn new(keep: bool) -> Self {
        Self { keep, kept: Vec::new(), open: None, first: None, poses: 0, withdrawn: 0 }
    }

    pub(super) fn is_open(&self) -> bool {
        self.open.is_some()
    }

    /// Adds an estimate; returns whether a segment begins with it.
    pub(super) fn push(&mut self, estimate: &Estimate) -> bool {
        let stamp = estimate.odometry.stamp;
        let begins = self.open.is_none();
        if self.open.is_some_and(|open| stamp <= open.last) {
            return false;
        }
        if begins && self.keep {
            self.kept.push(Segment::default());
        }
        self.open = Some(OpenSegment { poses: self.open.map_or(0, |open| open.poses) + 1, last: stamp });
        self.first.get_or_insert(stamp);
        self.poses += 1;
        if let Some(segment) = self.kept.last_mut().filter(|_| self.keep) {
            segment.estimates.push(*estimate);
        }
        begins
    }

    /// Takes back the last poses of the open segment, which ends; returns how many there were.
    pub(super) fn withdraw(&mut self, count: usize) -> usize {
        let Some(open) = self.open.take() else { return 0 };
        let count = count.min(open.poses);
        self.poses -= count;
        self.withdrawn += count;
        if self.poses == 0 {
            self.first = None;
        }
        if let Some(segment) = self.kept.last_mut().filter(|_| self.keep) {
            segment.estimates.truncate(open.poses - count);
        }
        count
    }

    /// The segments that have an estimate left.
    pub(super) fn into_kept(self) -> Vec<Segment> {
        self.kept.into_iter().filter(|segment| !segment.estimates.is_empty()).collect()
    }
}
