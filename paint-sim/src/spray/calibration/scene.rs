//! The readings as the search takes them: each where its nozzle sees it.

use nalgebra::Vector3;

use super::burst::Burst;
use super::curve::{CHANNELS, Channels};
use crate::spray::SprayModel;

/// Readings this near the edge of the cone, as a share of it, are left out: whether they have paint is decided by the parameters that are sought,
/// and a sum that jumps has no slopes.
const EDGE: f64 = 0.06;

/// Readings of a burst with which a search is brought near; more would make it no quicker.
const COARSE: f64 = 1000.0;

/// A reading inside the cone.
pub(super) struct Pixel {
    /// Slopes to the nozzle's left and upwards.
    pub(super) slopes: [f64; 2],
    /// Distance along the nozzle's axis, m.
    pub(super) depth: f64,
    /// Thickness of a unit volume in the middle of a jet of unit deviation, 1/m^2: efficiency, distance and incidence.
    pub(super) density: f64,
    pub(super) readings: Channels,
    /// Its number in the picture.
    pub(super) index: usize,
}

/// One burst, sorted by the cone of a spray.
pub(super) struct Shown {
    pub(super) duration: f64,
    pub(super) inside: Vec<Pixel>,
    /// Squared residuals, over the variance, of the readings outside, which should be bare.
    pub(super) outside_cost: f64,
    pub(super) outside: usize,
}

/// A burst's card from its nozzle.
pub(super) struct View<'a> {
    pub(super) burst: &'a Burst,
    /// Channels of a reading.
    pub(super) channels: usize,
    /// Rows of readings.
    pub(super) rows: usize,
    /// Distance of the nozzle from the card's plane, m.
    pub(super) height: f64,
    /// The first reading from the nozzle (depth, left and up, m), and the steps to the next column and row.
    first: Vector3<f64>,
    steps: [Vector3<f64>; 2],
}

impl<'a> View<'a> {
    pub(super) fn new(burst: &'a Burst, channels: usize) -> Self {
        let rows = burst.readings.len() / (channels * burst.columns);
        let nozzle_from_card = burst.card_from_nozzle.inverse();
        let steps = [Vector3::x(), Vector3::y()].map(|step| nozzle_from_card.rotation * step * burst.pixel);
        let middle = |count: usize| 0.5 * (count as f64 - 1.0);
        let first = nozzle_from_card.translation.vector - steps[0] * middle(burst.columns) - steps[1] * middle(rows);
        Self { burst, channels, rows, height: -burst.card_from_nozzle.translation.z, first, steps }
    }

    /// A reading from the nozzle: depth, left and up, m.
    pub(super) fn ray(&self, column: usize, row: usize) -> Vector3<f64> {
        self.first + self.steps[0] * column as f64 + self.steps[1] * row as f64
    }

    /// The card's middle from the nozzle.
    pub(super) fn middle(&self) -> Vector3<f64> {
        self.burst.card_from_nozzle.inverse().translation.vector
    }

    /// The channels of a reading, zero where it has fewer.
    pub(super) fn reading(&self, column: usize, row: usize) -> Channels {
        let start = (row * self.burst.columns + column) * self.channels;
        let mut padded = [0.0; CHANNELS];
        let readings = self.burst.readings.get(start..start + self.channels).unwrap_or_default();
        padded.iter_mut().zip(readings).for_each(|(to, from)| *to = *from);
        padded
    }

    /// Every how many columns and rows a reading is taken, so that enough of the cone are.
    fn stride(&self, spray: &SprayModel) -> usize {
        let [long, short] = spray.ellipse().deviations.map(|d| spray.cut * d * self.height / self.burst.pixel);
        let inside = (std::f64::consts::PI * long * short).min((self.burst.columns * self.rows) as f64);
        ((inside / COARSE).sqrt() as usize).max(1)
    }
}

/// Sorts the readings, or every few of them (`coarse`), by the cone of `spray`; `bare` is what the card reads.
pub(super) fn sort(views: &[View], coarse: bool, spray: &SprayModel, bare: &Channels, noise: f64) -> Vec<Shown> {
    let kept = -(-0.5 * spray.cut * spray.cut).exp_m1();
    let (ellipse, weight) = (spray.ellipse(), 1.0 / (noise * noise));
    let [c, s] = ellipse.long;
    let edge = |share: f64| (share * spray.cut).powi(2);
    let (inner, outer) = (edge(1.0 - EDGE), edge(1.0 + EDGE));
    let sort_one = |view: &View| {
        let stride = if coarse { view.stride(spray) } else { 1 };
        let factor = spray.efficiency * view.height / (std::f64::consts::TAU * kept);
        let mut shown = Shown { duration: view.burst.duration, inside: Vec::new(), outside_cost: 0.0, outside: 0 };
        for row in (0..view.rows).step_by(stride) {
            for column in (0..view.burst.columns).step_by(stride) {
                let (ray, readings) = (view.ray(column, row), view.reading(column, row));
                let slopes = [ray.y / ray.x, ray.z / ray.x];
                let [x, y] = [slopes[0] - ellipse.center[0], slopes[1] - ellipse.center[1]];
                let along = (c * x + s * y) / ellipse.deviations[0];
                let across = (c * y - s * x) / ellipse.deviations[1];
                let square = along * along + across * across;
                if ray.x <= 0.0 || square > outer {
                    shown.outside += view.channels;
                    shown.outside_cost += weight * (0..CHANNELS).map(|k| (readings[k] - bare[k]).powi(2)).sum::<f64>();
                } else if square < inner && ray.x <= spray.range {
                    let density = factor / (ray.x * ray.x * ray.x);
                    let index = row * view.burst.columns + column;
                    shown.inside.push(Pixel { slopes, depth: ray.x, density, readings, index });
                }
            }
        }
        shown
    };
    views.iter().map(sort_one).collect()
}
