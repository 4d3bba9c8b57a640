//! An image of three bands.

use crate::error::Error;

/// An image of three bands, row by row from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct ColourImage {
    width: usize,
    height: usize,
    data: Vec<[f64; 3]>,
}

impl ColourImage {
    /// From its values, all of them in `[0, 1]`; as many as `width * height > 0`.
    pub fn new(width: usize, height: usize, data: Vec<[f64; 3]>) -> Result<Self, Error> {
        if width == 0 || height == 0 || width.checked_mul(height) != Some(data.len()) {
            return Err(Error::ImageSize { what: "picture", width, height, values: data.len() });
        }
        for (k, value) in data.iter().enumerate() {
            if let Some(&value) = value.iter().find(|v| !(0.0..=1.0).contains(*v)) {
                let (x, y) = (k % width, k / width);
                return Err(Error::Pixel { what: "picture", x, y, value, range: "three values in [0, 1]" });
            }
        }
        Ok(Self { width, height, data })
    }

    /// From values that are known to fill it and to lie in `[0, 1]`.
    pub(super) fn from_clamped(width: usize, height: usize, data: Vec<[f64; 3]>) -> Self {
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
    pub fn data(&self) -> &[[f64; 3]] {
        &self.data
    }
}
