//! Readings that end where the sensor does.

use nalgebra::Vector3;

use crate::samples::Imu;

/// Equal readings in a row at the end of the range, and how many such rows: a reading that moves is hardly ever the same thrice.
const IN_A_ROW: usize = 3;
const ROWS: usize = 3;
/// A reading moves by at least so many of the sensor's smallest steps.
const MOVING: f64 = 3.0;
/// Smaller ends of a range are those of a sensor at rest: rad/s, m/s².
const LEAST: [f64; 2] = [0.3, 3.0];

/// An axis that is cut off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ClippedAxis {
    /// 0 the gyroscope, 1 the accelerometer.
    pub(super) sensor: usize,
    pub(super) axis: usize,
    /// The reading at which it ends.
    pub(super) end: f64,
    /// Samples there.
    pub(super) samples: usize,
}

/// The axes whose largest or smallest reading comes in rows of equal samples, as nothing but the end of a range does.
pub(super) fn clipped_axes(samples: &[Imu]) -> Vec<ClippedAxis> {
    let readings: [fn(&Imu) -> &Vector3<f64>; 2] = [|sample| &sample.gyro, |sample| &sample.accel];
    let mut found = Vec::new();
    for (sensor, reading) in readings.iter().enumerate() {
        for axis in 0..3 {
            let values: Vec<f64> = samples.iter().map(|sample| reading(sample)[axis]).collect();
            let ends = [
                values.iter().copied().fold(f64::INFINITY, f64::min),
                values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            ];
            for end in ends {
                let samples = in_rows(&values, end);
                if end.abs() >= LEAST[sensor] && samples > 0 && is_moving(&values) {
                    found.push(ClippedAxis { sensor, axis, end, samples });
                }
            }
        }
    }
    found
}

/// Samples at a reading, if they come in enough long rows.
fn in_rows(values: &[f64], end: f64) -> usize {
    let (mut rows, mut row, mut count) = (0, 0, 0);
    for value in values.iter().copied().chain([f64::NAN]) {
        if value == end {
            (row, count) = (row + 1, count + 1);
        } else {
            rows += usize::from(row >= IN_A_ROW);
            row = 0;
        }
    }
    if rows >= ROWS { count } else { 0 }
}

/// Whether the reading usually moves by more than the sensor's resolution from sample to sample.
fn is_moving(values: &[f64]) -> bool {
    let mut steps: Vec<f64> = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    steps.sort_unstable_by(f64::total_cmp);
    let smallest = steps.iter().copied().find(|step| *step > 0.0).unwrap_or(f64::INFINITY);
    steps.get(steps.len() / 2).is_some_and(|usual| *usual >= MOVING * smallest)
}
