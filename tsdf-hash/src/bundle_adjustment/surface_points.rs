//! Points of the surface with their normals, from the map of the keyframes at their present poses.

use nalgebra::{Isometry3, Vector3};

use crate::bundle_adjustment::settings::BundleAdjustmentSettings;
use crate::error::Error;
use crate::keyframes::index::KeyframeIndex;
use crate::settings::Settings;

/// A point of the surface, in the world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfacePoint {
    pub(crate) position: Vector3<f64>,
    /// Of unit length, into the free side.
    pub(crate) normal: Vector3<f64>,
}

/// Vertices of the map's mesh, evenly many of all of them.
pub(crate) fn surface_points(
    keyframes: &KeyframeIndex,
    poses: &[Isometry3<f64>],
    settings: &BundleAdjustmentSettings,
) -> Result<Vec<SurfacePoint>, Error> {
    let &BundleAdjustmentSettings { voxel_size, noise, threads, max_points, .. } = settings;
    let settings = Settings { voxel_size, threads, noise, ..Settings::default() };
    let mesh = keyframes.map_of(0..keyframes.len(), poses, settings)?.mesh();
    let every = mesh.positions.len().div_ceil(max_points.max(1)).max(1);
    let vertices = mesh.positions.iter().zip(&mesh.normals).step_by(every);
    let point = |(position, normal): (&[f32; 3], &[f32; 3])| SurfacePoint {
        position: Vector3::from(*position).cast(),
        normal: Vector3::from(*normal).cast(),
    };
    Ok(vertices.map(point).collect())
}
