use nalgebra::{Matrix3, SMatrix, SVector, Vector2, Vector3};

use super::covariance::{Covariance, Measurement};
use super::distance::InverseDistance;
use super::history::History;
use super::interval::Interval;
use super::propagate::{Workspace, propagate};
use super::rest::{RestSettings, Window};
use super::settings::{LandmarkSettings, LimitSettings, Settings};
use super::start::Start;
use super::state::{Landmark, State, at};
use super::{Excess, Odometry, later};
use crate::{Camera, Imu, ImuNoise, Stamp};

/// Most residuals of one update.
const MAX_RESIDUALS: usize = 6;

/// State and covariance at an anchor, the time of the last image, and the motion from there until now.
///
/// Nothing here knows what a pixel is: measurements come as residuals and derivatives.
#[derive(Debug, Clone)]
pub(crate) struct Estimator {
    pub(crate) state: State,
    pub(crate) covariance: Covariance,
    pub(crate) history: History,
    /// From the anchor until now.
    since: Interval,
    pub(super) noise: ImuNoise,
    pub(super) gravity: f64,
    pub(super) landmarks: LandmarkSettings,
    /// Rate of the body at the anchor.
    pub(crate) rate: Vector3<f64>,
    work: Workspace,
    delta: Vec<f64>,
    scratch: Vec<f64>,
}

impl Estimator {
    pub(crate) fn new(camera: &Camera, noise: ImuNoise, settings: &Settings, start: &Start, sample: Imu) -> Self {
        let capacity = at::landmark(settings.features);
        let state = State {
            position: start.world_from_body.translation.vector,
            velocity: start.velocity_in_body,
            attitude: start.world_from_body.rotation,
            gyro_bias: start.gyro_bias,
            accel_bias: start.accel_bias,
            camera_position: camera.body_from_camera.translation.vector,
            camera_attitude: camera.body_from_camera.rotation,
            time_offset: settings.calibration.time_offset_s,
            expected: InverseDistance::new(settings.landmarks.inverse_distance),
            landmarks: Vec::with_capacity(settings.features),
        };
        let mut covariance = Covariance::new(at::HEAD, capacity);
        let (sigma, calibration) = (&start.sigma, &settings.calibration);
        for (row, sigma) in [
            (at::POSITION, [sigma.position; 3]),
            (at::VELOCITY, [sigma.velocity; 3]),
            (at::ATTITUDE, [sigma.tilt, sigma.tilt, sigma.yaw]),
            (at::GYRO_BIAS, [sigma.gyro_bias; 3]),
            (at::ACCEL_BIAS, [sigma.accel_bias; 3]),
            (at::CAMERA_POSITION, [calibration.camera_position_sigma_m; 3]),
            (at::CAMERA_ATTITUDE, [calibration.camera_attitude_sigma; 3]),
        ] {
            covariance.set_block3(row, &Matrix3::from_diagonal(&Vector3::from(sigma.map(|s| s * s))));
        }
        covariance.isolate(at::TIME_OFFSET, calibration.time_offset_sigma_s.powi(2));
        let common = settings.landmarks.common_sigma * settings.landmarks.inverse_distance;
        covariance.isolate(at::EXPECTED, common * common);
        Self {
            rate: sample.gyro - state.gyro_bias,
            history: History::new(sample, start.stamp, settings.history_samples).judging(settings.sensor),
            since: Interval::default(),
            noise,
            gravity: settings.gravity,
            landmarks: settings.landmarks,
            work: Workspace::new(capacity),
            delta: vec![0.0; capacity],
            scratch: vec![0.0; capacity * MAX_RESIDUALS],
            state,
            covariance,
        }
    }

    fn biases(&self) -> [Vector3<f64>; 2] {
        [self.state.gyro_bias, self.state.accel_bias]
    }

    /// Takes one more sample; its stamp must be after all others.
    pub(crate) fn imu(&mut self, sample: Imu) {
        let biases = self.biases();
        self.history.push(sample);
        self.history.extend_to_latest(&mut self.since, &biases, &self.noise);
    }

