//! The run: samples and images in the order of their stamps, and what the filter made of them.

mod status_text;

use std::sync::mpsc::sync_channel;
use std::time::Duration;

use cpu_time::ThreadTime;
use vio_ekf::calibration::{CameraCalibration, ImuCalibration};
use vio_ekf::nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use vio_ekf::{Calibration, Error, FrameReport, ImuNoise, Odometry, Settings, Stamp, Status, Trajectory, Vio};

use super::camera_frames::{CameraFrame, camera_frames};
use super::error::VioError;
use super::recording::Recording;
use crate::progress::Stage;
use status_text::{divergence_text, initialization_text};

/// Images that wait for the filter when they are decoded beside it.
const DECODE_QUEUE: usize = 4;
/// A gap in the inertial samples, s, after which the motion cannot be carried on.
const MAX_IMU_GAP: f64 = 0.5;

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

/// A stretch without interruption. After each interruption the filter starts anew, in a world of its own: place and heading of
/// one segment say nothing about those of another.
#[derive(Debug, Clone, Default)]
pub struct Segment {
    /// The estimate after each image, stamps strictly increasing.
    pub odometry: Vec<Odometry>,
    /// Landmarks used with each image.
    pub used: Vec<usize>,
    /// Whether each estimate comes from inertial samples alone.
    pub dead_reckoned: Vec<bool>,
}

/// What came of a recording.
#[derive(Debug, Clone)]
pub struct Run {
    /// The stretches, in order; at least one, none of them empty.
    pub segments: Vec<Segment>,
    /// First and last stamp of the recording's images.
    pub images_span: (Stamp, Stamp),
    /// Images that the filter took.
    pub frames: usize,
    /// Those among them that came with one of the second camera.
    pub pairs: usize,
    /// Images that it could not take, with the reason.
    pub skipped: Vec<String>,
    /// Inertial samples that it took.
    pub imu_samples: usize,
    /// Seconds from the first image to the first estimate.
    pub initialization_time_s: f64,
    /// Why and when it gave up, each time.
    pub lost: Vec<(Stamp, String)>,
    /// Poses that were taken back, and are in no segment: of starts that turned out to be wrong, and those before a divergence with
    /// which the measurements disagreed already.
    pub withdrawn: usize,
    /// Whether it runs at the end.
    pub tracking_at_end: bool,
    /// The camera's calibration at the end.
    pub calibration: Calibration,
    /// Processor time of each image while running, s.
    pub frame_s: Vec<f64>,
    /// Processor time of an inertial sample with its output and covariance, s: the mean between two images, for each.
    pub imu_s: Vec<f64>,
}

/// Runs the filter over a recording.
///
/// # Errors
/// [`VioError`] if the recording cannot be used, or the filter never starts.
pub fn run(recording: &Recording, settings: &RunSettings) -> Result<Run, VioError> {
    let mut runner = FilterRunner::new(recording, settings)?;
    let stage = (!settings.quiet).then(|| Stage::start("odometry"));
    let total = recording.images.count().max(1) as f64;
    let mut seen = 0.0;
    let mut each = |frame: CameraFrame| {
        seen += 1.0;
        if let Some(stage) = &stage {
            stage.share(seen / total);
        }
        runner.camera_frame(frame)
    };
    if settings.threads < 2 {
        camera_frames(recording).try_for_each(&mut each)?;
    } else {
        std::thread::scope(|scope| {
            let (sender, receiver) = sync_channel(DECODE_QUEUE);
            // Ends by itself when the receiver is dropped.
            scope.spawn(move || camera_frames(recording).try_for_each(|frame| sender.send(frame)));
            receiver.into_iter().try_for_each(&mut each)
        })?;
    }
    let run = runner.finish()?;
    if let Some(stage) = stage {
        let poses = run.poses();
        stage.done(&format!("{poses} poses of {} images, {} left out", run.frames, run.skipped.len()));
    }
    Ok(run)
}

struct FilterRunner<'a> {
    recording: &'a Recording,
    vio: Vio,
    /// Index of the next inertial sample.
    next: usize,
    segments: Vec<Segment>,
    /// Whether the last segment goes on.
    segment_open: bool,
    withdrawn: usize,
    frames: usize,
    pairs: usize,
    skipped: Vec<String>,
    first_image: Option<Stamp>,
    last_image: Option<Stamp>,
    lost: Vec<(Stamp, String)>,
    frame_s: Vec<f64>,
    imu_s: Vec<f64>,
    calibration: Option<Calibration>,
}

