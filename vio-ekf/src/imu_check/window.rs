//! The part of a recording that tells most about axes.

use crate::samples::Imu;
use crate::stamp::Stamp;

/// First and last time of the part of `length_s` seconds that turns most, of those that begin at whole seconds; of all samples if
/// they are shorter; `None` if there are none.
pub fn busiest_window(samples: &[Imu], length_s: f64) -> Option<(Stamp, Stamp)> {
    let (first, last) = (samples.first()?.stamp, samples.last()?.stamp);
    let starts = (0..).map(|k| first.plus_secs(f64::from(k))).take_while(|start| start.plus_secs(length_s) <= last);
    let turning = |start: Stamp| {
        let end = start.plus_secs(length_s);
        let inside = samples.iter().filter(|sample| (start..=end).contains(&sample.stamp));
        inside.map(|sample| sample.gyro.norm_squared()).sum::<f64>()
    };
    let best = starts.map(|start| (turning(start), start)).max_by(|a, b| a.0.total_cmp(&b.0));
    let start = best.map_or(first, |(_, start)| start);
    Some((start, start.plus_secs(length_s).min(last)))
}
