//! Focal length and centre with which depth images fit each other best.
//!
//! A wrong focal length stretches all that is seen. Images of a camera that only moves still fit each other then; those of one that turns do
//! not. So pairs of images that were taken at an angle are registered once more, point to plane, with the camera's focal length and centre as
//! unknowns that all pairs share. A wrong depth scale makes a smaller world that fits as well: it cannot be told here.

use nalgebra::{Isometry3, Matrix3, Matrix6, Matrix6x3, Vector3, Vector6};

use crate::settings::NoiseModel;
use crate::tracking::image_level::ImageLevel;
use crate::tracking::pose::moved;

/// One point of an image is taken for every so many pixels along each side.
const STRIDE: usize = 2;
/// A normal is of pixels so far away on both sides.
const ARM: usize = 2;
/// Depths of neighbouring pixels of one surface differ by less (ours).
const LARGEST_RATIO: f64 = 1.15;
/// Largest distances of partners, metres, one iteration after the other (ours).
const REACHES: [f64; 14] = [0.3, 0.3, 0.2, 0.2, 0.15, 0.15, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1];
/// Huber's constant: 95 % efficiency on normal residuals.
const HUBER: f64 = 1.345;
/// What is known of the logarithm of the focal length and of the centre, as a share of the focal length, before (ours).
const PRIOR: [f64; 3] = [0.5, 0.5, 0.5];
/// Most change of these in one iteration.
const LARGEST_STEP: f64 = 0.08;
/// Of a pair's pose, radians and metres: keeps a pair before a wall from sliding away.
const POSE_PRIOR: f64 = 0.1;
/// Two points agree within three standard deviations and this, metres (ours).
const TOLERANCE: f64 = 0.004;

/// A depth image at low resolution, and where it was taken.
#[derive(Debug)]
pub(crate) struct Kept {
    pub(crate) level: ImageLevel,
    pub(crate) world_from_camera: Isometry3<f64>,
}

/// Focal lengths and centre of the low resolution, pixels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pinhole {
    pub(crate) focal: [f64; 2],
    pub(crate) centre: [f64; 2],
}

/// What a fit has found.
#[derive(Debug, Clone)]
pub(crate) struct Fit {
    /// Change of the logarithm of the focal length, and of the centre as a share of the focal length.
    pub(crate) change: Vector3<f64>,
    /// Standard deviations of that, by how much the pairs differ in it.
    pub(crate) deviation: Vector3<f64>,
    /// Share of the points that agree.
    pub(crate) agreement: f64,
}

impl Pinhole {
    pub(crate) fn of(level: &ImageLevel) -> Self {
        Self { focal: level.focal.map(f64::from), centre: level.centre.map(f64::from) }
    }

    pub(crate) fn changed(&self, change: &Vector3<f64>) -> Self {
        let [fx, fy] = self.focal;
        let (scale, [cx, cy]) = (change[0].exp(), self.centre);
        Self { focal: [fx * scale, fy * scale], centre: [cx + change[1] * fx.abs(), cy + change[2] * fy.abs()] }
    }

    fn point(&self, u: usize, v: usize, depth: f64) -> Vector3<f64> {
        let [x, y] = [u as f64 - self.centre[0], v as f64 - self.centre[1]];
        Vector3::new(x / self.focal[0] * depth, y / self.focal[1] * depth, depth)
    }

    /// Derivative of a pixel's point by a change, to first order.
    fn slopes(&self, point: &Vector3<f64>) -> Matrix3<f64> {
        let along = |k: usize| -point.z * self.focal[k].signum();
        Matrix3::new(-point.x, along(0), 0.0, -point.y, 0.0, along(1), 0.0, 0.0, 0.0)
    }
}

/// Sums of one pair: of its pose, of the camera, and of both.
#[derive(Default)]
struct Sums {
    pose: Matrix6<f64>,
    both: Matrix6x3<f64>,
    camera: Matrix3<f64>,
    pull: Vector6<f64>,
    camera_pull: Vector3<f64>,
    residuals: Vec<f64>,
    seen: u32,
    agreeing: u32,
}

/// A pair's normal equations without its pose (Schur complement).
struct Reduced {
    h: Matrix3<f64>,
    b: Vector3<f64>,
}

impl Sums {
    /// `None` where the pose's part cannot be inverted: no points.
    fn pose_inverse(&self) -> Option<Matrix6<f64>> {
        (self.pose + Matrix6::identity() / (POSE_PRIOR * POSE_PRIOR)).try_inverse()
    }

    fn reduced(&self) -> Option<Reduced> {
        let gain = self.both.transpose() * self.pose_inverse()?;
        Some(Reduced { h: self.camera - gain * self.both, b: self.camera_pull - gain * self.pull })
    }
}

struct Pair<'a> {
    from: &'a ImageLevel,
    to: &'a ImageLevel,
    to_from: Isometry3<f64>,
}

