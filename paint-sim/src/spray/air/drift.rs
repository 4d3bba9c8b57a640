//! What moving air makes of a spot: where its droplets land, as moments.

use std::array::from_fn;

use super::droplets::DropletSettings;
use super::jet::Jet;
use crate::error::{Error, check_positive, check_range};
use crate::spray::SprayModel;
use crate::spray::ellipse::SlopeEllipse;

/// Classes of droplets. Volume grows with the cube of their number: the finest that land drift by far the most.
const CLASSES: usize = 16;
/// Halvings by which the finest share that lands is found.
const HALVINGS: usize = 13;
/// Droplets that land so many deviations of the spot beyond the middle one are a spot of their own.
const APART: f64 = 1.0;
/// Less than this share is no spot of its own: it widens the main one.
const FAINT: f64 = 0.02;
/// Droplets that drift farther than this, in stand-offs, are carried past.
const CARRIED: f64 = 2.0;
/// Largest angle, rad, and aspect of a [`SprayModel`].
const STEEPEST: f64 = 1.4;
const LONGEST: f64 = 20.0;

/// Droplets that land together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spot {
    /// Share of the volume that lands.
    pub share: f64,
    /// How far the air has shifted its middle across the axis, m.
    pub shift: f64,
    /// Variances that it has added along the shift and across it, m².
    pub variances: [f64; 2],
}

/// What the air does to a spray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drift {
    /// Share of the volume that reaches the wall.
    pub landed: f64,
    /// The same in still air.
    pub landed_in_still_air: f64,
    /// Where most of it lands.
    pub main: Spot,
    /// The fine droplets that land more than a deviation of the spot farther downwind than the middle ones, if there are any.
    pub fog: Option<Spot>,
}

impl Drift {
    /// Share of the volume that lands, of what would land in still air.
    pub fn kept(&self) -> f64 {
        if self.landed_in_still_air > 0.0 { (self.landed / self.landed_in_still_air).min(1.0) } else { 0.0 }
    }
}

impl Spot {
    /// The spray whose spot is as far off and as wide, in air that goes towards an angle about the axis, from the nozzle's left towards up.
    ///
    /// Covariances add. That of a Gaussian which is cut is a part of the Gaussian's own, so what is added is divided by that part.
    pub fn bend(&self, spray: &SprayModel, stand_off: f64, towards: f64) -> SprayModel {
        let SlopeEllipse { center, long, deviations, .. } = spray.ellipse();
        let half = 0.5 * spray.cut * spray.cut;
        let part = 1.0 - half / half.exp_m1();
        let [along, across] = self.variances.map(|variance| variance / (part * stand_off * stand_off));
        // Covariance over left and up: [ll, lu, uu].
        let ellipse = |[c, s]: [f64; 2], [long, short]: [f64; 2]| {
            [c * c * long + s * s * short, c * s * (long - short), s * s * long + c * c * short]
        };
        let (sine, cosine) = towards.sin_cos();
        let (own, added) = (ellipse(long, deviations.map(|d| d * d)), ellipse([cosine, sine], [along, across]));
        let [ll, lu, uu]: [f64; 3] = from_fn(|k| own[k] + added[k]);
        let (middle, reach) = (0.5 * (ll + uu), (0.5 * (ll - uu)).hypot(lu));
        let (wide, narrow) = ((middle + reach).sqrt(), (middle - reach).max(0.0).sqrt());
        let narrow = narrow.max(wide / LONGEST);
        let slope = self.shift / stand_off;
        SprayModel {
            sigma: (wide * narrow).sqrt().atan().min(STEEPEST),
            aspect: (wide / narrow).min(LONGEST),
            turn: 0.5 * (2.0 * lu).atan2(ll - uu),
            yaw: (center[0] + slope * cosine).atan().clamp(-STEEPEST, STEEPEST),
            pitch: (center[1] + slope * sine).atan().clamp(-STEEPEST, STEEPEST),
            ..*spray
        }
    }
}

/// What air of the velocity `[along, across]` the axis (m/s), fluctuating by `turbulence` (standard deviation per axis, m/s), does to a
/// spray on a wall `stand_off` metres away.
///
/// Sixteen classes, from the finest that lands to the coarsest, fly each its own way ([`DropletSettings::path`]); a spot is as wide as their
/// landings differ. Fluctuations last longer than a flight: they move each class as a steady wind would, in either direction.
///
/// # Errors
/// Settings out of range, numbers that are not finite.
pub fn drift(
    droplets: &DropletSettings,
    spray: &SprayModel,
    stand_off: f64,
    [along, across]: [f64; 2],
    turbulence: f64,
) -> Result<Drift, Error> {
    droplets.check()?;
    spray.check()?;
    check_positive("stand-off", stand_off)?;
    check_range("air along the axis", along, -100.0, 100.0, "below 100 m/s")?;
    check_range("air across the axis", across, -100.0, 100.0, "below 100 m/s")?;
    check_range("turbulence", turbulence, 0.0, 100.0, "below 100 m/s and not negative")?;
    let slope = spray.sigma.tan();
    let jet = Jet::new(droplets.momentum, droplets.speed, slope, stand_off);
    let speed = across.hypot(turbulence);
    let landed_in_still_air =
        1.0 - finest_share(droplets, |diameter| droplets.path(diameter, &jet, [0.0; 2]).is_some());
    let offset = |diameter| Some(droplets.path(diameter, &jet, [along, speed])?.offset);
    let lands = |diameter| offset(diameter).is_some_and(|offset| offset <= CARRIED * stand_off);
    let finest = finest_share(droplets, lands);
    let landed = 1.0 - finest;
    // Way per speed of the air, class by class.
    let bound = |k: usize| (k as f64 / CLASSES as f64).powi(3);
    let mobility: [f64; CLASSES] = from_fn(|k| {
        let middle = ((k as f64 + 0.5) / CLASSES as f64).powi(3);
        let offset = || offset(droplets.diameter(finest + landed * middle));
        // Where nothing lands, or nothing moves, there is no way.
        if landed > 0.0 && speed > 0.0 { offset().unwrap_or_default() / speed } else { 0.0 }
    });
    let median = mobility[(CLASSES as f64 * 0.5_f64.cbrt()) as usize];
    let apart = APART * slope * stand_off;
    let fine = mobility.iter().take_while(|way| (**way - median) * across.abs() > apart).count();
    let fine = if bound(fine) < FAINT { 0 } else { fine };
    let spot = |classes: std::ops::Range<usize>| {
        let share = bound(classes.end) - bound(classes.start);
        let mean = |power| {
            let part = |k: usize| (bound(k + 1) - bound(k)) * mobility[k].powi(power);
            classes.clone().map(part).sum::<f64>() / share
        };
        let (first, second) = (mean(1), mean(2));
        let gusts = turbulence * turbulence * second;
        let along = across * across * (second - first * first).max(0.0);
        Spot { share, shift: across * first, variances: [along + gusts, gusts] }
    };
    let fog = (fine > 0).then(|| spot(0..fine));
    Ok(Drift { landed, landed_in_still_air, main: spot(fine..CLASSES), fog })
}

/// Share of the volume in droplets too fine for what the coarser ones do.
fn finest_share(droplets: &DropletSettings, does: impl Fn(f64) -> bool) -> f64 {
    let (mut below, mut above) = (0.0, 1.0);
    for _ in 0..HALVINGS {
        let half = 0.5 * (below + above);
        *(if does(droplets.diameter(half)) { &mut above } else { &mut below }) = half;
    }
    above
}
