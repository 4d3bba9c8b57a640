use nalgebra::Isometry3;

use super::{ImuPair, ImuPairSettings, PoseMeasurement};
use crate::error::invalid;
use crate::{
    Camera, Error, FrameReport, ImageView, Imu, ImuNoise, Odometry, PointObservation, Settings, Stamp, Start, Status,
    Vio,
};

/// Measurements that wait at most.
const WAITING: usize = 64;

/// Settings of [`UnifiedVio`] beside those of its filter.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct UnifiedSettings {
    /// The body's own inertial sensor.
    pub imu: ImuNoise,
    /// A second one, if there is one; `first` is then the body's own and `imu` is not used.
    pub pair: Option<ImuPairSettings>,
    /// Measurements are used when they are this old, s, and may arrive in any order until then; 0.1. As much as the slowest
    /// source needs; zero to use everything as it comes.
    pub lag_s: f64,
    /// Pose of the filter's world in the frame of the poses; identity.
    pub source_from_world: Isometry3<f64>,
    /// Pose of the sensor whose poses are measured, on the body; identity.
    pub body_from_sensor: Isometry3<f64>,
    /// Seconds to add to the stamps of the poses to get the inertial sensor's time; 0.
    pub pose_time_offset_s: f64,
}

impl Default for UnifiedSettings {
    fn default() -> Self {
        Self {
            imu: ImuNoise::default(),
            pair: None,
            lag_s: 0.1,
            source_from_world: Isometry3::identity(),
            body_from_sensor: Isometry3::identity(),
            pose_time_offset_s: 0.0,
        }
    }
}

/// One estimator for all that a robot has: a camera, one or two inertial sensors, and poses from a map.
///
/// There is one state and one covariance, that of [`Vio`]. The inertial sensors are joined by [`ImuPair`] before they get
/// there, images and poses are put in the order of their times. What is late by less than `lag_s` changes the estimate by
/// not a single bit; the output is nevertheless of the latest inertial sample.
///
/// Nothing of it is in the way of a caller who has all in order: [`Vio::imu`], [`Vio::image`] and [`Vio::pose`] are the
/// same filter.
#[derive(Debug, Clone)]
pub struct UnifiedVio {
    vio: Vio,
    pair: Option<ImuPair>,
    settings: UnifiedSettings,
    /// Seconds to add to the camera's stamps, as far as the order of measurements goes.
    camera_offset: i64,
    /// In order of time.
    waiting: Vec<Waiting>,
    pictures: Vec<Vec<u8>>,
    sights: Vec<Vec<PointObservation>>,
    frame: Option<FrameReport>,
    tally: Tally,
}

/// What has become of the measurements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Tally {
    /// Images, or sets of points, that the filter has taken.
    pub images: usize,
    /// Poses that were used.
    pub poses: usize,
    /// Poses that contradicted the estimate.
    pub poses_refused: usize,
    /// Measurements that the filter could not place, because they were older than others that it had taken.
    pub late: usize,
}

#[derive(Debug, Clone)]
struct Waiting {
    /// Time by the inertial sensor's clock; images before poses.
    place: (Stamp, bool),
    what: What,
}

#[derive(Debug, Clone)]
#[allow(clippy::large_enum_variant, reason = "a box would claim memory for every pose")]
enum What {
    Image(Stamp, Vec<u8>),
    Points(Stamp, Vec<PointObservation>),
    Pose(PoseMeasurement),
}

impl UnifiedVio {
    /// Refuses a camera or settings that cannot be.
    pub fn new(camera: Camera, vio: Settings, settings: UnifiedSettings) -> Result<Self, Error> {
        if !(0.0..=1.0).contains(&settings.lag_s) {
            return Err(invalid("lag_s", settings.lag_s, "must be between 0 and 1 s"));
        }
        if settings.pose_time_offset_s.is_nan() || settings.pose_time_offset_s.abs() > 10.0 {
            return Err(invalid("pose_time_offset_s", settings.pose_time_offset_s, "must be below 10 s"));
        }
        for (pose, what) in
            [(&settings.source_from_world, "source_from_world"), (&settings.body_from_sensor, "body_from_sensor")]
        {
            if !crate::trajectory::is_finite(pose) {
                return Err(Error::NonFinite { what, index: 0 });
            }
        }
        let pair = settings.pair.map(ImuPair::new).transpose()?;
        let noise = pair.as_ref().map_or(settings.imu, ImuPair::noise);
        Ok(Self {
            vio: Vio::new(camera, noise, vio)?,
            pair,
            settings,
            camera_offset: nanos(vio.calibration.time_offset_s),
            waiting: Vec::with_capacity(WAITING + 1),
            pictures: Vec::new(),
            sights: Vec::new(),
            frame: None,
            tally: Tally::default(),
        })
    }

    /// The filter.
    pub fn vio(&self) -> &Vio {
        &self.vio
    }

