//! Whether a frame shows what the map shows, whatever the lamp: correlation of intensities at a pose.

use nalgebra::{Isometry3, Vector3};

use crate::tracking::image_level::ImageLevel;
use crate::tracking::model_points::{Model, ModelPoint};
use crate::tracking::residuals::Comparison;

/// With fewer pairs nothing is said.
const LEAST_PAIRS: usize = 64;
/// Intensities that vary by less are noise, grey levels (ours).
const LEAST_DEVIATION: f64 = 6.0;

/// Correlation of the intensities of the model and of the frame, `-1..=1`, over the points that both have; `None` where there are few of
/// them or where the model is of one grey.
pub(crate) fn intensity_correlation(comparison: &Comparison, pose: &Isometry3<f64>) -> Option<f64> {
    let Comparison { level, model, .. } = comparison;
    if level.intensity.is_empty() {
        return None;
    }
    let origin = pose.translation.vector - comparison.origin;
    let pairs = pairs(level, model, |point| pose.rotation.inverse_transform_vector(&(point - origin)));
    if pairs.len() < LEAST_PAIRS {
        return None;
    }
    let count = pairs.len() as f64;
    let mean = [0, 1].map(|k| pairs.iter().map(|pair| pair[k]).sum::<f64>() / count);
    let moment = |i: usize, j: usize| pairs.iter().map(|p| (p[i] - mean[i]) * (p[j] - mean[j])).sum::<f64>() / count;
    let variance = [moment(0, 0), moment(1, 1)];
    // A frame of one grey before a model that is not is unlike it.
    (variance[0].sqrt() >= LEAST_DEVIATION).then(|| moment(0, 1) / (variance[0] * variance[1].max(1.0)).sqrt())
}

/// Intensities of the model and of the nearest pixel of the frame.
fn pairs(level: &ImageLevel, model: &Model, camera_from_model: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Vec<[f64; 2]> {
    let [focal, centre] = [level.focal, level.centre].map(|pair| pair.map(f64::from));
    let pair = |point: &ModelPoint| {
        let p = camera_from_model(Vector3::from(point.position.map(f64::from)));
        if p.z < 0.05 || point.intensity.is_nan() {
            return None;
        }
        let [u, v] = [focal[0] * p.x / p.z + centre[0], focal[1] * p.y / p.z + centre[1]].map(f64::round);
        if !(u >= 0.0 && v >= 0.0 && u < level.width as f64 && v < level.height as f64) {
            return None;
        }
        let seen = level.intensity[v as usize * level.width + u as usize];
        (!seen.is_nan()).then(|| [f64::from(point.intensity), f64::from(seen)])
    };
    model.points.iter().filter_map(pair).collect()
}
