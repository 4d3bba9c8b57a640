//! A run against the truth: its errors, and whether they are those that its covariances claim.

use nalgebra::{Isometry3, Matrix3, Vector3};

use crate::error::Error;
use crate::eval::{
    Alignment, Association, PairsFrom, RpeSettings, Span, Stats, Tolerance, apply, ate, heading_onto, rpe,
};
use crate::inertial::Odometry;
use crate::lie::so3;
use crate::run::Run;
use crate::stamp::Stamp;
use crate::trajectory::Trajectory;

/// Standard deviations that a recorded truth has of its own, added to those that the filter claims: 1 mm, 0.1 degrees,
/// 3 mm/s. Ours; without them the first poses, which the filter knows exactly by definition, would decide.
const GROUND_TRUTH_SIGMA: [f64; 3] = [1e-3, 1.7e-3, 3e-3];
/// Path length of the relative error, m.
const RPE_LENGTH: f64 = 10.0;

/// The true motion of the body, as far as it was recorded.
#[derive(Debug, Clone)]
pub struct GroundTruth {
    /// Poses.
    pub trajectory: Trajectory,
    /// Velocity in world axes, m/s, one per pose; empty if it was not recorded.
    pub velocities_in_world: Vec<Vector3<f64>>,
}

/// Time, true pose, and estimated pose moved into the truth's world.
pub type AlignedPair = (Stamp, Isometry3<f64>, Isometry3<f64>);

/// How good a run is.
#[derive(Debug, Clone)]
pub struct RunEvaluation {
    /// Root mean square position error after rigid alignment, m.
    pub ate_se3: f64,
    /// The same after alignment of position and yaw, m.
    pub ate_yaw: f64,
    /// Median translation error over 10 m of path, m; `None` for a shorter path.
    pub rpe_10m_median: Option<f64>,
    /// Mean normalised squared error of the position; 3 is right.
    pub nees_position: f64,
    /// The same of the attitude.
    pub nees_attitude: f64,
    /// The same of the velocity, if that is known.
    pub nees_velocity: Option<f64>,
    /// Share of the time with truth and images for which there is an estimate.
    pub coverage: f64,
    /// Truth and estimate in the truth's world, aligned in position and yaw.
    pub aligned: Vec<AlignedPair>,
    /// Errors and the standard deviations that the filter claims, for each pose.
    pub errors: Vec<PoseError>,
}

/// Error of one pose in the filter's world, which is the truth's where the stretch begins.
#[derive(Debug, Clone, Copy)]
pub struct PoseError {
    /// Its time.
    pub stamp: Stamp,
    /// Of the position, m.
    pub position: Vector3<f64>,
    /// Of the attitude, rotation vector in world axes, rad.
    pub attitude: Vector3<f64>,
    /// Standard deviations claimed for the position.
    pub position_sigma: Vector3<f64>,
    /// Standard deviations claimed for the attitude.
    pub attitude_sigma: Vector3<f64>,
}

/// Evaluates a run. `None` if truth and estimate have no time in common.
///
/// # Errors
/// Poses that cannot be aligned.
pub fn evaluate_run(run: &Run, truth: &GroundTruth) -> Result<Option<RunEvaluation>, Error> {
    let association = Association { interpolate: true, ..Association::default() };
    let settings = RpeSettings {
        span: Span::Metres(RPE_LENGTH),
        all_pairs: true,
        tolerance: Tolerance::Metres(0.5),
        pairs_from: PairsFrom::Reference,
    };
    // Each segment is in a world of its own, and aligned by itself.
    let (mut se3, mut yaw, mut drift, mut aligned, mut covered) = (Vec::new(), Vec::new(), Vec::new(), Vec::new(), 0.0);
    for estimate in run.trajectories()? {
        let pairs = match association.pair_up(&truth.trajectory, &estimate) {
            Err(Error::NoMatches { .. }) => continue,
            other => other?,
        };
        let error = |alignment| position_error(&pairs.reference, &pairs.estimate, alignment);
        let (ate_yaw, onto) = error(Alignment::PosYaw)?;
        let (ate_se3, _) = error(Alignment::Se3)?;
        yaw.push((ate_yaw, pairs.stamps.len()));
        se3.push((ate_se3, pairs.stamps.len()));
        match rpe(&pairs.reference, &pairs.estimate, &settings) {
            Ok(rpe) => drift.extend(rpe.translation_errors),
            Err(Error::NoPairs { .. }) => {}
            Err(error) => return Err(error),
        }
        covered += pairs.stamps[pairs.stamps.len() - 1].secs_since(pairs.stamps[0]);
        aligned.extend(pairs.stamps.iter().zip(&pairs.reference).zip(onto).map(|((&s, &g), e)| (s, g, e)));
    }
    if aligned.is_empty() {
        return Ok(None);
    }
    let both = match truth.trajectory.span() {
        Some((first, last)) => last.min(run.images_span.1).secs_since(first.max(run.images_span.0)),
        None => 0.0,
    };
    let coverage = if both > 0.0 { covered / both } else { 1.0 };
    let (mut errors, mut sums) = (Vec::new(), Sums::default());
    for segment in &run.segments {
        accumulate_errors(segment.estimates.iter().map(|estimate| &estimate.odometry), truth, &mut errors, &mut sums);
    }
    let count = (errors.len() as f64).max(1.0);
    Ok(Some(RunEvaluation {
        ate_se3: pooled(&se3),
        ate_yaw: pooled(&yaw),
        rpe_10m_median: Stats::of(&drift).map(|stats| stats.median),
        nees_position: sums.position / count,
        nees_attitude: sums.attitude / count,
        nees_velocity: (!truth.velocities_in_world.is_empty()).then(|| sums.velocity / count),
        coverage: coverage.min(1.0),
        aligned,
        errors,
    }))
}

