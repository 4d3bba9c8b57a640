//! The directions of a pose, by how much a frame says about each, and which of them it says nothing about.

use nalgebra::{Isometry3, Matrix6, SymmetricEigen, Vector6};

use crate::tracking::pose::moved;
use crate::tracking::residuals::Evaluation;

/// Directions with less than this share of the information of the best known one are degenerate without a second look (ours): normals
/// that scatter by a degree.
pub(crate) const LEAST_SHARE: f64 = 4e-4;
/// Of the information of a direction at least this share is believed (ours).
const LEAST_LEFT: f64 = 0.02;
/// Directions with a share below so many times the scatter of the normals get a second look (ours).
const MARGIN: f64 = 1.0;
/// The cost must rise by this share of what the linear system says when the pose is moved (ours); with the robust cost a perfect
/// constraint makes 0.3 or more.
const LEAST_RISE: f64 = 0.25;
/// How far the pose is moved, standard deviations of a residual (ours): nearer, the noise of new partners hides the rise.
const DEVIATIONS: f64 = 8.0;

/// Principal directions of the information on `(mean depth · ω, v)`: turns and shifts are then both metres at the surface.
#[derive(Clone)]
pub(crate) struct Directions {
    /// Orthonormal columns.
    pub(crate) axes: Matrix6<f64>,
    /// One value per column, 1/m².
    pub(crate) information: Vector6<f64>,
    scale: Vector6<f64>,
}

impl Directions {
    /// Of the information `h` on `(ω, v)`; `None` if it is none.
    pub(crate) fn new(h: &Matrix6<f64>, depth: f64) -> Option<Self> {
        if !(depth > 0.0 && h.iter().all(|x| x.is_finite())) {
            return None;
        }
        let scale = Vector6::new(depth, depth, depth, 1.0, 1.0, 1.0);
        let eigen = SymmetricEigen::new(Matrix6::from_fn(|r, c| h[(r, c)] / (scale[r] * scale[c])));
        (eigen.eigenvalues.max() > 0.0).then_some(Self {
            axes: eigen.eigenvectors,
            information: eigen.eigenvalues,
            scale,
        })
    }

    /// The covariance of `(ω, v)` along the directions that are kept.
    pub(crate) fn inverse(&self, kept: impl Fn(usize) -> bool, damping: f64) -> Matrix6<f64> {
        let mut inverse = Matrix6::zeros();
        for k in (0..6).filter(|&k| kept(k)) {
            let axis = self.axes.column(k);
            inverse += axis * axis.transpose() / (self.information[k] + damping);
        }
        Matrix6::from_fn(|r, c| inverse[(r, c)] / (self.scale[r] * self.scale[c]))
    }

    /// [`inverse`](Self::inverse) of what is left of the information when the noise of the normals has feigned some of it, 1/m²: never
    /// less than a share.
    pub(crate) fn honest_inverse(&self, kept: impl Fn(usize) -> bool, feigned: f64) -> Matrix6<f64> {
        let left = self.information.map(|information| (information - feigned).max(LEAST_LEFT * information));
        Self { information: left, ..self.clone() }.inverse(kept, 0.0)
    }

    /// `(ω, v)` of a unit step along a direction.
    fn step(&self, k: usize) -> Vector6<f64> {
        self.axes.column(k).component_div(&self.scale)
    }

    /// The part of a step `(ω, v)` along the directions that are taken.
    pub(crate) fn part(&self, step: &Vector6<f64>, taken: impl Fn(usize) -> bool) -> Vector6<f64> {
        let scaled = step.component_mul(&self.scale);
        let mut part = Vector6::zeros();
        for k in (0..6).filter(|&k| taken(k)) {
            part += self.axes.column(k) * self.axes.column(k).dot(&scaled);
        }
        part.component_div(&self.scale)
    }

    /// Which directions the frame says nothing about.
    ///
    /// The noise of the model's normals, of variance `scatter` in radians squared, makes the linear system believe that it can see a
    /// wall slide along itself. So where the system says no more than such noise would, the pose is moved a little, both
    /// ways: if the cost does not rise as it should, nothing is known. `dense` makes the comparison with as many points as
    /// there are, because the partners of a moved pose have other noise.
    pub(crate) fn degenerate(
        &self,
        dense: &mut dyn FnMut(&Isometry3<f64>) -> Evaluation,
        pose: &Isometry3<f64>,
        scatter: f64,
    ) -> [bool; 6] {
        let most = self.information.max();
        let shares = self.information / most;
        let doubtful = |k: usize| shares[k] >= LEAST_SHARE && shares[k] < MARGIN * scatter;
        let mut unknown = std::array::from_fn(|k| shares[k] < LEAST_SHARE);
        if !(0..6).any(doubtful) {
            return unknown;
        }
        let here = dense(pose);
        let share = here.share();
        // The information of the dense comparison along each direction, per point in view.
        let per_term = |k: usize| {
            let step = self.step(k);
            step.dot(&(here.equations.h * step)) / f64::from(here.in_view.max(1))
        };
        // A residual changes by as many standard deviations along the best known direction.
        let best = (0..6).map(per_term).fold(0.0, f64::max);
        let distance = DEVIATIONS / best.sqrt();
        for k in (0..6).filter(|&k| doubtful(k)) {
            let mut at = |step: f64| dense(&moved(pose, &(self.step(k) * step))).mean_cost(share);
            let rise = 0.5 * (at(distance) + at(-distance)) - here.mean_cost(share);
            unknown[k] = rise < LEAST_RISE * 0.5 * distance * distance * per_term(k);
        }
        unknown
    }
}
