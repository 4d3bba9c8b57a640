//! The odometry with one or two inertial sensors and with poses from a map, in order of time.

use nalgebra::{Isometry3, Vector2};

use super::imu_pair::{ImuPair, ImuPairSettings};
use super::pose_measurement::PoseMeasurement;
use crate::camera::model::CameraModel;
use crate::error::Error;
use crate::error::invalid;
use crate::filter::{BodyPose, FrameReport, PointObservation, PointPair, Settings, Status, Vio};
use crate::inertial::initial_state::InitialState;
use crate::inertial::odometry::Odometry;
use crate::samples::{ImageView, Imu, ImuNoise};
use crate::stamp::Stamp;

/// Measurements in the delay buffer at most.
const MAX_PENDING: usize = 64;

/// Settings of [`UnifiedVio`] beside those of its filter.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct UnifiedSettings {
    /// The body's own inertial sensor.
    pub imu: ImuNoise,
    /// A second one, if there is one; `first` is then the body's own and `imu` is not used.
    pub imu_pair: Option<ImuPairSettings>,
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
            imu_pair: None,
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
    pending: Vec<Pending>,
    image_buffers: Vec<Vec<u8>>,
    point_buffers: Vec<Vec<PointObservation>>,
    pair_buffers: Vec<Vec<PointPair>>,
    frame: Option<FrameReport>,
    counts: MeasurementCounts,
}

/// Counts of measurements by their outcome.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MeasurementCounts {
    /// Images, or sets of points, that the filter has taken.
    pub images: usize,
    /// Poses that were used.
    pub poses: usize,
    /// Poses that failed their gate.
    pub poses_rejected: usize,
    /// Measurements that arrived too late: older than others that the filter had taken.
    pub too_late: usize,
}

#[derive(Debug, Clone)]
struct Pending {
    /// Time by the inertial sensor's clock; images before poses.
    order: (Stamp, bool),
    measurement: PendingMeasurement,
}

#[derive(Debug, Clone)]
#[allow(clippy::large_enum_variant, reason = "a box would claim memory for every pose")]
enum PendingMeasurement {
    Image(Stamp, Vec<u8>),
    ImagePair(Stamp, [Vec<u8>; 2]),
    Points(Stamp, Vec<PointObservation>),
    PointPairs(Stamp, Vec<PointPair>),
    Pose(BodyPose),
}

impl UnifiedVio {
    /// Refuses a camera or settings that cannot be.
    pub fn new(camera: impl CameraModel + 'static, vio: Settings, settings: UnifiedSettings) -> Result<Self, Error> {
        Self::around(|noise| Vio::new(camera, noise, vio), &vio, &settings)
    }

    /// The same with a second camera fixed beside the first; see [`Vio::stereo`].
    pub fn stereo(
        first: impl CameraModel + 'static,
        second: impl CameraModel + 'static,
        vio: Settings,
        settings: UnifiedSettings,
    ) -> Result<Self, Error> {
        Self::around(|noise| Vio::stereo(first, second, noise, vio), &vio, &settings)
    }

    fn around(
        filter: impl FnOnce(ImuNoise) -> Result<Vio, Error>,
        vio: &Settings,
        settings: &UnifiedSettings,
    ) -> Result<Self, Error> {
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
        let pair = settings.imu_pair.map(ImuPair::new).transpose()?;
        let noise = pair.as_ref().map_or(settings.imu, ImuPair::noise);
        Ok(Self {
            vio: filter(noise)?,
            pair,
            settings: *settings,
            camera_offset: nanos(vio.calibration.time_offset_s),
            pending: Vec::with_capacity(MAX_PENDING + 1),
            image_buffers: Vec::new(),
            point_buffers: Vec::new(),
            pair_buffers: Vec::new(),
            frame: None,
            counts: MeasurementCounts::default(),
        })
    }

    /// The filter.
    pub fn vio(&self) -> &Vio {
        &self.vio
    }

    /// Initialises, or initialises again, from a given state; its biases are those of the pair where there are two sensors.
    pub fn initialize(&mut self, initial: &InitialState) -> Result<(), Error> {
        self.vio.initialize(initial)
    }