/// Root mean square over segments, from their own and their numbers of poses.
fn pooled(segments: &[(f64, usize)]) -> f64 {
    if let [(only, _)] = segments {
        return *only;
    }
    let sum = |value: &dyn Fn(&(f64, usize)) -> f64| segments.iter().map(value).sum::<f64>();
    (sum(&|(rms, count)| rms * rms * *count as f64) / sum(&|(_, count)| *count as f64)).sqrt()
}

/// Root mean square position error, and the estimate after alignment. Poses that do not tell a rotation, as at rest, are
/// aligned in position and heading at the first of them.
fn position_error(
    reference: &[Isometry3<f64>],
    estimate: &[Isometry3<f64>],
    alignment: Alignment,
) -> Result<(f64, Vec<Isometry3<f64>>), Error> {
    match ate(reference, estimate, alignment) {
        Ok(result) => Ok((result.position.rmse, apply(&result.reference_from_estimate, estimate))),
        Err(Error::Degenerate { .. }) => {
            let onto = heading_onto(&reference[0], &estimate[0]);
            let turned: Vec<_> = estimate.iter().map(|pose| onto * pose).collect();
            let shift = mean_shift(reference, &turned);
            let moved: Vec<_> =
                turned.iter().map(|pose| Isometry3::translation(shift.x, shift.y, shift.z) * pose).collect();
            let square = |(g, e): (&Isometry3<f64>, &Isometry3<f64>)| {
                (g.translation.vector - e.translation.vector).norm_squared()
            };
            let mean = reference.iter().zip(&moved).map(square).sum::<f64>() / reference.len() as f64;
            Ok((mean.sqrt(), moved))
        }
        Err(error) => Err(error),
    }
}

fn mean_shift(reference: &[Isometry3<f64>], estimate: &[Isometry3<f64>]) -> Vector3<f64> {
    let pairs = reference.iter().zip(estimate);
    pairs.map(|(g, e)| g.translation.vector - e.translation.vector).sum::<Vector3<f64>>() / reference.len() as f64
}

#[derive(Default)]
struct Sums {
    position: f64,
    attitude: f64,
    velocity: f64,
}

/// Errors along one stretch, the truth moved to where the stretch begins.
fn accumulate_errors<'a>(
    odometry: impl Iterator<Item = &'a Odometry>,
    truth: &GroundTruth,
    errors: &mut Vec<PoseError>,
    sums: &mut Sums,
) {
    let known = |o: &&Odometry| truth.trajectory.pose_at(o.stamp).is_ok();
    let mut filter_from_truth = None;
    for o in odometry.filter(known) {
        let Ok(pose) = truth.trajectory.pose_at(o.stamp) else { continue };
        let onto = *filter_from_truth.get_or_insert_with(|| heading_onto(&o.world_from_body, &pose));
        let moved = onto * pose;
        let position = moved.translation.vector - o.world_from_body.translation.vector;
        let attitude = so3::log(&(moved.rotation * o.world_from_body.rotation.inverse()));
        let block = |row: usize| o.covariance.fixed_view::<3, 3>(row, row).into_owned();
        sums.position += square(&position, block(0), GROUND_TRUTH_SIGMA[0]);
        sums.attitude += square(&attitude, block(6), GROUND_TRUTH_SIGMA[1]);
        if let Some(velocity) = velocity_at(truth, o.stamp) {
            let error = pose.rotation.inverse() * velocity - o.velocity_in_body;
            sums.velocity += square(&error, block(3), GROUND_TRUTH_SIGMA[2]);
        }
        let sigma = |row: usize| block(row).diagonal().map(|variance| variance.max(0.0).sqrt());
        let (position_sigma, attitude_sigma) = (sigma(0), sigma(6));
        errors.push(PoseError { stamp: o.stamp, position, attitude, position_sigma, attitude_sigma });
    }
}