    /// Moves the anchor to a later time; `dropped` is told the slots of landmarks that are lost on the way.
    pub(crate) fn advance(&mut self, until: Stamp, dropped: impl FnMut(usize)) {
        self.settle();
        let walk = self.landmarks.common_walk * self.state.expected.value;
        self.covariance.inflate(at::EXPECTED, walk * walk * until.secs_since(self.history.anchor()));
        let interval = self.history.integrate(until, &self.biases(), &self.noise);
        propagate(&mut self.state, &mut self.covariance, (&interval, self.gravity), &mut self.work, dropped);
        self.history.advance(until);
        self.rate = self.history.rate_at_anchor() - self.state.gyro_bias;
    }

    /// Goes on to a time without any motion: what the samples read is then bias and gravity. The anchor stays behind by the delay
    /// of the settings: should the body turn out to have set off meanwhile, the samples since the anchor tell how.
    pub(crate) fn stay(&mut self, now: Stamp, rest: &RestSettings) {
        let until = later(now, -rest.delay_s).max(self.history.oldest()).max(self.history.anchor());
        let elapsed = until.secs_since(self.history.anchor());
        let walks = [(at::GYRO_BIAS, self.noise.gyro_walk), (at::ACCEL_BIAS, self.noise.accel_walk)];
        for (row, walk) in walks.into_iter().flat_map(|(row, walk)| (row..row + 3).map(move |row| (row, walk))) {
            self.covariance.inflate(row, walk * walk * elapsed);
        }
        self.history.advance(until);
        // Nothing moves; what the correlations say about the velocity does not matter.
        self.state.velocity = Vector3::zeros();
        for row in at::VELOCITY..at::VELOCITY + 3 {
            self.covariance.isolate(row, rest.velocity_sigma * rest.velocity_sigma);
        }
        self.rate = Vector3::zeros();
    }

    /// Takes a new image's clock to be off by something of its own.
    pub(crate) fn doubt_clock(&mut self, offset: f64, jitter: f64) {
        self.state.time_offset = offset;
        self.covariance.isolate(at::TIME_OFFSET, jitter * jitter);
    }

    /// Admits a small motion, an angle, that went unnoticed before the body was found to be at rest.
    pub(crate) fn loosen(&mut self, angle: f64) {
        let variance = angle * angle;
        self.diffuse(variance);
        for axis in 0..3 {
            self.covariance.inflate(at::ATTITUDE + axis, variance);
            self.covariance.inflate(at::POSITION + axis, variance / self.state.expected.value.powi(2));
        }
    }

    /// Measures biases and tilt by the mean rate and force of a body at rest; `angle` may have gone unnoticed meanwhile.
    pub(crate) fn weigh(&mut self, window: &Window, angle: f64, rest: &RestSettings) {
        let white = |density: f64| density * density / window.duration;
        let noise = (angle / window.duration).powi(2) + white(self.noise.gyro_density);
        let rows = [at::GYRO_BIAS, at::GYRO_BIAS + 1, at::GYRO_BIAS + 2];
        let (residual, jacobian) = (window.rate - self.state.gyro_bias, Matrix3::identity());
        self.update(&Measurement { rows, residual, jacobian, noise: Matrix3::identity() * noise });

        let up = Vector3::new(0.0, 0.0, self.gravity);
        let body_from_world = self.state.attitude.inverse();
        let mut jacobian = SMatrix::<f64, 3, 6>::zeros();
        // d(Rᵀ a)/dθ = Rᵀ hat(a) for the world-side error.
        let tilt = body_from_world.to_rotation_matrix().into_inner() * up.cross_matrix();
        jacobian.fixed_columns_mut::<3>(0).copy_from(&tilt);
        jacobian.fixed_columns_mut::<3>(3).fill_with_identity();
        let rows = std::array::from_fn(|k| if k < 3 { at::ATTITUDE + k } else { at::ACCEL_BIAS + k - 3 });
        let residual = window.force - body_from_world * up - self.state.accel_bias;
        let noise = Matrix3::identity() * (rest.force_sigma.powi(2) + white(self.noise.accel_density));
        self.update(&Measurement { rows, residual, jacobian, noise });
    }

