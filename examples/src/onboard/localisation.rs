//! Where the robot is in a stored map (Paper II, Fig. 6.4): relocalisation before it takes off, then odometry by camera and inertial sensor,
//! to which every depth image gives a pose in the map.

use nalgebra::{Isometry3, Matrix6, Vector3};
use tsdf_hash::slam::{Event, OdometryError, PoseSource, Slam, SlamSettings, SlamState};
use tsdf_hash::tracking::TrackingOutcome;
use tsdf_hash::{ColourView, DepthView};
use vio_ekf::fusion::{PoseMeasurement, UnifiedSettings, UnifiedVio};
use vio_ekf::inertial::{InitialSigma, InitialState};
use vio_ekf::{Camera, ImageView, Imu, ImuNoise, Odometry, Stamp};

/// How the sources are joined. Ours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalisationSettings {
    /// The inertial sensor.
    pub imu: ImuNoise,
    /// Measurements are used when they are this old, s: as much as the slowest source needs.
    pub lag_s: f64,
    /// Seconds from one depth image to the next.
    pub depth_interval_s: f64,
    /// What the map itself is off, m and rad per axis: the same for all images of a place, so no number of images averages it away.
    pub map_sigma: [f64; 2],
    /// Time after which the error of a pose in the map is another one, s.
    pub map_correlation_s: f64,
    /// A position that is less well known is not to be painted by, m per axis.
    pub trusted_sigma: f64,
    /// Nor one that the map has not confirmed for so long, s.
    pub trusted_age_s: f64,
    /// A pose in the map that is farther from the one that was expected contradicts it, m: there is no painting by either.
    pub contradiction: f64,
    /// Inertial samples farther apart than this, s, end the odometry; and without one for so long there is no pose.
    pub longest_gap_s: f64,
    /// Poses in the map in a row that must follow from each other before the odometry starts again from them.
    pub confirmations: usize,
    /// Threads of tracking.
    pub threads: usize,
}

impl Default for LocalisationSettings {
    fn default() -> Self {
        Self {
            imu: ImuNoise::default(),
            lag_s: 0.08,
            depth_interval_s: 0.1,
            map_sigma: [2e-3, 1e-3],
            map_correlation_s: 0.3,
            trusted_sigma: 0.01,
            trusted_age_s: 0.5,
            contradiction: 0.02,
            longest_gap_s: 0.02,
            confirmations: 5,
            threads: 1,
        }
    }
}

/// Why the robot does not know where it is.
#[derive(Debug, thiserror::Error)]
pub enum LocalisationError {
    /// The odometry refused.
    #[error("odometry: {0}")]
    Odometry(#[from] vio_ekf::Error),
    /// The map refused.
    #[error("map: {0}")]
    Map(#[from] tsdf_hash::Error),
}

/// Where the robot takes itself to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OnboardPose {
    /// Pose in the world of the map.
    pub world_from_body: Isometry3<f64>,
    /// Standard deviation of the position along the axis where it is largest, m.
    pub position_sigma: f64,
    /// Whether it may paint by it.
    pub trusted: bool,
}

/// What a depth image said.
#[derive(Debug)]
pub struct MapUpdate {
    /// Whether it gave a pose in the map, near the one that was expected.
    pub confirmed: bool,
    /// What happened in the map.
    pub events: Vec<Event>,
}

/// Standard deviations of the velocity, m/s, of a robot that stands, and of one that flies and does not know how.
const STANDING: f64 = 0.05;
const FLYING: f64 = 0.7;

/// One estimator of odometry and map. Fed in the order in which measurements arrive; it opens no file and starts no thread of its own.
pub struct OnboardLocalisation {
    vio: UnifiedVio,
    slam: Slam,
    body_from_camera: Isometry3<f64>,
    settings: LocalisationSettings,
    /// When the map confirmed the pose last, s; `None` where it contradicts.
    confirmed: Option<f64>,
    /// The last pose in the map.
    last: Option<MapPose>,
    /// Poses in the map that have followed from each other since the odometry was given up; `None` while it goes on.
    recovering: Option<usize>,
    imu: InertialCheck,
}

impl OnboardLocalisation {
    /// In a stored map, which stays as it is.
    ///
    /// # Errors
    /// Settings that odometry or map refuse.
    pub fn new(
        map: SlamState,
        camera: Camera,
        odometry: vio_ekf::Settings,
        settings: LocalisationSettings,
    ) -> Result<Self, LocalisationError> {
        let body_from_camera = camera.body_from_camera;
        let unified = UnifiedSettings {
            imu: settings.imu,
            lag_s: settings.lag_s,
            body_from_sensor: body_from_camera,
            ..UnifiedSettings::default()
        };
        let mut slam = SlamSettings {
            poses: PoseSource::Odometry(OdometryError::default()),
            frame_interval: settings.depth_interval_s,
            fuse: false,
            relocalise_first: true,
            ..SlamSettings::default()
        };
        slam.map.threads = settings.threads;
        Ok(Self {
            vio: UnifiedVio::new(camera, odometry, unified)?,
            slam: Slam::with_source(slam, map.without_trajectory(), tsdf_hash::slam::FrameMemory::new())?,
            body_from_camera,
            settings,
            confirmed: None,
            last: None,
            recovering: None,
            imu: InertialCheck::default(),
        })
    }

