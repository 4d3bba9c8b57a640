//! Whether inertial samples can be what they claim to be: order, rate, units, axes.

use std::fmt;

use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::error::Error;
use crate::error::invalid;
use crate::imu_check::bias_at_rest::bias_at_rest;
use crate::imu_check::clipping::{ClippedAxis, clipped_axes};
use crate::imu_check::reading::AxesReading;
use crate::imu_check::signed_axes::{RADIANS_PER_DEGREE, axis_names, signed_permutations};
use crate::lie::so3;
use crate::samples::Imu;

/// Length of the windows over which the gyroscope is integrated, s: short enough for one without calibration.
const WINDOW_S: f64 = 24.0;
/// Forces are averaged over this first, s: vibration cancels, and so does the acceleration up to the change of speed.
const BLOCK_S: f64 = 8.0;
/// Beyond these multiples of gravity the mean force is in another unit: no flight floats or pulls for that long.
const PLAUSIBLE_FORCE: [f64; 2] = [0.5, 3.0];
/// The mean force of a calm flight differs from gravity by less, m/s².
const CALM: f64 = 2.0;
/// The length of its mean over a block does by less, m/s²: recorded flights of sound sensors by 0.2.
const OFF: f64 = 0.25;
/// Measured and claimed rate may differ by this share.
const RATE_TOLERANCE: f64 = 0.2;
/// Time between two samples, in units of the usual one, from which it counts as a gap.
const GAP: f64 = 5.0;
/// Another reading of the sensors is named if it departs from gravity less by this factor in square...
const CLEARER: f64 = 0.25;
/// ... and the one given by more than this, (m/s²)²: changes of speed by 13 m/s from block to block.
const DOUBTFUL: f64 = 2.5;
/// From here on the samples are refused if images contradict them too: 28 m/s.
const IMPLAUSIBLE: f64 = 12.0;
/// Mean rate from which rates may be degrees per second, rad/s. Slower ones would be no rotation at all then, and the force of a
/// multirotor stays along its own axis: without rotation it would always seem to agree.
const FAST: f64 = 3.0;
/// Rates that are read otherwise: as they are, negated, and both taken for degrees per second.
const RATE_FACTORS: [f64; 4] = [1.0, -1.0, RADIANS_PER_DEGREE, -RADIANS_PER_DEGREE];

/// What [`validate_samples`] found in samples that it did not refuse.
#[derive(Debug, Clone, PartialEq)]
pub struct ImuValidation {
    /// One over the median time between samples, Hz.
    pub rate_hz: f64,
    /// Times between samples of more than five times the median.
    pub gaps: usize,
    /// The longest time between two samples, s.
    pub longest_gap_s: f64,
    /// What is unusual, and may be right: people should look at it.
    pub warnings: Vec<ImuWarning>,
}

impl ImuValidation {
    /// Refuses samples whose axes both gravity and images contradict: gravity by changes of speed of 28 m/s from piece to piece, and
    /// images by what [`check_axes_with_images`](crate::imu_check::check_axes_with_images) has added to the warnings. Either alone
    /// is no proof.
    ///
    /// # Errors
    /// [`Error::SwappedAxes`] with the axes by which gravity would be steady.
    pub fn refuse_contradicted(&self) -> Result<(), Error> {
        let by_gravity = self.warnings.iter().find_map(|warning| match warning {
            ImuWarning::Axes { hint, departure, .. } if departure * departure > IMPLAUSIBLE => Some(hint),
            _ => None,
        });
        let by_images = self.warnings.iter().any(|warning| matches!(warning, ImuWarning::Images { .. }));
        match by_gravity.filter(|_| by_images) {
            Some(hint) => Err(Error::SwappedAxes { hint: hint.clone() }),
            None => Ok(()),
        }
    }
}

