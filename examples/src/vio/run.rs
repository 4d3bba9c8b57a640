//! The run: images decoded beside the filter, progress, and processor times around the library's runner.

use std::sync::mpsc::sync_channel;

use cpu_time::ThreadTime;
use vio_ekf::format::calibration::{CameraCalibration, ImuCalibration};
use vio_ekf::run::{Picture, RecordedFrame, Run, Runner, RunnerSettings};
use vio_ekf::{Error, Imu, ImuNoise, Settings, Vio};

use super::camera_frames::camera_frames;
use super::error::VioError;
use super::grey_image::GreyImage;
use super::recording::Recording;
use crate::progress::Stage;

/// Images that wait for the filter when they are decoded beside it.
const DECODE_QUEUE: usize = 4;

/// How a recording is run.
#[derive(Debug, Clone, Copy, Default)]
pub struct RunSettings {
    /// The filter.
    pub filter: Settings,
    /// Inertial noise instead of the recording's own.
    pub noise: Option<ImuNoise>,
    /// 1: everything on one thread; otherwise images are decoded on a second one. The results do not depend on it.
    pub threads: usize,
    /// Whether no progress is shown.
    pub quiet: bool,
}

/// What came of a recording, and what it cost.
#[derive(Debug, Clone)]
pub struct TimedRun {
    /// What came of it.
    pub run: Run,
    /// Processor time of each image while running, s.
    pub frame_s: Vec<f64>,
    /// Processor time of an inertial sample with its output and covariance, s: the mean between two images, for each.
    pub imu_s: Vec<f64>,
}

/// The filter of a recording, before the run; with the second camera if that is wanted and there.
///
/// # Errors
/// [`VioError::Library`] if camera, noise or settings cannot be.
pub(super) fn filter(recording: &Recording, settings: &RunSettings, stereo: bool) -> Result<Vio, VioError> {
    let first = recording.camera;
    let second = recording.second.as_ref().filter(|_| stereo);
    // Both images of a pair carry one stamp.
    let second = second.map(|second| CameraCalibration { camera: second.camera, ..first });
    let cameras: Vec<CameraCalibration> = std::iter::once(first).chain(second).collect();
    let imu = ImuCalibration { noise: settings.noise.unwrap_or(recording.imu.noise), ..recording.imu };
    let mut vio = Vio::from_calibration(&cameras, &imu, settings.filter)?;
    if let Some(mask) = &recording.mask {
        vio.set_mask(&mask.view())?;
    }
    Ok(vio)
}

/// Runs the filter over a recording.
///
/// # Errors
/// [`VioError`] if the recording cannot be used, or the filter never starts.
pub fn run(recording: &Recording, settings: &RunSettings) -> Result<TimedRun, VioError> {
    let mut runner = TimedRunner {
        // The calibration is checked beside the run, so that the times of images are those of one filter.
        runner: Runner::new(
            filter(recording, settings, true)?,
            RunnerSettings { watch_calibration: false, ..RunnerSettings::default() },
        ),
        samples: recording.samples.iter(),
        frame_s: Vec::new(),
        imu_s: Vec::new(),
    };
    let stage = (!settings.quiet).then(|| Stage::start("odometry"));
    let total = recording.images.count().max(1) as f64;
    let mut seen = 0.0;
    let mut each = |frame: RecordedFrame<GreyImage>| {
        seen += 1.0;
        if let Some(stage) = &stage {
            stage.share(seen / total);
        }
        runner.frame(&frame)
    };
    let done = if settings.threads < 2 {
        camera_frames(recording).try_for_each(&mut each)
    } else {
        std::thread::scope(|scope| {
            let (sender, receiver) = sync_channel(DECODE_QUEUE);
            // Ends by itself when the receiver is dropped.
            scope.spawn(move || camera_frames(recording).try_for_each(|frame| sender.send(frame)));
            receiver.into_iter().try_for_each(&mut each)
        })
    };
    let unusable = |error: Error| match error {
        Error::ImageSize { .. } | Error::NoImage { .. } | Error::NoSecondImage { .. } => {
            VioError::Pictures { recording: recording.name.clone(), why: error.to_string() }
        }
        Error::NeverStarted { .. } => VioError::Unusable { recording: recording.name.clone(), why: error.to_string() },
        error => error.into(),
    };
    let run = done.and_then(|()| runner.runner.finish()).map_err(unusable)?;
    if let Some(stage) = stage {
        let poses = run.poses();
        stage.done(&format!("{poses} poses of {} images, {} left out", run.frames, run.skipped.len()));
    }
    Ok(TimedRun { run, frame_s: runner.frame_s, imu_s: runner.imu_s })
}

struct TimedRunner<'a> {
    runner: Runner,
    samples: std::slice::Iter<'a, Imu>,
    frame_s: Vec<f64>,
    imu_s: Vec<f64>,
}

impl TimedRunner<'_> {
    /// An image, after the samples that come before it.
    fn frame(&mut self, frame: &RecordedFrame<GreyImage>) -> Result<(), Error> {
        if frame.picture.is_ok() {
            self.imu_until(frame)?;
        }
        let began = ThreadTime::now();
        if self.runner.frame(frame)?.odometry.is_some() {
            self.frame_s.push(began.elapsed().as_secs_f64());
        }
        Ok(())
    }

    /// As [`Runner::imu_until`], with the estimate after each sample.
    fn imu_until(&mut self, frame: &RecordedFrame<GreyImage>) -> Result<(), Error> {
        let time = self.runner.imu_time(frame.stamp);
        let (began, mut count) = (ThreadTime::now(), 0);
        while self.runner.latest_sample().is_none_or(|latest| latest < time) {
            let Some(sample) = self.samples.next() else { break };
            self.runner.imu(sample)?;
            std::hint::black_box(self.runner.output());
            count += 1;
        }
        if count > 0 && self.runner.output().is_some() {
            self.imu_s.push(began.elapsed().as_secs_f64() / f64::from(count));
        }
        Ok(())
    }
}
