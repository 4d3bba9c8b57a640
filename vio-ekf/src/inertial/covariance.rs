//! A dense covariance that grows and shrinks without claiming memory, and the Kalman update of it.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// A measurement linearised at the estimate, `y = H δ + n`: `M` residuals that depend on `C` rows of the error state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LinearizedMeasurement<const M: usize, const C: usize> {
    /// The rows that the residual depends on.
    pub(crate) rows: [usize; C],
    /// `y`, the innovation: measured minus predicted.
    pub(crate) residual: SVector<f64, M>,
    /// Derivative of the prediction by those rows.
    pub(crate) jacobian: SMatrix<f64, M, C>,
    /// Covariance of the measurement's noise.
    pub(crate) noise: SMatrix<f64, M, M>,
}

/// Rows `u` of updates that may wait: enough that a pass over the covariance is arithmetic, not memory.
const MAX_WAITING: usize = 16;
/// Rows that one pass takes together.
const TOGETHER: usize = 4;

/// The covariance of the error state: dense, symmetric, without gaps, in memory that is claimed once.
///
/// A series of updates ([`update_in_series`](Self::update_in_series)) leaves `P − Σ uᵀu` undone for some `u` and works on the lower triangle
/// alone; [`variance`](Self::variance), [`block`](Self::block) and [`marginal`](Self::marginal) know of it. Everything else
/// comes after [`end_updates`](Self::end_updates).
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Covariance {
    size: usize,
    stride: usize,
    values: Vec<f64>,
    /// Rows `u`, one after the other.
    waiting: Vec<f64>,
    waiting_count: usize,
    /// One row of it, whole.
    gathered: Vec<f64>,
}

impl Covariance {
    /// Zero, of `size` rows, with room for `capacity`.
    pub(crate) fn new(size: usize, capacity: usize) -> Self {
        let values = vec![0.0; capacity * capacity];
        let (waiting, gathered) = (vec![0.0; MAX_WAITING * capacity], vec![0.0; capacity]);
        Self { size, stride: capacity, values, waiting, waiting_count: 0, gathered }
    }

    /// Becomes equal to another of the same capacity, without claiming memory.
    pub(crate) fn assign(&mut self, other: &Self) {
        self.size = other.size;
        self.values.copy_from_slice(&other.values);
    }

    pub(crate) fn size(&self) -> usize {
        self.size
    }

    pub(crate) fn row(&self, row: usize) -> &[f64] {
        &self.values[row * self.stride..][..self.size]
    }

    pub(crate) fn row_mut(&mut self, row: usize) -> &mut [f64] {
        &mut self.values[row * self.stride..][..self.size]
    }

    /// Sets a variance, and the covariances of its row to zero.
    pub(crate) fn reset_row(&mut self, row: usize, variance: f64) {
        for other in 0..self.size {
            self.values[row * self.stride + other] = 0.0;
            self.values[other * self.stride + row] = 0.0;
        }
        self.values[row * self.stride + row] = variance;
    }

    pub(crate) fn variance(&self, row: usize) -> f64 {
        self.at(row, row)
    }

    /// An entry, with the updates that wait.
    fn at(&self, row: usize, column: usize) -> f64 {
        let mut value = self.values[row.max(column) * self.stride + row.min(column)];
        for u in self.waiting.chunks_exact(self.stride).take(self.waiting_count) {
            value -= u[row] * u[column];
        }
        value
    }

    pub(crate) fn inflate(&mut self, row: usize, variance: f64) {
        self.values[row * self.stride + row] += variance;
    }

    /// Sets the covariance of two rows.
    pub(crate) fn set_covariance(&mut self, row: usize, other: usize, value: f64) {
        self.values[row * self.stride + other] = value;
        self.values[other * self.stride + row] = value;
    }

    /// Rows that there is room for.
    pub(crate) fn capacity(&self) -> usize {
        self.stride
    }

    /// Multiplies an error by a factor.
    pub(crate) fn scale(&mut self, row: usize, factor: f64) {
        for other in 0..self.size {
            self.values[row * self.stride + other] *= factor;
            self.values[other * self.stride + row] *= factor;
        }
    }

