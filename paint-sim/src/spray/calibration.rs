//! A spray and its valve from photographed bursts: deviation, flow, ellipse, jet direction and delay, with their standard deviations.
//!
//! Bursts of known durations from known poses, best from several distances and with the card tilted for some, are compared with the
//! thicknesses of [`SprayModel::density_from`], or with the reflectances which films of those thicknesses have by Kubelka-Munk theory
//! ([`crate::km::reflectance`]). Levenberg-Marquardt on analytic derivatives finds the least squares; it starts from the moments of the paint.
//!
//! ```
//! use paint_sim::nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
//! use paint_sim::SprayModel;
//! use paint_sim::spray::calibration::{Burst, CalibrationSettings, calibrate};
//!
//! // Straight at the middle of a card of 81 x 81 readings, a millimetre apart, from two distances; 2 mm^3/s for half a second.
//! let truth = SprayModel { sigma: 0.12, cut: 5.0, ..SprayModel::default() };
//! let burst = |distance: f64| {
//!     let rotation = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -std::f64::consts::FRAC_PI_2);
//!     let card_from_nozzle = Isometry3::from_parts(Vector3::new(0.0, 0.0, -distance).into(), rotation);
//!     let thickness = |k: usize| {
//!         let at = Point3::new((k % 81) as f64 - 40.0, (k / 81) as f64 - 40.0, 0.0) * 1e-3;
//!         1e-9 * truth.density_from(&card_from_nozzle, &at, &-Vector3::z_axis())
//!     };
//!     let readings = (0..81 * 81).map(thickness).collect();
//!     Burst { card_from_nozzle, duration: 0.5, columns: 81, pixel: 1e-3, readings }
//! };
//! let settings = CalibrationSettings { noise: 1e-8, ..CalibrationSettings::default() };
//! let found = calibrate(&[burst(0.06), burst(0.1)], None, &settings)?;
//! assert!((found.spray.sigma - 0.12).abs() < 1e-4 && (found.flow - 2e-9).abs() < 1e-12 && found.agrees());
//! # Ok::<(), paint_sim::Error>(())
//! ```

mod burst;
mod curve;
mod doubts;
mod jet;
mod parameters;
mod scene;
mod start;

pub use burst::{Burst, Coating, Response};
pub use doubts::{Doubt, Explanation};
pub use parameters::{CalibrationSettings, Parameter};

use super::SprayModel;
use crate::error::{Error, check_range};
use crate::least_squares::{Normal, minimise};
use crate::trace::{event, span};
use curve::{CHANNELS, Film, Reading, Table, Thickness};
use parameters::{ALL, COUNT, Vector};
use scene::{Shown, View, sort};
use start::{Inverse, Start, start};

/// Times that readings are sorted anew by the cone that was found.
const ROUNDS: usize = 5;
/// Change of the cone, as a share, that leaves them sorted.
const SORTED: f64 = 0.01;
/// Least curvature of normal equations with a unit diagonal: below, it is rounding.
const FLAT: f64 = 1e-9;
/// Deviations at which chi-square and the correlation speak against the model.
const REFUSED: f64 = 5.0;
/// Nobody knows the noise better than this, as a share of its variance.
const NOISE_KNOWN: f64 = 0.05;

/// One parameter that was sought.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Estimate {
    /// Which.
    pub parameter: Parameter,
    /// Its value, in the parameter's unit.
    pub value: f64,
    /// Its standard deviation, widened where the readings scatter more than the settings' noise says.
    pub deviation: f64,
}

