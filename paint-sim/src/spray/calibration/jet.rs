//! The thickness that a spray leaves, and its derivatives by every coordinate.

use nalgebra::SMatrix;

use super::curve::{CHANNELS, Reading};
use super::parameters::{COUNT, CalibrationSettings, Vector};
use super::scene::Shown;
use crate::least_squares::Normal;

/// Aspects beyond `exp` of this are not sought.
const LONGEST: f64 = 3.0;

/// A spray at one point of the search.
///
/// With the deviation `t` and the vector `(p, q) = ln a (cos 2 turn, sin 2 turn)`, `r = ln a`, the squared distance from the middle is
/// `Q = (cosh r (x^2 + y^2) - sinh r / r (p (x^2 - y^2) + 2 q x y)) / t^2` (ours: the exponential of a symmetric matrix), which is smooth where
/// the spray is round.
pub(super) struct Jet {
    /// `1 / t^2`.
    tightness: f64,
    flow: f64,
    delay: f64,
    center: [f64; 2],
    pq: [f64; 2],
    cosh: f64,
    /// `sinh r / r`, and its derivative by `r` over `r`.
    sinhc: f64,
    sinhc_slope: f64,
    /// Derivatives of `(p, q)` by the two coordinates of the ellipse.
    basis: [[f64; 2]; 2],
}

/// What a jet is at one slope.
pub(super) struct Local {
    /// `Q`.
    pub(super) square: f64,
    /// `Q` by the two slopes.
    pub(super) gradient: [f64; 2],
    /// Logarithm of the thickness by all coordinates but the delay.
    pub(super) log: [f64; COUNT - 1],
}

impl Jet {
    /// Nothing where no spray has such coordinates.
    pub(super) fn new(settings: &CalibrationSettings, at: &Vector) -> Option<Self> {
        let [size, turn] = settings.ellipse(at);
        if size.abs() > LONGEST || at.iter().any(|v| !v.is_finite()) {
            return None;
        }
        let (s, c) = (2.0 * turn).sin_cos();
        let square = size * size;
        let (sinhc, sinhc_slope) = if size.abs() < 1e-2 {
            let slope = 1.0 / 3.0 + square * (1.0 / 30.0 + square / 840.0);
            (1.0 + square * (1.0 / 6.0 + square * (1.0 / 120.0 + square / 5040.0)), slope)
        } else {
            (size.sinh() / size, (size.cosh() - size.sinh() / size) / square)
        };
        let polar = [[c, s], [-2.0 * size * s, 2.0 * size * c]];
        Some(Self {
            tightness: (-2.0 * at[0]).exp(),
            flow: at[1].exp(),
            delay: at[6],
            center: [at[4], at[5]],
            pq: [size * c, size * s],
            cosh: size.cosh(),
            sinhc,
            sinhc_slope,
            basis: if settings.free_ellipse() { [[1.0, 0.0], [0.0, 1.0]] } else { polar },
        })
    }

    /// Volume of a burst over `t^2`, m^3; nothing where the valve does not open.
    pub(super) fn dose(&self, duration: f64) -> Option<f64> {
        let open = duration - self.delay;
        (open > 0.0).then_some(self.flow * open * self.tightness)
    }

    /// Logarithm of the thickness by the delay.
    pub(super) fn by_delay(&self, duration: f64) -> f64 {
        -1.0 / (duration - self.delay)
    }

    /// Unit vector of the ellipse's first side; any where it is round.
    pub(super) fn long_side(&self) -> [f64; 2] {
        let turn = 0.5 * self.pq[1].atan2(self.pq[0]);
        [turn.cos(), turn.sin()]
    }

    /// Distance from the middle along a side of the ellipse, in its deviations.
    pub(super) fn along(&self, [c, s]: [f64; 2], [x, y]: [f64; 2]) -> f64 {
        let [x, y] = [x - self.center[0], y - self.center[1]];
        let size = self.pq[0].hypot(self.pq[1]);
        (c * x + s * y) * (self.tightness * (-size).exp()).sqrt()
    }

    #[inline]
    pub(super) fn local(&self, [x, y]: [f64; 2]) -> Local {
        let ([x, y], [p, q]) = ([x - self.center[0], y - self.center[1]], self.pq);
        let (round, long, diagonal) = (x * x + y * y, x * x - y * y, 2.0 * x * y);
        let turned = p * long + q * diagonal;
        let square = self.tightness * (self.cosh * round - self.sinhc * turned);
        let gradient = [
            2.0 * self.tightness * (self.cosh * x - self.sinhc * (p * x + q * y)),
            2.0 * self.tightness * (self.cosh * y - self.sinhc * (q * x - p * y)),
        ];
        let common = self.sinhc * round - self.sinhc_slope * turned;
        let by_p = self.tightness * (p * common - self.sinhc * long);
        let by_q = self.tightness * (q * common - self.sinhc * diagonal);
        let [one, two] = self.basis.map(|[a, b]| -0.5 * (a * by_p + b * by_q));
        Local { square, gradient, log: [square - 2.0, 1.0, one, two, 0.5 * gradient[0], 0.5 * gradient[1]] }
    }
}

