//! The figures by which a painting flight is judged.

use super::sample::FlightSample;

/// Errors over the samples with an open valve (Paper II, Section 7.2, measures the same quantities), and extremes over
/// all samples. Zero where there is no sample to measure.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FlightStatistics {
    /// Samples with an open valve and an aim.
    pub open_samples: usize,
    /// Those of them in which the spray's axis missed the surface; they count in nothing below.
    pub missed_samples: usize,
    /// Samples for which the interlock kept the valve shut; they count in nothing below but the extremes.
    pub held_samples: usize,
    /// RMS distance between hit and aim at the same time, m.
    pub hit_error_rms: f64,
    /// The distance that 95 % of the samples do not exceed (nearest rank), m.
    pub hit_error_p95: f64,
    /// Largest distance, m.
    pub hit_error_max: f64,
    /// Mean of actual minus wanted distance from nozzle to surface along the axis, m.
    pub nozzle_distance_bias: f64,
    /// Standard deviation of the same, m.
    pub nozzle_distance_std: f64,
    /// RMS of actual minus desired pan, rad.
    pub pan_error_rms: f64,
    /// RMS of actual minus desired tilt, rad.
    pub tilt_error_rms: f64,
    /// RMS distance between true and wanted position of the body, m.
    pub position_error_rms: f64,
    /// RMS distance between true and estimated position of the body, m.
    pub localisation_error_rms: f64,
    /// Largest true speed over the flight, m/s.
    pub max_speed: f64,
    /// Largest true acceleration over the flight, m/s^2.
    pub max_acceleration: f64,
    /// Largest roll or pitch over the flight, rad.
    pub max_tilt: f64,
}

impl FlightStatistics {
    /// The figures of some runs of samples together.
    pub fn of(runs: &[&[FlightSample]]) -> Self {
        let samples = || runs.iter().flat_map(|run| run.iter());
        let open = || samples().filter(|s| s.flow > 0.0 && s.aim.is_some());
        let hits = || open().filter(|s| s.hit.is_some());
        let rms = |of: &dyn Fn(&FlightSample) -> f64| mean(hits().map(|s| of(s).powi(2))).sqrt();
        let largest = |of: &dyn Fn(&FlightSample) -> f64| samples().map(of).fold(0.0, f64::max);

        let mut errors: Vec<f64> = hits().filter_map(|s| Some((s.hit? - s.aim?).norm())).collect();
        errors.sort_by(f64::total_cmp);
        let rank = (0.95 * errors.len() as f64).ceil() as usize;
        let distance_error = |s: &FlightSample| s.distance - s.wanted_distance;
        let bias = mean(hits().map(distance_error));
        Self {
            open_samples: open().count(),
            missed_samples: open().count() - errors.len(),
            held_samples: samples().filter(|s| s.held).count(),
            hit_error_rms: mean(errors.iter().map(|e| e * e)).sqrt(),
            hit_error_p95: errors.get(rank.saturating_sub(1)).copied().unwrap_or(0.0),
            hit_error_max: errors.last().copied().unwrap_or(0.0),
            nozzle_distance_bias: bias,
            nozzle_distance_std: rms(&|s| distance_error(s) - bias),
            pan_error_rms: rms(&|s| s.pan_tilt[0] - s.desired_pan_tilt[0]),
            tilt_error_rms: rms(&|s| s.pan_tilt[1] - s.desired_pan_tilt[1]),
            position_error_rms: rms(&|s| (position(s) - s.reference_position).norm()),
            localisation_error_rms: rms(&|s| (position(s) - s.estimated_position).norm()),
            max_speed: largest(&|s| s.velocity.norm()),
            max_acceleration: largest(&|s| s.acceleration.norm()),
            max_tilt: largest(&|s| s.attitude[0].abs().max(s.attitude[1].abs())),
        }
    }
}

fn position(sample: &FlightSample) -> nalgebra::Point3<f64> {
    sample.world_from_body.translation.vector.into()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = values.fold((0_usize, 0.0), |(n, sum), value| (n + 1, sum + value));
    if count == 0 { 0.0 } else { sum / count as f64 }
}