impl<'a> FilterRunner<'a> {
    fn new(recording: &'a Recording, settings: &RunSettings) -> Result<Self, VioError> {
        let first = recording.camera;
        // Both images of a pair carry one stamp.
        let second = recording.second.as_ref().map(|second| CameraCalibration { camera: second.camera, ..first });
        let cameras: Vec<CameraCalibration> = std::iter::once(first).chain(second).collect();
        let imu = ImuCalibration { noise: settings.noise.unwrap_or(recording.imu.noise), ..recording.imu };
        let mut vio = Vio::from_calibration(&cameras, &imu, settings.filter)?;
        if let Some(mask) = &recording.mask {
            vio.set_mask(&mask.view())?;
        }
        Ok(Self {
            recording,
            vio,
            next: 0,
            segments: Vec::new(),
            segment_open: false,
            withdrawn: 0,
            frames: 0,
            pairs: 0,
            skipped: Vec::new(),
            first_image: None,
            last_image: None,
            lost: Vec::new(),
            frame_s: Vec::new(),
            imu_s: Vec::new(),
            calibration: None,
        })
    }

    /// An image, after the samples that come before it.
    fn camera_frame(&mut self, CameraFrame { stamp, picture, second }: CameraFrame) -> Result<(), VioError> {
        let picture = match picture {
            Ok(picture) => picture,
            Err(why) => {
                self.skip(why);
                return Ok(());
            }
        };
        let expected = self.recording.camera.camera;
        if (picture.width, picture.height) != (expected.width, expected.height) {
            let given = (picture.width, picture.height);
            let why = Error::ImageSize { given, expected: (expected.width, expected.height) }.to_string();
            // The first image decides whether it is the calibration that is wrong, or one picture.
            if self.frames == 0 {
                return Err(VioError::Unusable { recording: self.recording.name.clone(), why });
            }
            self.skip(format!("image of {stamp} s: {why}"));
            return Ok(());
        }
        if self.last_image.is_some_and(|last| stamp <= last) {
            self.skip(format!("image of {stamp} s: another one of that time or later came before it"));
            return Ok(());
        }
        let second = second.and_then(|second| second.map_err(|why| self.skip(why)).ok());
        self.feed_until(stamp)?;
        let began = ThreadTime::now();
        let taken = match &second {
            Some(second) => self.vio.image_pair(stamp, &picture.view(), &second.view()),
            None => self.vio.image(stamp, &picture.view()),
        };
        let report = match taken {
            Ok(report) => report,
            // Before the first sample, or after the last one.
            Err(error @ (Error::Late { .. } | Error::OutOfRange { .. })) => {
                self.skip(format!("image of {stamp} s: {error}"));
                return Ok(());
            }
            Err(error) => return Err(error.into()),
        };
        let elapsed = began.elapsed();
        self.frames += 1;
        self.pairs += usize::from(second.is_some());
        self.first_image.get_or_insert(stamp);
        self.last_image = Some(stamp);
        match report.status {
            Status::Tracking | Status::DeadReckoning => {
                self.record_estimate(&report, elapsed);
            }
            Status::Diverged(cause) => {
                self.withdraw(report.consecutive_outliers as usize);
                self.end_segment(stamp, divergence_text(cause));
            }
            // The start in motion was wrong, and so is all that came of it.
            Status::Uninitialised(_) if self.segment_open => {
                self.withdraw(usize::MAX);
                self.segment_open = false;
            }
            Status::Uninitialised(_) => {}
        }
        Ok(())
    }

    fn skip(&mut self, why: String) {
        self.skipped.push(why);
    }

    /// Feeds the samples up to the first one that is not before the image.
    fn feed_until(&mut self, stamp: Stamp) -> Result<(), VioError> {
        let samples = &self.recording.samples;
        let offset = self.vio.calibration().map_or(self.recording.camera.time_offset_s, |c| c.time_offset_s);
        let time = stamp.nanos().saturating_add((offset * 1e9).round() as i64);
        let from = self.next;
        let began = ThreadTime::now();
        while let Some(sample) = samples.get(self.next) {
            if self.next > 0 && samples[self.next - 1].stamp.nanos() >= time {
                break;
            }
            if self.next > 0 && self.vio.output().is_some() {
                let gap = sample.stamp.secs_since(samples[self.next - 1].stamp);
                if gap > MAX_IMU_GAP {
                    self.end_segment(sample.stamp, format!("{gap:.2} s without inertial samples"));
                }
            }
            self.vio.imu(sample)?;
            std::hint::black_box(self.vio.output());
            self.next += 1;
        }
        let count = self.next - from;
        if count > 0 && self.vio.output().is_some() {
            self.imu_s.push(began.elapsed().as_secs_f64() / count as f64);
        }
        Ok(())
    }

