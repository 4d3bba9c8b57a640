//! The flight itself: sensors, odometry and map, image by image.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use paint_sim::TriangleSurface;
use tsdf_hash::Map;
use tsdf_hash::place_recognition::KeyframeIndex;
use tsdf_hash::slam::SlamState;
use vio_ekf::sim::{RoomSettings, Scenario, Simulation};
use vio_ekf::{ImuNoise, Stamp, Trajectory, Vio};

use super::error::ScanFlightError;
use super::evaluation::{ScanFlightFigures, figures};
use super::localiser::Localiser;
use super::route::{STAND_OFF, along};
use crate::mesh_io::TriangleMesh;
use crate::mesh_placement::mean_normal;
use crate::progress::Stage;
use crate::simulated_sensors::{FRAMES_PER_SECOND, SimulatedCamera};

/// Edge of a voxel of the map, metres: below the size of a spray spot.
const VOXEL: f64 = 0.02;
/// One image in so many is fused: neighbours see the same.
const FUSE_EVERY: usize = 4;

/// A scanned surface, and how well it was scanned.
pub struct ScanFlight {
    /// The surface as the robot mapped it, in the world's frame.
    pub mesh: TriangleMesh,
    /// The map that it is taken from, with keyframes.
    pub(super) map: SlamState,
    /// How far it is from the true one.
    pub figures: ScanFlightFigures,
    /// Where the robot was.
    pub(super) flown: Trajectory,
    /// Where it took itself to be.
    pub(super) estimated: Trajectory,
}

impl ScanFlight {
    /// Flies along `mesh` (metres, z up), which the robot only sees through its sensors.
    ///
    /// The robot starts at rest on a place that is known, as on a charging station: the pose of the first estimate is set to the
    /// truth. Everything after that is its own: odometry leads from image to image, and the map that grows
    /// says where it is.
    pub fn fly(mesh: &TriangleMesh, seed: u64, threads: usize) -> Result<Self, ScanFlightError> {
        let stage = Stage::start("scan flight");
        let surface = TriangleSurface::new(&mesh.positions, &mesh.faces)?;
        let route = along(&surface, &mean_normal(mesh), STAND_OFF)?;
        let mut sensor = SimulatedCamera::new(&surface, route.towards, seed, threads);
        let camera = sensor.camera;
        let simulation = inertial(route.spline, seed)?;
        let mut samples = simulation.imu(0)?.samples.into_iter().peekable();
        let mut map = Map::new(tsdf_hash::Settings { voxel_size: VOXEL, threads, ..tsdf_hash::Settings::default() })?;

        let mut keyframes = KeyframeIndex::new();
        let mut localiser = Localiser::new(threads)?;
        let mut world_from_start = None;
        // From where odometry takes the robot to be to where the map does.
        let mut correction = None;
        let [mut flown, mut drifting, mut estimated] = [(); 3].map(|()| Trajectory::default());
        let (first, last) = simulation.spline().span();
        let count = (last.secs_since(first) * FRAMES_PER_SECOND) as usize;
        let mut vio = {
            // The odometry does not read depth, but need not guess how far away the surface is at first.
            let before = sensor.capture(0, &(simulation.motion(first)?.world_from_body * camera.body_from_camera))?;
            let mut settings = vio_ekf::Settings::default();
            if let Some(distance) = sensor.views(&before).depth().median() {
                (settings.landmarks.inverse_distance, settings.landmarks.shared_sigma) = (1.0 / distance, 0.1);
            }
            Vio::new(camera, ImuNoise::default(), settings)?
        };
        for k in 1..count {
            let stamp = Stamp::from_nanos(first.nanos() + (k as f64 * 1e9 / FRAMES_PER_SECOND) as i64);
            while let Some(sample) = samples.next_if(|sample| sample.stamp <= stamp) {
                vio.imu(&sample)?;
            }
            let truth = simulation.motion(stamp)?.world_from_body;
            let image = sensor.capture(k, &(truth * camera.body_from_camera))?;
            let report = vio.image(stamp, &image.grey())?;
            let Some(odometry) = vio.output().filter(|_| report.status.has_estimate()) else { continue };
            let world_from_start =
                *world_from_start.get_or_insert_with(|| yaw_alignment(&odometry.world_from_body, &truth));
            let by_odometry = world_from_start * odometry.world_from_body;
            // The odometry takes gravity for the vertical, as wrong as its accelerometer is at rest; the station stands as it stands.
            let correction = correction.get_or_insert_with(|| truth * by_odometry.inverse());
            // Past the edge of the surface there is nothing to see.
            let views = sensor.views(&image);
            let (depth, colour) = (views.depth(), views.colour());
            if depth.median().is_some() {
                let by_odometry = by_odometry * camera.body_from_camera;
                let start = *correction * by_odometry;
                let world_from_camera = localiser.place(&mut map, &depth, &colour, &by_odometry, &start)?;
                // The first image is what the others are tracked against.
                if k % FUSE_EVERY == 0 || map.blocks() == 0 {
                    match map.integrate(&depth, Some(&colour), &world_from_camera) {
                        Ok(_) => {
                            keyframes.add(&depth, Some(&colour), &world_from_camera)?;
                        }
                        Err(tsdf_hash::Error::NoDepth { .. }) => {}
                        Err(error) => return Err(error.into()),
                    }
                }
                *correction = world_from_camera * by_odometry.inverse();
            }
            flown.push(stamp, truth)?;
            drifting.push(stamp, by_odometry)?;
            estimated.push(stamp, *correction * by_odometry)?;
            stage.share(k as f64 / count as f64);
        }
        if !vio.status().has_estimate() {
            return Err(ScanFlightError::Lost(vio.status()));
        }
        let mapped = map.mesh();
        let scanned = TriangleMesh { positions: mapped.positions, faces: mapped.faces, ..TriangleMesh::default() };
        let figures = figures(&surface, mesh, &scanned, &flown, &drifting, &estimated)?;
        stage.done(&figures.summary());
        let map = SlamState { keyframes, ..SlamState::new(map) };
        Ok(Self { mesh: scanned, map, figures, flown, estimated })
    }
}

