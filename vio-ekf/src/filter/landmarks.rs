//! Landmarks enter the state and leave it.

use nalgebra::Matrix2;

use super::estimator::Estimator;
use super::measurements::inverse_distance::InverseDistanceMeasurement;
use super::measurements::update::ungated_update;
use super::state::bearing::Bearing;
use super::state::error_state;
use super::state::inverse_distance::InverseDistance;
use super::state::landmark::{Landmark, project};
use super::state::rolling_shutter::RollingShutter;

/// Adds a landmark seen in the current image, at the distance of the shared depth prior; there must be room. `covariance` is that of
/// its tangent coordinates.
pub(crate) fn add(estimator: &mut Estimator, bearing: Bearing, warp: Matrix2<f64>, covariance: &Matrix2<f64>) {
    let expected = estimator.state.depth_prior.value;
    let row = estimator.covariance.size() + 2;
    let variance = estimator.landmarks.own_variance(expected);
    insert(estimator, bearing, warp, covariance, (expected, variance));
    // The error of the prior is an error of the landmark, so that all of them share it.
    estimator.covariance.add_row(row, 1.0, error_state::DEPTH_PRIOR);
}

/// The bearing at the time of an image's stamp of what was seen some seconds later, in a row of its own, and what not knowing the distance
/// adds to its covariance. `distance` is the inverse distance and its variance, those of a new landmark if it is not known.
pub(crate) fn at_stamp(
    estimator: &Estimator,
    bearing: Bearing,
    warp: Matrix2<f64>,
    delay: f64,
    distance: Option<(f64, f64)>,
) -> (Bearing, Matrix2<f64>) {
    if delay == 0.0 {
        return (bearing, Matrix2::zeros());
    }
    let (value, variance) = distance.unwrap_or_else(|| {
        let expected = estimator.state.depth_prior.value;
        let shared = estimator.covariance.variance(error_state::DEPTH_PRIOR);
        (expected, estimator.landmarks.own_variance(expected) + shared)
    });
    let at = |value: f64| estimator.bearing_rate(&Landmark::new(bearing, InverseDistance::new(value), warp));
    let (rate, by_distance) = (at(value), (at(value) - at(0.0)) / value.max(f64::MIN_POSITIVE));
    let shift = by_distance * delay;
    (bearing.boxplus(&(rate * -delay)), shift * shift.transpose() * variance)
}

/// Adds a landmark whose inverse distance has been measured, with a variance, which is a measurement of the shared depth prior too.
pub(crate) fn add_with_distance(
    estimator: &mut Estimator,
    bearing: Bearing,
    warp: Matrix2<f64>,
    covariance: &Matrix2<f64>,
    (inverse_distance, variance): (f64, f64),
) {
    let expected = estimator.state.depth_prior.value;
    let prior = InverseDistanceMeasurement {
        row: error_state::DEPTH_PRIOR,
        predicted: expected,
        measured: inverse_distance,
        variance: variance + estimator.landmarks.own_variance(expected),
        gate: f64::INFINITY,
    };
    ungated_update(estimator, &prior);
    insert(estimator, bearing, warp, covariance, (inverse_distance, variance));
}

/// Inserts a landmark with an inverse distance, and its variance, that nothing else depends on.
pub(crate) fn insert(
    estimator: &mut Estimator,
    bearing: Bearing,
    warp: Matrix2<f64>,
    covariance: &Matrix2<f64>,
    (inverse_distance, variance): (f64, f64),
) {
    let landmark = Landmark::new(bearing, InverseDistance::new(inverse_distance), warp);
    let row = estimator.covariance.size();
    estimator.state.landmarks.push(landmark);
    estimator.covariance.grow(error_state::LANDMARK_SIZE);
    enter_bearing(estimator, row, &landmark, covariance);
    estimator.covariance.inflate(row + 2, variance);
}

/// Resets a landmark's bearing to that of another point, seen in the current image exactly where the old one is estimated, and at
/// the same distance.
pub(crate) fn reset_bearing(estimator: &mut Estimator, slot: usize, warp: Matrix2<f64>, covariance: &Matrix2<f64>) {
    let row = estimator.state.landmark_row(slot);
    let Landmark { bearing, inverse_distance, .. } = estimator.state.landmarks[slot];
    estimator.state.landmarks[slot] = Landmark::new(bearing, inverse_distance, warp);
    estimator.covariance.reset_row(row, 0.0);
    estimator.covariance.reset_row(row + 1, 0.0);
    let landmark = estimator.state.landmarks[slot];
    enter_bearing(estimator, row, &landmark, covariance);
}

