//! State, covariance and delay buffer of the odometry.

use nalgebra::{Matrix3, SMatrix, SVector, Vector2, Vector3};

use super::calibration_prior;
use super::depth_prior;
use super::propagation::propagate::{Workspace, propagate};
use super::settings::{LandmarkSettings, Settings};
use super::state::error_state;
use super::state::inverse_distance::InverseDistance;
use super::state::landmark::Landmark;
use super::state::vio_state::{SecondCamera, VioState};
use crate::camera::Camera;
use crate::camera::model::CameraModel;
use crate::inertial::core_state::{CoreCovariance, CoreState, set_core_covariance};
use crate::inertial::covariance::{Covariance, LinearizedMeasurement};
use crate::inertial::imu_buffer::ImuBuffer;
use crate::inertial::initial_state::InitialState;
use crate::inertial::odometry::Odometry;
use crate::inertial::preintegration::{CALIBRATION, ImuPreintegration};
use crate::samples::{Imu, ImuNoise};
use crate::stamp::Stamp;

/// State and covariance at the time of the last measurement, and the prediction from there until now.
///
/// Nothing here knows what a pixel is: measurements come as residuals and derivatives.
#[derive(Debug, Clone)]
pub(crate) struct Estimator {
    pub(crate) state: VioState,
    pub(crate) covariance: Covariance,
    pub(crate) buffer: ImuBuffer,
    /// From the time of the state until now.
    prediction: ImuPreintegration,
    pub(crate) noise: ImuNoise,
    pub(crate) gravity: f64,
    pub(crate) landmarks: LandmarkSettings,
    /// Rate of the body at the time of the state.
    pub(crate) rate: Vector3<f64>,
    /// Specific force integrated over the last propagation, in the body axes of its end, m/s, and over how many seconds.
    pub(crate) impulse: (Vector3<f64>, f64),
    workspace: Workspace,
    delta: Vec<f64>,
    /// Corrections of a series of updates that bearings have not had yet.
    owed: Vec<f64>,
}

impl Estimator {
    pub(crate) fn new(
        (camera, second): (&dyn CameraModel, Option<&dyn CameraModel>),
        noise: ImuNoise,
        settings: &Settings,
        initial: &InitialState,
        sample: Imu,
    ) -> Self {
        let mut state = VioState {
            core: CoreState::from(initial),
            camera_position: camera.body_from_camera().translation.vector,
            camera_attitude: camera.body_from_camera().rotation,
            time_offset: settings.calibration.time_offset_s,
            depth_prior: InverseDistance::new(settings.landmarks.inverse_distance),
            accel_matrix: None,
            row_time: settings.calibration.row_time_s,
            gyro_scale: Vector3::repeat(1.0),
            lens: None,
            second: None,
            landmarks: Vec::with_capacity(settings.landmarks.max_count),
        };
        if settings.estimates_lens() {
            state.lens = camera.kalibr().map(Camera::estimable);
            state.second = second.and_then(|second| SecondCamera::new(camera, second));
        }
        let capacity = state.landmark_row(settings.landmarks.max_count);
        let mut covariance = Covariance::new(state.head(), capacity);
        set_core_covariance(&mut covariance, &initial.sigma);
        calibration_prior::set_calibration(&mut covariance, &state, settings);
        let shared = settings.landmarks.shared_sigma * settings.landmarks.inverse_distance;
        covariance.reset_row(error_state::DEPTH_PRIOR, shared * shared);
        Self {
            rate: sample.gyro - state.core.gyro_bias,
            buffer: ImuBuffer::new(sample, initial.stamp, settings.imu.buffer_samples)
                .with_noise_estimation(settings.imu),
            prediction: ImuPreintegration::default(),
            noise,
            gravity: settings.gravity,
            landmarks: settings.landmarks,
            workspace: Workspace::new(capacity, settings.landmarks.max_count),
            delta: vec![0.0; capacity],
            owed: vec![0.0; capacity],
            impulse: (Vector3::zeros(), 0.0),
            state,
            covariance,
        }
    }