    /// The same from a state of the past; see [`Vio::initialize_past`]. With two sensors there are no such samples to give.
    pub fn initialize_past(&mut self, initial: &InitialState, samples: &[Imu]) -> Result<(), Error> {
        self.vio.initialize_past(initial, samples)
    }

    /// How far away things are where it starts from here on; see [`Vio::expect_distance`].
    pub fn expect_distance(&mut self, distance: f64, share: f64) -> Result<(), Error> {
        self.vio.expect_distance(distance, share)
    }

    /// Takes a sample of the body's own inertial sensor, and uses the measurements that have become old enough.
    pub fn imu(&mut self, sample: &Imu) -> Result<Status, Error> {
        match &mut self.pair {
            Some(pair) => {
                pair.first(sample)?;
                self.drain_pair()
            }
            None => self.process_imu(sample),
        }
    }

    /// Takes a sample of the second inertial sensor, in its own axes.
    pub fn second_imu(&mut self, sample: &Imu) -> Result<Status, Error> {
        let Some(pair) = &mut self.pair else {
            return Err(Error::NoSuch { what: "inertial sensor", index: 1, count: 1 });
        };
        pair.second(sample)?;
        self.drain_pair()
    }

    /// Takes an image; see [`Vio::image`].
    pub fn image(&mut self, stamp: Stamp, image: &ImageView) -> Result<(), Error> {
        let copy = self.copy(&image.checked(self.vio.camera().image_size())?);
        self.enqueue((plus_nanos(stamp, self.camera_offset), false), PendingMeasurement::Image(stamp, copy));
        Ok(())
    }

    /// Takes the images that both cameras took at the same moment; see [`Vio::image_pair`].
    pub fn image_pair(&mut self, stamp: Stamp, first: &ImageView, second: &ImageView) -> Result<(), Error> {
        let expected = self.vio.second_camera()?.image_size();
        let copies =
            [self.copy(&first.checked(self.vio.camera().image_size())?), self.copy(&second.checked(expected)?)];
        self.enqueue((plus_nanos(stamp, self.camera_offset), false), PendingMeasurement::ImagePair(stamp, copies));
        Ok(())
    }

    /// Takes points that both cameras have seen; see [`Vio::point_pairs`].
    pub fn point_pairs(&mut self, stamp: Stamp, pairs: &[PointPair]) -> Result<(), Error> {
        self.vio.second_camera()?;
        let wrong = |pixel: &Vector2<f64>| pixel.iter().any(|v| !v.is_finite());
        if let Some(index) = pairs.iter().position(|p| wrong(&p.first.pixel) || p.second.as_ref().is_some_and(wrong)) {
            return Err(Error::NonFinite { what: "pair of points", index });
        }
        let mut copy = self.pair_buffers.pop().unwrap_or_default();
        copy.clear();
        copy.extend_from_slice(pairs);
        self.enqueue((plus_nanos(stamp, self.camera_offset), false), PendingMeasurement::PointPairs(stamp, copy));
        Ok(())
    }

    /// A copy of an image in memory that has been used before.
    fn copy(&mut self, image: &ImageView) -> Vec<u8> {
        let mut copy = self.image_buffers.pop().unwrap_or_default();
        copy.clear();
        copy.extend_from_slice(image.data);
        copy
    }

    /// Takes the points of a tracker of the caller's own; see [`Vio::points`].
    pub fn points(&mut self, stamp: Stamp, points: &[PointObservation]) -> Result<(), Error> {
        if let Some(index) = points.iter().position(|p| p.pixel.iter().any(|v| !v.is_finite())) {
            return Err(Error::NonFinite { what: "point", index });
        }
        let mut copy = self.point_buffers.pop().unwrap_or_default();
        copy.clear();
        copy.extend_from_slice(points);
        self.enqueue((plus_nanos(stamp, self.camera_offset), false), PendingMeasurement::Points(stamp, copy));
        Ok(())
    }