    /// Adds a multiple of another error to a row's error.
    pub(crate) fn add_row(&mut self, row: usize, weight: f64, other: usize) {
        for column in 0..self.size {
            self.values[row * self.stride + column] += weight * self.values[other * self.stride + column];
        }
        for column in 0..self.size {
            self.values[column * self.stride + row] += weight * self.values[column * self.stride + other];
        }
    }

    /// Any block, from given first rows.
    pub(crate) fn block<const R: usize, const C: usize>(&self, row: usize, column: usize) -> SMatrix<f64, R, C> {
        SMatrix::from_fn(|r, c| self.at(row + r, column + c))
    }

    /// Sets a block on the diagonal.
    pub(crate) fn set_block3(&mut self, row: usize, block: &Matrix3<f64>) {
        for r in 0..3 {
            for c in 0..3 {
                self.values[(row + r) * self.stride + row + c] = block[(r, c)];
            }
        }
    }

    /// Sets a block on the diagonal to independent errors of given deviations.
    pub(crate) fn set_diagonal3(&mut self, row: usize, sigma: [f64; 3]) {
        self.set_block3(row, &Matrix3::from_diagonal(&Vector3::from(sigma.map(|s| s * s))));
    }

    /// Copies the lower triangle onto the upper one, tile by tile: each stays in the cache.
    pub(crate) fn mirror(&mut self) {
        const TILE: usize = 16;
        for first in (0..self.size).step_by(TILE) {
            for left in (0..=first).step_by(TILE) {
                for row in first..(first + TILE).min(self.size) {
                    for column in left..(left + TILE).min(row) {
                        self.values[column * self.stride + row] = self.values[row * self.stride + column];
                    }
                }
            }
        }
    }

    /// Appends `count` rows of zeros.
    pub(crate) fn grow(&mut self, count: usize) {
        let old = self.size;
        self.size += count;
        for row in 0..self.size {
            let from = if row < old { old } else { 0 };
            self.row_mut(row)[from..].fill(0.0);
        }
    }

    /// Drops `count` rows and columns at `at`; the last `count` rows take their place. Dropping is marginalising.
    pub(crate) fn swap_remove(&mut self, at: usize, count: usize) {
        let last = self.size - count;
        if at != last {
            self.values.copy_within(last * self.stride..(last + count) * self.stride, at * self.stride);
            for row in 0..self.size {
                let start = row * self.stride;
                self.values.copy_within(start + last..start + last + count, start + at);
            }
        }
        self.size = last;
    }

    /// Innovation covariance `H P Hᵀ + S`.
    pub(crate) fn innovation<const M: usize, const C: usize>(
        &self,
        m: &LinearizedMeasurement<M, C>,
    ) -> SMatrix<f64, M, M> {
        m.jacobian * self.marginal(&m.rows) * m.jacobian.transpose() + m.noise
    }

    /// The covariance of a few rows marginal themselves.
    pub(crate) fn marginal<const C: usize>(&self, rows: &[usize; C]) -> SMatrix<f64, C, C> {
        SMatrix::from_fn(|r, c| self.at(rows[r], rows[c]))
    }

    /// The update: `δ = P Hᵀ (H P Hᵀ + S)⁻¹ y` into `delta`, and `P ← P − P Hᵀ (H P Hᵀ + S)⁻¹ H P`.
    ///
    /// Returns false and changes nothing if the innovation covariance is not positive definite. `M` is at most 16.
    pub(crate) fn update<const M: usize, const C: usize>(
        &mut self,
        m: &LinearizedMeasurement<M, C>,
        delta: &mut [f64],
    ) -> bool {
        let updated = self.update_in_series(m, delta);
        self.end_updates();
        updated
    }

