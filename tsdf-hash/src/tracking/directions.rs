//! The directions of a pose, by how much a frame says about each, and which of them it says nothing about.

use nalgebra::{DMatrix, Isometry3, Matrix6, SymmetricEigen, Vector6};

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
    pub(crate) fn step(&self, k: usize) -> Vector6<f64> {
        self.axes.column(k).component_div(&self.scale)
    }

    /// Puts combinations of some directions, the columns, in the place of these.
    pub(crate) fn combine(&mut self, of: &[usize], columns: &DMatrix<f64>) {
        let axes = of.iter().map(|&k| self.axes.column(k).into_owned()).collect::<Vec<_>>();
        for (column, &k) in of.iter().enumerate() {
            let combined =
                axes.iter().enumerate().map(|(row, axis)| axis * columns[(row, column)]).sum::<Vector6<f64>>();
            self.axes.set_column(k, &combined);
        }
    }

    /// A direction is known to so many metres at the surface, by other means than slopes.
    pub(crate) fn fix(&mut self, k: usize, deviation: f64) {
        (self.information[k], self.of_distances[k]) = (deviation.powi(-2), 0.0);
    }

    /// The span of some steps without that of others: steps `(ω, v)` of a metre each.
    pub(crate) fn without(&self, steps: &[Vector6<f64>], others: &[Vector6<f64>]) -> Vec<Vector6<f64>> {
        let unit = |step: &Vector6<f64>| step.component_mul(&self.scale).normalize();
        let mut left = Matrix6::zeros();
        steps.iter().map(unit).for_each(|axis| left += axis * axis.transpose());
        let mut basis: Vec<Vector6<f64>> = Vec::new();
        for other in others.iter().map(unit) {
            let rest = basis.iter().fold(other, |rest, axis| rest - axis * axis.dot(&other));
            if rest.norm() > 0.1 {
                basis.push(rest.normalize());
            }
        }
        let out = basis.iter().fold(Matrix6::identity(), |out, axis| out - axis * axis.transpose());
        let eigen = SymmetricEigen::new(out * left * out);
        let kept = (0..6).filter(|&k| eigen.eigenvalues[k] > 0.5);
        kept.map(|k| eigen.eigenvectors.column(k).component_div(&self.scale)).collect()
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

    /// Which directions the linear system says nothing of, or no more than the noise of the model's normals would, of variance `scatter` in
    /// radians squared: it makes a wall seem to be seen to slide along itself.
    pub(crate) fn weak(&self, scatter: f64) -> [bool; 6] {
        let most = self.information.max();
        std::array::from_fn(|k| {
            let by_intensities = self.information[k] - self.of_distances[k] >= ENOUGH;
            let feigned = self.of_distances[k] < scatter * most && !by_intensities;
            self.information[k] < LEAST_INFORMATION || feigned
        })
    }

    /// Which directions the frame says nothing about.
    ///
    /// Where the system is [weak](Self::weak), the pose is moved a little, both ways: if the cost does not rise as it should, nothing is known.
    /// `dense` makes the comparison with as many points as there are, because the partners of a moved pose have other noise.
    pub(crate) fn degenerate(
        &self,
        dense: &mut dyn FnMut(&Isometry3<f64>) -> Evaluation,
        pose: &Isometry3<f64>,
        scatter: f64,
    ) -> [bool; 6] {
        let mut unknown = std::array::from_fn(|k| self.information[k] < LEAST_INFORMATION);
        let weak = self.weak(scatter);
        let doubtful = |k: &usize| weak[*k] && self.information[*k] >= LEAST_INFORMATION;
        if !(0..6).any(|k| doubtful(&k)) {
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
        for k in (0..6).filter(doubtful) {
            let mut at = |step: f64| dense(&moved(pose, &(self.step(k) * step))).mean_cost(share);
            let rise = 0.5 * (at(distance) + at(-distance)) - here.mean_cost(share);
            unknown[k] = rise < LEAST_RISE * 0.5 * distance * distance * per_term(k);
        }
        unknown
    }
}
