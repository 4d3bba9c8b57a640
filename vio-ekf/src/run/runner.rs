//! Sample by sample and image by image: start, withdrawal, loss and restart.

use crate::error::Error;
use crate::filter::report::{Calibration, FrameReport, Status};
use crate::filter::vio::Vio;
use crate::inertial::odometry::Odometry;
use crate::run::calibration_doubt::CalibrationDoubt;
use crate::run::calibration_watch::CalibrationWatch;
use crate::run::frames::{Picture, RecordedFrame};
use crate::run::outcome::{Event, ImageOutcome, Loss, LossReason, SkipReason, SkippedImage};
use crate::run::segments::{Estimate, Segments};
use crate::run::summary::Run;
use crate::samples::{ImageView, Imu};
use crate::stamp::Stamp;

/// What is done beside the filter.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct RunnerSettings {
    /// A gap in the inertial samples, s, after which the motion cannot be carried on.
    pub max_imu_gap_s: f64,
    /// Whether estimates, losses and skipped images are kept for [`Runner::finish`]. They take 2 kB an image: a robot that runs for days
    /// needs the events only.
    pub keep_history: bool,
    /// Whether a second filter beside the first, which knows the calibration roughly only, tests it over the first twenty seconds of
    /// motion. These take three times the processor time. Where something is doubted, filters with all and with parts of it follow the next
    /// ten seconds, too: as many as twice its parts.
    pub watch_calibration: bool,
}

impl Default for RunnerSettings {
    fn default() -> Self {
        Self { max_imu_gap_s: 0.5, keep_history: true, watch_calibration: true }
    }
}

/// The odometry of a robot: restarts the filter after a loss, and takes back poses that turn out to be wrong.
///
/// Without files or threads of its own; what happens is told by values. Samples and images come in the order of their arrival. An
/// image is best given when the samples have reached its time ([`imu_time`](Self::imu_time)); the filter waits for none.
///
/// ```
/// use vio_ekf::run::{Event, Runner, RunnerSettings};
/// use vio_ekf::{Camera, ImageView, Imu, ImuNoise, Settings, Stamp, Vio};
///
/// let vio = Vio::new(Camera::euroc(), ImuNoise::default(), Settings::default())?;
/// let mut runner = Runner::new(vio, RunnerSettings::default());
/// // At rest before a wall of tiles.
/// let bright = |k: usize| k % 752 % 60 < 30 && k / 752 % 60 < 30;
/// let picture: Vec<u8> = (0..752 * 480).map(|k| if bright(k) { 180 } else { 60 }).collect();
/// let mut events = Vec::new();
/// for k in 0..400 {
///     let stamp = Stamp::from_nanos(k * 5_000_000);
///     events.extend(runner.imu(&Imu { stamp, gyro: [0.0; 3].into(), accel: [0.0, 0.0, 9.81].into() })?);
///     if k % 10 == 0 {
///         events.extend(runner.image(stamp, &ImageView::new(752, 480, &picture)?)?.events);
///     }
/// }
/// assert_eq!(events, [Event::Started]);
/// let run = runner.finish()?;
/// assert_eq!((run.segments.len(), run.lost.len()), (1, 0));
/// # Ok::<(), vio_ekf::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Runner {
    vio: Vio,
    watch: Option<CalibrationWatch>,
    doubt: Option<CalibrationDoubt>,
    settings: RunnerSettings,
    latest_sample: Option<Stamp>,
    latest_image: Option<Stamp>,
    segments: Segments,
    lost: Vec<Loss>,
    skipped: Vec<SkippedImage>,
    calibration: Option<Calibration>,
    imu_samples: usize,
    frames: usize,
    pairs: usize,
    /// Images of the first camera that were offered, taken or not.
    offered: usize,
    /// First and last stamp of these.
    span: Option<(Stamp, Stamp)>,
    /// Stamp of the first image that was taken.
    first_image: Option<Stamp>,
}

impl Runner {
    /// Around a filter that has not started yet.
    pub fn new(vio: Vio, settings: RunnerSettings) -> Self {
        Self {
            watch: CalibrationWatch::beside(&vio).filter(|_| settings.watch_calibration),
            doubt: None,
            vio,
            settings,
            latest_sample: None,
            latest_image: None,
            segments: Segments::new(settings.keep_history),
            lost: Vec::new(),
            skipped: Vec::new(),
            calibration: None,
            imu_samples: 0,
            frames: 0,
            pairs: 0,
            offered: 0,
            span: None,
            first_image: None,
        }
    }

    /// The filter.
    pub fn vio(&self) -> &Vio {
        &self.vio
    }

    /// The estimate at the time of the latest sample; `None` before the start and after a loss.
    pub fn output(&self) -> Option<Odometry> {
        self.vio.output().filter(|_| self.vio.status().has_estimate())
    }

    /// Time of the latest sample.
    pub fn latest_sample(&self) -> Option<Stamp> {
        self.latest_sample
    }

