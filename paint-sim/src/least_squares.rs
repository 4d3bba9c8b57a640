//! Nonlinear least squares of a few parameters (Levenberg 1944, Marquardt 1963) on normal equations.

use nalgebra::{Const, SMatrix, SVector};

/// Marquardt's damping at the start, its least and its greatest value.
const DAMPING: [f64; 3] = [1e-4, 1e-12, 1e12];
/// A step this small, in deviations of the parameters, changes nothing that the data tell.
const STILL: f64 = 1e-2;
/// The longest step in any coordinate, which are logarithms or of order one: a longer one may end where nothing has a slope.
const LONGEST: f64 = 1.0;

/// A sum of weighted squares at one point, with the normal equations of its linearisation.
#[derive(Debug, Clone)]
pub(crate) struct Normal<const N: usize> {
    /// Sum of the squared residuals over their variances.
    pub(crate) cost: f64,
    /// `J^T W r`, with the residual `r` = measured less predicted.
    pub(crate) slope: SVector<f64, N>,
    /// `J^T W J`; rows of parameters that are held are zero.
    pub(crate) information: SMatrix<f64, N, N>,
}

impl<const N: usize> Normal<N> {
    pub(crate) fn zero() -> Self {
        Self { cost: 0.0, slope: SVector::zeros(), information: SMatrix::zeros() }
    }

    /// The covariance of the free parameters, zero in rows and columns of held ones; `None` where the data leave some open.
    pub(crate) fn covariance(&self) -> Option<SMatrix<f64, N, N>> {
        let scale = self.scale();
        let mut covariance = self.scaled(&scale).cholesky()?.inverse();
        for row in 0..N {
            for column in 0..N {
                covariance[(row, column)] *= scale[row] * scale[column];
            }
        }
        Some(covariance)
    }

    /// One over the root of the diagonal, zero for held parameters.
    fn scale(&self) -> SVector<f64, N> {
        self.information.diagonal().map(|d| if d > 0.0 { d.sqrt().recip() } else { 0.0 })
    }

    /// The information with a unit diagonal, held parameters included.
    pub(crate) fn scaled(&self, scale: &SVector<f64, N>) -> SMatrix<f64, N, N> {
        SMatrix::from_fn(
            |row, column| {
                if row == column { 1.0 } else { self.information[(row, column)] * scale[row] * scale[column] }
            },
        )
    }

    /// The least curved direction in the scaled parameters, and its curvature between 0 and 1.
    pub(crate) fn weakest(&self) -> (f64, SVector<f64, N>)
    where
        Const<N>: nalgebra::DimSub<nalgebra::U1>,
        nalgebra::DefaultAllocator: nalgebra::allocator::Allocator<nalgebra::DimDiff<Const<N>, nalgebra::U1>>,
    {
        let eigen = self.scaled(&self.scale()).symmetric_eigen();
        let index = eigen.eigenvalues.imin();
        (eigen.eigenvalues[index], eigen.eigenvectors.column(index).into_owned())
    }

    /// Marquardt's step.
    fn step(&self, damping: f64) -> Option<SVector<f64, N>> {
        let scale = self.scale();
        let mut damped = self.scaled(&scale);
        (0..N).for_each(|k| damped[(k, k)] += damping);
        let solved = damped.cholesky()?.solve(&self.slope.component_mul(&scale));
        Some(solved.component_mul(&scale))
    }
}

/// Where a search ended.
#[derive(Debug)]
pub(crate) struct Minimum<const N: usize> {
    pub(crate) at: SVector<f64, N>,
    pub(crate) normal: Normal<N>,
    pub(crate) converged: bool,
    pub(crate) iterations: usize,
}

/// The least sum of squares in reach of `start`. `linearise` says `None` where there is no prediction; it must have one at the start.
pub(crate) fn minimise<const N: usize>(
    start: SVector<f64, N>,
    most: usize,
    mut linearise: impl FnMut(&SVector<f64, N>) -> Option<Normal<N>>,
) -> Option<Minimum<N>> {
    let finite = |normal: &Normal<N>| normal.cost.is_finite() && normal.slope.iter().all(|v| v.is_finite());
    let mut at = start;
    let mut normal = linearise(&at).filter(finite)?;
    let [mut damping, least, greatest] = DAMPING;
    for iterations in 0..most {
        let Some(step) = normal.step(damping) else {
            damping *= 10.0;
            continue;
        };
        // Twice what the linearisation promises, in units of one deviation squared.
        let promised = step.dot(&normal.slope);
        if promised < STILL * STILL || damping > greatest {
            // A step that is small because it is damped is no sign of a minimum.
            return Some(Minimum { at, normal, converged: damping <= 1.0, iterations });
        }
        let step = step * (LONGEST / step.amax()).min(1.0);
        match linearise(&(at + step)).filter(finite) {
            Some(next) if next.cost <= normal.cost => {
                at += step;
                normal = next;
                damping = (0.1 * damping).max(least);
            }
            _ => damping *= 10.0,
        }
    }
    Some(Minimum { at, normal, converged: false, iterations: most })
}
