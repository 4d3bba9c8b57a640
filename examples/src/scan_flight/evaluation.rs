//! How well a surface was scanned.

use nalgebra::{Isometry3, Point3};
use paint_sim::{Surface, TriangleSurface};
use serde::Serialize;
use vio_ekf::Trajectory;
use vio_ekf::eval::{Alignment, ate};

use super::error::ScanFlightError;
use crate::mesh_io::TriangleMesh;

/// A place of the true surface counts as scanned when the map is no farther from it than this, metres.
const NEAR: f64 = 0.05;
/// Figures of a scan. Flat, SI units in the names.
#[derive(Debug, Clone, Serialize)]
pub struct ScanFlightFigures {
    /// Time with an estimate.
    pub duration_s: f64,
    /// Way flown meanwhile.
    pub path_length_m: f64,
    /// Position error in the map after rigid alignment, root mean square.
    pub ate_se3_rmse_m: f64,
    /// Position error in the map, without any alignment: largest.
    pub position_error_max_m: f64,
    /// The same of odometry alone.
    pub odometry_error_max_m: f64,
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
            "{:.0} m flown, {:.1} cm off at most ({:.1} cm by odometry alone); {} triangles, {:.1} mm off in the mean, {:.1} % of the surface",
            self.path_length_m,
            100.0 * self.position_error_max_m,
            100.0 * self.odometry_error_max_m,
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
    by_odometry: &Trajectory,
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
    let worst = |of: &Trajectory| flown.poses().iter().zip(of.poses()).map(apart).fold(0.0, f64::max);
    Ok(ScanFlightFigures {
        duration_s: flown.duration_s(),
        path_length_m: flown.path_length(),
        ate_se3_rmse_m: ate(flown.poses(), estimated.poses(), Alignment::Se3)?.position.rmse,
        position_error_max_m: worst(estimated),
        odometry_error_max_m: worst(by_odometry),
        mesh_error_mean_m: off.iter().sum::<f64>() / off.len().max(1) as f64,
        mesh_error_p95_m: off.get(off.len() * 95 / 100).copied().unwrap_or(0.0),
        covered_share: near as f64 / mesh.positions.len().max(1) as f64,
        vertices: scanned.positions.len(),
        triangles: scanned.faces.len(),
    })
}