/// What is unusual about inertial samples, with the evidence.
#[derive(Debug, Clone, PartialEq)]
pub enum ImuWarning {
    /// The force is far from gravity: an aggressive flight, or a wrong scale.
    Force {
        /// Median over windows of the mean length of the specific force, m/s².
        force: f64,
        /// What was expected, m/s².
        gravity: f64,
    },
    /// The mean force is not quite as long as gravity: a bias, or an accelerometer out of scale.
    Gravity {
        /// Median over blocks of the length of the mean force with the gyroscope's turns taken out, m/s².
        force: f64,
        /// What was expected, m/s².
        gravity: f64,
    },
    /// Another assignment of axes departs less from gravity: a flight that leans as it accelerates, or swapped axes.
    Axes {
        /// What the accelerometer's (x, y, z) and the gyroscope would have to be.
        hint: String,
        /// Root mean square departure from gravity with the axes as given, m/s².
        departure: f64,
        /// The same with those of the hint, m/s².
        departure_of_hint: f64,
    },
    /// An axis is cut off: more than its end is not read, and what is missing is missing in velocity and attitude.
    Clipped {
        /// `"gyroscope"` or `"accelerometer"`.
        sensor: &'static str,
        /// `'x'`, `'y'` or `'z'`.
        axis: char,
        /// The end of the range, rad/s or m/s².
        end: f64,
        /// Samples there.
        samples: usize,
    },
    /// The images agree with another reading ([`check_imu_axes`](crate::imu_check::check_imu_axes)).
    Images {
        /// `"gyroscope"` or `"accelerometer"`.
        sensor: &'static str,
        /// The reading.
        reading: AxesReading,
    },
    /// What is tracked stays in its place in the images while the sensor turns: part of the vehicle is in view, or the images stand
    /// still ([`Vio::set_mask`](crate::Vio::set_mask)).
    StaticView {
        /// Its share of what is tracked.
        share: f64,
        /// The box around it in the image, pixels: smallest column and row...
        low: [f64; 2],
        /// ... and largest.
        high: [f64; 2],
    },
}

impl From<ClippedAxis> for ImuWarning {
    fn from(ClippedAxis { sensor, axis, end, samples }: ClippedAxis) -> Self {
        Self::Clipped { sensor: ["gyroscope", "accelerometer"][sensor], axis: ['x', 'y', 'z'][axis], end, samples }
    }
}

impl fmt::Display for ImuWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Force { force, gravity } => write!(
                f,
                "the accelerometer reads {force:.1} m/s² on average, gravity is {gravity:.2}: an aggressive flight, or a wrong scale"
            ),
            Self::Gravity { force, gravity } => write!(
                f,
                "the accelerometer reads gravity as {force:.2} m/s², which is {gravity:.2}: it is {:+.1} % out of scale, or has a bias of \
                 {:+.2} m/s²; if distances matter, calibrate it",
                100.0 * (force / gravity - 1.0),
                force - gravity
            ),
            Self::Axes { hint, departure, departure_of_hint } => write!(
                f,
                "gravity is {departure:.1} m/s² off when the gyroscope's turns are taken out, and {departure_of_hint:.1} m/s² if \
                 the accelerometer's (x, y, z) were {hint}: a flight that leans as it accelerates, or other axes"
            ),
            Self::Clipped { sensor, axis, end, samples } => {
                let (unit, range) =
                    if *sensor == "gyroscope" { ("rad/s", "gyro_range") } else { ("m/s²", "accel_range") };
                write!(
                    f,
                    "the {sensor} is clipped: {axis} ends at {end:.2} {unit} in {samples} samples, and what is beyond is lost: use a \
                     larger range, or tell the filter ({range} = {:.2} in [imu] of --settings)",
                    end.abs()
                )
            }
            Self::Images { sensor, reading } => {
                let [given, read] = reading.unexplained;
                write!(
                    f,
                    "the images agree with the {sensor} if its (x, y, z) are {reading}, which leaves {:.0} % of the contradictions: \
                     check axes, signs and units",
                    100.0 * read / given
                )
            }
            Self::StaticView { share, low: [left, top], high: [right, bottom] } => write!(
                f,
                "{:.0} % of what is tracked stays in its place in the images while the sensor turns, between columns {left:.0} and \
                 {right:.0} and rows {top:.0} and {bottom:.0}: if that is part of the vehicle, leave it out with a mask (--mask)",
                100.0 * share
            ),
        }
    }
}

