//! Multi-level patches and their photometric comparison with an image.

pub(crate) mod deformation;

use nalgebra::{Matrix2, Vector2};

use super::pyramid::{Level, Pyramid};

/// Pixels along a side of a patch, as in ROVIO.
const SIDE: usize = 6;
const AREA: usize = SIDE * SIDE;
/// With a border for central differences.
const SIDE_WITH_BORDER: usize = SIDE + 2;
/// Pyramid levels of a patch, as in ROVIO.
pub(crate) const LEVELS: usize = 2;

/// The multi-level template of a landmark, extracted when it was first seen.
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
    /// What the projection took from each: a constant, and a multiple of the values.
    taken: [[f32; 2]; 2],
    /// Sum of squared values.
    energy: f32,
    /// Sums of products of the gradients: `AᵀA`.
    information: Matrix2<f64>,
}

/// A patch compared with an image at some pixel: the normal equations of the shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Comparison {
    /// `AᵀA` over the levels compared.
    pub(crate) information: Matrix2<f64>,
    /// `Aᵀb`: the shift of the patch from that pixel, in its own pixels, is `information⁻¹ · gradient`.
    pub(crate) gradient: Vector2<f64>,
    /// Sum of squared residuals after gain, offset and shift, grey values of the patch.
    pub(crate) residual: f64,
    /// Sum of squared differences after gain and offset, without a shift.
    pub(crate) ssd: f64,
    /// Sum of squares of the patch itself.
    pub(crate) energy: f64,
    /// Degrees of freedom of the residual.
    pub(crate) freedom: f64,
}

impl Patch {
    /// Extracted around a pixel; `None` at the border, and where there is no contrast.
    pub(crate) fn extract(pyramid: &Pyramid, pixel: &Vector2<f64>) -> Option<Self> {
        let level = |k: usize| PatchLevel::extract(&pyramid.patch_levels()[k], pixel);
        Some(Self { levels: [level(0)?, level(1)?] })
    }

    /// Smallest eigenvalue of the information about the shift (Shi and Tomasi 1994), per pixel of the patch, after gain
    /// and offset are accounted for.
    pub(crate) fn shi_tomasi_score(&self) -> f64 {
        let sum = self.levels[0].information + self.levels[1].information;
        let (half, difference) = (0.5 * sum.trace(), 0.5 * (sum[(0, 0)] - sum[(1, 1)]));
        (half - difference.hypot(sum[(0, 1)])) / (LEVELS * AREA) as f64
    }

    /// Compares all levels with the image at `pixel`; `warp` is image pixels by pixels of the patch. `None` if a part
    /// of the patch falls outside the image or its contrast there is inverted or lost.
    pub(crate) fn compare(&self, pyramid: &Pyramid, pixel: &Vector2<f64>, warp: &Matrix2<f64>) -> Option<Comparison> {
        let [fine, coarse] = [0, 1].map(|k| self.levels[k].compare(&pyramid.patch_levels()[k], pixel, warp));
        let (fine, coarse) = (fine?, coarse?);
        Some(Comparison {
            information: fine.information + coarse.information,
            gradient: fine.gradient + coarse.gradient,
            residual: fine.residual + coarse.residual,
            ssd: fine.ssd + coarse.ssd,
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
        self.levels[last].compare(&pyramid.patch_levels()[last], pixel, warp)
    }

    /// Whether all of the patch lies inside the image.
    pub(crate) fn is_inside(pyramid: &Pyramid, pixel: &Vector2<f64>, warp: &Matrix2<f64>) -> bool {
        pyramid.patch_levels().iter().all(|level| level.contains(&level.position(pixel), &half_size(warp)))
    }
}

/// Half the size of a warped patch.
fn half_size(warp: &Matrix2<f64>) -> Vector2<f64> {
    let half = 0.5 * (SIDE - 1) as f64;
    Vector2::new(warp[(0, 0)].abs() + warp[(0, 1)].abs(), warp[(1, 0)].abs() + warp[(1, 1)].abs()) * half
}

impl PatchLevel {
    fn extract(level: &Level, pixel: &Vector2<f64>) -> Option<Self> {
        let middle = level.position(pixel);
        let half = 0.5 * (SIDE_WITH_BORDER - 1) as f64;
        if !level.contains(&middle, &Vector2::repeat(half)) {
            return None;
        }
        let corner = (middle - Vector2::repeat(half)).map(|x| x as f32);
        let bordered: [[f32; SIDE_WITH_BORDER]; SIDE_WITH_BORDER] = std::array::from_fn(|row| {
            std::array::from_fn(|column| level.interpolate(corner.x + column as f32, corner.y + row as f32))
        });
        let (mut values, mut gradients) = ([0.0; AREA], [[0.0; AREA]; 2]);
        let half_scale = 0.5 * level.scale as f32;
        for row in 0..SIDE {
            for column in 0..SIDE {
                let k = row * SIDE + column;
                values[k] = bordered[row + 1][column + 1];
                gradients[0][k] = (bordered[row + 1][column + 2] - bordered[row + 1][column]) * half_scale;
                gradients[1][k] = (bordered[row + 2][column + 1] - bordered[row][column + 1]) * half_scale;
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
        let mut taken = [[0.0; 2]; 2];
        for (gradient, taken) in gradients.iter_mut().zip(&mut taken) {
            let mean = gradient.iter().sum::<f32>() / AREA as f32;
            let along = dot(gradient, &values) / energy;
            gradient.iter_mut().zip(&values).for_each(|(g, v)| *g -= mean + along * v);
            *taken = [mean, along];
        }
        let product = |a: usize, b: usize| f64::from(dot(&gradients[a], &gradients[b]));
        let information = Matrix2::new(product(0, 0), product(0, 1), product(0, 1), product(1, 1));
        Some(Self { values, gradients, taken, energy, information })
    }

    /// What an image shows where the patch is, less its mean, and its contrast against the patch.
    fn sample(&self, level: &Level, pixel: &Vector2<f64>, warp: &Matrix2<f64>) -> Option<([f32; AREA], f64)> {
        let middle = level.position(pixel);
        if !level.contains(&middle, &half_size(warp)) {
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
        (gain >= 0.05).then_some((samples, gain))
    }

    fn compare(&self, level: &Level, pixel: &Vector2<f64>, warp: &Matrix2<f64>) -> Option<Comparison> {
        let (samples, gain) = self.sample(level, pixel, warp)?;
        let energy = f64::from(self.energy);
        let ssd = (f64::from(dot(&samples, &samples)) / (gain * gain) - energy).max(0.0);
        // What is seen at the place is the patch moved the other way: hence the sign.
        let gradient =
            Vector2::new(f64::from(dot(&self.gradients[0], &samples)), f64::from(dot(&self.gradients[1], &samples)))
                / -gain;
        let explained = self.information.try_inverse().map_or(0.0, |inverse| gradient.dot(&(inverse * gradient)));
        let residual = (ssd - explained).max(0.0);
        let freedom = (AREA - 4) as f64;
        let information = self.information;
        Some(Comparison { information, gradient, residual, ssd, energy, freedom })
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
