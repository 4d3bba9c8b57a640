//! Sparse symmetric positive definite systems: one symbolic analysis, any number of numeric factorisations and solves.

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};

use crate::error::Error;

/// Lower triangle of a sparse symmetric matrix in column-compressed form, and its Cholesky factor.
pub(crate) struct Spd {
    columns: Vec<u32>,
    rows: Vec<u32>,
    /// One value per stored entry; filled by the caller between factorisations.
    pub(crate) values: Vec<f64>,
    symbolic: SymbolicCholesky<u32>,
    factor: Vec<f64>,
    workspace: MemBuffer,
}

impl Spd {
    /// Analyses the pattern given by the pairs (row, column) below the diagonal; the diagonal is always stored.
    pub(crate) fn new(size: usize, below: &[(u32, u32)], threshold: SupernodalThreshold) -> Result<Self, Error> {
        let mut columns = vec![0u32; size + 1];
        for &(_, column) in below {
            columns[column as usize + 1] += 1;
        }
        for j in 0..size {
            columns[j + 1] += columns[j] + 1;
        }
        let mut rows = vec![0u32; below.len() + size];
        let mut cursor: Vec<u32> = columns[..size].to_vec();
        for j in 0..size {
            rows[cursor[j] as usize] = j as u32;
            cursor[j] += 1;
        }
        for &(row, column) in below {
            rows[cursor[column as usize] as usize] = row;
            cursor[column as usize] += 1;
        }
        for j in 0..size {
            let column = &mut rows[columns[j] as usize..columns[j + 1] as usize];
            column.sort_unstable();
            // Two edges between the same two vertices: no triangle can lie between them in a plane.
            if column.windows(2).any(|pair| pair[0] == pair[1]) {
                return Err(Error::Singular);
            }
        }
        let pattern = SymbolicSparseColMatRef::new_checked(size, size, &columns, None, &rows);
        let params = CholeskySymbolicParams { supernodal_flop_ratio_threshold: threshold, ..Default::default() };
        let symbolic = factorize_symbolic_cholesky(pattern, Side::Lower, SymmetricOrdering::Amd, params)
            .map_err(|_| Error::TooLarge { count: size, limit: size / 2 })?;
        let scratch = StackReq::any_of(&[
            symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, faer::Spec::default()),
            symbolic.solve_in_place_scratch::<f64>(2, Par::Seq),
        ]);
        let workspace = MemBuffer::new(scratch);
        let factor = vec![0.0; symbolic.len_val()];
        Ok(Self { values: vec![0.0; rows.len()], columns, rows, symbolic, factor, workspace })
    }

    /// Position in [`Self::values`] of an entry of the lower triangle that the pattern holds.
    pub(crate) fn entry(&self, i: u32, j: u32) -> usize {
        let (row, column) = (i.max(j), i.min(j) as usize);
        let (from, to) = (self.columns[column] as usize, self.columns[column + 1] as usize);
        from + self.rows[from..to].partition_point(|&r| r < row)
    }

    /// Position of a diagonal entry: the first of its column.
    pub(crate) fn diagonal(&self, i: u32) -> usize {
        self.columns[i as usize] as usize
    }

    /// Cholesky factor of the current values.
    pub(crate) fn factorize(&mut self) -> Result<(), Error> {
        let size = self.columns.len() - 1;
        let pattern = SymbolicSparseColMatRef::new_checked(size, size, &self.columns, None, &self.rows);
        let matrix = SparseColMatRef::new(pattern, &self.values);
        self.symbolic
            .factorize_numeric_llt(
                &mut self.factor,
                matrix,
                Side::Lower,
                LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut self.workspace),
                faer::Spec::default(),
            )
            .map(|_| ())
            .map_err(|_| Error::Singular)
    }

    /// Solves in place for `right.len() / size` right-hand sides, one after the other in memory.
    pub(crate) fn solve(&mut self, right: &mut [f64]) {
        let size = self.columns.len() - 1;
        let right_sides = right.len() / size;
        let matrix = MatMut::from_column_major_slice_mut(right, size, right_sides);
        LltRef::<u32, f64>::new(&self.symbolic, &self.factor).solve_in_place_with_conj(
            Conj::No,
            matrix,
            Par::Seq,
            MemStack::new(&mut self.workspace),
        );
    }
}
