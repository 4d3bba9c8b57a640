//! A single-channel image.

use crate::error::Error;

/// A single-channel picture: row by row from the top, `data[y * width + x]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    width: usize,
    height: usize,
    data: Vec<f64>,
}

impl Image {
    /// From its values; every value must be finite and the count must be `width * height > 0`.
    pub fn new(width: usize, height: usize, data: Vec<f64>) -> Result<Self, Error> {
        if width == 0 || height == 0 || width.checked_mul(height) != Some(data.len()) {
            return Err(Error::ImageSize { what: "picture", width, height, values: data.len() });
        }
        let image = Self { width, height, data };
        image.check_range("picture", f64::MIN, f64::MAX, "a finite number")?;
        Ok(image)
    }

    /// A picture of one value. Sizes of zero are raised to one.
    pub fn filled(width: usize, height: usize, value: f64) -> Self {
        Self::from_fn(width, height, |_, _| value)
    }

    /// A picture from a function of column and row. Sizes of zero are raised to one.
    pub fn from_fn(width: usize, height: usize, mut value: impl FnMut(usize, usize) -> f64) -> Self {
        let (width, height) = (width.max(1), height.max(1));
        let data = (0..width * height).map(|k| value(k % width, k / width)).collect();
        Self { width, height, data }
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All values, row by row.
    pub fn data(&self) -> &[f64] {
        &self.data
    }

    /// All values, to be changed.
    pub fn data_mut(&mut self) -> &mut [f64] {
        &mut self.data
    }

    /// One value; panics outside, as a slice does.
    pub fn at(&self, x: usize, y: usize) -> f64 {
        self.data[y * self.width + x]
    }

    /// The same size with every value mapped.
    #[must_use]
    pub fn map(&self, f: impl Fn(f64) -> f64) -> Self {
        Self { width: self.width, height: self.height, data: self.data.iter().map(|&v| f(v)).collect() }
    }

    pub(crate) fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Refuses the first value that is NaN or outside `[low, high]`.
    pub(crate) fn check_range(
        &self,
        what: &'static str,
        low: f64,
        high: f64,
        range: &'static str,
    ) -> Result<(), Error> {
        match self.data.iter().position(|v| !(low..=high).contains(v)) {
            None => Ok(()),
            Some(k) => Err(Error::Pixel { what, x: k % self.width, y: k / self.width, value: self.data[k], range }),
        }
    }
}