    /// Begins to estimate the accelerometer's matrix. Until now its bias has taken the blame: `A f − b_a` stays as well known as it is
    /// at the mean reading `f` so far, though neither part is.
    pub(crate) fn estimate_accel_matrix(
        &mut self,
        sigma: &SVector<f64, { error_state::MATRIX_SIZE }>,
        mean_reading: &Vector3<f64>,
    ) {
        self.state.accel_matrix = Some(Matrix3::identity());
        for (entry, sigma) in sigma.iter().enumerate() {
            let row = error_state::ACCEL_MATRIX + entry;
            self.covariance.reset_row(row, sigma * sigma);
            self.covariance.add_row(error_state::ACCEL_BIAS + entry / 3, mean_reading[entry % 3], row);
        }
    }

    /// Ends that: the whole estimate is conditioned on the identity.
    pub(crate) fn fix_accel_matrix(&mut self) {
        const SIZE: usize = error_state::MATRIX_SIZE;
        let error = (Matrix3::identity() - self.state.accel_matrix()).transpose();
        let known = LinearizedMeasurement::<SIZE, SIZE> {
            rows: std::array::from_fn(|k| error_state::ACCEL_MATRIX + k),
            residual: SVector::from_iterator(error.iter().copied()),
            jacobian: SMatrix::identity(),
            // Far below any prior, far above the rounding of a variance.
            noise: SMatrix::identity() * 1e-12,
        };
        if !self.update(&known) {
            return;
        }
        self.state.accel_matrix = None;
        for entry in 0..SIZE {
            self.covariance.reset_row(error_state::ACCEL_MATRIX + entry, 0.0);
        }
    }

    /// Takes one more sample; its stamp must be after all others.
    pub(crate) fn imu(&mut self, sample: Imu) {
        self.buffer.push(sample);
        self.buffer.continue_to_latest(&mut self.prediction, &self.state.imu_correction(), &self.noise);
    }

    /// Preintegrates and propagates to a later time; `dropped` is told the slots of landmarks that are lost on the way.
    pub(crate) fn propagate_to(&mut self, until: Stamp, dropped: impl FnMut(usize)) {
        // Once per propagation, so that all updates of one image see the same scale.
        depth_prior::rescale_covariance(&mut self.state, &mut self.covariance);
        let elapsed = until.secs_since(self.buffer.state_stamp());
        depth_prior::propagate(&self.state, &mut self.covariance, &self.landmarks, elapsed);
        let preintegration = self.buffer.preintegrate(until, &self.state.imu_correction(), &self.noise);
        let input = (&preintegration, self.gravity);
        propagate(&mut self.state, &mut self.covariance, input, &mut self.workspace, dropped);
        self.impulse = (preintegration.impulse(), preintegration.duration);
        self.buffer.advance(until);
        self.rate = self.state.imu_correction().rate(&self.buffer.rate_at_state());
    }

    /// Propagates to the sample in the middle of a full buffer, to make room for more.
    pub(crate) fn free_buffer(&mut self, dropped: impl FnMut(usize)) {
        self.propagate_to(self.buffer.middle(), dropped);
        self.update_prediction();
    }

    /// The Kalman update of the whole state. False, and nothing changed, if the numbers do not allow it.
    pub(crate) fn update<const M: usize, const C: usize>(&mut self, measurement: &LinearizedMeasurement<M, C>) -> bool {
        let updated = self.update_in_series(measurement);
        self.end_updates();
        updated
    }

    /// The same as one of a series. Until its end a landmark must be [settled](Self::settle) before it is used, and of the covariance
    /// only single variances and blocks may be.
    pub(crate) fn update_in_series<const M: usize, const C: usize>(
        &mut self,
        measurement: &LinearizedMeasurement<M, C>,
    ) -> bool {
        if !self.covariance.update_in_series(measurement, &mut self.delta) {
            return false;
        }
        let delta = &self.delta[..self.covariance.size()];
        self.state.correct_head(delta);
        // Distances at once: a step back after a step away is not the sum of both.
        let head = self.state.head();
        for (landmark, delta) in self.state.landmarks.iter_mut().zip(landmark_rows(&delta[head..])) {
            landmark.inverse_distance.correct(delta[2]);
        }
        self.owed.iter_mut().zip(delta).for_each(|(owed, delta)| *owed += delta);
        true
    }

    /// Corrects a landmark's bearing by what the series has found so far.
    pub(crate) fn settle(&mut self, slot: usize) {
        let owed = &mut self.owed[self.state.landmark_row(slot)..][..error_state::LANDMARK_SIZE];
        if owed[0] != 0.0 || owed[1] != 0.0 {
            let bearing = &mut self.state.landmarks[slot].bearing;
            *bearing = bearing.boxplus(&Vector2::new(owed[0], owed[1]));
        }
        owed.fill(0.0);
    }

