//! A recording, run in one call.

use crate::error::Error;
use crate::filter::vio::Vio;
use crate::run::frames::{Picture, RecordedFrame};
use crate::run::runner::{Runner, RunnerSettings};
use crate::run::summary::Run;
use crate::samples::Imu;

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
