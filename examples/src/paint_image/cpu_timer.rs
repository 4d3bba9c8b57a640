//! Processor time of a piece of work.

use std::time::Instant;

use cpu_time::ThreadTime;

/// CPU time of this thread; with several threads, and where the system does not tell, wall time.
pub(super) struct CpuTimer {
    wall: Instant,
    cpu: Option<ThreadTime>,
}

impl CpuTimer {
    pub(super) fn start(threads: usize) -> Self {
        let cpu = if threads == 1 { ThreadTime::try_now().ok() } else { None };
        Self { wall: Instant::now(), cpu }
    }

    pub(super) fn milliseconds(&self) -> f64 {
        let cpu = self.cpu.and_then(|start| start.try_elapsed().ok());
        1e3 * cpu.unwrap_or_else(|| self.wall.elapsed()).as_secs_f64()
    }
}
