//! The directions of a pose, by how much a frame says about each, and which of them it says nothing about.

use nalgebra::{Isometry3, Matrix6, SymmetricEigen, Vector6};

use crate::tracking::normal_equations::NormalEquations;
use crate::tracking::pose::moved;
use crate::tracking::residuals::Evaluation;

/// Directions with less than this share of the information that distances have on the best known one are not known by distances (ours):
/// normals that scatter by a degree.
pub(crate) const LEAST_SHARE: f64 = 4e-4;
/// Along directions with less information nothing is known, 1/m²: five centimetres at the surface (ours).
const LEAST_INFORMATION: f64 = 400.0;
/// Intensities that fix a direction to a centimetre need no second look, 1/m² (ours): slopes of noise are left out of them.
const ENOUGH: f64 = 1e4;
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
    /// What of that is of distances.
    of_distances: Vector6<f64>,
    /// The gradient of the cost along each column.
    gradient: Vector6<f64>,
    scale: Vector6<f64>,
}

impl Directions {
    /// Of sums on `(ω, v)`, at a mean depth; `None` if they say nothing. Along directions of the distances with less than `least_share`
    /// of the information of the best known one the distances have no say, however much the intensities have.
    pub(crate) fn new(equations: &NormalEquations, depth: f64, least_share: f64) -> Option<Self> {
        let scale = Vector6::new(depth, depth, depth, 1.0, 1.0, 1.0);
        let scaled = |h: &Matrix6<f64>| Matrix6::from_fn(|r, c| h[(r, c)] / (scale[r] * scale[c]));
        let [distances, intensities] = [&equations.distances, &equations.intensities].map(|sums| scaled(&sums.h));
        if !(depth > 0.0 && distances.iter().chain(intensities.iter()).all(|x| x.is_finite())) {
            return None;
        }
        let eigen = SymmetricEigen::new(distances);
        let most = eigen.eigenvalues.max();
        let mut onto_known = Matrix6::zeros();
        for k in (0..6).filter(|&k| eigen.eigenvalues[k] > least_share * most) {
            let axis = eigen.eigenvectors.column(k);
            onto_known += axis * axis.transpose();
        }
        let known = onto_known * distances * onto_known;
        let sum = known + intensities;
        let eigen = SymmetricEigen::new(0.5 * (sum + sum.transpose()));
        let axes = eigen.eigenvectors;
        let pull =
            onto_known * equations.distances.b.component_div(&scale) + equations.intensities.b.component_div(&scale);
        (eigen.eigenvalues.max() > 0.0).then(|| Self {
            axes,
            information: eigen.eigenvalues,
            of_distances: Vector6::from_fn(|k, _| axes.column(k).dot(&(known * axes.column(k)))),
            gradient: axes.transpose() * pull,
            scale,
        })
    }

    /// The damped step of Gauss and Newton, along the directions that are known at all.
    pub(crate) fn gauss_newton(&self, damping: f64) -> Vector6<f64> {
        let mut step = Vector6::zeros();
        for k in (0..6).filter(|&k| self.information[k] > LEAST_INFORMATION) {
            step -= self.axes.column(k) * (self.gradient[k] / (self.information[k] * (1.0 + damping)));
        }
        step.component_div(&self.scale)
    }

    /// The covariance of `(ω, v)` along the directions that are kept, of what is left of the information when the noise of the normals
    /// has feigned some of that of the distances, 1/m²: never less than a share.
    pub(crate) fn honest_covariance(&self, kept: impl Fn(usize) -> bool, feigned: f64) -> Matrix6<f64> {
        let mut inverse = Matrix6::zeros();
        for k in (0..6).filter(|&k| kept(k)) {
            let left = (self.of_distances[k] - feigned).max(LEAST_LEFT * self.of_distances[k]);
            let axis = self.axes.column(k);
            inverse += axis * axis.transpose() / (self.information[k] - self.of_distances[k] + left);
        }
        Matrix6::from_fn(|r, c| inverse[(r, c)] / (self.scale[r] * self.scale[c]))
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
        let weak = |k: usize| self.of_distances[k] < MARGIN * scatter * most;
        let by_intensities = |k: usize| self.information[k] - self.of_distances[k] >= ENOUGH;
        let doubtful = |k: usize| self.information[k] >= LEAST_INFORMATION && weak(k) && !by_intensities(k);
        let mut unknown = std::array::from_fn(|k| self.information[k] < LEAST_INFORMATION);
        if !(0..6).any(doubtful) {
            return unknown;
        }
        let here = dense(pose);
        let share = here.share();
        let h = here.equations.distances.h + here.equations.intensities.h;
        // The information of the dense comparison along each direction, per point in view.
        let per_term = |k: usize| {
            let step = self.step(k);
            step.dot(&(h * step)) / f64::from(here.in_view.max(1))
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