/// `eᵀ (P + σ² I)⁻¹ e`; infinite if P is no covariance, so that the report refuses it.
fn square(error: &Vector3<f64>, covariance: Matrix3<f64>, sigma: f64) -> f64 {
    let claimed = covariance + Matrix3::identity() * (sigma * sigma);
    claimed.cholesky().map_or(f64::INFINITY, |factor| error.dot(&factor.solve(error)))
}

fn velocity_at(truth: &GroundTruth, stamp: Stamp) -> Option<Vector3<f64>> {
    let (stamps, velocities) = (truth.trajectory.stamps(), &truth.velocities_in_world);
    let next = stamps.partition_point(|&s| s < stamp);
    let after = velocities.get(next)?;
    let Some(before) = next.checked_sub(1) else { return Some(*after) };
    let fraction = stamp.secs_since(stamps[before]) / stamps[next].secs_since(stamps[before]);
    Some(velocities[before].lerp(after, fraction))
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    #[test]
    fn segments_count_by_their_poses() {
        // Squared errors of one pose of 3 m and of three of 1 m: 12 m² over 4 poses.
        assert!((pooled(&[(3.0, 1), (1.0, 3)]) - 3.0_f64.sqrt()).abs() < 1e-15);
    }

    /// A body that has turned by 90 degrees, seen by a filter whose world is turned and shifted: the errors are those of the
    /// body's axes, the world's for the position, and the covariance that goes with each is not round.
    #[test]
    fn errors_are_taken_in_the_frames_of_their_covariances() {
        let turned = |yaw: f64| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
        let poses =
            [0.0, 1.0, 2.0].map(|x| Isometry3::from_parts([x, 0.0, 0.0].into(), turned(0.5 * std::f64::consts::PI)));
        let stamps = [0, 1, 2].map(|k| Stamp::from_nanos(k * 1_000_000_000));
        let mut trajectory = Trajectory::default();
        stamps.iter().zip(poses).for_each(|(stamp, pose)| trajectory.push(*stamp, pose).unwrap());
        // Along x of the world is backwards along y of the body: -y.
        let truth = GroundTruth { trajectory, velocities_in_world: vec![Vector3::x(); 3] };
        let filter_from_truth = Isometry3::from_parts([5.0, -3.0, 1.0].into(), turned(0.7));
        let (position_error, velocity_error) = (Vector3::new(0.02, -0.03, 0.01), Vector3::new(0.1, 0.02, -0.3));
        let (position_sigma, velocity_sigma) = (Vector3::new(0.01, 0.02, 0.04), Vector3::new(0.05, 0.04, 0.2));
        let mut covariance = crate::inertial::CoreCovariance::identity() * 1e-4;
        covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::from_diagonal(&position_sigma.map(|s| s * s)));
        covariance.fixed_view_mut::<3, 3>(3, 3).copy_from(&Matrix3::from_diagonal(&velocity_sigma.map(|s| s * s)));
        let odometry: Vec<Odometry> = [0, 1, 2]
            .map(|k| {
                let mut world_from_body = filter_from_truth * poses[k];
                // The first pose is where the worlds are brought together.
                if k > 0 {
                    world_from_body.translation.vector -= position_error;
                }
                Odometry {
                    stamp: stamps[k],
                    world_from_body,
                    velocity_in_body: -Vector3::y() - velocity_error,
                    rate_in_body: Vector3::zeros(),
                    gyro_bias: Vector3::zeros(),
                    accel_bias: Vector3::zeros(),
                    covariance,
                }
            })
            .into();
        let (mut errors, mut sums) = (Vec::new(), Sums::default());
        accumulate_errors(odometry.iter(), &truth, &mut errors, &mut sums);
        let nees = |error: Vector3<f64>, sigma: Vector3<f64>, truth: f64| {
            error.zip_map(&sigma, |e, s| e * e / (s * s + truth * truth)).sum()
        };
        assert_eq!(errors.len(), 3);
        assert!((errors[1].position - position_error).norm() < 1e-12 && errors[2].attitude.norm() < 1e-12);
        assert!((sums.position - 2.0 * nees(position_error, position_sigma, 1e-3)).abs() < 1e-9);
        assert!((sums.velocity - 3.0 * nees(velocity_error, velocity_sigma, 3e-3)).abs() < 1e-9, "{}", sums.velocity);
        assert!(sums.attitude < 1e-12);
    }
}
