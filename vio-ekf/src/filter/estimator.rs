//! State, covariance and delay buffer of the odometry.

use nalgebra::{Vector2, Vector3};

use super::depth_prior;
use super::propagation::propagate::{Workspace, propagate};
use super::settings::{LandmarkSettings, Settings};
use super::state::error_state;
use super::state::inverse_distance::InverseDistance;
use super::state::landmark::Landmark;
use super::state::vio_state::VioState;
use crate::core::core_state::{CoreState, set_core_covariance};
use crate::core::covariance::{Covariance, LinearizedMeasurement};
use crate::core::imu_buffer::ImuBuffer;
use crate::core::initial_state::InitialState;
use crate::core::odometry::Odometry;
use crate::core::preintegration::ImuPreintegration;
use crate::{CameraModel, Imu, ImuNoise, Stamp};

/// Most residuals of one update.
pub(crate) const MAX_RESIDUALS: usize = 6;

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
    workspace: Workspace,
    delta: Vec<f64>,
    scratch: Vec<f64>,
}

impl Estimator {
    pub(crate) fn new(
        camera: &dyn CameraModel,
        noise: ImuNoise,
        settings: &Settings,
        initial: &InitialState,
        sample: Imu,
    ) -> Self {
        let capacity = error_state::landmark(settings.landmarks.max_count);
        let state = VioState {
            core: CoreState::from(initial),
            camera_position: camera.body_from_camera().translation.vector,
            camera_attitude: camera.body_from_camera().rotation,
            time_offset: settings.calibration.time_offset_s,
            depth_prior: InverseDistance::new(settings.landmarks.inverse_distance),
            landmarks: Vec::with_capacity(settings.landmarks.max_count),
        };
        let mut covariance = Covariance::new(error_state::FIRST_LANDMARK, capacity);
        let calibration = &settings.calibration;
        set_core_covariance(&mut covariance, &initial.sigma);
        covariance.set_diagonal3(error_state::CAMERA_POSITION, [calibration.camera_position_sigma_m; 3]);
        covariance.set_diagonal3(error_state::CAMERA_ATTITUDE, [calibration.camera_attitude_sigma; 3]);
        covariance.reset_row(error_state::TIME_OFFSET, calibration.time_offset_sigma_s.powi(2));
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
            workspace: Workspace::new(capacity),
            delta: vec![0.0; capacity],
            scratch: vec![0.0; capacity * MAX_RESIDUALS],
            state,
            covariance,
        }
    }

    /// Takes one more sample; its stamp must be after all others.
    pub(crate) fn imu(&mut self, sample: Imu) {
        self.buffer.push(sample);
        self.buffer.continue_to_latest(&mut self.prediction, &self.state.core.biases(), &self.noise);
    }

    /// Preintegrates and propagates to a later time; `dropped` is told the slots of landmarks that are lost on the way.
    pub(crate) fn propagate_to(&mut self, until: Stamp, dropped: impl FnMut(usize)) {
        // Once per propagation, so that all updates of one image see the same scale.
        depth_prior::rescale_covariance(&mut self.state, &mut self.covariance);
        let elapsed = until.secs_since(self.buffer.state_stamp());
        depth_prior::propagate(&self.state, &mut self.covariance, &self.landmarks, elapsed);
        let preintegration = self.buffer.preintegrate(until, &self.state.core.biases(), &self.noise);
        let input = (&preintegration, self.gravity);
        propagate(&mut self.state, &mut self.covariance, input, &mut self.workspace, dropped);
        self.buffer.advance(until);
        self.rate = self.buffer.rate_at_state() - self.state.core.gyro_bias;
    }

    /// Propagates to the sample in the middle of a full buffer, to make room for more.
    pub(crate) fn free_buffer(&mut self, dropped: impl FnMut(usize)) {
        self.propagate_to(self.buffer.middle(), dropped);
        self.update_prediction();
    }

    /// The Kalman update of the whole state. False, and nothing changed, if the numbers do not allow it.
    pub(crate) fn update<const M: usize, const C: usize>(&mut self, measurement: &LinearizedMeasurement<M, C>) -> bool {
        if !self.covariance.update(measurement, &mut self.delta, &mut self.scratch) {
            return false;
        }
        self.state.correct(&self.delta[..self.covariance.size()]);
        true
    }

    /// Brings the prediction up to date with a changed state.
    pub(crate) fn update_prediction(&mut self) {
        let until = self.buffer.now();
        self.prediction = self.buffer.preintegrate(until, &self.state.core.biases(), &self.noise);
    }

    /// Gives the next image a time offset of its own, with the deviation of a stamp.
    pub(crate) fn reset_time_offset(&mut self, offset: f64, jitter: f64) {
        self.state.time_offset = offset;
        self.covariance.reset_row(error_state::TIME_OFFSET, jitter * jitter);
    }

    /// Inflates the covariance of all bearings, rad² per axis.
    pub(crate) fn inflate_bearings(&mut self, variance: f64) {
        for row in (error_state::FIRST_LANDMARK..self.covariance.size()).step_by(error_state::LANDMARK_SIZE) {
            self.covariance.inflate(row, variance);
            self.covariance.inflate(row + 1, variance);
        }
    }

    /// Velocity of a landmark's bearing in tangent coordinates, rad/s: `Nᵀ(−ω_c − ρ μ × v_c)`.
    pub(crate) fn bearing_rate(&self, landmark: &Landmark) -> Vector2<f64> {
        let state = &self.state;
        let camera_from_body = state.camera_attitude.inverse();
        let rate = camera_from_body * self.rate;
        let velocity = camera_from_body * (state.core.velocity + self.rate.cross(&state.camera_position));
        let direction = landmark.bearing.direction();
        landmark.bearing.basis().transpose() * (-rate - direction.cross(&velocity) * landmark.inverse_distance.value)
    }

    /// The estimate now, with covariance.
    pub(crate) fn odometry(&self) -> Odometry {
        let prior = self.covariance.block::<{ error_state::CORE }, { error_state::CORE }>(0, 0);
        Odometry::predict(&self.state.core, &prior, (&self.buffer, &self.prediction), self.gravity)
    }
}