/// The covariance of a new bearing. Seen at the true time of the image but entered at the assumed one, it is correlated with
/// the time offset, and so with the lens.
fn enter_bearing(estimator: &mut Estimator, row: usize, landmark: &Landmark, covariance: &Matrix2<f64>) {
    let rate = estimator.bearing_rate(landmark);
    for k in 0..2 {
        if estimator.covariance.variance(error_state::TIME_OFFSET) > 0.0 {
            estimator.covariance.add_row(row + k, -rate[k], error_state::TIME_OFFSET);
        }
    }
    // Nor is a lens that is off what the bearing was measured with.
    let by_lens = estimator.state.lens.and_then(|lens| {
        let direction = landmark.bearing.direction();
        let (pixel, pixel_by_tangent) = project(&lens, &landmark.bearing)?;
        let rows = RollingShutter::new(&lens, estimator.state.row_time).rows_after_stamp(&pixel);
        let by_lens = pixel_by_tangent.try_inverse()? * lens.intrinsics_jacobian(&direction)?;
        Some((by_lens, rate * rows))
    });
    if let Some((by_lens, by_row_time)) = by_lens {
        let lens = (error_state::INTRINSICS..).zip(by_lens.column_iter().map(|column| [column[0], column[1]]));
        for (of, column) in lens.chain([(error_state::ROW_TIME, by_row_time.into())]) {
            estimator.covariance.add_row(row, -column[0], of);
            estimator.covariance.add_row(row + 1, -column[1], of);
        }
    }
    for (r, c) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        estimator.covariance.row_mut(row + r)[row + c] += covariance[(r, c)];
    }
}

/// Drops a landmark; the last one takes its slot.
pub(crate) fn remove(estimator: &mut Estimator, slot: usize) {
    estimator.state.landmarks.swap_remove(slot);
    estimator.covariance.swap_remove(estimator.state.landmark_row(slot), error_state::LANDMARK_SIZE);
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Vector3};

    use super::*;
    use crate::camera::Camera;
    use crate::filter::settings::LandmarkSettings;
    use crate::filter::settings::Settings;
    use crate::inertial::initial_state::{InitialSigma, InitialState};
    use crate::samples::{Imu, ImuNoise};
    use crate::stamp::Stamp;

    #[test]
    fn landmarks_share_the_error_of_the_depth_prior() {
        let stamp = Stamp::from_nanos(0);
        let sample = Imu { stamp, gyro: Vector3::zeros(), accel: Vector3::new(0.0, 0.0, 9.81) };
        let initial = InitialState {
            stamp,
            world_from_body: Isometry3::identity(),
            velocity_in_body: Vector3::zeros(),
            gyro_bias: Vector3::zeros(),
            accel_bias: Vector3::zeros(),
            sigma: InitialSigma::default(),
        };
        let settings = Settings::default();
        let mut estimator = Estimator::new((&Camera::euroc(), None), ImuNoise::default(), &settings, &initial, sample);
        let bearing = Bearing::new(&Vector3::z_axis());
        for _ in 0..4 {
            add(&mut estimator, bearing, Matrix2::identity(), &Matrix2::identity());
        }
        let prior = settings.landmarks;
        let of = |sigma: f64| (sigma * prior.inverse_distance).powi(2);
        let (shared, own) = (of(prior.shared_sigma), of(prior.inverse_distance_sigma));
        let row = |slot: usize| estimator.state.landmark_row(slot) + 2;
        for (one, other) in [(0, 3), (2, 1), (2, 2)] {
            let expected = shared + if one == other { own } else { 0.0 };
            assert!((estimator.covariance.row(row(one))[row(other)] - expected).abs() < 1e-12, "{one}, {other}");
        }
        // However many there are, they tell no more of the prior than the independent ones: the mean's variance stays.
        let of_mean = |count: usize| LandmarkSettings { max_count: count, ..prior }.own_variance(1.0) / count as f64;
        assert!((of_mean(200) - of_mean(25)).abs() < 1e-15 && (of_mean(5) - 5.0 * of_mean(25)).abs() < 1e-12);
        // A landmark measured exactly measures the prior with its own deviation from it.
        add_with_distance(&mut estimator, bearing, Matrix2::identity(), &Matrix2::identity(), (0.4, 0.0));
        let gain = shared / (shared + own);
        let moved = prior.inverse_distance + gain * (0.4 - prior.inverse_distance);
        assert!((estimator.state.depth_prior.value - moved).abs() < 1e-12);
        assert!((estimator.state.landmarks[1].inverse_distance.value - moved).abs() < 1e-12);
        assert!((estimator.covariance.variance(error_state::DEPTH_PRIOR) - shared * (1.0 - gain)).abs() < 1e-12);
    }
}
