//! The quadratic program of stage 1: local rows, a Hessian that couples neighbours only.

use crate::block_tridiagonal::BlockTridiagonal;
use nalgebra::{Matrix2x5, Matrix5, Vector2, Vector3, Vector5};

/// One inequality `a . q <= b`, where q is the position (hard row) or the mapped coordinate (soft row) of a state.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Row {
    pub(crate) a: Vector3<f64>,
    pub(crate) b: f64,
}

/// `min 1/2 x'Hx + g'x` over states `x_i = (p_i, u_i)` in R^5, with H block tridiagonal, subject to hard rows on the positions
/// `p_i` and soft rows on `w_i = soft_map_i x_i` (the aim beside the target) that may be exceeded at `penalty` per unit.
///
/// [`StandardForm`](crate::nozzle::StandardForm) has its matrices.
#[derive(Debug, Clone, Default)]
pub struct QuadraticProgram {
    pub(crate) hessian: BlockTridiagonal<5>,
    pub(crate) gradient: Vec<Vector5<f64>>,
    pub(crate) soft_map: Vec<Matrix2x5<f64>>,
    /// The rows of all states, `hard_rows + soft_rows` of them per state, the hard ones first.
    pub(crate) rows: Vec<Row>,
    pub(crate) hard_rows: usize,
    pub(crate) soft_rows: usize,
    pub(crate) penalty: f64,
}

impl QuadraticProgram {
    /// An empty program of `count` states.
    pub(crate) fn new(count: usize, hard_rows: usize, soft_rows: usize, penalty: f64) -> Self {
        Self {
            hessian: BlockTridiagonal {
                diagonal: vec![Matrix5::zeros(); count],
                lower: vec![Matrix5::zeros(); count.saturating_sub(1)],
            },
            gradient: vec![Vector5::zeros(); count],
            soft_map: vec![Matrix2x5::zeros(); count],
            rows: Vec::with_capacity(count * (hard_rows + soft_rows)),
            hard_rows,
            soft_rows,
            penalty,
        }
    }

    pub(crate) fn push_hard(&mut self, a: Vector3<f64>, b: f64) {
        self.rows.push(Row { a, b });
    }

    pub(crate) fn push_soft(&mut self, a: Vector2<f64>, b: f64) {
        self.rows.push(Row { a: Vector3::new(a.x, a.y, 0.0), b });
    }

    /// `H x` at the coordinates of state `i`.
    pub(crate) fn curvature_times(&self, x: &[Vector5<f64>], i: usize) -> Vector5<f64> {
        let mut slope = self.hessian.diagonal[i] * x[i];
        if i > 0 {
            slope += self.hessian.lower[i - 1] * x[i - 1];
        }
        if i + 1 < x.len() {
            slope += self.hessian.lower[i].tr_mul(&x[i + 1]);
        }
        slope
    }

    /// Position and mapped coordinate of a state.
    pub(crate) fn views(&self, i: usize, x: &Vector5<f64>) -> (Vector3<f64>, Vector2<f64>) {
        (Vector3::new(x[0], x[1], x[2]), self.soft_map[i] * x)
    }
}
