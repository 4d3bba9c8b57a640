//! The response of ink to depth in the network's units.

use super::real::Real;
use crate::model::Saturation;

/// Steps of a tabulated response over its range.
const STEPS: usize = 4096;
/// Depth, in the network's unit, beyond which a response no longer rises: `tanh 6` is 1 to 1e-5.
const DEEPEST: f64 = 6.0;

/// A saturation curve in the network's units: ink 1 is the most that the response reaches, half of it is reached at the depth
/// `atanh ½`, as with `tanh`, on which the network is trained.
#[derive(Debug, Clone)]
pub(crate) enum Response {
    Tanh,
    /// Ink and slope at equal steps of depth.
    Table(Vec<[f64; 2]>),
}

/// A response with the units that it is measured in.
#[derive(Debug, Clone)]
pub(crate) struct ScaledResponse {
    pub(crate) response: Response,
    /// Depth that the network calls 1.
    pub(crate) depth: f64,
    /// Ink that the network calls 1.
    pub(crate) ink: f64,
}

impl ScaledResponse {
    pub(crate) fn new(saturation: &Saturation) -> Self {
        if *saturation == Saturation::Tanh {
            return Self { response: Response::Tanh, depth: 1.0, ink: 1.0 };
        }
        let ink = match saturation {
            Saturation::Curve(_) => saturation.max_ink(),
            Saturation::Tanh | Saturation::BeerLambert { .. } => 1.0,
        };
        let depth = saturation.inverse(0.5 * ink) / 0.5_f64.atanh();
        let table = (0..=STEPS)
            .map(|k| {
                let at = depth * DEEPEST * k as f64 / STEPS as f64;
                let (value, slope) = saturation.forward_and_derivative(at);
                [value / ink, slope * depth / ink]
            })
            .collect();
        Self { response: Response::Table(table), depth, ink }
    }
}

impl Response {
    /// Ink and slope of a row of depths; `depth` and `ink` may be the same values before and after.
    pub(crate) fn apply<T: Real>(&self, ink: &mut [T], slope: &mut [T]) {
        match self {
            Self::Tanh => {
                for (a, w) in ink.iter_mut().zip(slope) {
                    *a = tanh(*a);
                    *w = T::of(1.0) - *a * *a;
                }
            }
            Self::Table(table) => {
                for (a, w) in ink.iter_mut().zip(slope) {
                    let at = (a.to_f64() * (STEPS as f64 / DEEPEST)).clamp(0.0, STEPS as f64);
                    let k = (at as usize).min(STEPS - 1);
                    let (t, low, high) = (at - k as f64, table[k], table[k + 1]);
                    *a = T::of(low[0] + t * (high[0] - low[0]));
                    *w = T::of(low[1] + t * (high[1] - low[1]));
                }
            }
        }
    }
}

/// `tanh` by the ninth convergent of Lambert's continued fraction, within 5e-5 of it everywhere: without branches, so that
/// whole blocks are computed at once.
#[inline(always)]
fn tanh<T: Real>(depth: T) -> T {
    // Beyond, the convergent would exceed 1.
    let x = depth.at_most(T::of(5.2)).at_least(T::of(-5.2));
    let q = x * x;
    let above = x * ((((q + T::of(990.0)) * q + T::of(135_135.0)) * q + T::of(4_729_725.0)) * q + T::of(34_459_425.0));
    let below = (((T::of(45.0) * q + T::of(13_860.0)) * q + T::of(945_945.0)) * q + T::of(16_216_200.0)) * q
        + T::of(34_459_425.0);
    above / below
}
