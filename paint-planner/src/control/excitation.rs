//! The flight that excites the attitude loop, and what it tells.

use super::attitude_sample::AttitudeSample;
use super::identification::{AttitudeFit, SecondOrderFit, identify_attitude, identify_second_order};
use crate::error::{Error, ensure};

/// Begin and end of a sweep fade in and out, s.
const FADE: f64 = 1.0;
/// A second order is shown where it leaves less than this share of what the first leaves (root mean square).
const SHOWN: f64 = 0.8;

/// A sweep in roll, then one in pitch, each after a rest: `a sin(2 pi (f0 t + (f1 - f0) t² / (2 T)))`, faded in and out over a second.
///
/// It is added to what the position controller commands, which brings the vehicle back to its place meanwhile.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct Excitation {
    /// Amplitude `a`, rad. Default 10 degrees.
    pub amplitude: f64,
    /// First and last frequency `f0`, `f1`, Hz. Default 0.2 and 4.
    pub frequencies: [f64; 2],
    /// Duration `T` of a sweep, s. Default 30.
    pub duration: f64,
    /// Rest before each, s. Default 2.
    pub rest: f64,
    /// Largest roll or pitch that is commanded, rad. Default 25 degrees.
    pub tilt_limit: f64,
}

impl Default for Excitation {
    fn default() -> Self {
        let [amplitude, tilt_limit] = [10.0_f64, 25.0].map(f64::to_radians);
        Self { amplitude, frequencies: [0.2, 4.0], duration: 30.0, rest: 2.0, tilt_limit }
    }
}

impl Excitation {
    /// How long all of it takes, s.
    pub fn total_duration(&self) -> f64 {
        2.0 * (self.rest + self.duration)
    }

    /// What is added to roll and pitch `t` seconds after it began, rad.
    pub fn at(&self, t: f64) -> [f64; 2] {
        let Some((axis, t)) = self.sweep(t) else { return [0.0; 2] };
        let [first, last] = self.frequencies;
        let turns = (first + 0.5 * (last - first) * t / self.duration) * t;
        let fade = (t.min(self.duration - t) / FADE).clamp(0.0, 1.0);
        let angle = self.amplitude * fade * (std::f64::consts::TAU * turns).sin();
        if axis == 0 { [angle, 0.0] } else { [0.0, angle] }
    }

    /// The axis whose sweep lasts at a time, and since when, s.
    fn sweep(&self, t: f64) -> Option<(usize, f64)> {
        let part = self.rest + self.duration;
        let (axis, since) = if t < part { (0, t - self.rest) } else { (1, t - part - self.rest) };
        (0.0..self.duration).contains(&since).then_some((axis, since))
    }

    fn check(&self) -> Result<(), Error> {
        let Self { amplitude, frequencies: [first, last], duration, rest, tilt_limit } = *self;
        ensure("excitation.tilt_limit", tilt_limit, (0.01..=1.2).contains(&tilt_limit), "between 0.01 and 1.2 rad")?;
        let swings = amplitude > 0.0 && amplitude <= tilt_limit;
        ensure("excitation.amplitude", amplitude, swings, "positive and within the tilt limit")?;
        ensure("excitation.frequencies[0]", first, first > 0.0 && first.is_finite(), "positive")?;
        ensure("excitation.frequencies[1]", last, last >= first && last <= 50.0, "from the first to 50 Hz")?;
        ensure("excitation.duration", duration, (4.0..=600.0).contains(&duration), "4 to 600 s")?;
        ensure("excitation.rest", rest, (0.0..=600.0).contains(&rest), "0 to 600 s")
    }
}

/// What an excitation tells about roll and pitch.
#[derive(Debug, Clone, PartialEq)]
pub struct IdentifiedAttitude {
    /// Roll and pitch, of first order.
    pub first_order: [AttitudeFit; 2],
    /// Roll and pitch, of second order, where they show one.
    pub second_order: [Option<SecondOrderFit>; 2],
}

/// An excitation in flight: fed step by step, it says what to command, and at its end what was learnt.
///
/// ```
/// use paint_planner::control::{Excitation, Identification};
///
/// let mut identification = Identification::new(Excitation::default())?;
/// let (mut roll, mut pitch) = (0.0, 0.0); // follow their commands with lags of 0.2 and 0.1 s and gains of 1 and 0.8
/// let mut time = 0.0;
/// while !identification.is_over(time) {
///     let hover = [0.0, 0.0]; // what the position controller wants
///     let command = identification.step(time, hover, [roll, pitch]);
///     roll += (command[0] - roll) * (1.0 - (-0.01_f64 / 0.2).exp());
///     pitch += (0.8 * command[1] - pitch) * (1.0 - (-0.01_f64 / 0.1).exp());
///     time += 0.01;
/// }
/// let [roll, pitch] = identification.finish()?.first_order;
/// assert!((roll.response.time_constant - 0.2).abs() < 1e-6 && (pitch.response.gain - 0.8).abs() < 1e-6);
/// # Ok::<(), paint_planner::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Identification {
    excitation: Excitation,
    samples: [Vec<AttitudeSample>; 2],
}

impl Identification {
    /// Before it begins.
    ///
    /// # Errors
    /// An excitation out of range.
    pub fn new(excitation: Excitation) -> Result<Self, Error> {
        excitation.check()?;
        Ok(Self { excitation, samples: [Vec::new(), Vec::new()] })
    }

    /// Whether it is over `t` seconds after it began.
    pub fn is_over(&self, t: f64) -> bool {
        t >= self.excitation.total_duration()
    }

    /// One control step, `t` seconds after it began: roll and pitch to command until the next, rad, for those that the controller wants and
    /// those that are measured.
    pub fn step(&mut self, t: f64, wanted: [f64; 2], measured: [f64; 2]) -> [f64; 2] {
        let added = self.excitation.at(t);
        let limit = self.excitation.tilt_limit;
        let commanded = [0, 1].map(|axis| (wanted[axis] + added[axis]).clamp(-limit, limit));
        if let Some((axis, time)) = self.excitation.sweep(t) {
            self.samples[axis].push(AttitudeSample { time, commanded: commanded[axis], measured: measured[axis] });
        }
        commanded
    }

    /// What it was told.
    pub fn recording(&self, axis: usize) -> &[AttitudeSample] {
        self.samples.get(axis).map_or(&[], Vec::as_slice)
    }

    /// What was learnt.
    ///
    /// # Errors
    /// As [`identify_attitude`], of the first order.
    pub fn finish(&self) -> Result<IdentifiedAttitude, Error> {
        let [roll, pitch] = &self.samples;
        let first_order = [identify_attitude(roll)?, identify_attitude(pitch)?];
        let second = |axis: usize| {
            let fit = identify_second_order(&self.samples[axis]).ok();
            fit.filter(|fit| fit.residual < SHOWN * first_order[axis].residual)
        };
        Ok(IdentifiedAttitude { second_order: [second(0), second(1)], first_order })
    }
}
