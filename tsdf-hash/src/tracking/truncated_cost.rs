//! The cost of a pose where slopes say nothing of it: truncated squares of the distances, as outlines shift.

use nalgebra::Isometry3;

use crate::tracking::image_level::ImageLevel;
use crate::tracking::model_points::ModelPoint;
use crate::tracking::residuals::Comparison;

/// Surfaces that are seen at a smaller angle say nothing: half a pixel is centimetres there (ours: 17 degrees).
const LEAST_COSINE: f32 = 0.3;

/// Depths of neighbouring pixels of one surface differ by less (ours).
const LARGEST_RATIO: f32 = 1.1;

/// A comparison at one pose, in single precision, relative to the camera of the view.
struct Posed<'a> {
    of: &'a Comparison<'a>,
    /// Columns of the rotation of the pose.
    columns: [[f32; 3]; 3],
    translation: [f32; 3],
    noise: [f32; 3],
    /// Multiple of the noise model.
    scale: f32,
    /// Distances that are noise, beyond three standard deviations, metres.
    width: f32,
}

impl<'a> Posed<'a> {
    fn new(of: &'a Comparison, pose: &Isometry3<f64>, scale: f32, width: f64) -> Self {
        let rotation = pose.rotation.to_rotation_matrix().into_inner().cast::<f32>();
        let noise = [of.noise.base, of.noise.quadratic, of.noise.nearest].map(|x| x as f32);
        let translation = (pose.translation.vector - of.origin).cast::<f32>().into();
        Self { of, columns: rotation.into(), translation, noise, scale, width: width as f32 }
    }

    /// `min(1, (r / (3 σ + width))²)`; `None` of a point that is out of view, or where nothing was measured.
    fn cost(&self, point: &ModelPoint) -> Option<f32> {
        let level = self.of.level;
        let arm: [f32; 3] = std::array::from_fn(|k| point.position[k] - self.translation[k]);
        let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let [x, y, z] = self.columns.map(|column| dot(column, arm));
        if z < 0.05 {
            return None;
        }
        let (u, v) = (level.focal[0] * x / z + level.centre[0], level.focal[1] * y / z + level.centre[1]);
        // A NaN fails.
        if !(u >= 0.0 && v >= 0.0 && u < (level.width - 1) as f32 && v < (level.height - 1) as f32) {
            return None;
        }
        let omega = inverse_depth(level, u, v);
        if omega <= 0.0 {
            return None;
        }
        let depth = 1.0 / omega;
        let normal = self.columns.map(|column| dot(column, point.normal));
        if dot(normal, [x, y, z]).powi(2) < LEAST_COSINE * LEAST_COSINE * (x * x + y * y + z * z) {
            return None;
        }
        let beyond = depth - self.noise[2];
        let sigma = (self.noise[0] + self.noise[1] * beyond * beyond) * normal[2].abs().max(0.2) * self.scale;
        // The measured point is on the same ray.
        let share = dot(normal, [x, y, z]) * (depth / z - 1.0) / (3.0 * sigma + self.width);
        Some((share * share).min(1.0))
    }
}

/// Between pixels: on a plane inverse depth is linear, and a rounded pixel would draw the pose to where it came from. Across an edge, that
/// of the nearest pixel.
fn inverse_depth(level: &ImageLevel, u: f32, v: f32) -> f32 {
    let (i, j) = (u as usize, v as usize);
    let (du, dv) = (u - i as f32, v - j as f32);
    let at = j * level.width + i;
    let [a, b, c, d] = [at, at + 1, at + level.width, at + level.width + 1].map(|k| level.omega[k]);
    let least = a.min(b).min(c).min(d);
    if least > 0.0 && a.max(b).max(c).max(d) < LARGEST_RATIO * least {
        return (1.0 - dv) * ((1.0 - du) * a + du * b) + dv * ((1.0 - du) * c + du * d);
    }
    match (du < 0.5, dv < 0.5) {
        (true, true) => a,
        (false, true) => b,
        (true, false) => c,
        (false, false) => d,
    }
}

/// By how much the cost rises from one pose to another: the sums of the tiles' rises and of their squares, over points that are in view
/// of both, and how many these are. Tiles, because what is wrong with the map is alike within one.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Rise {
    pub(crate) sum: f64,
    squares: f64,
    pub(crate) points: u32,
}

impl Rise {
    /// The rise as a share of the points.
    pub(crate) fn share(&self) -> f64 {
        self.sum / f64::from(self.points.max(1))
    }

    /// The rise in its own standard deviations, if tiles are independent.
    pub(crate) fn significance(&self) -> f64 {
        if self.squares > 0.0 { self.sum / self.squares.sqrt() } else { 0.0 }
    }
}

/// The rise from pose to pose, of distances that are noise up to three standard deviations and `width` metres.
pub(crate) fn rise(comparison: &Comparison, poses: [&Isometry3<f64>; 2], scale: f32, width: f64) -> Rise {
    let [from, to] = poses.map(|pose| Posed::new(comparison, pose, scale, width));
    let mut rise = Rise::default();
    for tile in comparison.model.tiles().flat_map(|tile| tile.chunks(8)) {
        let mut own = 0.0;
        for point in tile {
            if let (Some(before), Some(after)) = (from.cost(point), to.cost(point)) {
                own += f64::from(after - before);
                rise.points += 1;
            }
        }
        rise.sum += own;
        rise.squares += own * own;
    }
    rise
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::NoiseModel;
    use crate::tracking::model_points::Model;

    /// A wall a metre before the camera: squares of the distance from it, up to one; nothing of what is behind the camera or at it.
    #[test]
    fn the_cost_is_the_square_of_the_distance_before_the_camera() {
        let level = ImageLevel {
            width: 32,
            height: 24,
            focal: [30.0; 2],
            centre: [15.5, 11.5],
            omega: vec![1.0; 32 * 24],
            ..ImageLevel::default()
        };
        let noise = NoiseModel { base: 0.002, quadratic: 0.005, nearest: 0.4 };
        let (origin, model) = (nalgebra::Vector3::new(2.0, -1.0, 0.5), Model::default());
        let (max_distance, tolerance) = (0.2, 0.005);
        let comparison = Comparison {
            level: &level,
            model: &model,
            origin,
            noise,
            max_distance,
            tolerance,
            rim_width: 0.0,
            photometric: false,
            threads: 1,
        };
        let pose = Isometry3::from_parts(origin.into(), nalgebra::UnitQuaternion::identity());
        let posed = Posed::new(&comparison, &pose, 2.0, 0.01);
        let cost = |z: f32| {
            let position = [0.1 * z, 0.05 * z, z];
            posed.cost(&ModelPoint { position, normal: [0.0, 0.0, -1.0], intensity: f32::NAN })
        };
        // Three standard deviations, which are doubled, and a centimetre.
        let width = 3.0 * 2.0 * (0.002 + 0.005 * 0.36) + 0.01;
        for z in [0.985_f32, 1.0, 1.01, 1.02] {
            let expected = ((1.0 - z) / width).powi(2);
            assert!((cost(z).unwrap() - expected).abs() < 1e-4, "{z}: {:?} for {expected}", cost(z));
        }
        assert_eq!(cost(1.2), Some(1.0));
        assert_eq!([-1.0, -0.2, 0.04].map(cost), [None; 3]);
    }
}
