//! From a colour to a reflectance that has it: what a wall is known by is mostly a photograph.

use super::spectrum::{BANDS, Spectrum, wavelength};
use super::spectrum_linear_srgb;

/// Components nearer to 0 or 1 than this count as this far: no smooth reflectance has them.
const NEAREST: f64 = 0.004;
const ITERATIONS: usize = 60;
/// Error of the linear components at which the search ends.
const EXACT: f64 = 1e-7;

/// A smooth reflectance whose colour under D65 is this one, linear sRGB: the sigmoid of a parabola over wavelength, `1/2 + p / (2 sqrt(1 + p²))`
/// (Jakob and Hanika 2019), its three coefficients by damped Gauss-Newton. The most saturated colours are met as nearly as such a
/// reflectance can.
pub fn spectrum_of_linear_srgb(linear: [f64; 3]) -> Spectrum {
    let wanted = linear.map(|c| if c.is_nan() { 0.5 } else { c.clamp(NEAREST, 1.0 - NEAREST) });
    let mean = 0.2126 * wanted[0] + 0.7152 * wanted[1] + 0.0722 * wanted[2];
    let mut coefficients = [(mean - 0.5) / (mean * (1.0 - mean)).sqrt(), 0.0, 0.0];
    let mut residual = difference(&reflectance(coefficients), wanted);
    let mut damping = 1e-3;
    for _ in 0..ITERATIONS {
        if norm(residual) < EXACT {
            break;
        }
        let columns: [[f64; 3]; 3] = std::array::from_fn(|k| spectrum_linear_srgb(&slope(coefficients, k)));
        let step = damped_step(&columns, residual, damping);
        let trial = std::array::from_fn(|k| coefficients[k] - step[k]);
        let trial_residual = difference(&reflectance(trial), wanted);
        if norm(trial_residual) < norm(residual) {
            (coefficients, residual, damping) = (trial, trial_residual, 0.2 * damping);
        } else {
            damping *= 8.0;
        }
    }
    reflectance(coefficients)
}

/// Powers of the wavelength, from -1 at one end of the bands to 1 at the other.
fn power(band: usize, k: usize) -> f64 {
    ((wavelength(band) - 555.0) / 175.0).powi(k as i32)
}

fn parabola(coefficients: [f64; 3], band: usize) -> f64 {
    (0..3).map(|k| coefficients[k] * power(band, k)).sum()
}

fn reflectance(coefficients: [f64; 3]) -> Spectrum {
    std::array::from_fn(|band| {
        let p = parabola(coefficients, band);
        0.5 + 0.5 * p / (1.0 + p * p).sqrt()
    })
}

/// Of the reflectance, by one coefficient.
fn slope(coefficients: [f64; 3], k: usize) -> [f64; BANDS] {
    std::array::from_fn(|band| 0.5 * power(band, k) * (1.0 + parabola(coefficients, band).powi(2)).powf(-1.5))
}

fn difference(spectrum: &Spectrum, wanted: [f64; 3]) -> [f64; 3] {
    let colour = spectrum_linear_srgb(spectrum);
    std::array::from_fn(|c| colour[c] - wanted[c])
}

fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Levenberg's and Marquardt's step for the columns of a Jacobian.
fn damped_step(columns: &[[f64; 3]; 3], residual: [f64; 3], damping: f64) -> [f64; 3] {
    let columns = nalgebra::Matrix3::from_columns(&columns.map(nalgebra::Vector3::from));
    let mut normal = columns.transpose() * columns;
    for k in 0..3 {
        normal[(k, k)] *= 1.0 + damping;
        normal[(k, k)] += 1e-12;
    }
    let slope = columns.transpose() * nalgebra::Vector3::from(residual);
    normal.lu().solve(&slope).map_or([0.0; 3], Into::into)
}
