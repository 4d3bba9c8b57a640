//! A pose graph.

use nalgebra::Isometry3;

use crate::error::Error;
use crate::images::check_pose;
use crate::pose_graph::chordal;
use crate::pose_graph::factors::{BetweenFactor, PriorFactor};
use crate::pose_graph::levenberg_marquardt::{PoseGraphReport, PoseGraphSettings, cost, minimise};
use crate::trace::span;

/// Poses and what was measured about them; [`optimise`](Self::optimise) finds the poses that fit best:
///
/// ```text
/// ½ Σ ρ(‖Log(Z⁻¹ T_first⁻¹ T_second)‖²) + ½ Σ ‖Log(Z⁻¹ T)‖², in units of the covariances
/// ```
///
/// ```
/// use nalgebra::{Isometry3, Matrix6};
/// use tsdf_hash::pose_graph::{BetweenFactor, PoseGraph, PoseGraphSettings, RobustKernel};
///
/// // Three steps of a metre; from end to end 2.7 m were measured.
/// let x = |length| Isometry3::translation(length, 0.0, 0.0);
/// let factor = |first, second, length| BetweenFactor {
///     first,
///     second,
///     first_from_second: x(length),
///     information: Matrix6::identity(),
///     kernel: RobustKernel::Squared,
/// };
/// let mut graph = PoseGraph {
///     poses: vec![x(0.0), x(1.0), x(2.0), x(3.0)],
///     betweens: vec![factor(0, 1, 1.0), factor(1, 2, 1.0), factor(2, 3, 1.0), factor(0, 3, 2.7)],
///     ..PoseGraph::default()
/// };
/// let report = graph.optimise(&PoseGraphSettings::default())?;
/// // All four share what is missing.
/// assert!(report.converged && (graph.poses[3].translation.x - 2.775).abs() < 1e-9);
/// # Ok::<(), tsdf_hash::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PoseGraph {
    /// `world_from_body` of every pose.
    pub poses: Vec<Isometry3<f64>>,
    /// Poses that are known and stay as they are.
    pub fixed: Vec<usize>,
    /// Measured motions.
    pub betweens: Vec<BetweenFactor>,
    /// Measured poses.
    pub priors: Vec<PriorFactor>,
}

impl PoseGraph {
    /// Half of the sum of the squared residuals, under their robust kernels.
    ///
    /// # Errors
    /// [`Error::InvalidFactor`], [`Error::InvalidPose`].
    pub fn cost(&self) -> Result<f64, Error> {
        self.check()?;
        Ok(cost(&self.poses, &self.betweens, &self.priors))
    }

    /// Levenberg-Marquardt from the poses as they are. Where no pose is fixed and none has a prior, the first one stays as it is.
    ///
    /// # Errors
    /// [`Error::InvalidFactor`], [`Error::InvalidPose`], [`Error::UnconstrainedPose`] where a pose is not joined to what is known,
    /// [`Error::SingularGraph`], [`Error::GraphTooLarge`]. The poses are then as they were.
    pub fn optimise(&mut self, settings: &PoseGraphSettings) -> Result<PoseGraphReport, Error> {
        span!("optimise");
        let fixed = self.anchors()?;
        let mut poses = self.poses.clone();
        let report = minimise(&mut poses, &fixed, &self.betweens, &self.priors, settings)?;
        self.poses = poses;
        Ok(report)
    }

    /// Poses to start from when those that were put in are far off, from the measurements alone: the chordal relaxation of the
    /// rotations, then the positions, two linear systems (Martinec and Pajdla 2007; Carlone et al. 2015). Robust kernels are not
    /// heeded.
    ///
    /// # Errors
    /// As [`optimise`](Self::optimise).
    pub fn initialise(&mut self) -> Result<(), Error> {
        let fixed = self.anchors()?;
        self.poses = chordal::initialise(&self.poses, &fixed, &self.betweens, &self.priors)?;
        Ok(())
    }

    fn check(&self) -> Result<(), Error> {
        self.poses.iter().try_for_each(check_pose)?;
        self.betweens.iter().enumerate().try_for_each(|(k, f)| f.check(k, self.poses.len()))?;
        self.priors.iter().enumerate().try_for_each(|(k, f)| f.check(k, self.poses.len()))
    }

    /// Which poses stay; every other one must be joined to one of them, or to a prior.
    pub(crate) fn anchors(&self) -> Result<Vec<bool>, Error> {
        self.check()?;
        let mut fixed = vec![false; self.poses.len()];
        for &pose in &self.fixed {
            *fixed
                .get_mut(pose)
                .ok_or(Error::UnconstrainedPose { pose, why: "it is fixed, but not in the graph" })? = true;
        }
        if self.fixed.is_empty() && self.priors.is_empty() {
            fixed.iter_mut().take(1).for_each(|first| *first = true);
        }
        let mut known = fixed.clone();
        self.priors.iter().for_each(|prior| known[prior.pose] = true);
        let mut neighbours = vec![Vec::new(); self.poses.len()];
        for factor in &self.betweens {
            neighbours[factor.first].push(factor.second);
            neighbours[factor.second].push(factor.first);
        }
        let mut front: Vec<usize> = (0..known.len()).filter(|&k| known[k]).collect();
        while let Some(pose) = front.pop() {
            for &next in &neighbours[pose] {
                if !std::mem::replace(&mut known[next], true) {
                    front.push(next);
                }
            }
        }
        match known.iter().position(|known| !known) {
            Some(pose) => {
                Err(Error::UnconstrainedPose { pose, why: "no chain of factors joins it to a pose that is known" })
            }
            None => Ok(fixed),
        }
    }
}