    /// A depth image of a robot that stands still and does not know where. Once it has been found, the odometry starts there.
    ///
    /// # Errors
    /// What map and odometry refuse.
    pub fn relocalise(
        &mut self,
        stamp: Stamp,
        depth: &DepthView,
        colour: &ColourView,
    ) -> Result<Option<Isometry3<f64>>, LocalisationError> {
        let outcome = self.slam.frame(seconds(stamp), depth, Some(colour), None)?;
        let found = outcome.tracking.filter(|_| outcome.world_from_camera.is_some());
        let body_from_camera = self.body_from_camera;
        let pose = |tracking: &TrackingOutcome| {
            MapPose::standing(stamp, tracking.world_from_camera * body_from_camera.inverse())
        };
        found.map(|tracking| self.start(&pose(&tracking), &tracking, STANDING)).transpose()
    }

    /// Odometry from a pose in the map, moved on to the latest inertial sample.
    fn start(
        &mut self,
        pose: &MapPose,
        tracking: &TrackingOutcome,
        velocity: f64,
    ) -> Result<Isometry3<f64>, LocalisationError> {
        let stamp = self.imu.last.map_or(pose.stamp, |last| last.stamp.max(pose.stamp));
        let world_from_body = pose.after(stamp);
        let [position, attitude] = self.spread(tracking);
        let sigma = InitialSigma { position, velocity, yaw: attitude, tilt: attitude, ..InitialSigma::default() };
        let [gyro_bias, accel_bias] = [Vector3::zeros(); 2];
        let velocity_in_body = world_from_body.inverse_transform_vector(&pose.velocity);
        self.vio.initialize(&InitialState {
            stamp,
            world_from_body,
            velocity_in_body,
            gyro_bias,
            accel_bias,
            sigma,
        })?;
        (self.confirmed, self.recovering) = (Some(seconds(pose.stamp)), None);
        Ok(world_from_body)
    }

    /// Nothing that the odometry says is believed until it starts again.
    fn give_up(&mut self) {
        (self.confirmed, self.recovering) = (None, Some(0));
    }

    /// A sample of the inertial sensor.
    ///
    /// # Errors
    /// What the odometry refuses.
    pub fn imu(&mut self, sample: &Imu) -> Result<(), LocalisationError> {
        if !self.imu.is_sound(sample, self.settings.longest_gap_s) {
            self.give_up();
        }
        self.vio.imu(sample)?;
        Ok(())
    }