impl Pair<'_> {
    fn sums(&self, camera: &Pinhole, noise: &NoiseModel, scale: f64, reach: f64) -> Sums {
        let mut sums = Sums::default();
        let rotation = self.to_from.rotation.to_rotation_matrix().into_inner();
        for v in (STRIDE / 2..self.from.height).step_by(STRIDE) {
            for u in (STRIDE / 2..self.from.width).step_by(STRIDE) {
                let Some(depth) = depth(self.from, u, v) else { continue };
                let own = camera.point(u, v, depth);
                let there = rotation * own + self.to_from.translation.vector;
                if there.z < 0.05 {
                    continue;
                }
                let at = [0, 1].map(|k| (camera.focal[k] * there[k] / there.z + camera.centre[k]).round());
                // A NaN fails.
                if !(at[0] >= 0.0 && at[1] >= 0.0 && at[0] < self.to.width as f64 && at[1] < self.to.height as f64) {
                    continue;
                }
                let Some((seen, normal)) = surface(self.to, camera, at[0] as usize, at[1] as usize) else { continue };
                let apart = seen - there;
                sums.seen += 1;
                if apart.norm() > reach {
                    continue;
                }
                let sigma = noise.deviation(seen.z) * normal.z.abs().max(0.2);
                let residual = normal.dot(&apart);
                sums.agreeing += u32::from(residual.abs() < 3.0 * sigma + TOLERANCE);
                sums.residuals.push(residual.abs() / sigma);
                let sigma = sigma * scale;
                let weight = (HUBER / (residual.abs() / sigma).max(HUBER)) / (sigma * sigma);
                let turn = there.cross(&normal);
                let pose = -Vector6::new(turn.x, turn.y, turn.z, normal.x, normal.y, normal.z);
                let slopes = camera.slopes(&seen) - rotation * camera.slopes(&own);
                let of_camera = slopes.transpose() * normal;
                sums.pose += weight * pose * pose.transpose();
                sums.both += weight * pose * of_camera.transpose();
                sums.camera += weight * of_camera * of_camera.transpose();
                sums.pull += weight * residual * pose;
                sums.camera_pull += weight * residual * of_camera;
            }
        }
        sums
    }
}

fn depth(level: &ImageLevel, u: usize, v: usize) -> Option<f64> {
    let omega = level.omega[v * level.width + u];
    (omega > 0.0).then(|| 1.0 / f64::from(omega))
}

/// A point and the normal there; `None` on an edge.
fn surface(level: &ImageLevel, camera: &Pinhole, u: usize, v: usize) -> Option<(Vector3<f64>, Vector3<f64>)> {
    if u < ARM || v < ARM || u + ARM >= level.width || v + ARM >= level.height {
        return None;
    }
    let here = depth(level, u, v)?;
    let near = |u: usize, v: usize| {
        let depth = depth(level, u, v).filter(|z| (z / here).max(here / z) < LARGEST_RATIO)?;
        Some(camera.point(u, v, depth))
    };
    let across = near(u + ARM, v)? - near(u - ARM, v)?;
    let down = near(u, v + ARM)? - near(u, v - ARM)?;
    Some((camera.point(u, v, here), across.cross(&down).try_normalize(0.0)?))
}

/// Registers pairs of images with the camera's change among the unknowns, or, if not `free`, without. `None` if the pairs say nothing.
pub(crate) fn fit(kept: &[Kept], pairs: &[[usize; 2]], noise: &NoiseModel, free: bool) -> Option<Fit> {
    let given = Pinhole::of(&kept.first()?.level);
    let mut pairs: Vec<Pair> = pairs
        .iter()
        .map(|&[from, to]| Pair {
            from: &kept[from].level,
            to: &kept[to].level,
            to_from: kept[to].world_from_camera.inverse() * kept[from].world_from_camera,
        })
        .collect();
    let mut change = Vector3::zeros();
    let mut scale = 4.0;
    let prior = Matrix3::from_diagonal(&Vector3::from(PRIOR).map(|known| known.powi(-2)));
    let mut last: Vec<Sums> = Vec::new();
    for reach in REACHES {
        let camera = given.changed(&change);
        last = pairs.iter().map(|pair| pair.sums(&camera, noise, scale, reach)).collect();
        let mut residuals: Vec<f64> = last.iter().flat_map(|sums| sums.residuals.iter().copied()).collect();
        if residuals.is_empty() {
            return None;
        }
        let middle = residuals.len() / 2;
        scale = (1.4826 * *residuals.select_nth_unstable_by(middle, f64::total_cmp).1).max(0.1);
        let mut h = prior;
        let mut b = prior * change;
        for reduced in last.iter().filter_map(Sums::reduced) {
            h += reduced.h;
            b += reduced.b;
        }
        let step = if free { -(h.try_inverse()? * b) } else { Vector3::zeros() };
        let step = step * (LARGEST_STEP / step.amax().max(LARGEST_STEP));
        for (pair, sums) in pairs.iter_mut().zip(&last) {
            if let Some(inverse) = sums.pose_inverse() {
                let turned = -(inverse * (sums.pull + sums.both * step));
                pair.to_from = turned_there(&pair.to_from, &turned);
            }
        }
        change += step;
    }
    let reduced: Vec<Reduced> = last.iter().filter_map(Sums::reduced).collect();
    let inverse = reduced.iter().fold(prior, |sum, pair| sum + pair.h).try_inverse()?;
    // Pairs share images: twice what independent ones would have.
    let scatter = reduced.iter().fold(Matrix3::zeros(), |sum, pair| sum + 2.0 * pair.b * pair.b.transpose());
    let covariance = inverse * scatter * inverse + inverse;
    let count = |of: fn(&Sums) -> u32| last.iter().map(|sums| f64::from(of(sums))).sum::<f64>();
    let agreement = count(|sums| sums.agreeing) / count(|sums| sums.seen).max(1.0);
    Some(Fit { change, deviation: covariance.diagonal().map(f64::sqrt), agreement })
}

/// `exp(ξ) T`: a turn about the origin of the frame that the pose leads to.
fn turned_there(pose: &Isometry3<f64>, step: &Vector6<f64>) -> Isometry3<f64> {
    moved(&Isometry3::identity(), step) * pose
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pair that shows nothing leaves its pose as uncertain as it was: a tenth of a radian, and of a metre.
    #[test]
    fn without_points_the_pose_is_the_prior() {
        let covariance = Sums::default().pose_inverse().unwrap();
        assert!((covariance - Matrix6::identity() * 0.01).amax() < 1e-12, "{covariance}");
    }
}