    /// The first of the limits that the state exceeds.
    pub(crate) fn excess(&self, limits: &LimitSettings) -> Option<Excess> {
        let state = &self.state;
        let velocity = (at::VELOCITY..at::VELOCITY + 3).map(|row| self.covariance.variance(row)).fold(0.0, f64::max);
        // NaN is beyond all limits.
        let beyond = |value: f64, limit: f64| value.is_nan() || value > limit;
        if beyond(state.velocity.norm(), limits.speed) {
            Some(Excess::Speed)
        } else if beyond(state.gyro_bias.norm(), limits.gyro_bias) || beyond(state.accel_bias.norm(), limits.accel_bias)
        {
            Some(Excess::Bias)
        } else if beyond(velocity, limits.velocity_sigma * limits.velocity_sigma) {
            Some(Excess::Uncertainty)
        } else if !state.position.norm_squared().is_finite() {
            Some(Excess::Speed)
        } else {
            None
        }
    }

    /// Brings the motion since the anchor up to date with a changed state or anchor.
    pub(crate) fn replay(&mut self) {
        let until = self.history.now();
        self.since = self.history.integrate(until, &self.biases(), &self.noise);
    }

    /// The Kalman update of the whole state. False, and nothing changed, if the numbers do not allow it.
    pub(crate) fn update<const M: usize, const C: usize>(&mut self, measurement: &Measurement<M, C>) -> bool {
        if !self.covariance.update(measurement, &mut self.delta, &mut self.scratch) {
            return false;
        }
        self.state.correct(&self.delta[..self.covariance.size()]);
        true
    }

    /// Velocity of a landmark's bearing in tangent coordinates, rad/s: `Nᵀ(−ω_c − ρ μ × v_c)`.
    pub(crate) fn tangent_rate(&self, landmark: &Landmark) -> Vector2<f64> {
        let state = &self.state;
        let camera_from_body = state.camera_attitude.inverse();
        let rate = camera_from_body * self.rate;
        let velocity = camera_from_body * (state.velocity + self.rate.cross(&state.camera_position));
        let direction = landmark.bearing.direction();
        landmark.bearing.basis().transpose() * (-rate - direction.cross(&velocity) * landmark.inverse_distance.value)
    }

    /// Moves the anchor into the middle of the samples, to make room for more.
    pub(crate) fn forget(&mut self, dropped: impl FnMut(usize)) {
        self.advance(self.history.middle(), dropped);
        self.replay();
    }

    /// The estimate now, with covariance.
    pub(crate) fn odometry(&self) -> Odometry {
        let step = self.since.step(&self.state, self.gravity);
        let prior = self.covariance.block::<{ at::CORE }, { at::CORE }>(0, 0);
        Odometry {
            stamp: self.history.now(),
            world_from_body: step.end(&self.state.position, &self.state.attitude),
            velocity_in_body: step.velocity,
            rate_in_body: self.history.latest().gyro - self.state.gyro_bias,
            gyro_bias: self.state.gyro_bias,
            accel_bias: self.state.accel_bias,
            covariance: step.carry(&prior),
        }
    }
}

/// Covariance of the core, 15 rows; their order is that of [`Odometry::covariance`].
pub type CoreCovariance = SMatrix<f64, { at::CORE }, { at::CORE }>;

/// Rows of a landmark's bearing and of the time offset.
pub(crate) fn bearing_rows(slot: usize) -> [usize; 3] {
    let row = at::landmark(slot);
    [row, row + 1, at::TIME_OFFSET]
}

/// The part of a trial step that belongs to a landmark's bearing.
pub(crate) fn bearing_part(delta: &SVector<f64, 3>) -> Vector2<f64> {
    Vector2::new(delta[0], delta[1])
}
