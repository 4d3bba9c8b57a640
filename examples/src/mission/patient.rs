//! A source of poses that is waited for so long and no longer.

use paint_sim::Error;
use paint_sim::flight::{FlightSample, LocalisedPose, PoseSource, Vehicle};

/// Without a pose for so long the flight ends, s: on its model alone the robot drifts towards the surface.
const LONGEST: f64 = 5.0;

/// Another source of poses, which must say where the robot is at least once in five seconds.
pub(super) struct Patient<'a> {
    inner: &'a mut dyn PoseSource,
    known: Option<f64>,
}

impl<'a> Patient<'a> {
    /// With a source of poses.
    pub(super) fn with(inner: &'a mut dyn PoseSource) -> Self {
        Self { inner, known: None }
    }
}

impl PoseSource for Patient<'_> {
    fn moved(&mut self, time: f64, truth: &Vehicle) -> Result<(), Error> {
        self.inner.moved(time, truth)
    }

    fn sprayed(&mut self, sample: &FlightSample, interval: f64) {
        self.inner.sprayed(sample, interval);
    }

    fn pose(&mut self, time: f64, truth: &Vehicle) -> Result<Option<LocalisedPose>, Error> {
        let pose = self.inner.pose(time, truth)?;
        if pose.is_some() {
            self.known = Some(time);
        }
        match self.known {
            Some(known) if time - known > LONGEST => {
                Err(Error::Localisation { time, why: format!("no pose for {LONGEST} s: it lands") })
            }
            _ => Ok(pose),
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Point3};

    use super::*;

    /// Says where it is at the times of a list alone.
    struct Sometimes(Vec<f64>);

    impl PoseSource for Sometimes {
        fn pose(&mut self, time: f64, _: &Vehicle) -> Result<Option<LocalisedPose>, Error> {
            let pose = LocalisedPose { world_from_body: Isometry3::identity(), trusted: true, sigma: [0.0; 2] };
            Ok(self.0.contains(&time).then_some(pose))
        }
    }

    #[test]
    fn five_seconds_without_a_pose_are_enough() {
        let truth = Vehicle::at_rest(Point3::origin(), 0.0);
        let mut sometimes = Sometimes(vec![0.0, 4.0, 9.0]);
        let mut patient = Patient::with(&mut sometimes);
        for (time, known) in [(0.0, true), (2.0, false), (4.0, true), (8.0, false), (9.0, true), (14.0, false)] {
            assert_eq!(patient.pose(time, &truth).unwrap().is_some(), known, "{time}");
        }
        assert!(patient.pose(14.01, &truth).unwrap_err().to_string().contains("no pose for 5 s"));
    }
}