/// The normal equations of all readings; nothing where the coordinates are no spray.
pub(super) fn linearise(
    bursts: &[Shown],
    reading: &impl Reading,
    settings: &CalibrationSettings,
    at: &Vector,
) -> Option<Normal<COUNT>> {
    let (jet, weight) = (Jet::new(settings, at)?, 1.0 / (settings.noise * settings.noise));
    let mut slope = [0.0; COUNT];
    let mut information = [[0.0; COUNT]; COUNT];
    let mut cost = 0.0;
    for burst in bursts {
        let (dose, by_delay) = (jet.dose(burst.duration)?, jet.by_delay(burst.duration));
        cost += burst.outside_cost;
        for pixel in &burst.inside {
            let local = jet.local(pixel.slopes);
            let thickness = dose * pixel.density * (-0.5 * local.square).exp();
            let (values, by_thickness) = reading.at(thickness);
            let (mut known, mut pull) = (0.0, 0.0);
            for c in 0..CHANNELS {
                let residual = pixel.readings[c] - values[c];
                cost += weight * residual * residual;
                known += by_thickness[c] * by_thickness[c];
                pull += by_thickness[c] * residual;
            }
            let [a, b, c, d, e, f] = local.log;
            let by = [a, b, c, d, e, f, by_delay];
            let (known, pull) = (weight * known * thickness * thickness, weight * pull * thickness);
            for i in 0..COUNT {
                slope[i] += pull * by[i];
                let row = known * by[i];
                for j in 0..=i {
                    information[i][j] += row * by[j];
                }
            }
        }
    }
    let free = settings.free();
    let mut normal = Normal::zero();
    normal.cost = cost;
    normal.slope = Vector::from_fn(|i, _| if free[i] { slope[i] } else { 0.0 });
    normal.information = SMatrix::from_fn(|i, j| match (free[i] && free[j], i >= j) {
        (false, _) => 0.0,
        (true, true) => information[i][j],
        (true, false) => information[j][i],
    });
    Some(normal)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Point3, Vector3};

    use super::super::burst::{Burst, Coating, Response};
    use super::super::curve::{Film, Table};
    use super::super::parameters::Parameter;
    use super::super::scene::{View, sort};
    use super::*;
    use crate::paint::{Paint, Substrate};
    use crate::rng::Rng;
    use crate::spray::SprayModel;

    /// Settings whose held parameters differ, so that the ellipse has each of its coordinates.
    fn all_settings() -> [CalibrationSettings; 3] {
        [vec![], vec![Parameter::Turn], vec![Parameter::Aspect]]
            .map(|held| CalibrationSettings { held, ..CalibrationSettings::default() })
    }

    fn random_spray(rng: &mut Rng, round: bool) -> SprayModel {
        let mut between = |low: f64, high: f64| low + (high - low) * rng.uniform();
        SprayModel {
            sigma: between(0.05, 0.3),
            aspect: if round { 1.0 + 1e-4 * between(0.0, 1.0) } else { between(1.1, 4.0) },
            turn: between(-1.4, 1.4),
            yaw: between(-0.1, 0.1),
            pitch: between(-0.1, 0.1),
            cut: 5.0,
            ..SprayModel::default()
        }
    }

    /// A burst whose readings are not those of any spray.
    fn burst(rng: &mut Rng) -> Burst {
        let turned = Isometry3::rotation(Vector3::new(0.2, 0.3, 0.1));
        let forward = Isometry3::rotation(-Vector3::y() * std::f64::consts::FRAC_PI_2);
        let card_from_nozzle = turned * Isometry3::translation(0.0, 0.0, -0.1) * forward;
        let readings = (0..15 * 15).map(|_| 0.3 + 0.4 * rng.uniform()).collect();
        Burst { card_from_nozzle, duration: 0.7, columns: 15, pixel: 2e-3, readings }
    }

    #[test]
    fn a_burst_is_the_density_of_its_spray() {
        let mut rng = Rng::new(1, 0);
        for settings in all_settings() {
            let (spray, burst) = (random_spray(&mut rng, false), burst(&mut rng));
            let settings = CalibrationSettings { spray, ..settings };
            let at = settings.coordinates(&spray, 3e-9, 0.1);
            let jet = Jet::new(&settings, &at).unwrap();
            let shown = sort(&[View::new(&burst, 1)], false, &spray, &[0.0; 3], 1.0);
            let shown = &shown[0];
            assert!(shown.inside.len() > 100);
            for pixel in &shown.inside {
                let local = jet.local(pixel.slopes);
                let thickness = jet.dose(0.7).unwrap() * pixel.density * (-0.5 * local.square).exp();
                let at = |k: usize| k as f64 - 7.0;
                let place = Point3::new(at(pixel.index % 15), at(pixel.index / 15), 0.0) * 2e-3;
                let density = spray.density_from(&burst.card_from_nozzle, &place, &-Vector3::z_axis());
                assert!((thickness / (3e-9 * 0.6 * density) - 1.0).abs() < 1e-11, "{thickness} {density}");
            }
        }
    }

    #[test]
    fn thicknesses_have_the_derivatives_of_central_differences() {
        let mut rng = Rng::new(2, 0);
        for k in 0..300 {
            let settings = all_settings()[k % 3].clone();
            let spray = random_spray(&mut rng, k % 3 == 0 && k % 2 == 0);
            let at = settings.coordinates(&spray, 3e-9, 0.1);
            let slopes = [rng.uniform(), rng.uniform()].map(|u| 0.4 * (u - 0.5));
            let log = |at: &Vector| {
                let jet = Jet::new(&settings, at).unwrap();
                jet.dose(0.7).unwrap().ln() - 0.5 * jet.local(slopes).square
            };
            let jet = Jet::new(&settings, &at).unwrap();
            let [a, b, c, d, e, f] = jet.local(slopes).log;
            for (i, analytic) in [a, b, c, d, e, f, jet.by_delay(0.7)].into_iter().enumerate() {
                // Fourth order, so that a step may be long enough to leave no rounding.
                let at = |step: f64| {
                    let mut moved = at;
                    moved[i] += step;
                    log(&moved)
                };
                let step = 1e-3 * [1.0, 1.0, 1.0, 1.0, spray.sigma, spray.sigma, 1.0][i];
                let difference = (8.0 * (at(step) - at(-step)) - (at(2.0 * step) - at(-2.0 * step))) / (12.0 * step);
                let scale = analytic.abs().max(1e-2 / [1.0, 1.0, 1.0, 1.0, spray.sigma, spray.sigma, 1.0][i]);
                assert!((analytic - difference).abs() < 1e-6 * scale, "{k} {i}: {analytic} {difference}");
            }
        }
    }

    #[test]
    fn the_sum_of_squares_has_the_slope_of_central_differences() {
        let mut rng = Rng::new(3, 0);
        let paint = Paint::yellow(5e-6).unwrap();
        let coating = Coating { paint, card: Substrate::grey(0.8).unwrap(), response: Response::Band(5) };
        let film = Film::new(&coating);
        for settings in all_settings() {
            let (spray, burst) = (random_spray(&mut rng, false), burst(&mut rng));
            let settings = CalibrationSettings { spray, noise: 0.1, ..settings };
            let bursts = sort(&[View::new(&burst, 1)], false, &spray, &[0.8, 0.0, 0.0], 0.1);
            let at = settings.coordinates(&spray, 4e-9, 0.1);
            check(&at, &|at| linearise(&bursts, &film, &settings, at).unwrap());
        }
    }

    fn check(at: &Vector, of: &dyn Fn(&Vector) -> Normal<COUNT>) {
        let normal = of(at);
        for i in (0..COUNT).filter(|&i| normal.slope[i] != 0.0) {
            let cost = |step: f64| {
                let mut moved = *at;
                moved[i] += step;
                of(&moved).cost
            };
            let step = 2e-4 * [1.0, 1.0, 1.0, 1.0, 0.1, 0.1, 1.0][i];
            let difference =
                (8.0 * (cost(step) - cost(-step)) - (cost(2.0 * step) - cost(-2.0 * step))) / (12.0 * step);
            let analytic = -2.0 * normal.slope[i];
            assert!((analytic / difference - 1.0).abs() < 1e-6, "{i}: {analytic} {difference}");
        }
    }

    #[test]
    fn a_table_is_the_film() {
        let coating = Coating {
            paint: Paint::yellow(5e-6).unwrap(),
            card: Substrate::grey(0.8).unwrap(),
            response: Response::LinearSrgb,
        };
        let (film, table) = (Film::new(&coating), Table::new(Film::new(&coating), 30e-6));
        for k in 0..1000 {
            let thickness = 33e-6 * f64::from(k) / 1000.0;
            let ((values, slopes), (exact, exact_slopes)) = (table.at(thickness), film.at(thickness));
            for c in 0..CHANNELS {
                assert!((values[c] - exact[c]).abs() < 1e-6, "{thickness}: {values:?} {exact:?}");
                assert!((slopes[c] - exact_slopes[c]).abs() * 5e-6 < 1e-4, "{thickness}: {slopes:?} {exact_slopes:?}");
            }
        }
    }
}