    /// The time of an image by the inertial sensor's clock, as far as the offset between both clocks is known.
    pub fn imu_time(&self, stamp: Stamp) -> Stamp {
        stamp.plus_secs(self.vio.time_offset_s())
    }

    /// Takes an inertial sample. After a gap the filter is [lost](Event::Lost) and starts anew.
    ///
    /// # Errors
    /// [`Error`]: a stamp that is not after the one before, numbers that are not finite. The sample is then left out.
    pub fn imu(&mut self, sample: &Imu) -> Result<Option<Event>, Error> {
        // A broken sample must not end a segment.
        sample.check_after(None)?;
        let gap_s = self.latest_sample.map_or(0.0, |before| sample.stamp.secs_since(before));
        let interrupts = gap_s > self.settings.max_imu_gap_s && self.vio.output().is_some();
        let event = interrupts.then(|| self.end_segment(sample.stamp, LossReason::ImuGap { gap_s }));
        self.vio.imu(sample)?;
        if let Some(watch) = &mut self.watch {
            watch.imu(sample);
        }
        self.latest_sample = Some(sample.stamp);
        self.imu_samples += 1;
        Ok(event)
    }

    /// Takes samples until one is not before an image: what a recording needs between two images.
    ///
    /// # Errors
    /// As [`imu`](Self::imu).
    pub fn imu_until(&mut self, stamp: Stamp, samples: &mut impl Iterator<Item = Imu>) -> Result<Option<Event>, Error> {
        let (time, mut event) = (self.imu_time(stamp), None);
        while self.latest_sample.is_none_or(|latest| latest < time) {
            let Some(sample) = samples.next() else { break };
            event = self.imu(&sample)?.or(event);
        }
        Ok(event)
    }

    /// Takes an image; `stamp` is the middle of its exposure by the camera's clock.
    ///
    /// Images that come too late, too early or out of order are skipped, and so are those of another size once one was right.
    ///
    /// # Errors
    /// [`Error::ImageSize`] if the first image is not of the camera's size: then it is the calibration that is wrong.
    pub fn image(&mut self, stamp: Stamp, image: &ImageView) -> Result<ImageOutcome, Error> {
        let mut outcome = self.take(stamp, image.width, image.height, |vio| vio.image(stamp, image))?;
        if outcome.report.is_some() {
            outcome.events.extend(self.watch_calibration(stamp, image, None));
        }
        Ok(outcome)
    }

    /// Takes the images that both cameras took at the same moment.
    ///
    /// # Errors
    /// As [`image`](Self::image), and [`Error::NoSuch`] if the filter has no second camera. A second image of another size is an error
    /// always: give the first alone.
    pub fn image_pair(&mut self, stamp: Stamp, first: &ImageView, second: &ImageView) -> Result<ImageOutcome, Error> {
        let frames = self.frames;
        let mut outcome = self.take(stamp, first.width, first.height, |vio| vio.image_pair(stamp, first, second))?;
        if outcome.report.is_some() {
            outcome.events.extend(self.watch_calibration(stamp, first, Some(second)));
        }
        self.pairs += self.frames - frames;
        Ok(outcome)
    }

    /// Takes what a recording has at one time; images that cannot be read are skipped, and a first one is used without its second.
    ///
    /// # Errors
    /// As [`image_pair`](Self::image_pair).
    pub fn frame(&mut self, frame: &RecordedFrame<impl Picture>) -> Result<ImageOutcome, Error> {
        let RecordedFrame { stamp, picture, second } = frame;
        let picture = match picture {
            Ok(picture) => picture.view(),
            Err(why) => return Ok(self.skipped_image(*stamp, SkipReason::Unreadable(why.clone()))),
        };
        match second {
            Some(Ok(second)) => self.image_pair(*stamp, &picture, &second.view()),
            None => self.image(*stamp, &picture),
            Some(Err(why)) => {
                let skip = self.skip(*stamp, SkipReason::Unreadable(why.clone()));
                let mut outcome = self.image(*stamp, &picture)?;
                outcome.events.insert(0, skip);
                Ok(outcome)
            }
        }
    }

    /// Ends the run.
    ///
    /// # Errors
    /// [`Error::NoImage`], [`Error::NoSecondImage`] and [`Error::NeverStarted`]: there is not a single pose.
    pub fn finish(self) -> Result<Run, Error> {
        let first_skipped = |otherwise: &str| self.skipped.first().map_or(otherwise.into(), ToString::to_string);
        let Some(first_image) = self.first_image else {
            return Err(Error::NoImage { given: self.offered, first: first_skipped("there is none") });
        };
        if self.vio.second_camera().is_ok() && self.pairs == 0 {
            let first = first_skipped("their stamps are not those of the first camera's");
            return Err(Error::NoSecondImage { first });
        }
        let (Some(first_pose), Some(calibration)) = (self.segments.first, self.calibration) else {
            let why = match (self.lost.last(), self.vio.status()) {
                (Some(loss), _) => loss.reason.to_string(),
                (None, Status::Uninitialised(why)) => why.to_string(),
                (None, _) => "no image came after the start".into(),
            };
            return Err(Error::NeverStarted { why });
        };
        let doubt = self.doubt.or_else(|| self.watch?.finish());
        Ok(Run {
            doubt,
            images_span: self.span.unwrap_or((first_image, first_image)),
            initialization_time_s: first_pose.secs_since(first_image).max(0.0),
            frames: self.frames,
            pairs: self.pairs,
            imu_samples: self.imu_samples,
            skipped: self.skipped,
            lost: self.lost,
            withdrawn: self.segments.withdrawn,
            tracking_at_end: self.vio.status().has_estimate(),
            calibration,
            segments: self.segments.into_kept(),
        })
    }

