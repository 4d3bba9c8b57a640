//! A map of a mesh that somebody else has surveyed: nobody has flown before it, and nothing is known of its colours.

use paint_sim::TriangleSurface;
use tsdf_hash::Map;
use tsdf_hash::place_recognition::KeyframeIndex;
use tsdf_hash::slam::SlamState;
use vio_ekf::Stamp;

use super::error::ScanFlightError;
use super::fly::VOXEL;
use super::route::{STAND_OFF, along};
use crate::mesh_io::TriangleMesh;
use crate::mesh_placement::mean_normal;
use crate::simulated_sensors::SimulatedCamera;

/// Time of the flight of a scan between two views, milliseconds.
const BETWEEN: usize = 200;

/// The map and the keyframes that a scan would give of `mesh` (metres, z up), in depth alone: what the mesh would show to the robot's camera
/// along the way of a scan.
///
/// # Errors
/// As of a scan.
pub fn surveyed_map(mesh: &TriangleMesh, threads: usize) -> Result<SlamState, ScanFlightError> {
    let surface = TriangleSurface::new(&mesh.positions, &mesh.faces)?;
    let route = along(&surface, &mean_normal(mesh), STAND_OFF)?;
    let camera = SimulatedCamera::new(&surface, route.towards, 0, threads);
    let mut map = Map::new(tsdf_hash::Settings { voxel_size: VOXEL, threads, ..tsdf_hash::Settings::default() })?;
    let mut keyframes = KeyframeIndex::new();
    let (first, last) = route.spline.span();
    let milliseconds = (1e3 * last.secs_since(first)) as usize;
    for millisecond in (0..milliseconds).step_by(BETWEEN) {
        let stamp = Stamp::from_nanos(first.nanos() + 1_000_000 * millisecond as i64);
        let world_from_camera = route.spline.sample(stamp)?.world_from_body * camera.camera.body_from_camera;
        let image = camera.exact_depth(&world_from_camera)?;
        let views = camera.views(&image);
        match map.integrate(&views.depth(), None, &world_from_camera) {
            Ok(_) => keyframes.add(&views.depth(), None, &world_from_camera)?,
            // Past the edge of the surface there is nothing to see.
            Err(tsdf_hash::Error::NoDepth { .. }) => continue,
            Err(error) => return Err(error.into()),
        };
    }
    Ok(SlamState { keyframes, ..SlamState::new(map) })
}
