//! Time as the processor spends it: on a machine that others use as well, wall time says little.

use std::hint::black_box;
use std::time::{Duration, Instant};

use cpu_time::{ProcessTime, ThreadTime};

/// Shortest time worth reading.
const LEAST: Duration = Duration::from_millis(100);

/// Times of jobs of a few milliseconds that cannot be repeated, in all threads of this process.
#[derive(Debug, Default)]
pub struct CpuTimer {
    cpu: Vec<f64>,
    wall: Vec<f64>,
}

impl CpuTimer {
    /// Does a job and notes its times.
    pub fn time<T>(&mut self, job: impl FnOnce() -> T) -> T {
        let (cpu, wall) = (ProcessTime::now(), Instant::now());
        let done = job();
        self.cpu.push(cpu.elapsed().as_secs_f64());
        self.wall.push(wall.elapsed().as_secs_f64());
        done
    }

    /// Median processor time, milliseconds.
    pub fn cpu_ms(&self) -> f64 {
        median_ms(&self.cpu)
    }

    /// Median time on the wall, milliseconds.
    pub fn wall_ms(&self) -> f64 {
        median_ms(&self.wall)
    }
}

fn median_ms(seconds: &[f64]) -> f64 {
    let mut sorted = seconds.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    1e3 * sorted.get(sorted.len() / 2).copied().unwrap_or_default()
}

/// The result of a job that cannot be repeated, and the seconds that it takes on this thread.
pub fn seconds<T>(job: impl FnOnce() -> T) -> (T, f64) {
    let start = ThreadTime::now();
    let done = job();
    (done, start.elapsed().as_secs_f64())
}

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
