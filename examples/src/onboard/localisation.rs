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
    /// After so many contradictions in a row the odometry is given up for the map.
    pub contradictions: usize,
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
            contradictions: 5,
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
    /// Contradictions since then.
    contradictions: usize,
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
            contradictions: 0,
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
        found.map(|tracking| self.start(stamp, &tracking, STANDING)).transpose()
    }

    /// Odometry from a pose in the map, with a velocity that is off by so much.
    fn start(
        &mut self,
        stamp: Stamp,
        tracking: &TrackingOutcome,
        velocity: f64,
    ) -> Result<Isometry3<f64>, LocalisationError> {
        let world_from_body = tracking.world_from_camera * self.body_from_camera.inverse();
        let [position, attitude] = self.spread(tracking);
        let sigma = InitialSigma { position, velocity, yaw: attitude, tilt: attitude, ..InitialSigma::default() };
        let [velocity_in_body, gyro_bias, accel_bias] = [Vector3::zeros(); 3];
        self.vio.initialize(&InitialState {
            stamp,
            world_from_body,
            velocity_in_body,
            gyro_bias,
            accel_bias,
            sigma,
        })?;
        (self.confirmed, self.contradictions) = (Some(seconds(stamp)), 0);
        Ok(world_from_body)
    }

    /// A sample of the inertial sensor.
    ///
    /// # Errors
    /// What the odometry refuses.
    pub fn imu(&mut self, sample: &Imu) -> Result<(), LocalisationError> {
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

    /// A depth image, at most `lag_s` after it was taken, with the pose of the body by [`pose`](Self::pose) when it was taken: `None` if there
    /// was none, because the odometry has given up; it starts again where the map finds the camera.
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
        let Some(tracking) = tracking else { return Ok(MapUpdate { confirmed: false, events }) };
        let Some(expected) = prior.filter(|_| self.vio.output().is_some()) else {
            self.start(stamp, &tracking, FLYING)?;
            return Ok(MapUpdate { confirmed: true, events });
        };
        let off = tracking.world_from_camera.translation.vector - expected.translation.vector;
        let confirmed = off.norm() <= self.settings.contradiction;
        self.contradictions = if confirmed { 0 } else { self.contradictions + 1 };
        self.confirmed = confirmed.then_some(seconds(stamp));
        if self.contradictions >= self.settings.contradictions {
            self.start(stamp, &tracking, FLYING)?;
        } else if let Some(information) = self.information(&tracking) {
            let source_from_sensor = tracking.world_from_camera;
            self.vio.pose(&PoseMeasurement { source: 0, stamp, source_from_sensor, information })?;
        }
        Ok(MapUpdate { confirmed, events })
    }

    /// Where the robot is at the time of the latest inertial sample; `None` before it has been found, and after the odometry gave up.
    pub fn pose(&self) -> Option<OnboardPose> {
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

fn seconds(stamp: Stamp) -> f64 {
    1e-9 * stamp.nanos() as f64
}