    /// Ends a series of updates.
    pub(crate) fn end_updates(&mut self) {
        for slot in 0..self.state.landmarks.len() {
            self.settle(slot);
        }
        self.covariance.end_updates();
    }

    /// Brings the prediction up to date with a changed state.
    pub(crate) fn update_prediction(&mut self) {
        let until = self.buffer.now();
        self.prediction = self.buffer.preintegrate(until, &self.state.imu_correction(), &self.noise);
    }

    /// Gives the next image a time offset of its own, with the deviation of a stamp.
    pub(crate) fn reset_time_offset(&mut self, offset: f64, jitter: f64) {
        self.state.time_offset = offset;
        self.covariance.reset_row(error_state::TIME_OFFSET, jitter * jitter);
    }

    /// Inflates the covariance of all bearings, rad² per axis, by the rate at which the direction changes in which each point is
    /// seen, rad/s.
    pub(crate) fn inflate_bearings(&mut self, variance: impl Fn(f64) -> f64) {
        let velocity = self.camera_velocity();
        for (slot, landmark) in self.state.landmarks.iter().enumerate() {
            let across = landmark.bearing.direction().cross(&velocity).norm();
            let (row, variance) = (self.state.landmark_row(slot), variance(across * landmark.inverse_distance.value));
            self.covariance.inflate(row, variance);
            self.covariance.inflate(row + 1, variance);
        }
    }

    /// Velocity of the camera in its own axes, m/s.
    fn camera_velocity(&self) -> Vector3<f64> {
        let state = &self.state;
        state.camera_attitude.inverse() * (state.core.velocity + self.rate.cross(&state.camera_position))
    }

    /// Velocity of a landmark's bearing in tangent coordinates, rad/s: `Nᵀ(−ω_c − ρ μ × v_c)`.
    pub(crate) fn bearing_rate(&self, landmark: &Landmark) -> Vector2<f64> {
        let rate = self.state.camera_attitude.inverse() * self.rate;
        let direction = landmark.bearing.direction();
        let across = direction.cross(&self.camera_velocity());
        landmark.bearing.basis().transpose() * (-rate - across * landmark.inverse_distance.value)
    }

    /// The estimate now, with covariance.
    pub(crate) fn odometry(&self) -> Odometry {
        let prior = self.covariance.block::<{ error_state::CORE }, { error_state::CORE }>(0, 0);
        if self.state.lens.is_some() {
            self.odometry_with_calibration::<CALIBRATION>(&prior)
        } else if self.state.accel_matrix.is_some() {
            self.odometry_with_calibration::<{ error_state::MATRIX_SIZE }>(&prior)
        } else {
            Odometry::predict(&self.state.core, &prior, (&self.buffer, &self.prediction), self.gravity)
        }
    }

    /// The same where errors of so many entries of the inertial sensor's calibration add to it.
    fn odometry_with_calibration<const N: usize>(&self, prior: &CoreCovariance) -> Odometry {
        let core = &self.state.core;
        let transition = self.prediction.transition(&core.velocity, &core.attitude, self.gravity);
        let (by_imu, _) = self.prediction.by_calibration::<N>(&transition);
        let entry = |row: usize, column: usize| self.covariance.row(row)[error_state::imu_calibration(column)];
        let own = SMatrix::<f64, N, N>::from_fn(|r, c| entry(error_state::imu_calibration(r), c));
        let with_core = SMatrix::<f64, { error_state::CORE }, N>::from_fn(entry);
        let crossed = transition.transition * with_core * by_imu.transpose();
        let covariance =
            transition.propagate_covariance(prior) + by_imu * own * by_imu.transpose() + crossed + crossed.transpose();
        let covariance = (covariance + covariance.transpose()) * 0.5;
        let odometry = Odometry::at_end(core, &covariance, (&self.buffer, &transition));
        Odometry { rate_in_body: self.state.imu_correction().rate(&self.buffer.latest().gyro), ..odometry }
    }
}

/// The three rows of each landmark.
fn landmark_rows(delta: &[f64]) -> impl Iterator<Item = &[f64]> {
    delta.chunks_exact(error_state::LANDMARK_SIZE)
}
