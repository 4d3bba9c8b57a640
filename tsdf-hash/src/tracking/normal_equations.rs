//! Sums of the Gauss-Newton step: `H = Σ w J Jᵀ` and `b = Σ w J r`.

use nalgebra::{Matrix6, Vector6};

/// The terms of a tile, in single precision, so that they are added in vector registers.
#[derive(Clone, Copy)]
pub(crate) struct Run {
    /// Row `k`: `Σ w J_k (J, r, s)`.
    rows: [[f32; 8]; 6],
}

impl Run {
    pub(crate) const ZERO: Self = Self { rows: [[0.0; 8]; 6] };

    #[inline(always)]
    pub(crate) fn add(&mut self, jacobian: [f32; 6], residual: f32, weight: f32, shared: f32) {
        let [a, b, c, d, e, f] = jacobian;
        let term = [a, b, c, d, e, f, residual, shared];
        for (row, j) in self.rows.iter_mut().zip(jacobian) {
            let scaled = weight * j;
            for (sum, t) in row.iter_mut().zip(term) {
                *sum += scaled * t;
            }
        }
    }
}

/// The sums of one kind of residuals.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sums {
    pub(crate) h: Matrix6<f64>,
    pub(crate) b: Vector6<f64>,
}

impl Sums {
    fn zero() -> Self {
        Self { h: Matrix6::zeros(), b: Vector6::zeros() }
    }

    fn add_run(&mut self, run: &Run) {
        for (k, row) in run.rows.iter().enumerate() {
            for (n, &value) in row[..6].iter().enumerate() {
                self.h[(k, n)] += f64::from(value);
            }
            self.b[k] += f64::from(row[6]);
        }
    }

    fn add(&mut self, other: &Self) {
        self.h += other.h;
        self.b += other.b;
    }
}

/// The sums of distances and of intensities apart: what noise feigns in the one it does not in the other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NormalEquations {
    pub(crate) distances: Sums,
    pub(crate) intensities: Sums,
    /// `Σ (Σ w J s) (Σ w J s)ᵀ` over runs of distances: what an error of one `s` adds to the variance of `b` that all terms of a run
    /// share.
    pub(crate) shared: Matrix6<f64>,
}

impl NormalEquations {
    pub(crate) fn zero() -> Self {
        Self { distances: Sums::zero(), intensities: Sums::zero(), shared: Matrix6::zeros() }
    }

    pub(crate) fn add_runs(&mut self, distances: &Run, intensities: &Run) {
        self.distances.add_run(distances);
        self.intensities.add_run(intensities);
        let pull = Vector6::from(distances.rows.map(|row| f64::from(row[7])));
        self.shared += pull * pull.transpose();
    }

    pub(crate) fn add(&mut self, other: &Self) {
        self.distances.add(&other.distances);
        self.intensities.add(&other.intensities);
        self.shared += other.shared;
    }
}
