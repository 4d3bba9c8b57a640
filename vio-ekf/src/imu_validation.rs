use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::error::invalid;
use crate::{Error, Imu, so3};

/// Length of the pieces over which the gyroscope is integrated, s: short enough for one without calibration.
const WINDOW_S: f64 = 8.0;
/// Forces are averaged over this first, s: vibration and most of the acceleration of a flight cancel.
const BLOCK_S: f64 = 2.6;
/// The mean force may differ from gravity by this, m/s²: acceleration, and the bias.
const GRAVITY_TOLERANCE: f64 = 2.0;
/// Measured and claimed rate may differ by this share.
const RATE_TOLERANCE: f64 = 0.2;
/// Time between two samples, in units of the usual one, from which it counts as a gap.
const GAP: f64 = 5.0;
/// Another assignment of the axes is held to be the right one if it scatters gravity less by this factor...
const CLEARER: f64 = 0.6;
/// ... and if the one given scatters it by more than this, (m/s²)²: less is what changes of speed make, 5 m/s from block to
/// block. A multirotor's force stays along its own axis: an assignment that turns about that axis smears nothing at all.
const IMPLAUSIBLE: f64 = 3.5;

/// What [`validate_samples`] found in samples that it did not refuse.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImuValidation {
    /// One over the median time between samples, Hz.
    pub rate_hz: f64,
    /// Times between samples of more than five times the median.
    pub gaps: usize,
    /// The longest time between two samples, s.
    pub longest_gap_s: f64,
}

/// Whether inertial samples can be what they claim to be: finite, in order, as frequent as said, and with a force that
/// averages to gravity when the gyroscope's turns are taken out.
///
/// The last is a test of axes and units that needs no calibration and no camera. Piece by piece, 2.6 s each, the mean of
/// `R_k f_k`, with `R_k` integrated from the gyroscope, is gravity up to the change of speed. If the axes of one sensor are swapped or
/// mirrored against those of the other, gravity is smeared instead; the 24 rotations by quarters, each with both signs of
/// the gyroscope, are tried, and one that does much better is named. Motion that
/// hardly tilts the sensor tells nothing, and a mirror image of both sensors together shows only in the camera.
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
    let windows = windows(samples, GAP * usual);
    check_gravity(&windows, gravity)?;
    Ok(ImuValidation { rate_hz: measured, gaps, longest_gap_s: steps[steps.len() - 1] })
}

/// Forces of one window, turned into the axes of its first sample, with the gyroscope as it is and negated.
struct Window {
    /// For each second: `mean R_k[i][j] f_k[l]` as one matrix (j, l) for each i.
    turned: [Vec<[Matrix3<f64>; 3]>; 2],
    /// Mean length of the force.
    force: f64,
}

fn windows(samples: &[Imu], gap_s: f64) -> Vec<Window> {
    let mut windows = Vec::new();
    let mut first = 0;
    while first + 1 < samples.len() {
        let inside = |pair: &[Imu]| {
            pair[1].stamp.secs_since(samples[first].stamp) <= WINDOW_S
                && pair[1].stamp.secs_since(pair[0].stamp) <= gap_s
        };
        let count = 1 + samples[first..].windows(2).take_while(|pair| inside(pair)).count();
        windows.push(Window::new(&samples[first..first + count]));
        first += count;
    }
    windows
}

impl Window {
    fn new(samples: &[Imu]) -> Self {
        let force = samples.iter().map(|sample| sample.accel.norm()).sum::<f64>() / samples.len() as f64;
        let turned = [1.0, -1.0].map(|sign| {
            let (mut means, mut sums, mut count) = (Vec::new(), [Matrix3::zeros(); 3], 0.0);
            let mut turn = Rotation3::identity();
            let mut began = samples[0].stamp;
            for (index, sample) in samples.iter().enumerate() {
                if index > 0 {
                    let before = &samples[index - 1];
                    let mean = (before.gyro + sample.gyro) * (0.5 * sign);
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
        Self { turned, force }
    }

    /// Sum of the squared departures of the seconds' mean forces from their mean, if axis `l` of the accelerometer is
    /// column `l` of `axes`; and how many seconds there are.
    fn scatter(&self, axes: &Matrix3<f64>, sign: usize) -> (f64, f64) {
        let (mut sum, mut square, mut count) = (Vector3::zeros(), 0.0, 0.0);
        for block in &self.turned[sign] {
            let force = Vector3::from_fn(|i, _| block[i].component_mul(axes).sum());
            sum += force;
            square += force.norm_squared();
            count += 1.0;
        }
        if count < 2.0 { (0.0, 0.0) } else { (square - sum.norm_squared() / count, count) }
    }
}

fn check_gravity(windows: &[Window], gravity: f64) -> Result<(), Error> {
    let median = |values: Vec<f64>| {
        let mut sorted = values;
        sorted.sort_unstable_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied()
    };
    let Some(force) = median(windows.iter().map(|window| window.force).collect()) else { return Ok(()) };
    if (force - gravity).abs() > GRAVITY_TOLERANCE {
        return Err(Error::NoGravity { force, gravity });
    }
    let scatter = |axes: &Matrix3<f64>, sign: usize| {
        let parts = windows.iter().map(|window| window.scatter(axes, sign));
        let (sum, count) = parts.fold((0.0, 0.0), |(sum, count), part| (sum + part.0, count + part.1));
        sum / f64::max(count, 1.0)
    };
    let as_given = scatter(&Matrix3::identity(), 0);
    let best = quarter_turns()
        .into_iter()
        .flat_map(|axes| [(axes, 0), (axes, 1)])
        .map(|(axes, sign)| (scatter(&axes, sign), axes, sign))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    match best {
        Some((least, axes, sign)) if least < CLEARER * as_given && as_given > IMPLAUSIBLE => {
            let gyroscope = if sign == 0 { "" } else { ", and the gyroscope negated" };
            Err(Error::SwappedAxes { hint: format!("{}{gyroscope}", names(&axes)) })
        }
        _ => Ok(()),
    }
}

/// The 24 rotations that map axes to axes. Their mirror images scatter gravity alike: they turn the world upside down.
fn quarter_turns() -> Vec<Matrix3<f64>> {
    let mut turns = Vec::with_capacity(24);
    for permutation in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
        for signs in 0..8_u8 {
            let mut axes = Matrix3::zeros();
            for (column, row) in permutation.into_iter().enumerate() {
                axes[(row, column)] = if signs >> column & 1 == 0 { 1.0 } else { -1.0 };
            }
            if axes.determinant() > 0.0 {
                turns.push(axes);
            }
        }
    }
    turns
}

/// What the accelerometer's three readings would have to be, in terms of those given.
fn names(axes: &Matrix3<f64>) -> String {
    let row = |i: usize| {
        let column = (0..3).find(|&c| axes[(i, c)] != 0.0).unwrap_or(i);
        format!("{}{}", if axes[(i, column)] < 0.0 { "-" } else { "" }, ["x", "y", "z"][column])
    };
    format!("({}, {}, {})", row(0), row(1), row(2))
}
