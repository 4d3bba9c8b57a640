//! Sparse Cholesky of symmetric positive definite matrices of square blocks: one symbolic analysis, any number of factorisations.

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::perm::PermRef;
use faer::sparse::linalg::amd::{self, Control};
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side, Spec};

use crate::error::Error;

/// Lower triangle of a matrix of `side × side` blocks, by columns, and its factor.
pub(crate) struct BlockCholesky {
    side: usize,
    /// For each column of blocks: its rows below the diagonal, sorted.
    below: Vec<Vec<u32>>,
    columns: Vec<u32>,
    rows: Vec<u32>,
    pub(crate) values: Vec<f64>,
    symbolic: SymbolicCholesky<u32>,
    factor: Vec<f64>,
    workspace: MemBuffer,
}

impl BlockCholesky {
    /// Of `count` blocks on the diagonal and the blocks of some pairs, in any order, repeated or not.
    pub(crate) fn new(count: usize, side: usize, pairs: impl Iterator<Item = [usize; 2]>) -> Result<Self, Error> {
        let mut below = vec![Vec::new(); count];
        for [a, b] in pairs {
            below[a.min(b)].push(a.max(b) as u32);
        }
        for rows in &mut below {
            rows.sort_unstable();
            rows.dedup();
        }
        let size = count * side;
        let (mut columns, mut rows) = (vec![0_u32], Vec::new());
        for (block, others) in below.iter().enumerate() {
            for column in 0..side {
                rows.extend((column..side).map(|row| (block * side + row) as u32));
                rows.extend(others.iter().flat_map(|o| (0..side).map(move |row| o * side as u32 + row as u32)));
                columns.push(rows.len() as u32);
            }
        }
        let too_large = |_| Error::GraphTooLarge { poses: count };
        let ordering = Ordering::of_blocks(&below, side).map_err(too_large)?;
        let pattern = SymbolicSparseColMatRef::new_checked(size, size, &columns, None, &rows);
        let symbolic = factorize_symbolic_cholesky(
            pattern,
            Side::Lower,
            SymmetricOrdering::Custom(PermRef::new_checked(&ordering.forward, &ordering.inverse, size)),
            CholeskySymbolicParams::default(),
        )
        .map_err(too_large)?;
        let workspace = MemBuffer::new(StackReq::any_of(&[
            symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Spec::default()),
            symbolic.solve_in_place_scratch::<f64>(3, Par::Seq),
        ]));
        let factor = vec![0.0; symbolic.len_val()];
        Ok(Self { side, below, values: vec![0.0; rows.len()], columns, rows, symbolic, factor, workspace })
    }

    /// Where the block of a pair lies, to be added to.
    pub(crate) fn place(&self, a: usize, b: usize) -> Place {
        let (column, row) = (a.min(b), a.max(b) as u32);
        Place { column, slot: (a != b).then(|| self.below[column].partition_point(|r| *r < row)) }
    }

    /// Adds to the block of a place; `block(row, column)`, of which a block on the diagonal is asked for its lower triangle only.
    #[inline]
    pub(crate) fn add(&mut self, place: Place, block: impl Fn(usize, usize) -> f64) {
        let side = self.side;
        for column in 0..side {
            let start = self.columns[place.column * side + column] as usize;
            let (from, first) = match place.slot {
                Some(slot) => (start + side - column + slot * side, 0),
                None => (start, column),
            };
            for (value, row) in self.values[from..].iter_mut().zip(first..side) {
                *value += block(row, column);
            }
        }
    }

    /// Position in the values of every entry on the diagonal.
    pub(crate) fn diagonal(&self) -> impl Iterator<Item = usize> {
        self.columns[..self.columns.len() - 1].iter().map(|at| *at as usize)
    }

    /// Factorises the values.
    pub(crate) fn factorise(&mut self) -> Result<(), Error> {
        let size = self.columns.len() - 1;
        let pattern = SymbolicSparseColMatRef::new_checked(size, size, &self.columns, None, &self.rows);
        let stack = MemStack::new(&mut self.workspace);
        let matrix = SparseColMatRef::new(pattern, &self.values);
        let none = LltRegularization::default();
        self.symbolic
            .factorize_numeric_llt(&mut self.factor, matrix, Side::Lower, none, Par::Seq, stack, Spec::default())
            .map(|_| ())
            .map_err(|_| Error::SingularGraph)
    }

    /// Solves in place for one to three right sides, one after the other.
    pub(crate) fn solve(&mut self, right: &mut [f64]) {
        let size = self.columns.len() - 1;
        let sides = right.len() / size.max(1);
        let stack = MemStack::new(&mut self.workspace);
        let matrix = MatMut::from_column_major_slice_mut(right, size, sides);
        let factor = LltRef::<u32, f64>::new(&self.symbolic, &self.factor);
        factor.solve_in_place_with_conj(Conj::No, matrix, Par::Seq, stack);
    }
}

/// Where a block lies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    column: usize,
    /// Which of those below the diagonal; `None` on it.
    slot: Option<usize>,
}

/// Approximate minimum degree of the graph of blocks, which is `side` times smaller than that of the entries.
struct Ordering {
    forward: Vec<u32>,
    inverse: Vec<u32>,
}

impl Ordering {
    fn of_blocks(below: &[Vec<u32>], side: usize) -> Result<Self, faer::sparse::FaerError> {
        let count = below.len();
        let mut columns = vec![0_u32];
        let mut rows = Vec::new();
        for (block, others) in below.iter().enumerate() {
            rows.push(block as u32);
            rows.extend_from_slice(others);
            columns.push(rows.len() as u32);
        }
        let pattern = SymbolicSparseColMatRef::new_checked(count, count, &columns, None, &rows);
        let (mut forward, mut inverse) = (vec![0_u32; count], vec![0_u32; count]);
        let mut workspace = MemBuffer::new(amd::order_maybe_unsorted_scratch::<u32>(count, rows.len()));
        let stack = MemStack::new(&mut workspace);
        amd::order_maybe_unsorted(&mut forward, &mut inverse, pattern, Control::default(), stack)?;
        let spread = |order: &[u32]| -> Vec<u32> {
            order.iter().flat_map(|block| (0..side).map(move |k| block * side as u32 + k as u32)).collect()
        };
        Ok(Self { forward: spread(&forward), inverse: spread(&inverse) })
    }
}

/// Number of the block of every pose that is free, and how many there are.
pub(crate) fn free_blocks(fixed: &[bool]) -> (Vec<Option<usize>>, usize) {
    let mut count = 0;
    let number = |fixed: &bool| {
        count += usize::from(!fixed);
        (!fixed).then(|| count - 1)
    };
    let blocks = fixed.iter().map(number).collect();
    (blocks, count)
}
