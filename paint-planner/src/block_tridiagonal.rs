//! Cholesky factorisation of symmetric positive definite block-tridiagonal systems, O(number of blocks).

use nalgebra::SMatrix;

/// `M` with square blocks of `N`: `diagonal[i]` = M(i,i), `lower[i]` = M(i+1,i). Factorised in place.
#[derive(Debug, Clone, Default)]
pub(crate) struct BlockTridiagonal<const N: usize> {
    /// Diagonal blocks; after [`factor`](Self::factor) their Cholesky factors with inverted diagonals.
    pub(crate) diagonal: Vec<SMatrix<f64, N, N>>,
    /// Blocks below the diagonal; after [`factor`](Self::factor) `M(i+1,i) L_i^-T`.
    pub(crate) lower: Vec<SMatrix<f64, N, N>>,
}

impl<const N: usize> BlockTridiagonal<N> {
    /// Factorises; false when the matrix is not positive definite.
    pub(crate) fn factor(&mut self) -> bool {
        (0..self.diagonal.len()).all(|i| self.factor_block(i))
    }

    /// Solves `M x = b` in place for `K` right-hand sides; call after [`factor`](Self::factor).
    pub(crate) fn solve<const K: usize>(&self, b: &mut [SMatrix<f64, N, K>]) {
        (0..b.len()).for_each(|i| self.forward_block(i, b));
        (0..b.len()).rev().for_each(|i| self.backward_block(i, b));
    }

    /// Factorises block `i`; those before must be factorised.
    #[inline]
    pub(crate) fn factor_block(&mut self, i: usize) -> bool {
        if i > 0 {
            let below = &self.lower[i - 1];
            let diagonal = &mut self.diagonal[i];
            // Only the lower triangle is read.
            for c in 0..N {
                for k in 0..N {
                    let factor = below[(c, k)];
                    for r in c..N {
                        diagonal[(r, c)] -= below[(r, k)] * factor;
                    }
                }
            }
        }
        if !cholesky(&mut self.diagonal[i]) {
            return false;
        }
        if let Some(below) = self.lower.get_mut(i) {
            over_transposed(&self.diagonal[i], below);
        }
        true
    }

    /// Block `i` of the forward substitution; block `i` must be factorised, the blocks of `b` before substituted.
    #[inline]
    pub(crate) fn forward_block<const K: usize>(&self, i: usize, b: &mut [SMatrix<f64, N, K>]) {
        if i > 0 {
            let carried = self.lower[i - 1] * b[i - 1];
            b[i] -= carried;
        }
        forward(&self.diagonal[i], &mut b[i]);
    }

    /// Block `i` of the backward substitution, which goes from the last to the first.
    #[inline]
    pub(crate) fn backward_block<const K: usize>(&self, i: usize, b: &mut [SMatrix<f64, N, K>]) {
        if i + 1 < b.len() {
            let carried = self.lower[i].tr_mul(&b[i + 1]);
            b[i] -= carried;
        }
        backward(&self.diagonal[i], &mut b[i]);
    }
}

/// Lower Cholesky factor in place, its diagonal inverted so that the substitutions multiply.
#[inline]
fn cholesky<const N: usize>(m: &mut SMatrix<f64, N, N>) -> bool {
    for j in 0..N {
        let mut pivot = m[(j, j)];
        for k in 0..j {
            pivot -= m[(j, k)] * m[(j, k)];
        }
        // Also false for NaN.
        if !(pivot > 0.0 && pivot.is_finite()) {
            return false;
        }
        let inverse = 1.0 / pivot.sqrt();
        m[(j, j)] = inverse;
        for i in j + 1..N {
            let mut value = m[(i, j)];
            for k in 0..j {
                value -= m[(i, k)] * m[(j, k)];
            }
            m[(i, j)] = value * inverse;
        }
    }
    true
}

/// `B L^-T` in place, column by column.
#[inline]
fn over_transposed<const N: usize>(l: &SMatrix<f64, N, N>, b: &mut SMatrix<f64, N, N>) {
    for c in 0..N {
        for k in 0..c {
            let factor = l[(c, k)];
            for r in 0..N {
                b[(r, c)] -= b[(r, k)] * factor;
            }
        }
        for r in 0..N {
            b[(r, c)] *= l[(c, c)];
        }
    }
}

#[inline]
fn forward<const N: usize, const K: usize>(l: &SMatrix<f64, N, N>, b: &mut SMatrix<f64, N, K>) {
    for column in 0..K {
        for i in 0..N {
            let mut value = b[(i, column)];
            for k in 0..i {
                value -= l[(i, k)] * b[(k, column)];
            }
            b[(i, column)] = value * l[(i, i)];
        }
    }
}

#[inline]
fn backward<const N: usize, const K: usize>(l: &SMatrix<f64, N, N>, b: &mut SMatrix<f64, N, K>) {
    for column in 0..K {
        for i in (0..N).rev() {
            let mut value = b[(i, column)];
            for k in i + 1..N {
                value -= l[(k, i)] * b[(k, column)];
            }
            b[(i, column)] = value * l[(i, i)];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, Matrix3, SMatrix, Vector3};

    #[test]
    fn agrees_with_a_dense_solve_and_refuses_indefinite() {
        let count = 6;
        let mut dense = DMatrix::<f64>::zeros(3 * count, 3 * count);
        let mut blocks = BlockTridiagonal::<3>::default();
        for i in 0..count {
            let base = Matrix3::from_fn(|r, c| ((i * 9 + r * 3 + c) as f64 * 0.7).sin());
            let diagonal = base * base.transpose() + Matrix3::identity() * 4.0;
            dense.view_mut((3 * i, 3 * i), (3, 3)).copy_from(&diagonal);
            blocks.diagonal.push(diagonal);
            if i + 1 < count {
                let lower = Matrix3::from_fn(|r, c| ((i * 5 + r * 2 + c) as f64).cos());
                dense.view_mut((3 * i + 3, 3 * i), (3, 3)).copy_from(&lower);
                dense.view_mut((3 * i, 3 * i + 3), (3, 3)).copy_from(&lower.transpose());
                blocks.lower.push(lower);
            }
        }
        let mut rhs: Vec<Vector3<f64>> =
            (0..count).map(|i| Vector3::from_fn(|r, _| (i as f64 - r as f64).exp().sin())).collect();
        let expected = dense
            .lu()
            .solve(&nalgebra::DVector::from_iterator(18, rhs.iter().flat_map(|v| v.iter().copied())))
            .unwrap();
        assert!(blocks.factor());
        blocks.solve(&mut rhs);
        for (i, v) in rhs.iter().enumerate() {
            for r in 0..3 {
                assert!((v[r] - expected[3 * i + r]).abs() < 1e-12);
            }
        }
        let mut bad = BlockTridiagonal::<2> { diagonal: vec![SMatrix::from([[1.0, 2.0], [2.0, 1.0]])], lower: vec![] };
        assert!(!bad.factor());
    }
}
