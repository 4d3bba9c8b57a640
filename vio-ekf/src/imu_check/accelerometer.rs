//! The accelerometer: places that stay where they are, under gravity.

use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};

use crate::imu_check::reading::{AxesReading, clearly_better};
use crate::imu_check::seen_image::{MIN_POINTS, SeenImage, between};
use crate::imu_check::signed_axes::signed_permutations;
use crate::lie::so3;
use crate::samples::Imu;

/// Images that one window holds.
const WINDOW: usize = 12;
/// Time between them at least, s: long enough for accelerations to show; where too few points stay in view for so long, shorter.
const SPACINGS: [f64; 3] = [0.15, 0.08, 0.04];
/// Windows without which nothing is said.
const MIN_WINDOWS: usize = 3;
/// More windows tell no more.
const MAX_WINDOWS: usize = 40;
/// Standard deviation of an accelerometer's bias, m/s², and of what a direction times its distance is off, m: their ratio weighs
/// the bias in the fit.
const BIAS_SIGMA: f64 = 0.1;
const PLACE_SIGMA: f64 = 0.01;
/// Prior distance of a point, m, and its weight, per m².
const PRIOR_DISTANCE: (f64, f64) = (4.0, 1e-5);

/// Unknowns of a window: velocity, gravity, bias; then the entries of the accelerometer's matrix, and one for what is known.
const FREE: usize = 9;
const TERMS: usize = FREE + 9 + 1;

/// How the accelerometer has to be read, and how many windows tell.
pub(super) fn check_accelerometer(
    samples: &[Imu],
    images: &[SeenImage],
    lever: &Vector3<f64>,
    gravity: f64,
) -> (Option<AxesReading>, usize) {
    let readings: Vec<AxesReading> = signed_permutations().map(|axes| AxesReading::new(axes, false)).collect();
    let mut left: Vec<Vec<f64>> = vec![Vec::new(); readings.len()];
    for spacing in SPACINGS {
        left.iter_mut().for_each(Vec::clear);
        for window in windows(images, spacing) {
            let Some(equations) = window_equations(samples, &window, lever) else { continue };
            for (reading, left) in readings.iter().zip(&mut left) {
                left.push(least_squares(&equations, reading, gravity));
            }
            if left[0].len() == MAX_WINDOWS {
                break;
            }
        }
        if left[0].len() >= MIN_WINDOWS {
            break;
        }
    }
    let windows = left[0].len();
    if windows < MIN_WINDOWS {
        return (None, windows);
    }
    (clearly_better(&readings, &left), windows)
}

/// Windows of images that are so far apart at least, each from where the one before ends.
fn windows(images: &[SeenImage], spacing: f64) -> Vec<Vec<&SeenImage>> {
    let (mut windows, mut window): (_, Vec<&SeenImage>) = (Vec::new(), Vec::with_capacity(WINDOW));
    for image in images {
        if window.last().is_none_or(|before| image.stamp.secs_since(before.stamp) >= spacing) {
            window.push(image);
        }
        if window.len() == WINDOW {
            windows.push(std::mem::replace(&mut window, vec![image]));
        }
    }
    windows
}

/// Normal equations of a window, without the distances, per equation; `None` if it shares too few points.
fn window_equations(
    samples: &[Imu],
    window: &[&SeenImage],
    lever: &Vector3<f64>,
) -> Option<SMatrix<f64, TERMS, TERMS>> {
    let moved: Vec<Moved> = moved(samples, window);
    // The camera's place by the terms: v t + g t²/2 + α(A) − α_b b + R r.
    let place = |k: usize| {
        let Moved { rotation, time, by_bias, by_entries } = &moved[k];
        let mut place = SMatrix::<f64, 3, TERMS>::zeros();
        place.fixed_view_mut::<3, 3>(0, 0).fill_diagonal(*time);
        place.fixed_view_mut::<3, 3>(0, 3).fill_diagonal(0.5 * time * time);
        place.fixed_columns_mut::<3>(6).copy_from(&-by_bias);
        place.fixed_columns_mut::<9>(FREE).copy_from(by_entries);
        place.set_column(TERMS - 1, &(rotation * lever));
        place
    };
    let places: Vec<_> = (0..window.len()).map(place).collect();
    let mut ids: Vec<u64> = window.iter().flat_map(|image| image.points.iter().map(|point| point.0)).collect();
    ids.sort_unstable();
    ids.dedup();
    let mut normal = SMatrix::<f64, TERMS, TERMS>::zeros();
    let (mut used, mut count) = (0, 0.0);
    for id in ids {
        let seen: Vec<(usize, Vector3<f64>)> =
            window.iter().enumerate().filter_map(|(k, image)| Some((k, image.direction(id)?))).collect();
        // A point that is followed through half of the window tells of its motion.
        if seen.len() * 2 < window.len() {
            continue;
        }
        used += 1;
        let (anchor, first) = (seen[0].0, moved[seen[0].0].rotation * seen[0].1);
        let (mut hh, mut h) = (PRIOR_DISTANCE.1, SVector::<f64, TERMS>::zeros());
        h[TERMS - 1] = -PRIOR_DISTANCE.0 * PRIOR_DISTANCE.1;
        for (k, direction) in &seen[1..] {
            // m × (d m_a + r_a − r) = 0.
            let cross = so3::hat(&(moved[*k].rotation * direction));
            let row = cross * (places[anchor] - places[*k]);
            let by_distance = cross * first;
            hh += by_distance.norm_squared();
            h += row.transpose() * by_distance;
            normal += row.transpose() * row;
            count += 1.0;
        }
        normal -= h * h.transpose() / hh;
    }
    (used >= MIN_POINTS).then(|| normal / count)
}

