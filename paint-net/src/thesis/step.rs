//! What the network did in one step.

use super::read_attention::FilterGrid;
use super::rollout::Rollout;
use super::spray::SprayParameters;

/// One step of the network: where it looked and what it sprayed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// READ's window.
    pub window: AttentionWindow,
    /// Position of the spray: column and row, pixels.
    pub position: (f64, f64),
    /// Standard deviation of the spray, pixels.
    pub sigma: f64,
    /// Depth that it adds at its centre, the gate included.
    pub volume: f64,
    /// `σ(z_paint)`.
    pub gate: f64,
}

/// Where READ looked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttentionWindow {
    /// Centre: column and row, pixels.
    pub centre: (f64, f64),
    /// From the first filter to the last, pixels.
    pub extent: f64,
    /// Standard deviation of the filters, pixels.
    pub sigma: f64,
}

/// The steps of a sample, up to the stop.
pub(crate) fn steps_of(rollout: &Rollout<f32>, k: usize) -> Vec<Step> {
    let painting = |&t: &usize| rollout.paints(t, k);
    (0..rollout.architecture.steps).take_while(painting).map(|t| step_of(rollout, t, k)).collect()
}

fn step_of(rollout: &Rollout<f32>, t: usize, k: usize) -> Step {
    let architecture = &rollout.architecture;
    let window = FilterGrid::new(architecture, &rollout.attention.at(t)[5 * k..5 * k + 5]);
    let spray = SprayParameters::new(architecture, &rollout.spray.at(t)[4 * k..4 * k + 4]);
    let pair = |x: f32, y: f32| (f64::from(x), f64::from(y));
    Step {
        window: AttentionWindow {
            centre: pair(window.x, window.y),
            extent: (architecture.read - 1) as f64 * f64::from(window.spacing),
            sigma: f64::from(window.variance).sqrt(),
        },
        position: pair(spray.x, spray.y),
        sigma: f64::from(spray.sigma),
        volume: f64::from(rollout.volume.at(t)[k]),
        gate: f64::from(rollout.gate(t, k)),
    }
}
