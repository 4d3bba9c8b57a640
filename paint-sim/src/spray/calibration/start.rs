//! Where the search starts: the moments of the paint, reading by reading.

use nalgebra::{Matrix2, Vector2};

use super::curve::{Channels, Film, Reading};
use super::parameters::{ALL, CalibrationSettings, Parameter};
use super::scene::View;
use crate::error::{Error, check_range};
use crate::spray::SprayModel;

/// Moments are taken where there is at least this share of the densest paint: below, noise would widen the spot.
const SHARE: f64 = 0.15;
/// Readings that must have paint.
const FEWEST: usize = 12;
/// Every so many columns and rows a reading is taken, if that gives enough with paint.
const SPARSE: usize = 3;
const ENOUGH: usize = 300;
/// Thicknesses that a reading is compared with.
const NODES: usize = 129;

/// What one reading says of the film.
pub(super) struct Guess {
    thickness: f64,
    painted: bool,
    /// Thicker films would read the same.
    saturated: bool,
}

/// From readings to thicknesses, roughly.
pub(super) enum Inverse {
    Thickness { noise: f64 },
    Film { nodes: Vec<(f64, f64)>, channel: usize, opaque: f64, noise: f64 },
}

impl Inverse {
    /// By the channel that tells the paint from the card best.
    pub(super) fn of_film(film: &Film, noise: f64) -> Result<Self, Error> {
        let (bare, opaque) = (film.at(0.0).0, film.opaque());
        let contrast = |c: usize| (opaque[c] - bare[c]).abs();
        let channel = (1..bare.len()).fold(0, |best, c| if contrast(c) > contrast(best) { c } else { best });
        let allowed = "at least 20 deviations of a reading: take another card, paint or band";
        check_range("contrast of paint and card", contrast(channel) / noise, 20.0, f64::MAX, allowed)?;
        let mut hiding = 1e-9;
        while hiding < 1.0 && (film.at(hiding).0[channel] - opaque[channel]).abs() > noise {
            hiding *= 2.0;
        }
        let node = |k: usize| {
            let thickness = hiding * (k as f64 / (NODES - 1) as f64).powi(3);
            (thickness, film.at(thickness).0[channel])
        };
        Ok(Self::Film { nodes: (0..NODES).map(node).collect(), channel, opaque: opaque[channel], noise })
    }

    fn guess(&self, readings: &Channels) -> Guess {
        match self {
            Self::Thickness { noise } => {
                Guess { thickness: readings[0].max(0.0), painted: readings[0] > 4.0 * noise, saturated: false }
            }
            Self::Film { nodes, channel, opaque, noise } => {
                let value = readings[*channel];
                let (first, last) = (nodes[0].1, nodes[NODES - 1].1);
                let above = |node: &(f64, f64)| if last > first { node.1 < value } else { node.1 > value };
                let k = nodes.partition_point(above).clamp(1, NODES - 1);
                let ((low, a), (high, b)) = (nodes[k - 1], nodes[k]);
                let t = if a == b { 0.5 } else { ((value - a) / (b - a)).clamp(0.0, 1.0) };
                let saturated = (value - opaque).abs() < 2.0 * noise || (value > *opaque) == (last > first);
                // Readings beyond the bare card are noise.
                let change = (value - first) * (last - first).signum();
                Guess { thickness: low + t * (high - low), painted: change > 4.0 * noise, saturated }
            }
        }
    }
}

/// A spray, a flow, and the greatest thickness that was met.
pub(super) struct Start {
    pub(super) spray: SprayModel,
    pub(super) flow: f64,
    pub(super) thickest: f64,
}

/// Moments of the paint of one burst in slopes.
struct Moments {
    volume: f64,
    mean: Vector2<f64>,
    covariance: Matrix2<f64>,
    thickest: f64,
}

