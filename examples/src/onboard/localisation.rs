//! Where the robot is in a stored map (Paper II, Fig. 6.4): relocalisation before it takes off, then odometry by camera and inertial sensor,
//! to which every depth image gives a pose in the map.

use std::path::Path;

use nalgebra::{Isometry3, Matrix6, Vector3};
use tsdf_hash::global_registration::{GlobalRegistration, GlobalRegistrationSettings};
use tsdf_hash::slam::{Event, FrameMemory, OdometryError, PoseSource, Slam, SlamSettings, SlamState};
use tsdf_hash::storage::MapFile;
use tsdf_hash::tracking::TrackingOutcome;
use tsdf_hash::{ColourView, DepthView};
use vio_ekf::fusion::{AidedPose, MapAidedSettings, MapAidedVio, PoseMeasurement};
use vio_ekf::{Camera, ImageView, Imu, Stamp};

/// A frame that does not fix its pose shows what is expected if at least so much of it is on the map and agrees, and if what it does fix is
/// within so many metres of what is expected.
const SHOWN: f64 = 0.9;
const NEAR: f64 = 0.02;
/// What the odometry sees is about as far away as the middle of the latest depth image, within this share.
const DISTANCE_SHARE: f64 = 0.1;

/// Why the robot does not know where it is.
#[derive(Debug, thiserror::Error)]
pub enum LocalisationError {
    /// The odometry refused.
    #[error("odometry: {0}")]
    Odometry(#[from] vio_ekf::Error),
    /// The map refused.
    #[error("map: {0}")]
    Map(#[from] tsdf_hash::Error),
    /// There is no way along the surface that was surveyed.
    #[error("surveyed surface: {0}")]
    Surveyed(#[from] crate::scan_flight::ScanFlightError),
    /// The simulated sensors refused.
    #[error("sensors: {0}")]
    Sensors(#[from] paint_sim::Error),
    /// It is not where the map was made, or does not see enough of it.
    #[error("the robot does not find itself in the map within {seconds} s: it does not take off")]
    NotHere {
        /// How long it has looked, s.
        seconds: f64,
    },
}

/// What a depth image said.
#[derive(Debug)]
pub struct MapUpdate {
    /// Whether it gave a pose in the map, near the one that was expected.
    pub confirmed: bool,
    /// What happened in the map.
    pub events: Vec<Event>,
}

/// A stored map from its file.
///
/// # Errors
/// A file that is none.
pub fn read_map(path: &Path) -> Result<SlamState, LocalisationError> {
    let settings = tsdf_hash::Settings { threads: 1, ..tsdf_hash::Settings::default() };
    Ok(SlamState::read(MapFile::open(path)?, &settings, None)?)
}

/// Tracking in a stored map and odometry, joined. Fed in the order in which measurements arrive; it opens no file and starts no thread of its
/// own.
pub struct OnboardLocalisation {
    aided: MapAidedVio,
    slam: Slam,
    body_from_camera: Isometry3<f64>,
    /// Sum of what the accelerometer has measured before the robot was found: up, as it stands or sways.
    up_in_body: Vector3<f64>,
}

impl OnboardLocalisation {
    /// In a stored map, which stays as it is: the robot is found in it by its keyframes, and by its shape. Tracking takes one thread. Where the camera is comes from `camera`.
    ///
    /// # Errors
    /// Settings that odometry or map refuse.
    pub fn new(
        map: SlamState,
        camera: Camera,
        odometry: vio_ekf::Settings,
        mut settings: MapAidedSettings,
    ) -> Result<Self, LocalisationError> {
        let body_from_camera = camera.body_from_camera;
        settings.unified.body_from_sensor = body_from_camera;
        let slam = SlamSettings {
            poses: PoseSource::Odometry(OdometryError::default()),
            frame_interval: settings.pose_interval_s,
            fuse: false,
            relocalise_first: true,
            ..SlamSettings::default()
        };
        let shape = map.map.mesh();
        let surface = GlobalRegistration::new(&shape.positions, &shape.faces, GlobalRegistrationSettings::default())?;
        let mut slam = Slam::with_source(slam, map.without_trajectory(), FrameMemory::new())?;
        slam.set_surface(surface);
        let aided = MapAidedVio::new(camera, odometry, settings)?;
        Ok(Self { aided, slam, body_from_camera, up_in_body: Vector3::zeros() })
    }

    /// A depth image of a robot that does not know where it is. Once it has been found and stands still, the odometry starts there; the pose of
    /// the body. Where no keyframe shows it, it must sway to be found. Without colour shape alone is compared: paint changes how a surface looks.
    ///
    /// # Errors
    /// What map and odometry refuse.
    pub fn relocalise(
        &mut self,
        stamp: Stamp,
        depth: &DepthView,
        colour: Option<&ColourView>,
        stands: bool,
    ) -> Result<Option<Isometry3<f64>>, LocalisationError> {
        self.slam.set_vertical(self.body_from_camera.inverse_transform_vector(&self.up_in_body));
        let outcome = self.slam.frame(seconds(stamp), depth, colour, None)?;
        self.expect_distance(depth)?;
        let found = outcome.tracking.filter(|_| stands && outcome.world_from_camera.is_some());
        let Some(measured) = found.and_then(|tracking| measurement(stamp, &tracking)) else { return Ok(None) };
        Ok(Some(self.aided.start(&measured)?))
    }

    /// A sample of the inertial sensor.
    ///
    /// # Errors
    /// What the odometry refuses.
    pub fn imu(&mut self, sample: &Imu) -> Result<(), LocalisationError> {
        if self.aided.unified().output().is_none() {
            self.up_in_body += sample.accel;
        }
        Ok(self.aided.imu(sample)?)
    }

    /// A sample of the vehicle's own inertial sensor, where the settings have one.
    ///
    /// # Errors
    /// What the odometry refuses.
    pub fn second_imu(&mut self, sample: &Imu) -> Result<(), LocalisationError> {
        Ok(self.aided.second_imu(sample)?)
    }

    /// An image; how late it may come says [`UnifiedSettings::lag_s`](vio_ekf::fusion::UnifiedSettings::lag_s).
    ///
    /// # Errors
    /// What the odometry refuses.
    pub fn image(&mut self, stamp: Stamp, image: &ImageView) -> Result<(), LocalisationError> {
        Ok(self.aided.image(stamp, image)?)
    }

    /// A depth image, as late at most, with what [`pose`](Self::pose) said when it was taken. Shape alone is compared with the map: the robot
    /// changes how the surface looks.
    ///
    /// # Errors
    /// What map and odometry refuse.
    pub fn depth(
        &mut self,
        stamp: Stamp,
        depth: &DepthView,
        expected: Option<&AidedPose>,
    ) -> Result<MapUpdate, LocalisationError> {
        // While the map stands in for the odometry, its own poses are no odometry to lead the tracker by: the camera moves as before.
        let odometry = expected.filter(|expected| !expected.from_map);
        let prior = odometry.map(|expected| expected.world_from_body * self.body_from_camera);
        let outcome = self.slam.frame(seconds(stamp), depth, None, prior.as_ref())?;
        self.expect_distance(depth)?;
        let shown = |tracking: &TrackingOutcome| {
            let off = prior.map_or(f64::INFINITY, |prior| {
                (tracking.world_from_camera.translation.vector - prior.translation.vector).norm()
            });
            !tracking.degenerate.is_empty() && tracking.agreement.min(tracking.overlap) >= SHOWN && off <= NEAR
        };
        let confirmed = if outcome.tracking.as_ref().is_some_and(shown) {
            self.aided.seen(stamp, expected)
        } else {
            let fixed = outcome.tracking.filter(|tracking| tracking.is_tracked() && tracking.degenerate.is_empty());
            let measured = fixed.and_then(|tracking| measurement(stamp, &tracking));
            self.aided.map(measured.as_ref(), expected)?
        };
        Ok(MapUpdate { confirmed, events: outcome.events })
    }

    fn expect_distance(&mut self, depth: &DepthView) -> Result<(), LocalisationError> {
        depth.median().map_or(Ok(()), |distance| Ok(self.aided.expect_distance(distance, DISTANCE_SHARE)?))
    }

    /// Where the robot is now; `None` before it has been found, and where nothing recent says so.
    pub fn pose(&self, now: Stamp) -> Option<AidedPose> {
        self.aided.pose(now)
    }
}

/// What tracking found as the odometry wants it: information for the covariance, shift before turn. `None` of a covariance without an inverse.
fn measurement(stamp: Stamp, tracking: &TrackingOutcome) -> Option<PoseMeasurement> {
    let covariance = Matrix6::from_fn(|r, c| tracking.covariance[((r + 3) % 6, (c + 3) % 6)]);
    let information = covariance.cholesky()?.inverse();
    Some(PoseMeasurement { source: 0, stamp, source_from_sensor: tracking.world_from_camera, information })
}

fn seconds(stamp: Stamp) -> f64 {
    1e-9 * stamp.nanos() as f64
}