    /// The same as one of a series.
    pub(crate) fn update_in_series<const M: usize, const C: usize>(
        &mut self,
        m: &LinearizedMeasurement<M, C>,
        delta: &mut [f64],
    ) -> bool {
        let Some(factor) = self.innovation(m).cholesky() else { return false };
        let factor = factor.l();
        let Some(whitened) = factor.solve_lower_triangular(&m.residual) else { return false };
        // With S = L Lᵀ: L⁻¹ H P, row by row. P ← P − Uᵀ U is then symmetric to the last bit.
        let Some(jacobian) = factor.solve_lower_triangular(&m.jacobian) else { return false };
        if self.waiting_count + M > MAX_WAITING {
            self.apply_waiting();
        }
        let (n, stride) = (self.size, self.stride);
        let (before, rest) = self.waiting.split_at_mut(self.waiting_count * stride);
        rest[..M * stride].fill(0.0);
        for (c, &row) in m.rows.iter().enumerate() {
            self.gathered[..=row].copy_from_slice(&self.values[row * stride..=row * stride + row]);
            for (column, value) in self.gathered[..n].iter_mut().enumerate().skip(row + 1) {
                *value = self.values[column * stride + row];
            }
            for (k, u) in rest.chunks_exact_mut(stride).take(M).enumerate() {
                subtract(&mut u[..n], -jacobian[(k, c)], &self.gathered);
            }
        }
        for waiting in before.chunks_exact(stride) {
            let seen = jacobian * SVector::<f64, C>::from_fn(|c, _| waiting[m.rows[c]]);
            for (u, weight) in rest.chunks_exact_mut(stride).zip(seen.iter()) {
                subtract(&mut u[..n], *weight, waiting);
            }
        }
        let delta = &mut delta[..n];
        delta.fill(0.0);
        for (u, residual) in rest.chunks_exact(stride).zip(whitened.iter()) {
            for (d, u) in delta.iter_mut().zip(u) {
                *d += residual * u;
            }
        }
        self.waiting_count += M;
        true
    }

    /// `P ← P − Σ uᵀu`, lower triangle.
    fn apply_waiting(&mut self) {
        let (n, stride) = (self.size, self.stride);
        for some in self.waiting[..self.waiting_count * stride].chunks(TOGETHER * stride) {
            for row in 0..n {
                let target = &mut self.values[row * stride..=row * stride + row];
                if some.len() < TOGETHER * stride {
                    some.chunks_exact(stride).for_each(|u| subtract(target, u[row], u));
                    continue;
                }
                let u: [&[f64]; TOGETHER] = std::array::from_fn(|k| &some[k * stride..=k * stride + row]);
                let weights = u.map(|u| u[row]);
                // Rows of what is not estimated are zero.
                if weights == [0.0; TOGETHER] {
                    continue;
                }
                let [a, b, c, d] = u;
                for ((((p, a), b), c), d) in target.iter_mut().zip(a).zip(b).zip(c).zip(d) {
                    *p = (((*p - weights[0] * a) - weights[1] * b) - weights[2] * c) - weights[3] * d;
                }
            }
        }
        self.waiting_count = 0;
    }

    /// Ends a series of updates.
    pub(crate) fn end_updates(&mut self) {
        if self.waiting_count > 0 {
            self.apply_waiting();
            self.mirror();
        }
    }
}

