//! What the residuals say against the model, and what would explain them.

use nalgebra::{SVector, Vector3};

use super::curve::{CHANNELS, Reading};
use super::jet::{Jet, Local};
use super::parameters::{COUNT, CalibrationSettings, Parameter, Vector};
use super::scene::{Pixel, Shown, View};
use crate::least_squares::Normal;

/// Deviations from which an explanation is told.
const TELLING: f64 = 5.0;
/// Residuals of less than this share of the noise's variance may be alike: rounding is.
const QUIET: f64 = 0.1;
/// Explanations that concern all bursts.
const COMMON: usize = 5;
/// The columns of an extended Jacobian.
const COLUMNS: usize = COUNT + COMMON;
/// Column of the flow, which is one in logarithms.
const FLOW: usize = 1;
const DISTANCE: usize = COUNT + 1;

/// What is wrong with a model or with its data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Explanation {
    /// Pixels are larger on the card than was told; size: share.
    PictureScale,
    /// All nozzles stood farther away along their axes; size: m.
    Distance,
    /// The jet is no Gaussian: more paint in its middle and far out, less between (second Laguerre polynomial); size: share of the middle.
    Profile,
    /// The same along the ellipse's first side alone (fourth Hermite polynomial); negative where the jet has two peaks.
    DoublePeak,
    /// The delay, which is held, is longer; size: s.
    Delay,
    /// One burst left more paint than its duration says; size: share.
    BurstDose(usize),
    /// The nozzle of one burst stood farther away along its axis; size: m.
    BurstDistance(usize),
}

/// An explanation that the residuals ask for.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Doubt {
    /// What would explain them.
    pub explanation: Explanation,
    /// By how much, to first order and with nothing else wrong, in the unit of the explanation.
    pub size: f64,
    /// Its standard deviation.
    pub deviation: f64,
}

impl Doubt {
    /// Size over deviation.
    pub fn weight(&self) -> f64 {
        self.size / self.deviation
    }
}

/// Residuals at the minimum.
pub(super) struct Residuals {
    /// Explanations by falling weight (score tests, Rao 1948).
    pub(super) doubts: Vec<Doubt>,
    /// Sum of the products of neighbouring residuals, in its standard deviations.
    pub(super) correlation: f64,
}

/// Sums over the readings of one burst: Jacobian with itself, and with the residuals.
struct Sums {
    information: [[f64; COLUMNS]; COLUMNS],
    slope: [f64; COLUMNS],
}

/// `ratio` is chi-square over its degrees of freedom.
pub(super) fn residuals(
    (views, bursts): (&[View], &[Shown]),
    reading: &impl Reading,
    settings: &CalibrationSettings,
    (at, normal): (&Vector, &Normal<COUNT>),
    ratio: f64,
) -> Residuals {
    let none = Residuals { doubts: Vec::new(), correlation: 0.0 };
    let (Some(jet), Some(covariance)) = (Jet::new(settings, at), normal.covariance()) else { return none };
    let (mut products, mut pairs) = (0.0, 0_usize);
    let sums: Vec<Sums> = views
        .iter()
        .zip(bursts)
        .map(|(view, burst)| {
            let (sum, product, pair) = sums(view, burst, reading, settings, &jet);
            products += product;
            pairs += pair;
            sum
        })
        .collect();
    // The noise may be more than was told.
    let excess = ratio.max(1.0);
    let test = |explanation: Explanation, column: usize, bursts: &[Sums]| {
        let total = |of: &dyn Fn(&Sums) -> f64| bursts.iter().map(of).sum::<f64>();
        let known = SVector::<f64, COUNT>::from_fn(|k, _| total(&|s| s.information[column][k]));
        let all = total(&|s| s.information[column][column]);
        let left = all - known.dot(&(covariance * known));
        let score = total(&|s| s.slope[column]) - known.dot(&(covariance * normal.slope));
        let doubt = Doubt { explanation, size: score / left, deviation: (excess / left).sqrt() };
        // What the parameters explain by themselves leaves nothing but rounding.
        (left > 1e-9 * all && doubt.weight().abs() > TELLING).then_some(doubt)
    };
    let common = [
        Explanation::PictureScale,
        Explanation::Distance,
        Explanation::Profile,
        Explanation::DoublePeak,
        Explanation::Delay,
    ];
    let delay_is_held = settings.held.contains(&Parameter::Delay);
    let mut doubts: Vec<Doubt> = (COUNT..)
        .zip(common)
        .filter(|(_, explanation)| delay_is_held || *explanation != Explanation::Delay)
        .filter_map(|(column, explanation)| test(explanation, column, &sums))
        .collect();
    for (number, sum) in sums.iter().enumerate() {
        let alone = std::slice::from_ref(sum);
        doubts.extend(test(Explanation::BurstDose(number), FLOW, alone));
        doubts.extend(test(Explanation::BurstDistance(number), DISTANCE, alone));
    }
    doubts.sort_by(|a, b| b.weight().abs().total_cmp(&a.weight().abs()));
    let correlation = products / (ratio.max(QUIET) * (pairs.max(1) as f64).sqrt());
    Residuals { doubts, correlation }
}