    /// Starts, or starts again, from a given state; its biases are those of the pair where there are two sensors.
    pub fn start(&mut self, start: &Start) -> Result<(), Error> {
        self.vio.start(start)
    }

    /// Takes a sample of the body's own inertial sensor, and uses the measurements that have become old enough.
    pub fn imu(&mut self, sample: &Imu) -> Result<Status, Error> {
        match &mut self.pair {
            Some(pair) => {
                pair.first(sample)?;
                self.go_on()
            }
            None => self.inertial(sample),
        }
    }

    /// Takes a sample of the second inertial sensor, in its own axes.
    pub fn second_imu(&mut self, sample: &Imu) -> Result<Status, Error> {
        let Some(pair) = &mut self.pair else {
            return Err(Error::NoSuch { what: "inertial sensor", index: 1, count: 1 });
        };
        pair.second(sample)?;
        self.go_on()
    }

    /// Takes an image; see [`Vio::image`].
    pub fn image(&mut self, stamp: Stamp, image: &ImageView) -> Result<(), Error> {
        let expected = (self.vio.camera().width, self.vio.camera().height);
        if (image.width, image.height) != expected {
            return Err(Error::ImageSize { given: (image.width, image.height), expected });
        }
        let image = ImageView::new(image.width, image.height, image.data)?;
        let mut copy = self.pictures.pop().unwrap_or_default();
        copy.clear();
        copy.extend_from_slice(image.data);
        self.wait((later(stamp, self.camera_offset), false), What::Image(stamp, copy));
        Ok(())
    }

    /// Takes the points of a tracker of the caller's own; see [`Vio::points`].
    pub fn points(&mut self, stamp: Stamp, points: &[PointObservation]) -> Result<(), Error> {
        if let Some(index) = points.iter().position(|p| p.pixel.iter().any(|v| !v.is_finite())) {
            return Err(Error::NonFinite { what: "point", index });
        }
        let mut copy = self.sights.pop().unwrap_or_default();
        copy.clear();
        copy.extend_from_slice(points);
        self.wait((later(stamp, self.camera_offset), false), What::Points(stamp, copy));
        Ok(())
    }

    /// Takes a pose of the source's sensor in the source's frame; `source` is not used.
    pub fn pose(&mut self, pose: &PoseMeasurement) -> Result<(), Error> {
        pose.whitener()?;
        let mut body = pose.of_body(&self.settings.source_from_world, &self.settings.body_from_sensor);
        body.stamp = later(pose.stamp, nanos(self.settings.pose_time_offset_s));
        self.wait((body.stamp, true), What::Pose(body));
        Ok(())
    }

    /// The estimate at the time of the latest inertial sample; `None` before the start.
    pub fn output(&self) -> Option<Odometry> {
        self.vio.output()
    }

    /// What has become of the measurements so far.
    pub fn tally(&self) -> Tally {
        self.tally
    }

    /// What the latest image did; `None` before the first.
    pub fn frame(&self) -> Option<FrameReport> {
        self.frame
    }

    fn go_on(&mut self) -> Result<Status, Error> {
        while let Some(sample) = self.pair.as_mut().and_then(ImuPair::read) {
            self.inertial(&sample)?;
        }
        Ok(self.vio.status())
    }

    fn inertial(&mut self, sample: &Imu) -> Result<Status, Error> {
        self.vio.imu(sample)?;
        let old = later(sample.stamp, -nanos(self.settings.lag_s));
        while self.waiting.first().is_some_and(|waiting| waiting.place.0 <= old) {
            self.use_first();
        }
        Ok(self.vio.status())
    }

    /// Puts a measurement in its place. If too many wait, the oldest is used now.
    fn wait(&mut self, place: (Stamp, bool), what: What) {
        if self.waiting.len() >= WAITING {
            self.use_first();
        }
        let index = self.waiting.partition_point(|waiting| waiting.place <= place);
        self.waiting.insert(index, Waiting { place, what });
    }

    fn use_first(&mut self) {
        let Waiting { what, .. } = self.waiting.remove(0);
        let frame = match what {
            What::Image(stamp, data) => {
                let (width, height) = (self.vio.camera().width, self.vio.camera().height);
                let report = self.vio.image(stamp, &ImageView { width, height, data: &data });
                self.pictures.push(data);
                report
            }
            What::Points(stamp, points) => {
                let report = self.vio.points(stamp, &points);
                self.sights.push(points);
                report
            }
            What::Pose(pose) => {
                match self.vio.pose(&pose) {
                    Ok(true) => self.tally.poses += 1,
                    Ok(false) => self.tally.poses_refused += 1,
                    Err(_) => self.tally.late += 1,
                }
                return;
            }
        };
        match frame {
            Ok(report) => {
                self.frame = Some(report);
                self.tally.images += 1;
            }
            // All else was checked when it came.
            Err(_) => self.tally.late += 1,
        }
    }
}

fn nanos(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}

fn later(stamp: Stamp, nanos: i64) -> Stamp {
    Stamp::from_nanos(stamp.nanos().saturating_add(nanos))
}
