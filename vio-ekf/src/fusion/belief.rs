use nalgebra::{Isometry3, Matrix3, Matrix6, SMatrix, SVector, Vector3};

use super::Pose;
use super::model::{Core, FRAME, Frame, LOCAL, first_row, frame, linearise, predict, rows, trial};
use super::settings::{AlignmentSettings, FusionSettings, PoseSource};
use crate::filter::covariance::Covariance;
use crate::filter::interval::Step;
use crate::filter::state::at;
use crate::filter::update::{Iteration, iterate, mahalanobis};
use crate::{Excess, Imu, LimitSettings, Stamp, Start};

/// Residuals of a pose.
const POSE: usize = 6;

/// All that is believed at one time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Belief {
    pub(crate) stamp: Stamp,
    pub(crate) core: Core,
    pub(crate) frames: Vec<Frame>,
    pub(crate) covariance: Covariance,
    /// Poses refused in a row.
    pub(crate) refused: u32,
    pub(crate) excess: Option<Excess>,
}

/// Memory of an update, claimed once.
#[derive(Debug, Clone)]
pub(crate) struct Workspace {
    delta: Vec<f64>,
    scratch: Vec<f64>,
}

impl Workspace {
    pub(crate) fn new(sources: usize) -> Self {
        let size = first_row(sources);
        Self { delta: vec![0.0; size], scratch: vec![0.0; POSE * size] }
    }
}

impl Belief {
    pub(crate) fn new(start: &Start, sources: &[PoseSource]) -> Self {
        let size = first_row(sources.len());
        let mut covariance = Covariance::new(size, size);
        let sigma = &start.sigma;
        for (row, sigma) in [
            (at::POSITION, [sigma.position; 3]),
            (at::VELOCITY, [sigma.velocity; 3]),
            (at::ATTITUDE, [sigma.tilt, sigma.tilt, sigma.yaw]),
            (at::GYRO_BIAS, [sigma.gyro_bias; 3]),
            (at::ACCEL_BIAS, [sigma.accel_bias; 3]),
        ] {
            covariance.set_block3(row, &squares(sigma));
        }
        for (k, source) in sources.iter().enumerate() {
            let (alignment, mount, first) = (&source.alignment, &source.mount, first_row(k));
            let turn = alignment.source_from_world.rotation.to_rotation_matrix().into_inner();
            let angles = squares([alignment.tilt_sigma, alignment.tilt_sigma, alignment.yaw_sigma]);
            for (row, block) in [
                (frame::ALIGNMENT_POSITION, squares([alignment.position_sigma; 3])),
                (frame::ALIGNMENT_ATTITUDE, turn * angles * turn.transpose()),
                (frame::SENSOR_POSITION, squares([mount.position_sigma; 3])),
                (frame::SENSOR_ATTITUDE, squares([mount.attitude_sigma; 3])),
            ] {
                covariance.set_block3(first + row, &block);
            }
            covariance.inflate(first + frame::SCALE, source.scale_sigma * source.scale_sigma);
            covariance.inflate(first + frame::LATE, source.time_offset_sigma_s * source.time_offset_sigma_s);
        }
        let parts = |pose: &Isometry3<f64>| (pose.translation.vector, pose.rotation);
        let frames = sources.iter().map(|source| Frame {
            alignment: parts(&source.alignment.source_from_world),
            sensor: parts(&source.mount.body_from_sensor),
            scale: source.scale,
            late: 0.0,
        });
        Self {
            stamp: start.stamp,
            core: Core {
                position: start.world_from_body.translation.vector,
                velocity: start.velocity_in_body,
                attitude: start.world_from_body.rotation,
                gyro_bias: start.gyro_bias,
                accel_bias: start.accel_bias,
            },
            frames: frames.collect(),
            covariance,
            refused: 0,
            excess: None,
        }
    }

    /// Becomes equal to another, without claiming memory.
    pub(crate) fn assign(&mut self, other: &Self) {
        (self.stamp, self.core) = (other.stamp, other.core);
        (self.refused, self.excess) = (other.refused, other.excess);
        self.frames.copy_from_slice(&other.frames);
        self.covariance.assign(&other.covariance);
    }

    /// `P ← F P Fᵀ + N`: the body moves, the frames of the sources drift.
    pub(crate) fn propagate(&mut self, step: &Step, elapsed: f64, until: Stamp, sources: &[PoseSource]) {
        let end = step.end(&self.core.position, &self.core.attitude);
        (self.core.position, self.core.attitude) = (end.translation.vector, end.rotation);
        self.core.velocity = step.velocity;
        self.stamp = until;

        let core = step.carry(&self.covariance.block::<{ at::CORE }, { at::CORE }>(0, 0));
        for source in 0..self.frames.len() {
            let cross = step.transition * self.covariance.block::<{ at::CORE }, FRAME>(0, first_row(source));
            self.set_cross(source, &cross);
        }
        for r in 0..at::CORE {
            for c in 0..at::CORE {
                self.covariance.row_mut(r)[c] = core[(r, c)];
            }
        }
        for (k, source) in sources.iter().enumerate() {
            self.drift(k, &source.alignment, elapsed);
        }
    }

