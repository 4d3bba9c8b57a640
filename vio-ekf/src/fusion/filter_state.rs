//! State and covariance of the fusion at one time.

use nalgebra::{Isometry3, Matrix3, Matrix6, SMatrix, SVector, Vector3};

use super::pose_model::{
    LOCAL, SOURCE, SourceState, WhitenedPose, first_row, linearize, predict, rows, source_rows, trial,
};
use super::settings::{AlignmentSettings, FusionSettings, PoseSource};
use crate::inertial::core_state::{CoreState, set_core_covariance};
use crate::inertial::covariance::Covariance;
use crate::inertial::divergence::{DivergenceCause, DivergenceSettings, exceeded_limit};
use crate::inertial::error_state;
use crate::inertial::initial_state::InitialState;
use crate::inertial::iterated_update::{Iteration, iterate, mahalanobis};
use crate::inertial::preintegration::StateTransition;
use crate::samples::Imu;
use crate::stamp::Stamp;

/// State and covariance at one time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FilterState {
    pub(crate) stamp: Stamp,
    pub(crate) core: CoreState,
    pub(crate) sources: Vec<SourceState>,
    pub(crate) covariance: Covariance,
    /// Poses that failed their gate, in a row.
    pub(crate) consecutive_outliers: u32,
    pub(crate) divergence_cause: Option<DivergenceCause>,
}

/// Memory of an update, claimed once.
#[derive(Debug, Clone)]
pub(crate) struct Workspace {
    delta: Vec<f64>,
}

impl Workspace {
    pub(crate) fn new(sources: usize) -> Self {
        let size = first_row(sources);
        Self { delta: vec![0.0; size] }
    }
}

impl FilterState {
    pub(crate) fn new(initial: &InitialState, sources: &[PoseSource]) -> Self {
        let size = first_row(sources.len());
        let mut covariance = Covariance::new(size, size);
        set_core_covariance(&mut covariance, &initial.sigma);
        for (k, source) in sources.iter().enumerate() {
            let (alignment, extrinsics, first) = (&source.alignment, &source.extrinsics, first_row(k));
            let rotation = alignment.source_from_world.rotation.to_rotation_matrix().into_inner();
            let angles = squares([alignment.tilt_sigma, alignment.tilt_sigma, alignment.yaw_sigma]);
            for (row, block) in [
                (source_rows::ALIGNMENT_POSITION, squares([alignment.position_sigma; 3])),
                (source_rows::ALIGNMENT_ATTITUDE, rotation * angles * rotation.transpose()),
                (source_rows::SENSOR_POSITION, squares([extrinsics.position_sigma; 3])),
                (source_rows::SENSOR_ATTITUDE, squares([extrinsics.attitude_sigma; 3])),
            ] {
                covariance.set_block3(first + row, &block);
            }
            covariance.inflate(first + source_rows::SCALE, source.scale_sigma * source.scale_sigma);
            covariance
                .inflate(first + source_rows::TIME_OFFSET, source.time_offset_sigma_s * source.time_offset_sigma_s);
        }
        let parts = |pose: &Isometry3<f64>| (pose.translation.vector, pose.rotation);
        let sources = sources.iter().map(|source| SourceState {
            alignment: parts(&source.alignment.source_from_world),
            sensor: parts(&source.extrinsics.body_from_sensor),
            scale: source.scale,
            time_offset_error: 0.0,
        });
        Self {
            stamp: initial.stamp,
            core: CoreState::from(initial),
            sources: sources.collect(),
            covariance,
            consecutive_outliers: 0,
            divergence_cause: None,
        }
    }

    /// Becomes equal to another, without claiming memory.
    pub(crate) fn assign(&mut self, other: &Self) {
        (self.stamp, self.core) = (other.stamp, other.core);
        (self.consecutive_outliers, self.divergence_cause) = (other.consecutive_outliers, other.divergence_cause);
        self.sources.copy_from_slice(&other.sources);
        self.covariance.assign(&other.covariance);
    }