/// A spray as the bursts show it.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Calibration {
    /// The spray, found and held parameters together.
    pub spray: SprayModel,
    /// Paint per second with the valve open, m^3/s.
    pub flow: f64,
    /// How much shorter paint leaves the nozzle than the valve is told to be open, s.
    pub delay: f64,
    /// What was sought, in the order of [`Parameter`].
    pub estimates: Vec<Estimate>,
    /// Whether the ellipse differs from a circle by so little that its turn means nothing.
    pub round: bool,
    /// Sum of the squared residuals over the variance of the noise.
    pub chi_square: f64,
    /// Readings less parameters: what `chi_square` should be, within a few times the root of twice as much.
    pub degrees_of_freedom: usize,
    /// How much neighbouring residuals are alike, in standard deviations of chance. It tells structure from noise that was underrated.
    pub correlation: f64,
    /// What would explain residuals that are no noise, by falling weight.
    pub doubts: Vec<Doubt>,
    /// Steps of the search.
    pub iterations: usize,
}

impl Calibration {
    /// Whether the residuals are noise: chi-square, correlation and every explanation within five deviations of chance (and 5 % of the noise's
    /// variance). Otherwise `doubts` says what may be wrong.
    pub fn agrees(&self) -> bool {
        let degrees = self.degrees_of_freedom as f64;
        let most = degrees * (1.0 + NOISE_KNOWN) + REFUSED * (2.0 * degrees).sqrt();
        self.chi_square <= most && self.correlation <= REFUSED && self.doubts.is_empty()
    }

    /// The estimate of a parameter that was sought.
    pub fn estimate(&self, parameter: Parameter) -> Option<Estimate> {
        self.estimates.iter().find(|estimate| estimate.parameter == parameter).copied()
    }
}

/// Finds the parameters that `settings` does not hold. Without a `coating` the readings are thicknesses in metres.
///
/// # Errors
/// No bursts or readings, numbers that are not finite or out of range, pixels too coarse for the spot; [`Error::Unpainted`],
/// [`Error::Saturated`]; [`Error::Undetermined`] where the bursts leave parameters open, as one duration leaves flow and delay;
/// [`Error::NoConvergence`].
pub fn calibrate(
    bursts: &[Burst],
    coating: Option<&Coating>,
    settings: &CalibrationSettings,
) -> Result<Calibration, Error> {
    span!("calibrate");
    settings.check()?;
    if bursts.is_empty() {
        return Err(Error::Empty { what: "bursts" });
    }
    let channels = match coating {
        Some(Coating { response: Response::LinearSrgb, .. }) => CHANNELS,
        _ => 1,
    };
    bursts.iter().try_for_each(|burst| burst.check(channels))?;
    let views: Vec<View> = bursts.iter().map(|burst| View::new(burst, channels)).collect();
    let Some(coating) = coating else {
        let start = start(&views, &Inverse::Thickness { noise: settings.noise }, settings)?;
        return search(&views, &Thickness, settings, &start);
    };
    coating.check()?;
    let film = Film::new(coating);
    let start = start(&views, &Inverse::of_film(&film, settings.noise)?, settings)?;
    // Twice the thickest that was met: hardly a step leads beyond.
    let table = Table::new(film, 2.0 * start.thickest);
    search(&views, &table, settings, &start)
}

/// Where the search ended.
struct Found {
    at: Vector,
    normal: Normal<COUNT>,
    bursts: Vec<Shown>,
    iterations: usize,
}

fn search(
    views: &[View],
    reading: &impl Reading,
    settings: &CalibrationSettings,
    start: &Start,
) -> Result<Calibration, Error> {
    let bare = reading.at(0.0).0;
    let mut spray = start.spray;
    let mut at = settings.coordinates(&spray, start.flow, settings.delay);
    let (mut round, mut coarse, mut iterations) = (1, true, 0);
    loop {
        let bursts = sort(views, coarse, &spray, &bare, settings.noise);
        let found = minimise(at, settings.iterations, |at| jet::linearise(&bursts, reading, settings, at))
            .ok_or(Error::NoConvergence { what: "a spray" })?;
        iterations += found.iterations;
        at = found.at;
        check_determined(&found.normal, settings)?;
        if !found.converged {
            return Err(Error::NoConvergence { what: "a spray" });
        }
        let before = std::mem::replace(&mut spray, settings.spray(&at));
        let settled = round >= ROUNDS || moved(&before, &spray) < SORTED;
        if settled && !coarse {
            check_pixels(views, &spray)?;
            return report(views, reading, settings, Found { at, normal: found.normal, bursts, iterations });
        }
        // A few readings bring the search near; all of them end it.
        coarse = coarse && !settled && round < 2;
        round += 1;
    }
}