    fn set_cross(&mut self, source: usize, cross: &SMatrix<f64, { at::CORE }, FRAME>) {
        let first = first_row(source);
        for r in 0..at::CORE {
            for c in 0..FRAME {
                self.covariance.row_mut(r)[first + c] = cross[(r, c)];
                self.covariance.row_mut(first + c)[r] = cross[(r, c)];
            }
        }
    }

    /// The frame turns about the place where the body is: a drifting odometry knows nothing of the world's origin. With
    /// turn `φ`, the position must move by `hat(q) φ` for the body's place `q` in the source's frame to stay.
    fn drift(&mut self, source: usize, walk: &AlignmentSettings, elapsed: f64) {
        let frame = &self.frames[source];
        let here = frame.alignment.1 * self.core.position * frame.scale;
        let turn = frame.alignment.1.to_rotation_matrix().into_inner();
        let angles = turn * squares([walk.tilt_walk, walk.tilt_walk, walk.yaw_walk]) * turn.transpose() * elapsed;
        let lever = here.cross_matrix();
        let mut noise = Matrix6::zeros();
        let position = lever * angles * lever.transpose() + squares([walk.position_walk; 3]) * elapsed;
        noise.fixed_view_mut::<3, 3>(0, 0).copy_from(&position);
        noise.fixed_view_mut::<3, 3>(0, 3).copy_from(&(lever * angles));
        noise.fixed_view_mut::<3, 3>(3, 0).copy_from(&(lever * angles).transpose());
        noise.fixed_view_mut::<3, 3>(3, 3).copy_from(&angles);
        let first = first_row(source) + frame::ALIGNMENT_POSITION;
        for r in 0..6 {
            for c in 0..6 {
                self.covariance.row_mut(first + r)[first + c] += 0.5 * (noise[(r, c)] + noise[(c, r)]);
            }
        }
    }

    /// Uses a pose of the present time, or refuses it.
    pub(crate) fn update(&mut self, pose: &Pose, reading: &Imu, settings: &FusionSettings, work: &mut Workspace) {
        let source = pose.measurement.source;
        let (core, frame) = (self.core, self.frames[source]);
        let iteration = Iteration { limit: settings.iterations, tolerance: 1e-3 };
        let rows: [usize; LOCAL] = rows(source);
        let measurement = iterate(&self.covariance, rows, iteration, SVector::zeros(), |delta| {
            let (core, frame) = trial(&core, &frame, delta);
            let prediction = predict(&core, &frame, reading, settings.gravity);
            Some(linearise(&prediction, &pose.measurement, &pose.whitener))
        });
        let used = measurement.is_some_and(|measurement| {
            mahalanobis(&self.covariance, &measurement).is_some_and(|distance| distance <= settings.gate)
                && self.covariance.update(&measurement, &mut work.delta, &mut work.scratch)
        });
        if !used {
            self.refused += 1;
            return;
        }
        self.refused = 0;
        self.core = self.core.corrected(&work.delta);
        for (k, frame) in self.frames.iter_mut().enumerate() {
            *frame = frame.corrected(&work.delta[first_row(k)..]);
        }
    }

    /// The divergence test; once failed, failed for good.
    pub(crate) fn judge(&mut self, limits: &LimitSettings) {
        let worst = |first: usize| (first..first + 3).map(|row| self.covariance.variance(row)).fold(0.0, f64::max);
        // NaN is beyond all limits.
        let beyond = |value: f64, limit: f64| value.is_nan() || value > limit;
        let core = &self.core;
        let excess = if beyond(core.velocity.norm(), limits.speed) || !core.position.iter().all(|p| p.is_finite()) {
            Some(Excess::Speed)
        } else if beyond(core.gyro_bias.norm(), limits.gyro_bias) || beyond(core.accel_bias.norm(), limits.accel_bias) {
            Some(Excess::Bias)
        } else if beyond(worst(at::VELOCITY), limits.velocity_sigma * limits.velocity_sigma) {
            Some(Excess::Uncertainty)
        } else if self.refused >= limits.contradictions {
            Some(Excess::Contradiction)
        } else {
            None
        };
        self.excess = self.excess.or(excess);
    }
}

fn squares(sigma: [f64; 3]) -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::from(sigma.map(|s| s * s)))
}
