//! Time as the processor spends it: on a machine that others use as well, wall time says little.

use std::hint::black_box;
use std::time::Instant;

/// Seconds that this thread has computed, where the system tells; `None` elsewhere.
fn thread_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds: f64 = text.split_whitespace().next()?.parse().ok()?;
    (nanoseconds > 0.0).then_some(nanoseconds * 1e-9)
}

/// Name of the clock that [`median_seconds`] reads.
pub fn clock_name() -> &'static str {
    if thread_seconds().is_some() { "cpu" } else { "wall" }
}

/// Median over `runs` (at least one) of the seconds that `job` takes on this thread, its result included but not used.
pub fn median_seconds<T>(runs: usize, mut job: impl FnMut() -> T) -> f64 {
    let mut one = || {
        let (wall, cpu) = (Instant::now(), thread_seconds());
        black_box(job());
        match (cpu, thread_seconds()) {
            (Some(before), Some(after)) => after - before,
            _ => wall.elapsed().as_secs_f64(),
        }
    };
    let mut seconds: Vec<f64> = (0..runs.max(1)).map(|_| one()).collect();
    seconds.sort_unstable_by(f64::total_cmp);
    seconds[seconds.len() / 2]
}