fn report(
    views: &[View],
    reading: &impl Reading,
    settings: &CalibrationSettings,
    found: Found,
) -> Result<Calibration, Error> {
    let Found { at, normal, bursts, iterations } = found;
    let undetermined = || Error::Undetermined { parameters: "all of a spray together".to_owned() };
    let covariance = normal.covariance().ok_or_else(undetermined)?;
    let readings: usize = bursts.iter().zip(views).map(|(b, view)| b.inside.len() * view.channels + b.outside).sum();
    let sought: Vec<usize> = (0..COUNT).filter(|k| settings.free()[*k]).collect();
    let degrees_of_freedom = readings.saturating_sub(sought.len()).max(1);
    let ratio = normal.cost / degrees_of_freedom as f64;
    let residuals = doubts::residuals((views, &bursts), reading, settings, (&at, &normal), ratio);
    let deviations = settings.deviations(&at, &covariance) * ratio.max(1.0).sqrt();
    let (spray, flow, delay) = (settings.spray(&at), at[1].exp(), at[6]);
    let values = [spray.sigma, flow, spray.aspect, spray.turn, spray.yaw, spray.pitch, delay];
    let estimate = |k: usize| Estimate { parameter: ALL[k], value: values[k], deviation: deviations[k] };
    event!(debug, chi_square = normal.cost, degrees_of_freedom, doubts = residuals.doubts.len(), "calibrated");
    Ok(Calibration {
        spray,
        flow,
        delay,
        estimates: sought.into_iter().map(estimate).collect(),
        round: settings.free_ellipse() && spray.aspect - 1.0 < 3.0 * deviations[2],
        chi_square: normal.cost,
        degrees_of_freedom,
        correlation: residuals.correlation,
        doubts: residuals.doubts,
        iterations,
    })
}

/// Refuses readings too coarse for the spot of the nearest nozzle.
fn check_pixels(views: &[View], spray: &SprayModel) -> Result<(), Error> {
    let [long, short] = spray.ellipse().deviations;
    let share = |view: &View| view.burst.pixel / (view.height * long.min(short));
    let coarsest = views.iter().map(share).fold(0.0, f64::max);
    let allowed = "at most 0.25: take sharper pictures, or spray from farther away";
    check_range("pixel of a burst over the deviation of its spot", coarsest, 0.0, 0.25, allowed)
}

/// Refuses data that leave parameters open, by name.
fn check_determined(normal: &Normal<COUNT>, settings: &CalibrationSettings) -> Result<(), Error> {
    let free = settings.free();
    let named = |open: &dyn Fn(usize) -> bool| {
        let names = (0..COUNT).filter(|k| free[*k] && open(*k)).map(|k| format!("{:?}", ALL[k]).to_lowercase());
        Error::Undetermined { parameters: names.collect::<Vec<_>>().join(", ") }
    };
    let blind = |k: usize| normal.information[(k, k)] <= 0.0;
    if (0..COUNT).any(|k| free[k] && blind(k)) {
        return Err(named(&blind));
    }
    let (curvature, direction) = normal.weakest();
    if curvature < FLAT { Err(named(&|k| direction[k].abs() > 0.1)) } else { Ok(()) }
}

/// How far the cone has moved, as a share of its size.
fn moved(before: &SprayModel, after: &SprayModel) -> f64 {
    let [one, two] = [before.ellipse(), after.ellipse()];
    let size = |k: usize| (one.deviations[k] / two.deviations[k]).ln().abs();
    let place = (one.center[0] - two.center[0]).hypot(one.center[1] - two.center[1]) / one.deviations[0];
    let turned = (before.turn - after.turn).sin().abs() * (after.aspect - 1.0).abs().min(1.0);
    size(0).max(size(1)).max(place).max(turned)
}
