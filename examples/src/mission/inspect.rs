//! After the paint: the wall mapped with a depth camera, and the flight as trajectories.

use nalgebra::{Isometry3, Point3, Vector3};
use paint_sim::render::{Frame, Lights, Shading};
use paint_sim::surface::Hit;
use paint_sim::{Camera, Surface, render};
use tsdf_hash::mesh::Mesh;
use tsdf_hash::{ColourData, ColourView, DepthData, DepthView, Intrinsics, Map};
use vio_ekf::eval::Alignment;
use vio_ekf::{Stamp, Trajectory};

use super::error::MissionError;
use super::run::Mission;
use super::shading::shading;

/// Size of the depth camera's images, pixels.
const IMAGE: (u32, u32) = (320, 240);
/// Horizontal opening angle of the depth camera, radians: a common structured-light camera's 58 degrees.
const FIELD_OF_VIEW: f64 = 1.02;
/// Distance of the camera from the surface's box, metres.
const DISTANCE: f64 = 1.6;
/// Edge of a voxel of the map, metres.
const VOXEL: f64 = 0.015;
/// Views of a surface that faces one side: columns and rows of the grid of viewpoints.
const GRID: (usize, usize) = (5, 3);
/// Views around a surface that closes in, at each of two heights.
const RING: usize = 12;

/// A mission checked by other means.
pub struct Inspection {
    /// The painted surface as a depth camera maps it, with the colours seen.
    pub mesh: Mesh,
    /// Mean distance of the map's vertices from the true surface, metres.
    pub mesh_error: f64,
    /// The flight under the drifting localisation: what was flown.
    pub flown: Trajectory,
    /// What the localisation estimated.
    pub estimated: Trajectory,
    /// Root mean square position error between the two after rigid alignment, the ATE of odometry, metres.
    pub slam_ate: f64,
}

/// Maps the painted surface with a simulated depth camera, and evaluates the localisation of the flight.
pub fn inspect(mission: &Mission) -> Result<Inspection, MissionError> {
    let mesh = scan(mission)?;
    let world = &mission.task.surface.world;
    let off = |p: &[f32; 3]| world.distance(&Point3::from(p.map(f64::from)), 1.0);
    let mesh_error = mesh.positions.iter().map(off).sum::<f64>() / mesh.positions.len().max(1) as f64;
    let (flown, estimated) = trajectories(mission)?;
    let slam_ate = vio_ekf::eval::ate(flown.poses(), estimated.poses(), Alignment::Se3)?.position.rmse;
    Ok(Inspection { mesh, mesh_error, flown, estimated, slam_ate })
}

/// Looks at the painted surface from all sides that have paint, and fuses what it sees.
fn scan(mission: &Mission) -> Result<Mesh, MissionError> {
    let painted = mission.painted_depth();
    // Even light from everywhere: the colours of the map are the surface's own.
    let lights = Lights { sun: [0.0; 3], ambient: [1.0; 3], ..Lights::default() };
    let shade = |hit: &Hit| -> Shading { shading(&mission.task, &painted, hit) };
    let threads = mission.task.settings.threads;
    let settings = tsdf_hash::Settings { voxel_size: VOXEL, threads, ..tsdf_hash::Settings::default() };
    let mut map = Map::new(settings)?;
    for camera in viewpoints(mission)? {
        let frame = render(&mission.task.surface.world, &camera, &shade, &lights, 1, threads)?;
        if frame.depth.iter().any(|&depth| depth > 0.0) {
            fuse(&mut map, &camera, &frame)?;
        }
    }
    Ok(map.mesh())
}

/// A grid of viewpoints before a surface that faces one side, two rings around one that does not.
fn viewpoints(mission: &Mission) -> Result<Vec<Camera>, MissionError> {
    let positions = mission.task.surface.disk().positions();
    let (low, high) = positions
        .iter()
        .map(|p| Vector3::from(*p))
        .fold((Vector3::repeat(f64::MAX), Vector3::repeat(f64::MIN)), |(l, h), p| (l.inf(&p), h.sup(&p)));
    let centre = (low + high) / 2.0;
    let up = Vector3::z();
    let camera_at = |eye: Vector3<f64>, target: Vector3<f64>| {
        Camera::looking_at(&Point3::from(eye), &Point3::from(target), &up, FIELD_OF_VIEW, IMAGE)
    };
    let facing = mission.task.surface.facing();
    let flat = Vector3::new(facing.x, facing.y, 0.0);
    let mut cameras = Vec::new();
    if let Some(front) = flat.try_normalize(0.5) {
        let side: Vector3<f64> = up.cross(&front);
        let share = |k: usize, n: usize| (k as f64 + 0.5) / n as f64 - 0.5;
        let width = side.abs().dot(&(high - low));
        let depth = 0.5 * front.abs().dot(&(high - low));
        for row in 0..GRID.1 {
            for column in 0..GRID.0 {
                let along = side * (share(column, GRID.0) * width) + up * (share(row, GRID.1) * (high.z - low.z));
                let target = centre + along;
                cameras.push(camera_at(target + front * (depth + DISTANCE), target)?);
            }
        }
    } else {
        let radius = 0.5 * (high - low).xy().norm() + DISTANCE;
        for height in [0.3, 0.8] {
            for k in 0..RING {
                let (sin, cos) = (std::f64::consts::TAU * k as f64 / RING as f64).sin_cos();
                let target = Vector3::new(centre.x, centre.y, low.z + height * (high.z - low.z));
                cameras.push(camera_at(target + Vector3::new(cos, sin, 0.1) * radius, target)?);
            }
        }
    }
    Ok(cameras)
}

/// What is compared of the flights, one after the other at 10 Hz: as flown, and as the drifting localisation saw them.
fn trajectories(mission: &Mission) -> Result<(Trajectory, Trajectory), MissionError> {
    let mut flown = Trajectory::default();
    let mut estimated = Trajectory::default();
    let mut start = 0.0;
    for f in &mission.flights {
        for (time, world_from_body, estimated_position) in &f.slam.poses {
            let stamp = Stamp::from_secs(start + time).map_err(vio_ekf::Error::from)?;
            if flown.stamps().last().is_some_and(|&last| last >= stamp) {
                continue;
            }
            flown.push(stamp, *world_from_body)?;
            estimated.push(stamp, Isometry3::from_parts((*estimated_position).into(), world_from_body.rotation))?;
        }
        start += f.plan.trajectory.duration();
    }
    Ok((flown, estimated))
}
/// Puts one rendered frame into the map.
fn fuse(map: &mut Map, camera: &Camera, frame: &Frame) -> Result<(), MissionError> {
    let (width, height) = (frame.width as usize, frame.height as usize);
    let intrinsics = Intrinsics { fx: camera.fx, fy: camera.fy, cx: camera.cx, cy: camera.cy };
    let rgb8: Vec<u8> = frame.colour.iter().flatten().copied().collect();
    let depth = DepthView { width, height, data: DepthData::F32 { data: &frame.depth }, intrinsics };
    let colour = ColourView { width, height, data: ColourData::Rgb8(&rgb8), intrinsics };
    map.integrate(&depth, Some(&colour), &camera.world_from_camera)?;
    Ok(())
}