    /// `P ← F P Fᵀ + N`: the body moves, the frames of the sources drift.
    pub(crate) fn propagate(
        &mut self,
        transition: &StateTransition,
        elapsed: f64,
        until: Stamp,
        sources: &[PoseSource],
    ) {
        let end = transition.end(&self.core.position, &self.core.attitude);
        (self.core.position, self.core.attitude) = (end.translation.vector, end.rotation);
        self.core.velocity = transition.velocity;
        self.stamp = until;

        let core = transition
            .propagate_covariance(&self.covariance.block::<{ error_state::CORE }, { error_state::CORE }>(0, 0));
        for source in 0..self.sources.len() {
            let cross =
                transition.transition * self.covariance.block::<{ error_state::CORE }, SOURCE>(0, first_row(source));
            self.set_cross(source, &cross);
        }
        for r in 0..error_state::CORE {
            for c in 0..error_state::CORE {
                self.covariance.row_mut(r)[c] = core[(r, c)];
            }
        }
        for (k, source) in sources.iter().enumerate() {
            self.drift(k, &source.alignment, elapsed);
        }
    }

    fn set_cross(&mut self, source: usize, cross: &SMatrix<f64, { error_state::CORE }, SOURCE>) {
        let first = first_row(source);
        for r in 0..error_state::CORE {
            for c in 0..SOURCE {
                self.covariance.row_mut(r)[first + c] = cross[(r, c)];
                self.covariance.row_mut(first + c)[r] = cross[(r, c)];
            }
        }
    }

    /// The frame turns about the place where the body is: a drifting odometry knows nothing of the world's origin. With
    /// rotation `φ`, the position must move by `hat(q) φ` for the body's place `q` in the source's frame to stay.
    fn drift(&mut self, source: usize, walk: &AlignmentSettings, elapsed: f64) {
        let frame = &self.sources[source];
        let here = frame.alignment.1 * self.core.position * frame.scale;
        let rotation = frame.alignment.1.to_rotation_matrix().into_inner();
        let angles =
            rotation * squares([walk.tilt_walk, walk.tilt_walk, walk.yaw_walk]) * rotation.transpose() * elapsed;
        let lever = here.cross_matrix();
        let mut noise = Matrix6::zeros();
        let position = lever * angles * lever.transpose() + squares([walk.position_walk; 3]) * elapsed;
        noise.fixed_view_mut::<3, 3>(0, 0).copy_from(&position);
        noise.fixed_view_mut::<3, 3>(0, 3).copy_from(&(lever * angles));
        noise.fixed_view_mut::<3, 3>(3, 0).copy_from(&(lever * angles).transpose());
        noise.fixed_view_mut::<3, 3>(3, 3).copy_from(&angles);
        let first = first_row(source) + source_rows::ALIGNMENT_POSITION;
        for r in 0..6 {
            for c in 0..6 {
                self.covariance.row_mut(first + r)[first + c] += 0.5 * (noise[(r, c)] + noise[(c, r)]);
            }
        }
    }

    /// Updates with a pose of the present time, unless it fails its gate.
    pub(crate) fn update(
        &mut self,
        pose: &WhitenedPose,
        reading: &Imu,
        settings: &FusionSettings,
        workspace: &mut Workspace,
    ) {
        let source = pose.measurement.source;
        let (core, frame) = (self.core, self.sources[source]);
        let iteration = Iteration { limit: settings.max_iterations, tolerance: 1e-3 };
        let rows: [usize; LOCAL] = rows(source);
        let measurement = iterate(&self.covariance, rows, iteration, SVector::zeros(), |delta| {
            let (core, frame) = trial(&core, &frame, delta);
            let prediction = predict(&core, &frame, reading, settings.gravity);
            Some(linearize(&prediction, &pose.measurement, &pose.whitener))
        });
        let used = measurement.is_some_and(|measurement| {
            mahalanobis(&self.covariance, &measurement).is_some_and(|distance| distance <= settings.max_mahalanobis)
                && self.covariance.update(&measurement, &mut workspace.delta)
        });
        if !used {
            self.consecutive_outliers += 1;
            return;
        }
        self.consecutive_outliers = 0;
        self.core = self.core.corrected(&workspace.delta);
        for (k, frame) in self.sources.iter_mut().enumerate() {
            *frame = frame.corrected(&workspace.delta[first_row(k)..]);
        }
    }

    /// The divergence test; once failed, failed for good.
    pub(crate) fn check_divergence(&mut self, settings: &DivergenceSettings) {
        let too_many = self.consecutive_outliers >= settings.max_consecutive_outliers;
        let outliers = too_many.then_some(DivergenceCause::ConsecutiveOutliers);
        let cause = exceeded_limit(&self.core, &self.covariance, settings).or(outliers);
        self.divergence_cause = self.divergence_cause.or(cause);
    }
}

fn squares(sigma: [f64; 3]) -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::from(sigma.map(|s| s * s)))
}
