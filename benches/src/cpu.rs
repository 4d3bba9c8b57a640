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

/// Shortest time worth reading: the system counts a running thread's time in steps of milliseconds.
const LEAST: f64 = 0.2;

/// Seconds that all threads of this process have computed, where the system tells; `None` elsewhere.
fn process_seconds() -> Option<f64> {
    // The system brings a running thread's account up to date when it pauses, and else every few milliseconds.
    std::thread::sleep(std::time::Duration::from_micros(60));
    let mut nanoseconds = 0.0;
    for thread in std::fs::read_dir("/proc/self/task").ok()? {
        let text = std::fs::read_to_string(thread.ok()?.path().join("schedstat")).ok()?;
        nanoseconds += text.split_whitespace().next()?.parse::<f64>().ok()?;
    }
    (nanoseconds > 0.0).then_some(nanoseconds * 1e-9)
}

/// Times of jobs of a few milliseconds that cannot be repeated, in any threads they start and wait for.
///
/// Threads that have ended are no longer counted by the system: with more than one, read the wall's time.
#[derive(Debug, Default)]
pub struct Clock {
    cpu: Vec<f64>,
    wall: Vec<f64>,
}

impl Clock {
    /// Does a job and notes its times.
    pub fn time<T>(&mut self, job: impl FnOnce() -> T) -> T {
        let before = process_seconds();
        let wall = Instant::now();
        let done = job();
        let wall = wall.elapsed().as_secs_f64();
        self.wall.push(wall);
        self.cpu.push(before.zip(process_seconds()).map_or(wall, |(before, after)| after - before));
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

/// Median over `runs` (at least one) of the seconds that `job` takes on this thread, its result included but not used.
/// Short jobs are repeated within a run.
pub fn median_seconds<T>(runs: usize, mut job: impl FnMut() -> T) -> f64 {
    let mut repeated = |times: u32| {
        let (wall, cpu) = (Instant::now(), thread_seconds());
        for _ in 0..times {
            black_box(job());
        }
        match (cpu, thread_seconds()) {
            (Some(before), Some(after)) => after - before,
            _ => wall.elapsed().as_secs_f64(),
        }
    };
    let mut times = 1;
    while repeated(times) < LEAST && times < 1 << 20 {
        times *= 2;
    }
    let mut seconds: Vec<f64> = (0..runs.max(1)).map(|_| repeated(times) / f64::from(times)).collect();
    seconds.sort_unstable_by(f64::total_cmp);
    seconds[seconds.len() / 2]
}