    /// Gives an image to the filter, and does what its status asks for.
    fn take(
        &mut self,
        stamp: Stamp,
        width: usize,
        height: usize,
        give: impl FnOnce(&mut Vio) -> Result<FrameReport, Error>,
    ) -> Result<ImageOutcome, Error> {
        let (given, expected) = ((width, height), self.vio.camera().image_size());
        if given != expected {
            let error = Error::ImageSize { given, expected };
            return if self.frames == 0 {
                Err(error)
            } else {
                Ok(self.skipped_image(stamp, SkipReason::Refused(error)))
            };
        }
        if self.latest_image.is_some_and(|latest| stamp <= latest) {
            return Ok(self.skipped_image(stamp, SkipReason::NotIncreasing));
        }
        let report = match give(&mut self.vio) {
            Ok(report) => report,
            // Before the first sample, or after the last one.
            Err(error @ (Error::Late { .. } | Error::OutOfRange { .. })) => {
                return Ok(self.skipped_image(stamp, SkipReason::Refused(error)));
            }
            Err(error) => return Err(error),
        };
        self.offer(stamp);
        self.frames += 1;
        self.first_image.get_or_insert(stamp);
        self.latest_image = Some(stamp);
        let mut events = Vec::new();
        match report.status {
            Status::Tracking | Status::DeadReckoning => return Ok(self.estimate(report)),
            Status::Diverged(cause) => {
                // What was estimated since the images began to contradict is in doubt.
                let count = report.consecutive_outliers as usize;
                events.extend(self.withdraw(count));
                events.push(self.end_segment(stamp, LossReason::Diverged(cause)));
            }
            // The start in motion was wrong, and so is all that came of it.
            Status::Uninitialised(_) if self.segments.is_open() => events.extend(self.withdraw(usize::MAX)),
            Status::Uninitialised(_) => {}
        }
        Ok(ImageOutcome { report: Some(report), odometry: None, events })
    }

    /// Remembers the estimate.
    fn estimate(&mut self, report: FrameReport) -> ImageOutcome {
        let odometry = self.vio.output();
        let mut events = Vec::new();
        if let Some(odometry) = odometry {
            let dead_reckoned = report.status == Status::DeadReckoning;
            if self.segments.push(&Estimate { odometry, used: report.used, dead_reckoned }) {
                events.push(Event::Started);
            }
            self.calibration = self.vio.calibration();
        }
        ImageOutcome { report: Some(report), odometry, events }
    }

    /// Gives images that were taken to the second filter as well.
    fn watch_calibration(&mut self, stamp: Stamp, first: &ImageView, second: Option<&ImageView>) -> Option<Event> {
        let found = self.watch.as_mut()?.images(stamp, first, second)?;
        self.watch = None;
        self.doubt = found;
        self.doubt.clone().map(|doubt| Event::Doubted(Box::new(doubt)))
    }

    fn withdraw(&mut self, count: usize) -> Option<Event> {
        let poses = self.segments.withdraw(count);
        (poses > 0).then_some(Event::Withdrawn { poses })
    }

    fn end_segment(&mut self, stamp: Stamp, reason: LossReason) -> Event {
        self.segments.withdraw(0);
        self.vio.reset();
        let loss = Loss { stamp, reason };
        if self.settings.keep_history {
            self.lost.push(loss);
        }
        Event::Lost(loss)
    }

    fn skipped_image(&mut self, stamp: Stamp, reason: SkipReason) -> ImageOutcome {
        self.offer(stamp);
        ImageOutcome { report: None, odometry: None, events: vec![self.skip(stamp, reason)] }
    }

    fn skip(&mut self, stamp: Stamp, reason: SkipReason) -> Event {
        let image = SkippedImage { stamp, reason };
        if self.settings.keep_history {
            self.skipped.push(image.clone());
        }
        Event::Skipped(image)
    }

    /// Counts an image of the first camera.
    fn offer(&mut self, stamp: Stamp) {
        self.offered += 1;
        let (first, last) = self.span.unwrap_or((stamp, stamp));
        self.span = Some((first.min(stamp), last.max(stamp)));
    }
}
