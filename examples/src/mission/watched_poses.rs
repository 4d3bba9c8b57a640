//! A source of poses that tells how far a flight is.

use paint_sim::Error;
use paint_sim::flight::{FlightSample, LocalisedPose, PoseSource, Vehicle};

/// The poses of a source; `tell` hears the flight's time, s, at each of them.
pub(super) struct WatchedPoses<'a> {
    pub(super) poses: &'a mut dyn PoseSource,
    pub(super) tell: &'a dyn Fn(f64),
}

impl PoseSource for WatchedPoses<'_> {
    fn moved(&mut self, time: f64, truth: &Vehicle) -> Result<(), Error> {
        self.poses.moved(time, truth)
    }

    fn sprayed(&mut self, sample: &FlightSample, interval: f64) {
        self.poses.sprayed(sample, interval);
    }

    fn pose(&mut self, time: f64, truth: &Vehicle) -> Result<Option<LocalisedPose>, Error> {
        (self.tell)(time);
        self.poses.pose(time, truth)
    }
}