/// Whether inertial samples can be what they claim to be: finite, in order, as frequent as said, and with a force that
/// averages to gravity when the gyroscope's turns are taken out.
///
/// The last is a test of axes and units that needs no calibration and no camera. Piece by piece, the mean of `R_k f_k`, with
/// `R_k` integrated from the gyroscope, is gravity up to the change of speed. If the axes of one sensor are swapped or
/// mirrored against those of the other, or rates are in degrees, gravity is smeared instead; the 24 rotations by quarters, each
/// with both signs and both units of the gyroscope, are tried, and one that does much better is [named](ImuWarning::Axes). That refuses
/// nothing: over half a minute real flights do so too; see [`refuse_contradicted`](ImuValidation::refuse_contradicted). Motion that
/// hardly tilts the sensor tells nothing, nor does the force of a multirotor that leans about one axis only, and a mirror image of
/// both sensors together shows only in the camera.
pub fn validate_samples(samples: &[Imu], rate_hz: f64, gravity: f64) -> Result<ImuValidation, Error> {
    if samples.len() < 2 {
        return Err(Error::TooFew { what: "inertial samples", got: samples.len(), need: 2 });
    }
    if !(rate_hz > 0.0 && rate_hz.is_finite()) {
        return Err(invalid("rate_hz", rate_hz, "must be positive"));
    }
    if let Some(index) = samples.iter().position(|sample| !sample.is_finite()) {
        return Err(Error::NonFinite { what: "inertial sample", index });
    }
    if let Some(before) = samples.windows(2).position(|pair| pair[1].stamp <= pair[0].stamp) {
        let (previous, stamp) = (samples[before].stamp, samples[before + 1].stamp);
        return Err(Error::NotIncreasing { index: before + 1, previous, stamp });
    }
    let mut steps: Vec<f64> = samples.windows(2).map(|pair| pair[1].stamp.secs_since(pair[0].stamp)).collect();
    steps.sort_unstable_by(f64::total_cmp);
    let usual = steps[steps.len() / 2];
    let measured = 1.0 / usual;
    if (measured / rate_hz - 1.0).abs() > RATE_TOLERANCE {
        return Err(Error::SampleRate { measured_hz: measured, claimed_hz: rate_hz });
    }
    let gaps = steps.len() - steps.partition_point(|&step| step <= GAP * usual);
    let windows = windows(samples, GAP * usual, &bias_at_rest(samples));
    let mut warnings = check_gravity(&windows, gravity)?;
    if warnings.is_empty() {
        warnings.extend(check_length(&windows, gravity));
    }
    warnings.extend(clipped_axes(samples).into_iter().map(ImuWarning::from));
    Ok(ImuValidation { rate_hz: measured, gaps, longest_gap_s: steps[steps.len() - 1], warnings })
}

/// Forces of one window, turned into the axes of its first sample, for each reading of the gyroscope.
struct Window {
    /// For each block: `mean R_k[i][j] f_k[l]` as one matrix (j, l) for each i.
    turned: [Vec<[Matrix3<f64>; 3]>; 4],
    /// Mean length of the force.
    force: f64,
    /// Mean length of the rate.
    rate: f64,
}

fn windows(samples: &[Imu], gap_s: f64, gyro_bias: &Vector3<f64>) -> Vec<Window> {
    let mut windows = Vec::new();
    let mut first = 0;
    while first + 1 < samples.len() {
        let inside = |pair: &[Imu]| {
            pair[1].stamp.secs_since(samples[first].stamp) <= WINDOW_S
                && pair[1].stamp.secs_since(pair[0].stamp) <= gap_s
        };
        let count = 1 + samples[first..].windows(2).take_while(|pair| inside(pair)).count();
        windows.push(Window::new(&samples[first..first + count], gyro_bias));
        first += count;
    }
    windows
}

impl Window {
    fn new(samples: &[Imu], gyro_bias: &Vector3<f64>) -> Self {
        let mean = |length: fn(&Imu) -> f64| samples.iter().map(length).sum::<f64>() / samples.len() as f64;
        let (force, rate) = (mean(|sample| sample.accel.norm()), mean(|sample| sample.gyro.norm()));
        let turned = RATE_FACTORS.map(|factor| {
            let (mut means, mut sums, mut count) = (Vec::new(), [Matrix3::zeros(); 3], 0.0);
            let mut turn = Rotation3::identity();
            let mut began = samples[0].stamp;
            for (index, sample) in samples.iter().enumerate() {
                if index > 0 {
                    let before = &samples[index - 1];
                    let mean = ((before.gyro + sample.gyro) * 0.5 - gyro_bias) * factor;
                    turn *= so3::exp(&(mean * sample.stamp.secs_since(before.stamp))).to_rotation_matrix();
                }
                if sample.stamp.secs_since(began) >= BLOCK_S {
                    means.push(sums.map(|sum| sum / count));
                    (sums, count, began) = ([Matrix3::zeros(); 3], 0.0, sample.stamp);
                }
                for (i, sum) in sums.iter_mut().enumerate() {
                    *sum += turn.matrix().row(i).transpose() * sample.accel.transpose();
                }
                count += 1.0;
            }
            means
        });
        Self { turned, force, rate }
    }

    /// Lengths of the mean force of each block, the axes as they are.
    fn mean_forces(&self) -> impl Iterator<Item = f64> + '_ {
        self.turned[0].iter().map(|block| Vector3::from_fn(|i, _| block[i].trace()).norm())
    }

    /// Sum over blocks of the squared departure of the mean force from a vector as long as gravity along the window's mean, if
    /// axis `l` of the accelerometer is column `l` of `axes`; and how many blocks there are.
    fn departure(&self, axes: &Matrix3<f64>, reading: usize, gravity: f64) -> (f64, f64) {
        let block = |block: &[Matrix3<f64>; 3]| Vector3::from_fn(|i, _| block[i].component_mul(axes).sum());
        let forces: Vec<Vector3<f64>> = self.turned[reading].iter().map(block).collect();
        let sum: Vector3<f64> = forces.iter().sum();
        let up = sum.try_normalize(0.0).unwrap_or_default() * gravity;
        (forces.iter().map(|force| (force - up).norm_squared()).sum(), forces.len() as f64)
    }
}

