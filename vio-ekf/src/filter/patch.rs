use nalgebra::{Matrix2, Vector2};

use super::pyramid::{Level, Pyramid};

/// Pixels along a side of a patch, as in ROVIO.
const SIDE: usize = 6;
const AREA: usize = SIDE * SIDE;
/// With a border for central differences.
const WIDE: usize = SIDE + 2;
/// Pyramid levels of a patch, as in ROVIO.
pub(crate) const LEVELS: usize = 2;

/// What a landmark looked like when it was first seen.
///
/// Gain and offset of the brightness are free in each comparison. They are eliminated once and for all: the gradients are
/// projected onto the complement of the constant image and of the patch itself, which gives the same shift as a least
/// squares with these two columns added. A level is then compared with four sums over its pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Patch {
    levels: [PatchLevel; LEVELS],
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct PatchLevel {
    /// Grey values less their mean.
    values: [f32; AREA],
    /// Gradients per pixel of the **full** image, projected.
    gradients: [[f32; AREA]; 2],
    /// Sum of squared values.
    energy: f32,
    /// Sums of products of the gradients: `AᵀA`.
    information: Matrix2<f64>,
}

/// A patch compared with a place in an image: the normal equations of the shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Comparison {
    /// `AᵀA` over the levels compared.
    pub(crate) information: Matrix2<f64>,
    /// `Aᵀb`: the shift of the patch from where it was looked for, in its own pixels, is `information⁻¹ · moment`.
    pub(crate) moment: Vector2<f64>,
    /// Sum of squares of what gain, offset and shift leave unexplained, grey values of the patch.
    pub(crate) unexplained: f64,
    /// Of what gain and offset leave unexplained at the place itself.
    pub(crate) mismatch: f64,
    /// Sum of squares of the patch itself.
    pub(crate) energy: f64,
    /// Degrees of freedom of the unexplained rest.
    pub(crate) freedom: f64,
}

impl Patch {
    /// Taken around a pixel; `None` at the border, and where nothing is to be seen.
    pub(crate) fn take(pyramid: &Pyramid, pixel: &Vector2<f64>) -> Option<Self> {
        let level = |k: usize| PatchLevel::take(&pyramid.used()[k], pixel);
        Some(Self { levels: [level(0)?, level(1)?] })
    }

    /// Smallest eigenvalue of the information about the shift (Shi and Tomasi 1994), per pixel of the patch, after gain
    /// and offset are accounted for.
    pub(crate) fn score(&self) -> f64 {
        let sum = self.levels[0].information + self.levels[1].information;
        let (half, difference) = (0.5 * sum.trace(), 0.5 * (sum[(0, 0)] - sum[(1, 1)]));
        (half - difference.hypot(sum[(0, 1)])) / (LEVELS * AREA) as f64
    }

    /// Compares all levels with the image at `pixel`; `warp` is image pixels by pixels of the patch. `None` if a part
    /// of the patch falls outside the image or what is there has nothing in common with it.
    pub(crate) fn compare(&self, pyramid: &Pyramid, pixel: &Vector2<f64>, warp: &Matrix2<f64>) -> Option<Comparison> {
        let [fine, coarse] = [0, 1].map(|k| self.levels[k].compare(&pyramid.used()[k], pixel, warp));
        let (fine, coarse) = (fine?, coarse?);
        Some(Comparison {
            information: fine.information + coarse.information,
            moment: fine.moment + coarse.moment,
            unexplained: fine.unexplained + coarse.unexplained,
            mismatch: fine.mismatch + coarse.mismatch,
            energy: fine.energy + coarse.energy,
            freedom: fine.freedom + coarse.freedom,
        })
    }

    /// Compares the coarsest level only.
    pub(crate) fn compare_coarse(
        &self,
        pyramid: &Pyramid,
        pixel: &Vector2<f64>,
        warp: &Matrix2<f64>,
    ) -> Option<Comparison> {
        let last = LEVELS - 1;
        self.levels[last].compare(&pyramid.used()[last], pixel, warp)
    }

    /// Whether all of the patch lies inside the image.
    pub(crate) fn fits(pyramid: &Pyramid, pixel: &Vector2<f64>, warp: &Matrix2<f64>) -> bool {
        pyramid.used().iter().all(|level| level.holds(&level.position(pixel), &reach(warp)))
    }
}