/// `target −= weight · row`.
fn subtract(target: &mut [f64], weight: f64, row: &[f64]) {
    for (target, value) in target.iter_mut().zip(row) {
        *target -= weight * value;
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

    use super::*;
    use crate::sim::Rng;
    use crate::test_random::signed;

    fn random_covariance(rng: &mut Rng, n: usize) -> DMatrix<f64> {
        let a = DMatrix::from_fn(n, n, |_, _| signed(rng));
        &a * a.transpose()
    }

    fn filled(matrix: &DMatrix<f64>) -> Covariance {
        let n = matrix.nrows();
        let mut covariance = Covariance::new(n, n);
        for row in 0..n {
            for column in 0..n {
                covariance.row_mut(row)[column] = matrix[(row, column)];
            }
        }
        covariance
    }

    fn dense(covariance: &Covariance) -> DMatrix<f64> {
        DMatrix::from_fn(covariance.size(), covariance.size(), |r, c| covariance.row(r)[c])
    }

    #[test]
    fn update_is_the_textbook_one() {
        let mut rng = Rng::new(6);
        let n = 31;
        let prior = random_covariance(&mut rng, n);
        let rows = [4, 22, 30];
        let jacobian = SMatrix::<f64, 2, 3>::from_fn(|_, _| signed(&mut rng));
        let residual = Vector2::new(0.3, -0.7);
        let noise = Matrix2::new(0.5, 0.1, 0.1, 0.4);
        let mut h = DMatrix::zeros(2, n);
        for (c, &row) in rows.iter().enumerate() {
            h.set_column(row, &jacobian.column(c));
        }
        let s = &h * &prior * h.transpose() + DMatrix::from_fn(2, 2, |r, c| noise[(r, c)]);
        let gain = &prior * h.transpose() * s.try_inverse().unwrap();
        let expected = (DMatrix::identity(n, n) - &gain * &h) * &prior;
        let correction = &gain * DVector::from_column_slice(residual.as_slice());

        let mut covariance = filled(&prior);
        let mut delta = vec![0.0; n];
        assert!(covariance.update(&LinearizedMeasurement { rows, residual, jacobian, noise }, &mut delta));
        assert!((dense(&covariance) - expected).amax() < 1e-11);
        assert!((DVector::from_vec(delta) - correction).amax() < 1e-12);
        assert_eq!(dense(&covariance), dense(&covariance).transpose());
    }

    #[test]
    fn a_series_of_updates_is_one_after_the_other() {
        let mut rng = Rng::new(9);
        let n = 40;
        let prior = random_covariance(&mut rng, n);
        let (mut series, mut single) = (filled(&prior), filled(&prior));
        let (mut delta, mut expected) = (vec![0.0; n], vec![0.0; n]);
        // More than may wait, and not a multiple of what is taken together.
        for k in 0..21 {
            let measurement = LinearizedMeasurement {
                rows: [k, (7 * k + 3) % n, 39],
                residual: Vector2::new(signed(&mut rng), signed(&mut rng)),
                jacobian: SMatrix::<f64, 2, 3>::from_fn(|_, _| signed(&mut rng)),
                noise: Matrix2::identity(),
            };
            assert!(series.update_in_series(&measurement, &mut delta));
            assert!(single.update(&measurement, &mut expected));
            let apart = delta.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(apart < 1e-11, "{k}: {apart}");
            assert!((series.variance(k) - single.variance(k)).abs() < 1e-11);
            assert!((series.marginal(&[39, 2, k]) - single.marginal(&[39, 2, k])).amax() < 1e-11);
        }
        series.end_updates();
        assert!((dense(&series) - dense(&single)).amax() < 1e-11);
        assert_eq!(dense(&series), dense(&series).transpose());
    }

    #[test]
    fn rows_leave_and_arrive_without_disturbing_the_others() {
        let mut rng = Rng::new(7);
        let prior = random_covariance(&mut rng, 12);
        let mut covariance = Covariance::new(12, 15);
        for row in 0..12 {
            for column in 0..12 {
                covariance.row_mut(row)[column] = prior[(row, column)];
            }
        }
        covariance.swap_remove(3, 3);
        // Rows 9..12 have taken the place of 3..6.
        let order = [0, 1, 2, 9, 10, 11, 6, 7, 8];
        for (row, &from) in order.iter().enumerate() {
            for (column, &other) in order.iter().enumerate() {
                assert_eq!(covariance.row(row)[column], prior[(from, other)]);
            }
        }
        covariance.grow(3);
        assert!(covariance.row(2)[9..].iter().chain(covariance.row(10)).all(|&v| v == 0.0));
        covariance.inflate(9, 2.0);
        covariance.add_row(9, 0.5, 1);
        assert!((covariance.variance(9) - (2.0 + 0.25 * prior[(1, 1)])).abs() < 1e-12);
        assert!(
            (covariance.row(9)[4] - 0.5 * prior[(1, 10)]).abs() < 1e-12 && covariance.row(9)[4] == covariance.row(4)[9]
        );
    }
}