/// Flow, size, place and shape of the jet by moments; what is held is as the settings have it.
pub(super) fn start(views: &[View], inverse: &Inverse, settings: &CalibrationSettings) -> Result<Start, Error> {
    let moments = views
        .iter()
        .enumerate()
        .map(|(number, view)| moments(view, inverse, number))
        .collect::<Result<Vec<_>, Error>>()?;
    let count = moments.len() as f64;
    let mean = moments.iter().map(|m| m.mean).sum::<Vector2<f64>>() / count;
    let eigen = (moments.iter().map(|m| m.covariance).sum::<Matrix2<f64>>() / count).symmetric_eigen();
    let long = eigen.eigenvalues.imax();
    let [wide, narrow] = [eigen.eigenvalues[long], eigen.eigenvalues[1 - long]];
    let axis = eigen.eigenvectors.column(long);
    let open: f64 = views.iter().map(|view| view.burst.duration - settings.delay).sum();
    check_range("sum of the bursts' durations less the delay", open, f64::MIN_POSITIVE, f64::MAX, "positive")?;
    let volume: f64 = moments.iter().map(|m| m.volume).sum();
    let held = |parameter: Parameter| settings.held.contains(&parameter);
    let (mut spray, mut flow) = (settings.spray, settings.flow);
    for parameter in ALL.into_iter().filter(|parameter| !held(*parameter)) {
        match parameter {
            Parameter::Sigma => spray.sigma = (wide * narrow).sqrt().sqrt().atan().clamp(1e-3, 1.3),
            Parameter::Flow => flow = volume / (spray.efficiency * open),
            Parameter::Aspect => spray.aspect = (wide / narrow).sqrt().clamp(1.0 + 1e-6, 10.0),
            Parameter::Turn => spray.turn = axis[1].atan2(axis[0]),
            Parameter::Yaw => spray.yaw = mean.x.atan(),
            Parameter::Pitch => spray.pitch = mean.y.atan(),
            Parameter::Delay => {}
        }
    }
    Ok(Start { spray, flow, thickest: moments.iter().map(|m| m.thickest).fold(0.0, f64::max) })
}

fn moments(view: &View, inverse: &Inverse, number: usize) -> Result<Moments, Error> {
    let (mut met, mut saturated, mut stride) = (Vec::new(), 0, SPARSE);
    loop {
        for row in (0..view.rows).step_by(stride) {
            for column in (0..view.burst.columns).step_by(stride) {
                let guess = inverse.guess(&view.reading(column, row));
                let ray = view.ray(column, row);
                if guess.painted && ray.x > 0.0 {
                    saturated += usize::from(guess.saturated);
                    // Per slope, not per area: the cube of the depth is the ratio of both.
                    met.push((guess.thickness, guess.thickness * ray.x.powi(3), Vector2::new(ray.y, ray.z) / ray.x));
                }
            }
        }
        if stride == 1 || met.len() >= ENOUGH {
            break;
        }
        met.clear();
        (saturated, stride) = (0, 1);
    }
    if met.len() < FEWEST {
        return Err(Error::Unpainted { burst: number });
    }
    if 2 * saturated > met.len() {
        return Err(Error::Saturated { burst: number });
    }
    // The rank of the peak: single readings are noisy, and those of thick films most.
    let mut densities: Vec<f64> = met.iter().map(|m| m.1).collect();
    let rank = densities.len() / 20;
    let (_, peak, _) = densities.select_nth_unstable_by(rank, |a, b| b.total_cmp(a));
    let least = SHARE * *peak;
    met.retain(|m| m.1 >= least);
    let total: f64 = met.iter().map(|m| m.0).sum();
    let mean = met.iter().map(|m| m.2 * m.0).sum::<Vector2<f64>>() / total;
    let covariance = met.iter().map(|m| (m.2 - mean) * (m.2 - mean).transpose() * m.0).sum::<Matrix2<f64>>() / total;
    // A Gaussian has the share `1 - c` and this much of its variance above `c` of its peak.
    let variance = 1.0 + SHARE * SHARE.ln() / (1.0 - SHARE);
    let scale = (view.burst.pixel * stride as f64).powi(2) / (1.0 - SHARE);
    let floor = Matrix2::identity() * (view.burst.pixel / view.height).powi(2) / 12.0;
    let thickest = met.iter().map(|m| m.0).fold(0.0, f64::max);
    Ok(Moments { volume: total * scale, mean, covariance: covariance / variance + floor, thickest })
}
