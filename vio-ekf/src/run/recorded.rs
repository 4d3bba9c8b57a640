//! A recording, run in one call, and what came of it.

use nalgebra::Matrix3;

use crate::error::Error;
use crate::filter::report::Calibration;
use crate::filter::vio::Vio;
use crate::run::frames::{Picture, RecordedFrame};
use crate::run::outcome::{Loss, SkippedImage};
use crate::run::runner::{Runner, RunnerSettings};
use crate::run::segments::Segment;
use crate::samples::Imu;
use crate::stamp::Stamp;
use crate::trajectory::Trajectory;

/// What came of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// The stretches, in order; at least one, none of them empty. None if [`RunnerSettings::keep_history`] is off.
    pub segments: Vec<Segment>,
    /// First and last stamp of the images, skipped ones included.
    pub images_span: (Stamp, Stamp),
    /// Images that the filter took.
    pub frames: usize,
    /// Those among them that came with one of the second camera.
    pub pairs: usize,
    /// Images that it could not take.
    pub skipped: Vec<SkippedImage>,
    /// Inertial samples that it took.
    pub imu_samples: usize,
    /// Seconds from the first image to the first estimate.
    pub initialization_time_s: f64,
    /// Why and when it gave up, each time.
    pub lost: Vec<Loss>,
    /// Poses that were taken back, and are in no segment: of starts that turned out to be wrong, and those before a divergence with
    /// which the measurements disagreed already.
    pub withdrawn: usize,
    /// Whether it runs at the end.
    pub tracking_at_end: bool,
    /// The camera's calibration at the end.
    pub calibration: Calibration,
}

impl Run {
    /// Poses of all segments.
    pub fn poses(&self) -> usize {
        self.segments.iter().map(|segment| segment.estimates.len()).sum()
    }

    /// Poses that come from inertial samples alone.
    pub fn dead_reckoned(&self) -> usize {
        self.segments.iter().flat_map(|segment| &segment.estimates).filter(|estimate| estimate.dead_reckoned).count()
    }

    /// The matrix of the accelerometer at the end, if it was estimated: the sensor is not calibrated, or has not shown yet that it is.
    pub fn accel_matrix(&self) -> Option<Matrix3<f64>> {
        let is_estimated = self.calibration.accel_matrix_sigma.amax() > 0.0;
        is_estimated.then_some(self.calibration.accel_matrix)
    }

    /// The trajectories of the segments, each in its own world.
    ///
    /// # Errors
    /// As [`Segment::trajectory`].
    pub fn trajectories(&self) -> Result<Vec<Trajectory>, Error> {
        self.segments.iter().map(Segment::trajectory).collect()
    }
}

/// Runs the odometry over a recording: samples and frames by rising stamps, each read when it is due.
///
/// ```
/// use vio_ekf::run::{RecordedFrame, run_recording};
/// use vio_ekf::sim::{RoomSettings, Scenario, SimulatedCamera, Simulation, camera_ahead, painting_flight};
/// use vio_ekf::{ImuNoise, Settings, Vio};
///
/// let cameras = vec![SimulatedCamera { camera: camera_ahead(), ..SimulatedCamera::default() }];
/// let room = RoomSettings { texture_size: 512, ..RoomSettings::default() };
/// let flight = Simulation::new(painting_flight(1, 3.0)?, Scenario { cameras, room, ..Scenario::default() })?;
/// let frames = flight.frames(0).flatten().map(|frame| RecordedFrame::single(frame.stamp, frame));
/// let vio = Vio::new(camera_ahead(), ImuNoise::default(), Settings::default())?;
/// let run = run_recording(vio, flight.imu(0)?.samples, frames)?;
/// assert!(run.lost.is_empty() && run.segments[0].trajectory()?.path_length() > 0.1);
/// # Ok::<(), vio_ekf::Error>(())
/// ```
///
/// # Errors
/// As [`Runner::imu`], [`Runner::frame`] and [`Runner::finish`].
pub fn run_recording<P: Picture>(
    vio: Vio,
    samples: impl IntoIterator<Item = Imu>,
    frames: impl IntoIterator<Item = RecordedFrame<P>>,
) -> Result<Run, Error> {
    let (mut runner, mut samples) = (Runner::new(vio, RunnerSettings::default()), samples.into_iter());
    for frame in frames {
        if frame.picture.is_ok() {
            runner.imu_until(frame.stamp, &mut samples)?;
        }
        runner.frame(&frame)?;
    }
    runner.finish()
}