/// Sums of one burst, the sum of products of neighbouring residuals over the variance, and how many those are.
fn sums(
    view: &View,
    burst: &Shown,
    reading: &impl Reading,
    settings: &CalibrationSettings,
    jet: &Jet,
) -> (Sums, f64, usize) {
    let weight = 1.0 / (settings.noise * settings.noise);
    let mut sums = Sums { information: [[0.0; COLUMNS]; COLUMNS], slope: [0.0; COLUMNS] };
    let (mut products, mut pairs) = (0.0, 0);
    let Some(dose) = jet.dose(burst.duration) else { return (sums, products, pairs) };
    let (turn, by_delay) = (jet.long_side(), jet.by_delay(burst.duration));
    let middle = view.middle();
    let closer = (view.burst.card_from_nozzle.rotation * Vector3::x()).z / view.height;
    let mut before: Option<(usize, [f64; CHANNELS])> = None;
    for pixel in &burst.inside {
        let local = jet.local(pixel.slopes);
        let thickness = dose * pixel.density * (-0.5 * local.square).exp();
        let (values, by_thickness) = reading.at(thickness);
        let residual: [f64; CHANNELS] = std::array::from_fn(|c| pixel.readings[c] - values[c]);
        let in_row = pixel.index % view.burst.columns != 0;
        if let Some((_, left)) = before.filter(|(index, _)| index + 1 == pixel.index && in_row) {
            products += weight * (0..CHANNELS).map(|c| left[c] * residual[c]).sum::<f64>();
            // Channels that are not there have no residuals.
            pairs += view.channels;
        }
        before = Some((pixel.index, residual));

        let by = columns(&local, pixel, jet, turn, by_delay, &middle, closer);
        let known = weight * thickness * thickness * by_thickness.iter().map(|s| s * s).sum::<f64>();
        let pull = weight * thickness * (0..CHANNELS).map(|c| by_thickness[c] * residual[c]).sum::<f64>();
        for i in 0..COLUMNS {
            sums.slope[i] += pull * by[i];
            let row = known * by[i];
            for (sum, value) in sums.information[i].iter_mut().zip(&by).take(i + 1) {
                *sum += row * value;
            }
        }
    }
    for i in 0..COLUMNS {
        for j in 0..i {
            sums.information[j][i] = sums.information[i][j];
        }
    }
    (sums, products, pairs)
}