    /// Remembers the estimate.
    fn record_estimate(&mut self, report: &FrameReport, elapsed: Duration) {
        let Some(odometry) = self.vio.output() else { return };
        if !std::mem::replace(&mut self.segment_open, true) {
            self.segments.push(Segment::default());
        }
        let Some(segment) = self.segments.last_mut() else { return };
        if segment.odometry.last().is_none_or(|last| last.stamp < odometry.stamp) {
            segment.odometry.push(odometry);
            segment.used.push(report.used);
            segment.dead_reckoned.push(report.status == Status::DeadReckoning);
        }
        self.frame_s.push(elapsed.as_secs_f64());
        self.calibration = self.vio.calibration();
    }

    /// Takes back the last poses of the open segment.
    fn withdraw(&mut self, count: usize) {
        let Some(segment) = self.segments.last_mut().filter(|_| self.segment_open) else { return };
        let left = segment.odometry.len().saturating_sub(count);
        self.withdrawn += segment.odometry.len() - left;
        segment.odometry.truncate(left);
        segment.used.truncate(left);
        segment.dead_reckoned.truncate(left);
    }

    fn end_segment(&mut self, stamp: Stamp, why: String) {
        self.lost.push((stamp, why));
        self.segment_open = false;
        self.vio.reset();
    }

    fn finish(self) -> Result<Run, VioError> {
        let unusable = |why: String| VioError::Unusable { recording: self.recording.name.clone(), why };
        if self.frames == 0 {
            let first = self.skipped.first().map_or("there is none", String::as_str);
            let count = self.recording.images.count();
            return Err(unusable(format!("none of the {count} images could be used; the first: {first}")));
        }
        if self.recording.second.is_some() && self.pairs == 0 {
            let first = self.skipped.first().map_or("their stamps are not those of the first camera's", String::as_str);
            return Err(unusable(format!("no image of the second camera could be used; the first: {first}")));
        }
        let segments: Vec<Segment> = self.segments.into_iter().filter(|s| !s.odometry.is_empty()).collect();
        let (Some(first), Some(calibration)) = (segments.first(), self.calibration) else {
            let why = self.lost.last().map_or(initialization_text(self.vio.status()), |(_, why)| why.clone());
            return Err(unusable(format!("the odometry never started: {why}")));
        };
        let began = self.first_image.unwrap_or(first.odometry[0].stamp);
        Ok(Run {
            images_span: self.recording.images.span().unwrap_or((began, began)),
            initialization_time_s: first.odometry[0].stamp.secs_since(began).max(0.0),
            frames: self.frames,
            pairs: self.pairs,
            skipped: self.skipped,
            imu_samples: self.next,
            lost: self.lost,
            withdrawn: self.withdrawn,
            tracking_at_end: self.vio.status().has_estimate(),
            calibration,
            frame_s: self.frame_s,
            imu_s: self.imu_s,
            segments,
        })
    }
}

impl Segment {
    /// Its poses, in its own world.
    ///
    /// # Errors
    /// [`VioError::Library`] if the filter gave poses that are not finite.
    pub fn trajectory(&self) -> Result<Trajectory, VioError> {
        let mut trajectory = Trajectory::default();
        for odometry in &self.odometry {
            trajectory.push(odometry.stamp, odometry.world_from_body)?;
        }
        Ok(trajectory)
    }
}

impl Run {
    /// Poses of all segments.
    pub fn poses(&self) -> usize {
        self.segments.iter().map(|segment| segment.odometry.len()).sum()
    }

    /// Poses that come from inertial samples alone.
    pub fn dead_reckoned(&self) -> usize {
        self.segments.iter().flat_map(|segment| &segment.dead_reckoned).filter(|&&dead| dead).count()
    }

    /// The matrix of the accelerometer at the end, if it was estimated: the sensor is not calibrated, or has not shown yet that it is.
    pub fn accel_matrix(&self) -> Option<Matrix3<f64>> {
        let is_estimated = self.calibration.accel_matrix_sigma.amax() > 0.0;
        is_estimated.then_some(self.calibration.accel_matrix)
    }

    /// The trajectories of the segments, each in its own world.
    ///
    /// # Errors
    /// [`VioError::Library`] if the filter gave poses that are not finite.
    pub fn trajectories(&self) -> Result<Vec<Trajectory>, VioError> {
        self.segments.iter().map(Segment::trajectory).collect()
    }
}

/// The shift and the turn about the vertical that take one pose to the place and heading of another.
pub(super) fn heading_onto(target: &Isometry3<f64>, from: &Isometry3<f64>) -> Isometry3<f64> {
    // The turn about z that is nearest to the rotation between both.
    let q = (target.rotation * from.rotation.inverse()).into_inner();
    let yaw = 2.0 * q.k.atan2(q.w);
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
    Isometry3::from_parts(Translation3::from(target.translation.vector - turn * from.translation.vector), turn)
}
