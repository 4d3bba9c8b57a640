//! What a scan leaves in its folder.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Point3, UnitVector3, Vector3};
use paint_sim::render::{Lights, Shading};
use paint_sim::surface::Hit;
use paint_sim::{Camera, TriangleSurface, render};
use vio_ekf::Trajectory;

use super::fly::ScanFlight;
use crate::mesh_io::{PlyMesh, write_ply};
use crate::mission::MissionError;
use crate::pictures::{Polyline, Rgb, Scene, save_scene};
use crate::report::{ReportError, check_finite};
use crate::whole_file;

/// Size of the picture, pixels.
const VIEW: (u32, u32) = (1400, 900);

/// The map with its keyframes, in which the robot finds itself again.
pub const MAP_FILE: &str = "scan_flight.tsdf";

/// Writes `scan_flight.json`, `scan_flight.png`, `scan_flight.ply`, [`MAP_FILE`] and both trajectories into an existing folder.
pub fn save(scan: &ScanFlight, folder: &Path) -> Result<(), MissionError> {
    let write = |name: &str, text: String| {
        let path = folder.join(name);
        whole_file::write(&path, text)
            .map_err(|source| MissionError::Unwritable { path: path.display().to_string(), source })
    };
    write("scan_flight_true.tum", vio_ekf::format::tum::write(&scan.flown))?;
    write("scan_flight_estimated.tum", vio_ekf::format::tum::write(&scan.estimated))?;
    let ply = folder.join("scan_flight.ply");
    let (positions, faces) = (&scan.mesh.positions, &scan.mesh.faces);
    let grey = vec![[180; 3]; positions.len()];
    write_ply(&ply, &PlyMesh { positions, normals: None, colours: &grey, faces })
        .map_err(|source| MissionError::Unwritable { path: ply.display().to_string(), source })?;
    save_picture(scan, &folder.join("scan_flight.png"))?;
    let saved = scan.map.save(&folder.join(MAP_FILE), None, BTreeMap::new());
    saved.map_err(|error| MissionError::Localisation(error.into()))?;
    check_finite(&scan.figures)?;
    let figures = serde_json::to_string_pretty(&scan.figures).map_err(ReportError::from)?;
    write("scan_flight.json", figures + "\n")
}

/// The map with the way that was flown (blue) and the way that was estimated (orange), from behind the robot's shoulder.
fn save_picture(scan: &ScanFlight, path: &Path) -> Result<(), MissionError> {
    let surface = TriangleSurface::new(&scan.mesh.positions, &scan.mesh.faces)?;
    let way = |of: &Trajectory| -> Vec<Point3<f64>> {
        of.poses().iter().step_by(4).map(|pose| pose.translation.vector.into()).collect()
    };
    let (true_way, estimated) = (way(&scan.flown), way(&scan.estimated));
    let middle: Vector3<f64> = true_way.iter().map(|p| p.coords).sum::<Vector3<f64>>() / true_way.len().max(1) as f64;
    let ahead = scan.flown.poses().first().map_or(Vector3::x(), |pose| pose * Vector3::x());
    let reach = true_way.iter().map(|p| (p.coords - middle).norm()).fold(1.0, f64::max);
    let aside = Vector3::z().cross(&ahead);
    let eye = middle - ahead * (2.2 * reach) + aside * (1.1 * reach) + Vector3::z() * (0.7 * reach);
    let camera = Camera::looking_at(&eye.into(), &(middle + ahead * 0.7).into(), &Vector3::z(), 1.05, VIEW)?;
    let towards_sun = UnitVector3::new_normalize(Vector3::z() - ahead * 0.6 - aside);
    let lights = Lights { towards_sun, ..Lights::default() };
    let shade = |hit: &Hit| Shading::matt([0.62, 0.56, 0.5], hit.normal);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let frame = render(&surface, &camera, &shade, &lights, 2, threads)?;
    let project = |p: &Point3<f64>| {
        let c = camera.world_from_camera.inverse_transform_point(p);
        (c.z > 0.05).then(|| (camera.fx * c.x / c.z + camera.cx, camera.fy * c.y / c.z + camera.cy, c.z))
    };
    let picture = Rgb::from_pixels(VIEW.0 as usize, VIEW.1 as usize, frame.colour.iter().copied());
    let scene = Scene { picture, depth: &frame.depth, project: &project };
    let line = |points, colour| Polyline { points, colour, radius: 1.2 };
    save_scene(path, scene, &[line(true_way, [0, 90, 200]), line(estimated, [230, 110, 20])])?;
    Ok(())
}
