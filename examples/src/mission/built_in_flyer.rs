//! The built-in simulation as the flyer of a mission.

use paint_sim::flight::{FlightLog, PoseSource};

use super::error::MissionError;
use super::flyer::{Flight, Flyer};
use super::simulated_flight::fly_reference;
use super::watched_poses::WatchedPoses;
use crate::onboard::Approach;

/// Flies in the simulation of `paint_sim::flight`: first-order attitude, wind and hose, at the robot's control rate.
#[derive(Debug, Clone, Copy, Default)]
pub struct BuiltInFlyer;

impl Flyer for BuiltInFlyer {
    fn fly(
        &mut self,
        flight: &Flight,
        poses: &mut dyn PoseSource,
        tell: &dyn Fn(f64),
    ) -> Result<(FlightLog, Option<MissionError>), MissionError> {
        let Flight { task, reference, ref conditions, .. } = *flight;
        let fly = |reference, poses: &mut dyn PoseSource| {
            fly_reference(reference, task.met(), &task.robot, &task.settings, conditions, poses)
        };
        if !flight.is_by_own_senses() {
            return fly(reference, poses);
        }
        let approach = Approach::before(reference, flight.purpose.stands_back(), flight.corners());
        // Only these flights take long.
        let (log, ended) = fly(&approach, &mut WatchedPoses { poses, tell })?;
        let log = approach.cut(log);
        match ended {
            Some(error) if log.samples.is_empty() => Err(error),
            ended => Ok((log, ended)),
        }
    }
}
