//! The gyroscope: rotations between images against rates.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::imu_check::reading::{AxesReading, clearly_better};
use crate::imu_check::seen_image::{MIN_POINTS, SeenImage, between};
use crate::imu_check::signed_axes::signed_permutations;
use crate::lie::so3;
use crate::samples::Imu;

/// Time between the two images that tell a rotation, s.
const PAIR_S: f64 = 0.15;
/// Pairs of images without which nothing is said.
const MIN_PAIRS: usize = 20;
/// More pairs tell no more.
const MAX_PAIRS: usize = 120;
/// Steps between samples that count as one rotation.
const STEPS_TOGETHER: usize = 4;

/// How the gyroscope has to be read, and how many pairs of images tell.
pub(super) fn check_gyroscope(
    samples: &[Imu],
    images: &[SeenImage],
    bias: &Vector3<f64>,
) -> (Option<AxesReading>, usize) {
    let readings: Vec<AxesReading> = [false, true]
        .into_iter()
        .flat_map(|degrees| signed_permutations().map(move |axes| AxesReading::new(axes, degrees)))
        .collect();
    let pairs = turning_pairs(samples, images, bias);
    let mut left: Vec<Vec<f64>> = vec![Vec::with_capacity(pairs.len()); readings.len()];
    for pair in &pairs {
        for (reading, left) in readings.iter().zip(&mut left) {
            left.push(pair.unexplained(reading));
        }
    }
    let pairs = pairs.len();
    if pairs < MIN_PAIRS {
        return (None, pairs);
    }
    (clearly_better(&readings, &left), pairs)
}

/// Two images, and how the sensor turned from one to the other.
struct Pair {
    /// Directions of the same points.
    seen: Vec<(Vector3<f64>, Vector3<f64>)>,
    /// Rotation vectors of successive short times, as read.
    turns: Vec<Vector3<f64>>,
}

/// The pairs of images between which the sensor turned most, whichever axes it has.
fn turning_pairs(samples: &[Imu], images: &[SeenImage], bias: &Vector3<f64>) -> Vec<Pair> {
    let (mut pairs, mut first): (Vec<Pair>, _) = (Vec::new(), 0);
    for (second, to) in images.iter().enumerate() {
        while first < second && to.stamp.secs_since(images[first].stamp) > 1.5 * PAIR_S {
            first += 1;
        }
        let from = &images[first];
        if to.stamp.secs_since(from.stamp) < PAIR_S {
            continue;
        }
        let seen: Vec<_> = from.points.iter().filter_map(|(id, d)| Some((*d, to.direction(*id)?))).collect();
        if seen.len() < MIN_POINTS {
            continue;
        }
        let steps = between(samples, from.stamp, to.stamp);
        let turn =
            |pair: &[Imu]| ((pair[0].gyro + pair[1].gyro) * 0.5 - bias) * pair[1].stamp.secs_since(pair[0].stamp);
        let each: Vec<Vector3<f64>> = steps.windows(2).map(turn).collect();
        let turns = each.chunks(STEPS_TOGETHER).map(|some| some.iter().sum()).collect();
        pairs.push(Pair { seen, turns });
    }
    let turned = |pair: &Pair| pair.turns.iter().sum::<Vector3<f64>>().norm();
    pairs.sort_by(|a, b| turned(b).total_cmp(&turned(a)));
    pairs.truncate(MAX_PAIRS);
    pairs
}

impl Pair {
    /// Smallest eigenvalue of the mean square of the normals of the epipolar planes.
    fn unexplained(&self, reading: &AxesReading) -> f64 {
        let mut rotation = UnitQuaternion::identity();
        for turn in &self.turns {
            rotation *= so3::exp(&(reading.axes * turn * reading.factor()));
        }
        let mut normals = Matrix3::zeros();
        for (a, b) in &self.seen {
            let normal = a.cross(&(rotation * b));
            normals += normal * normal.transpose();
        }
        normals.symmetric_eigenvalues().min().max(0.0) / self.seen.len() as f64
    }
}