/// The inertial sensor along the flight.
fn inertial(spline: vio_ekf::trajectory::Spline, seed: u64) -> Result<Simulation, vio_ekf::Error> {
    // The cameras look at the surface, not at the simulator's own room.
    let room = RoomSettings { texture_size: 64, furniture: 0, ..RoomSettings::default() };
    Simulation::new(spline, Scenario { seed, cameras: Vec::new(), room, ..Scenario::default() })
}

/// The turn about the vertical and the shift that bring `from` to the place and heading of `to`.
fn yaw_alignment(from: &Isometry3<f64>, to: &Isometry3<f64>) -> Isometry3<f64> {
    let turn = (to.rotation * from.rotation.inverse()).to_rotation_matrix();
    let yaw = (turn[(1, 0)] - turn[(0, 1)]).atan2(turn[(0, 0)] + turn[(1, 1)]);
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
    Isometry3::from_parts((to.translation.vector - rotation * from.translation.vector).into(), rotation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heading_and_place_are_taken_over_and_the_vertical_is_not() {
        let from = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.1, 0.0, 0.4));
        let yaw = Isometry3::new(Vector3::new(-4.0, 0.3, 1.0), Vector3::new(0.0, 0.0, 2.1));
        assert!((yaw_alignment(&from, &(yaw * from)).to_matrix() - yaw.to_matrix()).norm() < 1e-12);
        let tilted = Isometry3::new(Vector3::zeros(), Vector3::new(0.2, 0.0, 0.0)) * from;
        let found = yaw_alignment(&from, &tilted);
        assert!((found.rotation * Vector3::z() - Vector3::z()).norm() < 1e-12);
        assert!(((found * from).translation.vector - tilted.translation.vector).norm() < 1e-12);
    }
}
