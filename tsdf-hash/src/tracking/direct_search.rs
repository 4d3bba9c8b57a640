//! Direct search (Hooke and Jeeves 1961) along the directions that the linear system does not see, and whether the cost fixes them:
//! outlines, and walls that weigh little beside something near, hold a pose where slopes do not.

use nalgebra::{DMatrix, DVector, Isometry3, SymmetricEigen, Vector6};

use crate::tracking::pose::moved;
use crate::tracking::residuals::Comparison;
use crate::tracking::truncated_cost::{Rise, rise};

/// Step sizes, metres at the surface (ours): the first is as far as a fast camera moves in a frame.
pub(crate) const STEPS: [f64; 6] = [0.08, 0.04, 0.02, 0.01, 0.005, 0.0025];
/// Most moves with one step.
const MOST_MOVES: usize = 6;
/// Share of the points by which the cost rises, both ways together, over steps that are compared (ours).
const ALIKE: f64 = 0.05;
/// The shortest of these steps, metres at the surface.
const SHORTEST: f64 = 0.001;
/// Distances at which the cost must have risen, metres at the surface (ours).
const TESTED: [f64; 3] = [0.01, 0.02, 0.04];
/// It has when it rises both ways by so many of its standard deviations (ours): 2.0 at most where nothing fixes a pose.
const LEAST_SIGNIFICANCE: f64 = 5.0;
/// And by so large a share of the points per metre (ours): an outline over a fortieth of the image makes 0.3, what is wrong with a map 0.1.
const LEAST_SLOPE: f64 = 0.2;

/// A comparison by truncated squares of the distances; `scale` is the noise as a multiple of the noise model's.
#[derive(Clone, Copy)]
pub(crate) struct DirectSearch<'a> {
    pub(crate) comparison: Comparison<'a>,
    pub(crate) scale: f32,
}

impl DirectSearch<'_> {
    /// Moves a pose by multiples of a step along some directions, of a metre at the surface each, as long as the cost falls.
    pub(crate) fn descend(&self, pose: &mut Isometry3<f64>, directions: &[Vector6<f64>], step: f64) {
        for _ in 0..MOST_MOVES {
            let ways = directions.iter().flat_map(|direction| [direction * step, direction * -step]);
            let there = ways.map(|way| moved(pose, &way)).map(|there| (self.rise([pose, &there], step).sum, there));
            match there.min_by(|a, b| a.0.total_cmp(&b.0)) {
                Some((rise, there)) if rise < 0.0 => *pose = there,
                _ => return,
            }
        }
    }

    /// The principal directions of the cost about a pose, in the span of some orthonormal directions: orthonormal columns, each a combination of
    /// these, the flattest first.
    pub(crate) fn principal(&self, pose: &Isometry3<f64>, directions: &[Vector6<f64>]) -> DMatrix<f64> {
        let count = directions.len();
        let rises = |way: &Vector6<f64>| self.both_ways(pose, way, 1.0).map(|rise| rise.share()).iter().sum::<f64>();
        // Steps after which the cost has risen alike: it is truncated, and one that is steep would hide one that is not.
        let lengths: Vec<f64> = directions
            .iter()
            .map(|axis| STEPS[1..].iter().copied().find(|step| rises(&(axis * *step)) < ALIKE).unwrap_or(SHORTEST))
            .collect();
        let steps: Vec<Vector6<f64>> = directions.iter().zip(&lengths).map(|(axis, length)| axis * *length).collect();
        let mut curvature = DMatrix::from_diagonal(&DVector::from_iterator(count, steps.iter().map(rises)));
        for i in 0..count {
            for j in 0..i {
                let between = 0.5 * (rises(&(steps[i] + steps[j])) - rises(&(steps[i] - steps[j])));
                (curvature[(i, j)], curvature[(j, i)]) = (0.5 * between, 0.5 * between);
            }
        }
        let eigen = SymmetricEigen::new(curvature);
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
        let scaled = |k: usize| DVector::from_fn(count, |row, _| eigen.eigenvectors[(row, k)] * lengths[row]);
        let mut columns: Vec<DVector<f64>> = Vec::new();
        for k in order {
            let own = scaled(k).normalize();
            let rest = columns.iter().fold(own.clone(), |rest, other| rest - other * other.dot(&own));
            columns.push(rest.try_normalize(1e-12).unwrap_or(own));
        }
        DMatrix::from_columns(&columns)
    }

    /// To how many metres at the surface the cost fixes a pose along a direction: the least is between two places where it has risen. `None` if
    /// it has not.
    pub(crate) fn deviation(&self, pose: &Isometry3<f64>, direction: &Vector6<f64>) -> Option<f64> {
        TESTED.into_iter().find(|&distance| {
            let rises = self.both_ways(pose, direction, distance);
            let steep = |rise: &Rise| rise.share() >= LEAST_SLOPE * distance;
            rises.iter().all(|rise| steep(rise) && rise.significance() >= LEAST_SIGNIFICANCE)
        })
    }

    fn both_ways(&self, pose: &Isometry3<f64>, direction: &Vector6<f64>, distance: f64) -> [Rise; 2] {
        let width = f64::from(self.comparison.tolerance);
        [distance, -distance].map(|step| self.rise([pose, &moved(pose, &(direction * step))], width))
    }

    fn rise(&self, poses: [&Isometry3<f64>; 2], width: f64) -> Rise {
        rise(&self.comparison, poses, self.scale, width)
    }
}
