//! What the layers did in every step.

use std::ops::Range;

/// What one layer did in every step: for each step a row of `width` numbers per sample.
#[derive(Debug, Clone)]
pub(crate) struct Activations<T> {
    step: usize,
    data: Vec<T>,
}

impl<T: Copy + Default> Activations<T> {
    pub(crate) fn new(steps: usize, batch: usize, width: usize) -> Self {
        Self { step: batch * width, data: vec![T::default(); steps * batch * width] }
    }

    fn range(&self, t: usize) -> Range<usize> {
        t * self.step..(t + 1) * self.step
    }

    pub(crate) fn at(&self, t: usize) -> &[T] {
        &self.data[self.range(t)]
    }

    pub(crate) fn at_mut(&mut self, t: usize) -> &mut [T] {
        let range = self.range(t);
        &mut self.data[range]
    }

    /// Step `t`, and the one after it to be written.
    pub(crate) fn pair(&mut self, t: usize) -> (&[T], &mut [T]) {
        let (past, next) = self.data.split_at_mut((t + 1) * self.step);
        (&past[t * self.step..], &mut next[..self.step])
    }

    #[cfg(any(test, feature = "train"))]
    /// Steps one after another.
    pub(crate) fn steps(&self, range: Range<usize>) -> &[T] {
        &self.data[range.start * self.step..range.end * self.step]
    }
}