/// What happened since the first image of a window.
struct Moved {
    rotation: UnitQuaternion<f64>,
    time: f64,
    /// `∬ R`, and `∬ R e_r f_c` for each entry of the accelerometer's matrix, row by row.
    by_bias: Matrix3<f64>,
    by_entries: SMatrix<f64, 3, 9>,
}

fn moved(samples: &[Imu], window: &[&SeenImage]) -> Vec<Moved> {
    let mut moved = vec![Moved {
        rotation: UnitQuaternion::identity(),
        time: 0.0,
        by_bias: Matrix3::zeros(),
        by_entries: SMatrix::zeros(),
    }];
    let (mut rotation, mut time) = (UnitQuaternion::identity(), 0.0);
    let (mut bias, mut entries) = ([Matrix3::zeros(); 2], [SMatrix::<f64, 3, 9>::zeros(); 2]);
    let mut from = window[0].stamp;
    for image in &window[1..] {
        for pair in between(samples, from, image.stamp).windows(2) {
            let dt = pair[1].stamp.secs_since(pair[0].stamp);
            let (rate, force) = ((pair[0].gyro + pair[1].gyro) * 0.5, (pair[0].accel + pair[1].accel) * 0.5);
            let middle = (rotation * so3::exp(&(rate * (0.5 * dt)))).to_rotation_matrix().into_inner();
            let now = SMatrix::<f64, 3, 9>::from_fn(|axis, k| middle[(axis, k / 3)] * force[k % 3]);
            let half = 0.5 * dt * dt;
            bias[1] += bias[0] * dt + middle * half;
            bias[0] += middle * dt;
            entries[1] += entries[0] * dt + now * half;
            entries[0] += now * dt;
            rotation = UnitQuaternion::new_normalize((rotation * so3::exp(&(rate * dt))).into_inner());
            time += dt;
        }
        from = image.stamp;
        moved.push(Moved { rotation, time, by_bias: bias[1], by_entries: entries[1] });
    }
    moved
}

/// What a reading leaves of the equations with the best velocity, bias, and gravity of the given length.
fn least_squares(equations: &SMatrix<f64, TERMS, TERMS>, reading: &AxesReading, gravity: f64) -> f64 {
    // The reading makes a constant of nine terms.
    let mut fold = SMatrix::<f64, TERMS, { FREE + 1 }>::zeros();
    fold.fixed_view_mut::<FREE, FREE>(0, 0).fill_with_identity();
    for k in 0..9 {
        fold[(FREE + k, FREE)] = reading.axes[(k / 3, k % 3)];
    }
    fold[(TERMS - 1, FREE)] = 1.0;
    let mut folded = fold.transpose() * equations * fold;
    for k in 6..FREE {
        folded[(k, k)] += (PLACE_SIGMA / BIAS_SIGMA).powi(2);
    }
    let cost = |x: &SVector<f64, FREE>| {
        let mut full = SVector::<f64, { FREE + 1 }>::from_element(1.0);
        full.fixed_rows_mut::<FREE>(0).copy_from(x);
        full.dot(&(folded * full)).max(0.0)
    };
    let matrix = folded.fixed_view::<FREE, FREE>(0, 0).into_owned();
    let vector = -folded.fixed_view::<FREE, 1>(0, FREE).into_owned();
    let Some(factor) = matrix.cholesky() else { return f64::INFINITY };
    let free = factor.solve(&vector);
    let mut x = free;
    // Gravity's length by a Lagrange multiplier on its linearised square, a few times.
    for _ in 0..4 {
        let Some(along) = x.fixed_rows::<3>(3).try_normalize(0.0) else { return f64::INFINITY };
        let mut constraint = SVector::<f64, FREE>::zeros();
        constraint.fixed_rows_mut::<3>(3).copy_from(&along);
        let response = factor.solve(&constraint);
        let excess = constraint.dot(&free) - gravity;
        x = free - response * (excess / constraint.dot(&response));
    }
    cost(&x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stamp::Stamp;

    #[test]
    fn windows_hold_twelve_images_that_are_far_enough_apart() {
        let at = |k: i64| SeenImage { stamp: Stamp::from_nanos(50_000_000 * k), points: Vec::new() };
        let images: Vec<SeenImage> = (0..100).map(at).collect();
        let found = windows(&images, 0.15);
        // Every third image, and the last of a window is the first of the next.
        assert_eq!(found.len(), 3);
        for (k, window) in found.iter().enumerate() {
            let expected: Vec<Stamp> = (0..12).map(|j| images[3 * (11 * k + j)].stamp).collect();
            assert_eq!(window.iter().map(|image| image.stamp).collect::<Vec<_>>(), expected);
        }
    }
}
