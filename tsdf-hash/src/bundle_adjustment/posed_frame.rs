//! A keyframe at its present pose: what it says of a point of the surface.

use nalgebra::{Isometry3, Matrix3, Vector3, Vector6};

use crate::bundle_adjustment::pixel_cell::PixelCell;
use crate::bundle_adjustment::settings::BundleAdjustmentSettings;
use crate::bundle_adjustment::surface_points::SurfacePoint;
use crate::tracking::image_level::ImageLevel;

/// Surfaces seen at a smaller cosine than this say little, and that badly (ours).
const LEAST_COSINE: f64 = 0.25;
/// Nothing is seen nearer than this, metres.
const NEAREST: f64 = 0.05;

/// A keyframe at its present pose.
pub(crate) struct PosedFrame<'a> {
    level: &'a ImageLevel,
    camera_from_world: Matrix3<f64>,
    centre: Vector3<f64>,
}

/// How a keyframe sees a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Observation {
    pub(crate) frame: usize,
    /// Of the measured surface above the point, along the normal, and its standard deviation, metres.
    pub(crate) distance: f64,
    pub(crate) sigma: f64,
    pub(crate) intensity: Option<Intensity>,
}

/// An intensity, 0..=255, and its slope along the surface, in the world, per metre.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Intensity {
    pub(crate) value: f64,
    pub(crate) slope: Vector3<f64>,
}

impl<'a> PosedFrame<'a> {
    pub(crate) fn new(level: &'a ImageLevel, world_from_camera: &Isometry3<f64>) -> Self {
        Self {
            level,
            camera_from_world: world_from_camera.rotation.inverse().to_rotation_matrix().into_inner(),
            centre: world_from_camera.translation.vector,
        }
    }

    /// From the camera to the point, and the normal there, along the axes of the camera.
    fn seen(&self, point: &SurfacePoint) -> (Vector3<f64>, Vector3<f64>) {
        (self.camera_from_world * (point.position - self.centre), self.camera_from_world * point.normal)
    }

    /// The point as this keyframe, number `frame`, sees it; `None` where it does not, or sees something else.
    pub(crate) fn observe(
        &self,
        frame: usize,
        point: &SurfacePoint,
        settings: &BundleAdjustmentSettings,
    ) -> Option<Observation> {
        let level = self.level;
        let (arm, normal) = self.seen(point);
        let facing = -normal.dot(&arm);
        if arm.z < NEAREST || facing < LEAST_COSINE * arm.norm() {
            return None;
        }
        let cell = PixelCell::of(level, &arm)?;
        let omega = f64::from(cell.inverse_depth(level)?);
        // Where the ray meets what was measured.
        let distance = normal.dot(&arm) * (1.0 / (omega * arm.z) - 1.0);
        // By the depth of the point, not by the one that was measured: what happens to be too near would weigh more.
        let sigma = settings.noise.deviation(arm.z) * facing / arm.z;
        if distance.abs() > 3.0 * sigma + settings.max_distance {
            return None;
        }
        let intensity = if settings.photometric { cell.intensity(level) } else { None };
        let intensity = intensity.map(|(value, [gu, gv])| {
            let (gx, gy) = (gu / arm.z, gv / arm.z);
            let gradient = Vector3::new(gx, gy, -(gx * arm.x + gy * arm.y) / arm.z);
            let slope = gradient - gradient.dot(&normal) * normal;
            Intensity { value, slope: self.camera_from_world.transpose() * slope }
        });
        Some(Observation { frame, distance, sigma, intensity })
    }

    /// Derivative of the distance by `ξ` in `T exp(ξ)` of the keyframe's pose. It is taken at the point, not at what was measured: the same noise in
    /// both would turn the keyframe.
    pub(crate) fn distance_jacobian(&self, point: &SurfacePoint) -> Vector6<f64> {
        let (arm, normal) = self.seen(point);
        let turn = arm.cross(&normal);
        Vector6::new(turn.x, turn.y, turn.z, normal.x, normal.y, normal.z)
    }

    /// Derivatives of the intensity that this keyframe sees at a point of a surface whose intensity has a slope: by `ξ`, and by the way of the
    /// point along its normal.
    pub(crate) fn intensity_jacobian(&self, point: &SurfacePoint, slope: &Vector3<f64>) -> (Vector6<f64>, f64) {
        let (arm, normal) = self.seen(point);
        let slope = self.camera_from_world * slope;
        // Along the ray nothing changes.
        let gradient = slope - slope.dot(&arm) / normal.dot(&arm) * normal;
        // The point moves against the camera.
        let turn = gradient.cross(&arm);
        (Vector6::new(turn.x, turn.y, turn.z, -gradient.x, -gradient.y, -gradient.z), gradient.dot(&normal))
    }
}
