//! Time as the processor spends it: on a machine that others use as well, wall time says little.

use std::hint::black_box;
use std::time::Duration;

use cpu_time::ThreadTime;

/// Shortest time worth reading.
const LEAST: Duration = Duration::from_millis(100);

/// Median over `runs` (at least one) of the seconds that `job` takes on this thread, its result included but not used.
/// Short jobs are repeated within a run.
pub fn median_seconds<T>(runs: usize, mut job: impl FnMut() -> T) -> f64 {
    let mut repeated = |times: u32| {
        let start = ThreadTime::now();
        for _ in 0..times {
            black_box(job());
        }
        start.elapsed()
    };
    let mut times = 1;
    while repeated(times) < LEAST && times < 1 << 20 {
        times *= 2;
    }
    let mut seconds: Vec<f64> = (0..runs.max(1)).map(|_| repeated(times).as_secs_f64() / f64::from(times)).collect();
    seconds.sort_unstable_by(f64::total_cmp);
    seconds[seconds.len() / 2]
}