/// How far the outermost pixel centres are from the middle of the patch.
fn reach(warp: &Matrix2<f64>) -> Vector2<f64> {
    let half = 0.5 * (SIDE - 1) as f64;
    Vector2::new(warp[(0, 0)].abs() + warp[(0, 1)].abs(), warp[(1, 0)].abs() + warp[(1, 1)].abs()) * half
}

impl PatchLevel {
    fn take(level: &Level, pixel: &Vector2<f64>) -> Option<Self> {
        let middle = level.position(pixel);
        let half = 0.5 * (WIDE - 1) as f64;
        if !level.holds(&middle, &Vector2::repeat(half)) {
            return None;
        }
        let corner = (middle - Vector2::repeat(half)).map(|x| x as f32);
        let wide: [[f32; WIDE]; WIDE] = std::array::from_fn(|row| {
            std::array::from_fn(|column| level.interpolate(corner.x + column as f32, corner.y + row as f32))
        });
        let (mut values, mut gradients) = ([0.0; AREA], [[0.0; AREA]; 2]);
        let half_scale = 0.5 * level.scale as f32;
        for row in 0..SIDE {
            for column in 0..SIDE {
                let k = row * SIDE + column;
                values[k] = wide[row + 1][column + 1];
                gradients[0][k] = (wide[row + 1][column + 2] - wide[row + 1][column]) * half_scale;
                gradients[1][k] = (wide[row + 2][column + 1] - wide[row][column + 1]) * half_scale;
            }
        }
        let mean = values.iter().sum::<f32>() / AREA as f32;
        for value in &mut values {
            *value -= mean;
        }
        let energy = dot(&values, &values);
        // Less than a third of a grey level of contrast is noise.
        if energy < 0.1 * AREA as f32 {
            return None;
        }
        for gradient in &mut gradients {
            let mean = gradient.iter().sum::<f32>() / AREA as f32;
            let along = dot(gradient, &values) / energy;
            gradient.iter_mut().zip(&values).for_each(|(g, v)| *g -= mean + along * v);
        }
        let product = |a: usize, b: usize| f64::from(dot(&gradients[a], &gradients[b]));
        let information = Matrix2::new(product(0, 0), product(0, 1), product(0, 1), product(1, 1));
        Some(Self { values, gradients, energy, information })
    }

    fn compare(&self, level: &Level, pixel: &Vector2<f64>, warp: &Matrix2<f64>) -> Option<Comparison> {
        let middle = level.position(pixel);
        if !level.holds(&middle, &reach(warp)) {
            return None;
        }
        let half = 0.5 * (SIDE - 1) as f64;
        let corner = (middle - warp * Vector2::repeat(half)).map(|x| x as f32);
        let warp = warp.map(|x| x as f32);
        let mut samples = [0.0; AREA];
        for row in 0..SIDE {
            let start = corner + warp.column(1) * row as f32;
            for column in 0..SIDE {
                let at = start + warp.column(0) * column as f32;
                samples[row * SIDE + column] = level.interpolate(at.x, at.y);
            }
        }
        let mean = samples.iter().sum::<f32>() / AREA as f32;
        for sample in &mut samples {
            *sample -= mean;
        }
        let gain = f64::from(dot(&self.values, &samples) / self.energy);
        // Contrast that is inverted, or all but gone, is another object or no light.
        if gain.is_nan() || gain < 0.05 {
            return None;
        }
        let energy = f64::from(self.energy);
        let mismatch = (f64::from(dot(&samples, &samples)) / (gain * gain) - energy).max(0.0);
        // What is seen at the place is the patch moved the other way: hence the sign.
        let moment =
            Vector2::new(f64::from(dot(&self.gradients[0], &samples)), f64::from(dot(&self.gradients[1], &samples)))
                / -gain;
        let explained = self.information.try_inverse().map_or(0.0, |inverse| moment.dot(&(inverse * moment)));
        let unexplained = (mismatch - explained).max(0.0);
        let freedom = (AREA - 4) as f64;
        let information = self.information;
        Some(Comparison { information, moment, unexplained, mismatch, energy, freedom })
    }
}

fn dot(a: &[f32; AREA], b: &[f32; AREA]) -> f32 {
    // Four partial sums: a single one would be a chain of additions.
    let mut sums = [0.0; 4];
    for (a, b) in a.chunks_exact(4).zip(b.chunks_exact(4)) {
        for k in 0..4 {
            sums[k] += a[k] * b[k];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}