    /// An image, at most `lag_s` after it was taken.
    ///
    /// # Errors
    /// What the odometry refuses.
    pub fn image(&mut self, stamp: Stamp, image: &ImageView) -> Result<(), LocalisationError> {
        Ok(self.vio.image(stamp, image)?)
    }

    /// A depth image, at most `lag_s` after it was taken, with the pose of the body by [`pose`](Self::pose) when it was taken, if there was
    /// one. An odometry that was given up starts again where the map finds the camera.
    ///
    /// # Errors
    /// What map and odometry refuse.
    pub fn depth(
        &mut self,
        stamp: Stamp,
        depth: &DepthView,
        colour: &ColourView,
        world_from_body: Option<&Isometry3<f64>>,
    ) -> Result<MapUpdate, LocalisationError> {
        let prior = world_from_body.map(|pose| pose * self.body_from_camera);
        let outcome = self.slam.frame(seconds(stamp), depth, Some(colour), prior.as_ref())?;
        let tracking = outcome.tracking.filter(|tracking| tracking.is_tracked() && tracking.degenerate.is_empty());
        let events = outcome.events;
        let Some(tracking) = tracking else {
            self.last = None;
            return Ok(MapUpdate { confirmed: false, events });
        };
        let pose = MapPose::next(self.last, stamp, tracking.world_from_camera * self.body_from_camera.inverse());
        let follows = self.last.is_some_and(|last| last.distance(&pose) <= self.settings.contradiction);
        self.last = Some(pose);
        if self.vio.output().is_none() && self.recovering.is_none() {
            self.give_up();
        }
        if let Some(count) = self.recovering {
            let count = if follows && self.imu.is_sound_now() { count + 1 } else { 0 };
            self.recovering = Some(count);
            if count >= self.settings.confirmations {
                self.start(&pose, &tracking, FLYING)?;
            }
            return Ok(MapUpdate { confirmed: false, events });
        }
        let off = world_from_body
            .map_or(0.0, |expected| (pose.world_from_body.translation.vector - expected.translation.vector).norm());
        if off > self.settings.contradiction {
            self.give_up();
            return Ok(MapUpdate { confirmed: false, events });
        }
        self.confirmed = Some(seconds(stamp));
        if let Some(information) = self.information(&tracking) {
            let source_from_sensor = tracking.world_from_camera;
            self.vio.pose(&PoseMeasurement { source: 0, stamp, source_from_sensor, information })?;
        }
        Ok(MapUpdate { confirmed: true, events })
    }

    /// Where the robot is; `None` before it has been found, and where nothing recent says so. While odometry and map contradict each other, or
    /// the inertial sensor fails, that is the last pose in the map, moved on, and not to be trusted.
    pub fn pose(&self, now: Stamp) -> Option<OnboardPose> {
        let silent = self.imu.last.is_none_or(|last| now.secs_since(last.stamp) > self.settings.longest_gap_s);
        if silent || self.recovering.is_some() {
            let last = self.last.filter(|last| now.secs_since(last.stamp) <= self.settings.trusted_age_s)?;
            return Some(OnboardPose {
                world_from_body: last.after(now),
                position_sigma: f64::INFINITY,
                trusted: false,
            });
        }
        let Odometry { stamp, world_from_body, covariance, .. } = self.vio.output()?;
        let position = covariance.fixed_view::<3, 3>(0, 0).into_owned();
        let position_sigma = position.symmetric_eigenvalues().max().max(0.0).sqrt();
        let age = self.confirmed.map_or(f64::INFINITY, |confirmed| seconds(stamp) - confirmed);
        let trusted = position_sigma <= self.settings.trusted_sigma && age <= self.settings.trusted_age_s;
        Some(OnboardPose { world_from_body, position_sigma, trusted })
    }

