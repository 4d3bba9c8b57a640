//! How well a surface was scanned, and a picture of it.

use std::path::Path;

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};
use paint_sim::{Camera, Hit, Lights, Shading, Surface, TriangleSurface, render};
use serde::Serialize;
use vio_ekf::{Alignment, Trajectory, ate};

use super::{ScanFlight, ScanFlightError};
use crate::mesh_io::{TriangleMesh, write_ply};
use crate::mission::MissionError;
use crate::pictures::{Polyline, Rgb, Scene, save_scene};

/// A place of the true surface counts as scanned when the map is no farther from it than this, metres.
const NEAR: f64 = 0.05;
/// Size of the picture, pixels.
const VIEW: (u32, u32) = (1400, 900);

/// Figures of a scan. Flat, SI units in the names.
#[derive(Debug, Clone, Serialize)]
pub struct ScanFlightFigures {
    /// Time with an estimate.
    pub duration_s: f64,
    /// Way flown meanwhile.
    pub path_length_m: f64,
    /// Position error of the odometry after rigid alignment, root mean square.
    pub ate_se3_rmse_m: f64,
    /// Position error as flown, without any alignment: largest.
    pub position_error_max_m: f64,
    /// Distance of the map's vertices from the true surface: mean.
    pub mesh_error_mean_m: f64,
    /// The same: 95th percentile.
    pub mesh_error_p95_m: f64,
    /// Share of the true surface's vertices that the map comes near to (5 cm).
    pub covered_share: f64,
    /// Vertices of the map's mesh.
    pub vertices: usize,
    /// Its triangles.
    pub triangles: usize,
}

impl ScanFlightFigures {
    pub(super) fn summary(&self) -> String {
        format!(
            "{:.0} m flown, {:.1} cm of drift at most; {} triangles, {:.1} mm off in the mean, {:.1} % of the surface",
            self.path_length_m,
            100.0 * self.position_error_max_m,
            self.triangles,
            1e3 * self.mesh_error_mean_m,
            100.0 * self.covered_share
        )
    }
}

pub(super) fn figures(
    surface: &TriangleSurface,
    mesh: &TriangleMesh,
    scanned: &TriangleMesh,
    flown: &Trajectory,
    estimated: &Trajectory,
) -> Result<ScanFlightFigures, ScanFlightError> {
    let distances = |points: &[[f32; 3]], to: &TriangleSurface| -> Vec<f64> {
        points.iter().map(|p| to.distance(&Point3::from(p.map(f64::from)), 1.0)).collect()
    };
    let mut off = distances(&scanned.positions, surface);
    off.sort_unstable_by(f64::total_cmp);
    let map = TriangleSurface::new(&scanned.positions, &scanned.faces)?;
    let near = distances(&mesh.positions, &map).into_iter().filter(|d| *d <= NEAR).count();
    let apart = |(a, b): (&Isometry3<f64>, &Isometry3<f64>)| (a.translation.vector - b.translation.vector).norm();
    Ok(ScanFlightFigures {
        duration_s: flown.duration_s(),
        path_length_m: flown.path_length(),
        ate_se3_rmse_m: ate(flown.poses(), estimated.poses(), Alignment::Se3)?.position.rmse,
        position_error_max_m: flown.poses().iter().zip(estimated.poses()).map(apart).fold(0.0, f64::max),
        mesh_error_mean_m: off.iter().sum::<f64>() / off.len().max(1) as f64,
        mesh_error_p95_m: off.get(off.len() * 95 / 100).copied().unwrap_or(0.0),
        covered_share: near as f64 / mesh.positions.len().max(1) as f64,
        vertices: scanned.positions.len(),
        triangles: scanned.faces.len(),
    })
}

impl ScanFlight {
    /// Writes `survey.json`, `survey.png`, `survey.ply` and both trajectories into an existing folder.
    pub fn save(&self, folder: &Path) -> Result<(), MissionError> {
        let write = |name: &str, text: String| {
            let path = folder.join(name);
            std::fs::write(&path, text)
                .map_err(|source| MissionError::Unwritable { path: path.display().to_string(), source })
        };
        write("survey_true.tum", vio_ekf::tum::write(&self.flown))?;
        write("survey_estimated.tum", vio_ekf::tum::write(&self.estimated))?;
        let ply = folder.join("survey.ply");
        let grey = vec![[180; 3]; self.mesh.positions.len()];
        write_ply(&ply, &self.mesh.positions, &self.mesh.faces, &grey)
            .map_err(|source| MissionError::Unwritable { path: ply.display().to_string(), source })?;
        self.save_picture(&folder.join("survey.png"))?;
        let figures = serde_json::to_string_pretty(&self.figures).map_err(crate::report::ReportError::from)?;
        write("survey.json", figures + "\n")
    }

    /// The map with the way that was flown (blue) and the way that was estimated (orange), from behind the robot's shoulder.
    fn save_picture(&self, path: &Path) -> Result<(), MissionError> {
        let surface = TriangleSurface::new(&self.mesh.positions, &self.mesh.faces)?;
        let way = |of: &Trajectory| -> Vec<Point3<f64>> {
            of.poses().iter().step_by(4).map(|pose| pose.translation.vector.into()).collect()
        };
        let (true_way, estimated) = (way(&self.flown), way(&self.estimated));
        let middle: Vector3<f64> =
            true_way.iter().map(|p| p.coords).sum::<Vector3<f64>>() / true_way.len().max(1) as f64;
        let ahead = self.flown.poses().first().map_or(Vector3::x(), |pose| pose * Vector3::x());
        let reach = true_way.iter().map(|p| (p.coords - middle).norm()).fold(1.0, f64::max);
        let aside = Vector3::z().cross(&ahead);
        let eye = middle - ahead * (2.2 * reach) + aside * (1.1 * reach) + Vector3::z() * (0.7 * reach);
        let camera = Camera::looking_at(&eye.into(), &(middle + ahead * 0.7).into(), &Vector3::z(), 1.05, VIEW)?;
        let towards_sun = UnitVector3::new_normalize(Vector3::z() - ahead * 0.6 - aside);
        let lights = Lights { towards_sun, ..Lights::default() };
        let shade = |hit: &Hit| Shading { albedo: [0.62, 0.56, 0.5], normal: hit.normal };
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
}