/// The logarithm of the thickness by the coordinates and by what all bursts may have in common. `middle` is the card's from the nozzle, `closer`
/// the cosine of axis and card over the height.
fn columns(
    local: &Local,
    pixel: &Pixel,
    jet: &Jet,
    turn: [f64; 2],
    by_delay: f64,
    middle: &Vector3<f64>,
    closer: f64,
) -> [f64; COLUMNS] {
    let ([x, y], [by_x, by_y], depth) = (pixel.slopes, local.gradient, pixel.depth);
    // A pixel that moves by a vector in the nozzle's axes.
    let moved = |by: &Vector3<f64>| {
        let [dx, dy] = [(by.y - x * by.x) / depth, (by.z - y * by.x) / depth];
        -0.5 * (by_x * dx + by_y * dy) - 3.0 * by.x / depth
    };
    let along = jet.along(turn, pixel.slopes);
    let square = along * along;
    let [a, b, c, d, e, f] = local.log;
    [
        a,
        b,
        c,
        d,
        e,
        f,
        by_delay,
        moved(&(Vector3::new(depth, x * depth, y * depth) - middle)),
        moved(&Vector3::x()) + closer,
        1.0 - local.square + 0.125 * local.square * local.square,
        square * square - 6.0 * square + 3.0,
        by_delay,
    ]
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::super::burst::Burst;
    use super::super::scene::sort;
    use super::*;
    use crate::spray::SprayModel;

    /// What the picture's scale and the distance do to the thickness, by central differences.
    #[test]
    fn explanations_have_the_derivatives_of_central_differences() {
        let spray = SprayModel { cut: 5.0, aspect: 1.7, turn: 0.4, yaw: 0.05, pitch: -0.02, ..SprayModel::default() };
        let settings = CalibrationSettings { spray, ..CalibrationSettings::default() };
        let at = settings.coordinates(&spray, 3e-9, 0.0);
        let jet = Jet::new(&settings, &at).unwrap();
        let forward = Isometry3::rotation(-Vector3::y() * std::f64::consts::FRAC_PI_2);
        let burst = |scale: f64, farther: f64| {
            let tilted = Isometry3::rotation(Vector3::new(0.3, -0.4, 0.2)) * Isometry3::translation(4e-3, 0.0, -0.1);
            let card_from_nozzle = tilted * forward * Isometry3::translation(-farther, 0.0, 0.0);
            let pixel = 2e-3 * (1.0 + scale);
            Burst { card_from_nozzle, duration: 0.7, columns: 15, pixel, readings: vec![0.0; 225] }
        };
        let logs = |scale: f64, farther: f64| -> Vec<f64> {
            let burst = burst(scale, farther);
            let shown = sort(&[View::new(&burst, 1)], false, &spray, &[0.0; 3], 1.0);
            let log = |pixel: &Pixel| pixel.density.ln() - 0.5 * jet.local(pixel.slopes).square;
            assert_eq!(shown[0].inside.len(), 225);
            shown[0].inside.iter().map(log).collect()
        };
        let step = 1e-5;
        let differences = |ahead: &[f64], back: &[f64]| -> Vec<f64> {
            ahead.iter().zip(back).map(|(a, b)| (a - b) / (2.0 * step)).collect()
        };
        let scale = differences(&logs(step, 0.0), &logs(-step, 0.0));
        let distance = differences(&logs(0.0, step), &logs(0.0, -step));
        let burst = burst(0.0, 0.0);
        let view = View::new(&burst, 1);
        let closer = (burst.card_from_nozzle.rotation * Vector3::x()).z / view.height;
        for pixel in &sort(&[View::new(&burst, 1)], false, &spray, &[0.0; 3], 1.0)[0].inside {
            let local = jet.local(pixel.slopes);
            let by = columns(&local, pixel, &jet, jet.long_side(), -1.0, &view.middle(), closer);
            for (found, expected) in [(by[COUNT], scale[pixel.index]), (by[DISTANCE], distance[pixel.index])] {
                assert!((found - expected).abs() < 1e-6 * expected.abs().max(1.0), "{found} {expected}");
            }
        }
    }
}