    /// The covariance of a pose in the map, shift before turn, with what the map itself is off.
    fn covariance(&self, tracking: &TrackingOutcome) -> Matrix6<f64> {
        let [shift, turn] = self.settings.map_sigma;
        let mut covariance = Matrix6::zeros();
        for (row, from_row) in [(0, 3), (3, 0)] {
            for (column, from_column) in [(0, 3), (3, 0)] {
                let block = tracking.covariance.fixed_view::<3, 3>(from_row, from_column);
                covariance.fixed_view_mut::<3, 3>(row, column).copy_from(&block);
            }
        }
        for k in 0..3 {
            covariance[(k, k)] += shift * shift;
            covariance[(k + 3, k + 3)] += turn * turn;
        }
        covariance
    }

    /// Its inverse, less by what successive poses have in common (see [`vio_ekf::Vio::pose`]).
    fn information(&self, tracking: &TrackingOutcome) -> Option<Matrix6<f64>> {
        let independent = (2.0 * self.settings.map_correlation_s / self.settings.depth_interval_s).max(1.0);
        self.covariance(tracking).cholesky().map(|cholesky| cholesky.inverse() / independent)
    }

    /// Standard deviations of position and attitude along the axes where they are largest.
    fn spread(&self, tracking: &TrackingOutcome) -> [f64; 2] {
        let covariance = self.covariance(tracking);
        [0, 3].map(|first| {
            covariance.fixed_view::<3, 3>(first, first).into_owned().symmetric_eigenvalues().max().max(0.0).sqrt()
        })
    }
}

/// A pose in the map, with the velocity since the one before.
#[derive(Debug, Clone, Copy)]
struct MapPose {
    stamp: Stamp,
    world_from_body: Isometry3<f64>,
    velocity: Vector3<f64>,
}

impl MapPose {
    fn standing(stamp: Stamp, world_from_body: Isometry3<f64>) -> Self {
        Self { stamp, world_from_body, velocity: Vector3::zeros() }
    }

    fn next(last: Option<Self>, stamp: Stamp, world_from_body: Isometry3<f64>) -> Self {
        let since = |last: Self| {
            let way = world_from_body.translation.vector - last.world_from_body.translation.vector;
            way / stamp.secs_since(last.stamp).max(1e-3)
        };
        Self { stamp, world_from_body, velocity: last.map_or_else(Vector3::zeros, since) }
    }

    /// Where it leads until a time, without turning.
    fn after(&self, stamp: Stamp) -> Isometry3<f64> {
        let way = self.velocity * stamp.secs_since(self.stamp);
        Isometry3::from_parts((self.world_from_body.translation.vector + way).into(), self.world_from_body.rotation)
    }

    /// How far the next one is from where this one leads, m.
    fn distance(&self, next: &Self) -> f64 {
        (self.after(next.stamp).translation.vector - next.world_from_body.translation.vector).norm()
    }
}

/// Whether inertial samples can be believed by themselves.
#[derive(Debug, Clone, Copy, Default)]
struct InertialCheck {
    last: Option<Imu>,
    /// Samples in a row in which a number of each sensor did not change at all: noise changes it, a limit of the range does not.
    unchanged: usize,
}

/// So many are no chance, even of a sensor of few bits.
const UNCHANGED: usize = 3;

impl InertialCheck {
    /// Takes a sample; whether it follows the one before, and the sensor moves.
    fn is_sound(&mut self, sample: &Imu, longest_gap_s: f64) -> bool {
        let last = self.last.replace(*sample);
        let same = |a: &Vector3<f64>, b: &Vector3<f64>| (0..3).any(|k| a[k] == b[k]);
        let stuck = last.is_some_and(|last| same(&last.accel, &sample.accel) || same(&last.gyro, &sample.gyro));
        self.unchanged = if stuck { self.unchanged + 1 } else { 0 };
        self.is_sound_now() && last.is_none_or(|last| sample.stamp.secs_since(last.stamp) <= longest_gap_s)
    }

    fn is_sound_now(&self) -> bool {
        self.unchanged < UNCHANGED
    }
}

fn seconds(stamp: Stamp) -> f64 {
    1e-9 * stamp.nanos() as f64
}
