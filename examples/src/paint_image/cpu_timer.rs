//! Processor time of a piece of work.

use std::time::Instant;

/// CPU time of this thread where the system tells it, wall time elsewhere and with several threads.
pub(super) struct CpuTimer {
    wall: Instant,
    cpu: Option<f64>,
}

impl CpuTimer {
    pub(super) fn start(threads: usize) -> Self {
        Self { wall: Instant::now(), cpu: (threads == 1).then(Self::cpu_ms).flatten() }
    }

    fn cpu_ms() -> Option<f64> {
        let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
        text.split_whitespace().next()?.parse::<f64>().ok().filter(|&ns| ns > 0.0).map(|ns| 1e-6 * ns)
    }

    pub(super) fn milliseconds(&self) -> f64 {
        match (self.cpu, Self::cpu_ms()) {
            (Some(before), Some(after)) => after - before,
            _ => 1e3 * self.wall.elapsed().as_secs_f64(),
        }
    }
}
