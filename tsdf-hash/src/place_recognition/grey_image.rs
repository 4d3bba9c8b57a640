//! Images of 8 bits, as corners and descriptors read them.

use crate::tracking::image_level::ImageLevel;

/// Grey values, row-major.
pub(super) struct GreyImage {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) pixels: Vec<u8>,
}

impl GreyImage {
    /// The intensities of a frame; black where the colour camera does not look. `None` without colour.
    pub(super) fn of_intensity(level: &ImageLevel) -> Option<Self> {
        // NaN becomes 0.
        let pixels: Vec<u8> = level.intensity.iter().map(|i| i.round() as u8).collect();
        (!pixels.is_empty()).then_some(Self { width: level.width, height: level.height, pixels })
    }

    /// Every pixel once more smaller by `5 / 7`, about the square root of two: means over the pixels' areas.
    pub(super) fn reduced(&self) -> Self {
        let (width, height) = (self.width * 5 / 7, self.height * 5 / 7);
        // A new pixel covers 7 fifths of an old one: weights in fifths.
        let spans = |n: usize| -> [(usize, u32); 3] {
            let (mut from, end) = (7 * n, 7 * n + 7);
            std::array::from_fn(|k| {
                let at = 7 * n / 5 + k;
                let to = (5 * (at + 1)).min(end);
                let weight = to.saturating_sub(from) as u32;
                from = from.max(to);
                (at, weight)
            })
        };
        let columns: Vec<_> = (0..width).map(spans).collect();
        let mut pixels = Vec::with_capacity(width * height);
        for v in 0..height {
            let rows = spans(v);
            for column in &columns {
                let mut sum = 0;
                for (y, down) in rows.into_iter().filter(|(_, w)| *w > 0) {
                    for (x, across) in column.iter().filter(|(_, w)| *w > 0) {
                        sum += down * across * u32::from(self.pixels[y * self.width + x]);
                    }
                }
                pixels.push(((sum + 24) / 49) as u8);
            }
        }
        Self { width, height, pixels }
    }

    /// Means over 5 × 5 pixels; as it is within two pixels of the rim.
    pub(super) fn smoothed(&self) -> Self {
        let (w, h) = (self.width, self.height);
        let mut across = vec![0_u16; w * h];
        for v in 0..h {
            let row = &self.pixels[v * w..][..w];
            for (out, five) in across[v * w..][..w].iter_mut().skip(2).zip(row.windows(5)) {
                *out = five.iter().map(|p| u16::from(*p)).sum();
            }
        }
        let mut pixels = self.pixels.clone();
        for v in 2..h.saturating_sub(2) {
            for u in 2..w.saturating_sub(2) {
                let sum: u32 = (v - 2..=v + 2).map(|y| u32::from(across[y * w + u])).sum();
                pixels[v * w + u] = ((sum + 12) / 25) as u8;
            }
        }
        Self { width: w, height: h, pixels }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ramp stays a ramp: the mean over a pixel is the value at its middle.
    #[test]
    fn a_ramp_is_reduced_and_smoothed_to_a_ramp() {
        let (width, height) = (70, 42);
        let ramp = |x: f64, y: f64| 20.0 + 1.5 * x + 2.0 * y;
        let pixels = (0..width * height).map(|k| ramp((k % width) as f64, (k / width) as f64).round() as u8).collect();
        let image = GreyImage { width, height, pixels };
        let small = image.reduced();
        assert_eq!((small.width, small.height), (50, 30));
        for k in 0..small.pixels.len() {
            let middle = |n: usize| (n as f64 + 0.5) * 1.4 - 0.5;
            let expected = ramp(middle(k % 50), middle(k / 50));
            assert!((f64::from(small.pixels[k]) - expected).abs() <= 1.01, "{k}");
        }
        let smooth = image.smoothed();
        for k in 0..smooth.pixels.len() {
            assert!(smooth.pixels[k].abs_diff(image.pixels[k]) <= 1, "{k}");
        }
    }
}