fn check_gravity(windows: &[Window], gravity: f64) -> Result<Vec<ImuWarning>, Error> {
    let mut forces: Vec<f64> = windows.iter().map(|window| window.force).collect();
    forces.sort_unstable_by(f64::total_cmp);
    let mut warnings = Vec::new();
    let Some(&force) = forces.get(forces.len() / 2) else { return Ok(warnings) };
    let [least, most] = PLAUSIBLE_FORCE.map(|factor| factor * gravity);
    if force < least || force > most {
        return Err(Error::NoGravity { force, gravity });
    }
    if (force - gravity).abs() > CALM {
        warnings.push(ImuWarning::Force { force, gravity });
    }
    let departure = |axes: &Matrix3<f64>, reading: usize| {
        let parts = windows.iter().map(|window| window.departure(axes, reading, gravity));
        let (sum, count) = parts.fold((0.0, 0.0), |(sum, count), part| (sum + part.0, count + part.1));
        sum / f64::max(count, 1.0)
    };
    let as_given = departure(&Matrix3::identity(), 0);
    let rate = windows.iter().map(|window| window.rate).sum::<f64>() / windows.len() as f64;
    let factors = if rate > FAST { RATE_FACTORS.len() } else { 2 };
    let readings = quarter_turns().flat_map(|axes| (0..factors).map(move |k| (axes, k)));
    let best =
        readings.map(|(axes, reading)| (departure(&axes, reading), axes, reading)).min_by(|a, b| a.0.total_cmp(&b.0));
    let Some((least, axes, reading)) = best.filter(|(least, ..)| *least < CLEARER * as_given) else {
        return Ok(warnings);
    };
    let gyroscope = [
        "",
        ", and the gyroscope negated",
        ", and the gyroscope in degrees per second",
        ", and the gyroscope in negated degrees per second",
    ][reading];
    let hint = format!("{}{gyroscope}", names(&axes));
    if as_given > DOUBTFUL {
        let [departure, departure_of_hint] = [as_given, least].map(f64::sqrt);
        warnings.push(ImuWarning::Axes { hint, departure, departure_of_hint });
    }
    Ok(warnings)
}

/// The factor on readings of an accelerometer by which gravity is as long as it should be, where it is not.
pub(crate) fn gravity_scale(samples: &[Imu], gravity: f64) -> Option<f64> {
    let (first, last) = (samples.first()?, samples.last()?);
    let rate_hz = (samples.len() - 1) as f64 / last.stamp.secs_since(first.stamp);
    let found = validate_samples(samples, rate_hz, gravity).ok()?;
    found.warnings.iter().find_map(|warning| match warning {
        ImuWarning::Gravity { force, gravity } => Some(gravity / force),
        _ => None,
    })
}

/// Whether what the forces of sound axes have in common is as long as gravity.
fn check_length(windows: &[Window], gravity: f64) -> Option<ImuWarning> {
    let mut lengths: Vec<f64> = windows.iter().flat_map(Window::mean_forces).collect();
    lengths.sort_unstable_by(f64::total_cmp);
    let force = *lengths.get(lengths.len() / 2)?;
    ((force - gravity).abs() > OFF && lengths.len() > 1).then_some(ImuWarning::Gravity { force, gravity })
}

/// The 24 rotations that map axes to axes. Their mirror images scatter gravity alike: they turn the world upside down.
fn quarter_turns() -> impl Iterator<Item = Matrix3<f64>> {
    signed_permutations().filter(|axes| axes.determinant() > 0.0)
}

/// What the accelerometer's three readings would have to be, in terms of those given. With all signs turned it is the same world
/// upside down: the one with fewer is the likelier mistake.
fn names(axes: &Matrix3<f64>) -> String {
    let axes = if axes.sum() < 0.0 { -axes } else { *axes };
    axis_names(&axes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::{Scenario, Simulation, swaying_flight};

    #[test]
    fn gravity_is_as_long_as_the_scale_of_the_accelerometer_says() {
        let phases = [Vector3::new(0.3, 1.9, 4.0), Vector3::zeros(), Vector3::new(2.0, 0.1, 1.0), Vector3::x()];
        let flight = Simulation::new(swaying_flight(&phases, 30.0).unwrap(), Scenario::default()).unwrap();
        let mut samples = flight.imu(0).unwrap().samples;
        assert_eq!(gravity_scale(&samples, 9.81), None);
        for sample in &mut samples {
            sample.accel *= 0.94;
        }
        let scale = gravity_scale(&samples, 9.81).unwrap();
        assert!((scale * 0.94 - 1.0).abs() < 0.02, "{scale}");
        assert_eq!(gravity_scale(&samples[..1], 9.81), None);
    }
}