    /// Takes a pose of the source's sensor in the source's frame. There is one source, with index 0.
    pub fn pose(&mut self, pose: &PoseMeasurement) -> Result<(), Error> {
        if pose.source != 0 {
            return Err(Error::NoSuch { what: "source", index: pose.source, count: 1 });
        }
        pose.whitener()?;
        let mut body = pose.of_body(&self.settings.source_from_world, &self.settings.body_from_sensor);
        body.stamp = plus_nanos(pose.stamp, nanos(self.settings.pose_time_offset_s));
        self.enqueue((body.stamp, true), PendingMeasurement::Pose(body));
        Ok(())
    }

    /// The estimate at the time of the latest inertial sample; `None` before the initialization.
    pub fn output(&self) -> Option<Odometry> {
        self.vio.output()
    }

    /// Counts of the measurements so far.
    pub fn counts(&self) -> MeasurementCounts {
        self.counts
    }

    /// What the latest image did; `None` before the first.
    pub fn last_frame(&self) -> Option<FrameReport> {
        self.frame
    }

    fn drain_pair(&mut self) -> Result<Status, Error> {
        while let Some(sample) = self.pair.as_mut().and_then(ImuPair::read) {
            self.process_imu(&sample)?;
        }
        Ok(self.vio.status())
    }

    fn process_imu(&mut self, sample: &Imu) -> Result<Status, Error> {
        self.vio.imu(sample)?;
        let old = plus_nanos(sample.stamp, -nanos(self.settings.lag_s));
        while self.pending.first().is_some_and(|pending| pending.order.0 <= old) {
            self.process_oldest();
        }
        Ok(self.vio.status())
    }

    /// Puts a measurement into the delay buffer. If that is full, the oldest is used now.
    fn enqueue(&mut self, order: (Stamp, bool), measurement: PendingMeasurement) {
        if self.pending.len() >= MAX_PENDING {
            self.process_oldest();
        }
        let index = self.pending.partition_point(|pending| pending.order <= order);
        self.pending.insert(index, Pending { order, measurement });
    }

    fn process_oldest(&mut self) {
        let Pending { measurement, .. } = self.pending.remove(0);
        let frame = match measurement {
            PendingMeasurement::Image(stamp, data) => {
                let (width, height) = self.vio.camera().image_size();
                let report = self.vio.image(stamp, &ImageView { width, height, data: &data });
                self.image_buffers.push(data);
                report
            }
            PendingMeasurement::ImagePair(stamp, [first, second]) => {
                let report = self.process_pair(stamp, &first, &second);
                self.image_buffers.extend([first, second]);
                report
            }
            PendingMeasurement::PointPairs(stamp, pairs) => {
                let report = self.vio.point_pairs(stamp, &pairs);
                self.pair_buffers.push(pairs);
                report
            }
            PendingMeasurement::Points(stamp, points) => {
                let report = self.vio.points(stamp, &points);
                self.point_buffers.push(points);
                report
            }
            PendingMeasurement::Pose(pose) => {
                match self.vio.pose(&pose) {
                    Ok(true) => self.counts.poses += 1,
                    Ok(false) => self.counts.poses_rejected += 1,
                    Err(_) => self.counts.too_late += 1,
                }
                return;
            }
        };
        match frame {
            Ok(report) => {
                self.frame = Some(report);
                self.counts.images += 1;
            }
            // All else was checked when it came.
            Err(_) => self.counts.too_late += 1,
        }
    }

    fn process_pair(&mut self, stamp: Stamp, first: &[u8], second: &[u8]) -> Result<FrameReport, Error> {
        let sizes = [self.vio.camera().image_size(), self.vio.second_camera()?.image_size()];
        let [first, second] =
            [(first, sizes[0]), (second, sizes[1])].map(|(data, (width, height))| ImageView { width, height, data });
        self.vio.image_pair(stamp, &first, &second)
    }
}

fn nanos(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}

fn plus_nanos(stamp: Stamp, nanos: i64) -> Stamp {
    Stamp::from_nanos(stamp.nanos().saturating_add(nanos))
}
