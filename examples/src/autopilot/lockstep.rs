//! Whether a program has done all that it can do before it is told that time goes on.
//!
//! PX4's threads hand work to one another, and at its start to the commands of a script; how far they are when the next sample arrives
//! depends on the scheduler, and with it the flight. When all of them sleep, the step is over, and the same samples give the same
//! flight on any machine. Linux tells; elsewhere a flight is repeatable to about a millimetre.

use std::ffi::OsString;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

/// A thread that never sleeps is not waited for longer than this.
const LONGEST: Duration = Duration::from_millis(500);
/// Threads are looked for again after so many steps, once the start is over.
const RELIST: u32 = 25;
/// Steps without a child process after which the start is over.
const STARTED: u32 = 25;
/// During the start the sleep must last: commands of a script wait for one another on the wall clock.
const START_SLEEP: Duration = Duration::from_millis(12);

/// The threads of a process and of its children.
pub(super) struct Threads {
    process: u32,
    states: Vec<File>,
    steps: u32,
    childless: u32,
}

impl Threads {
    pub(super) fn of(process: u32) -> Self {
        Self { process, states: Vec::new(), steps: 0, childless: 0 }
    }

    /// Waits until every thread has been seen asleep twice in a row.
    pub(super) fn wait_until_idle(&mut self) {
        let starting = self.childless < STARTED;
        let start = Instant::now();
        let (mut idle, mut since) = (0, start);
        while (idle < 2 || (starting && since.elapsed() < START_SLEEP)) && start.elapsed() < LONGEST {
            if starting || (idle == 0 && self.steps.is_multiple_of(RELIST)) {
                self.states.clear();
                let children = list(self.process, &mut self.states);
                self.childless = if children { 0 } else { self.childless };
            }
            if self.states.iter().all(asleep) {
                idle += 1;
            } else {
                (idle, since) = (0, Instant::now());
            }
            std::thread::yield_now();
        }
        self.steps = self.steps.wrapping_add(1);
        self.childless = self.childless.saturating_add(1);
    }
}

/// A command that runs a program on one processor, so that its threads take turns in the same order each time, another one for each
/// `instance`, as far as they go; in a process group of its own; and that ends it when this program dies, or it would wait for samples for
/// ever. Without `taskset` and `setpriv` (util-linux) the program runs as it is.
pub(super) fn tied(program: &Path, instance: u16) -> Command {
    let processors = allowed_processors(&std::fs::read_to_string("/proc/self/status").unwrap_or_default());
    let last_first = processors.iter().rev().cycle().nth(instance.into());
    let processor = last_first.map_or_else(String::new, usize::to_string);
    let mut words = Vec::new();
    for prefix in [["setpriv", "--pdeathsig", "KILL"], ["taskset", "-c", &processor]] {
        let [name, options @ ..] = prefix;
        if Command::new(name).args(options).arg("true").status().is_ok_and(|status| status.success()) {
            words.extend(prefix.map(OsString::from));
        }
    }
    words.push(program.into());
    let mut command = Command::new(&words[0]);
    command.args(&words[1..]).process_group(0);
    command
}

/// The processors that a process may use, as its status has them: `0-3,6`.
fn allowed_processors(status: &str) -> Vec<usize> {
    let list = status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:")).unwrap_or("");
    let ranges = list.trim().split(',').filter_map(|range| {
        let (first, last) = range.split_once('-').unwrap_or((range, range));
        Some(first.parse().ok()?..=last.parse().ok()?)
    });
    ranges.flatten().collect()
}

/// Opens the states of all threads of a process and of its descendants; whether it has any.
fn list(process: u32, states: &mut Vec<File>) -> bool {
    let mut found = false;
    for thread in std::fs::read_dir(PathBuf::from(format!("/proc/{process}/task"))).into_iter().flatten().flatten() {
        states.extend(File::open(thread.path().join("stat")));
        let children = std::fs::read_to_string(thread.path().join("children")).unwrap_or_default();
        for child in children.split_whitespace().filter_map(|child| child.parse().ok()) {
            found = true;
            list(child, states);
        }
    }
    found
}

/// The state is the letter after the name in brackets; a thread that is gone sleeps for good.
fn asleep(stat: &File) -> bool {
    let mut line = [0; 96];
    let Ok(count) = stat.read_at(&mut line, 0) else { return true };
    let line = &line[..count];
    let state = line.iter().rposition(|byte| *byte == b')').and_then(|at| line.get(at + 2));
    !matches!(state, Some(b'R' | b'D'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn processors_are_read() {
        assert_eq!(allowed_processors("Name:\tx\nCpus_allowed_list:\t0-2,5,7-8\n"), [0, 1, 2, 5, 7, 8]);
        assert!(allowed_processors("").is_empty());
    }

    /// Linux ends it when the thread that started it is gone; `setpriv` must have asked for that before.
    #[test]
    fn what_is_tied_dies_with_this_program() {
        let sleep = Path::new("/bin/sleep");
        if !cfg!(target_os = "linux") || !sleep.exists() || Command::new("setpriv").arg("--version").output().is_err() {
            return;
        }
        let started = Instant::now();
        let start = move || {
            let child = tied(sleep, 0).arg("20").spawn().unwrap();
            let name = PathBuf::from(format!("/proc/{}/comm", child.id()));
            while !std::fs::read_to_string(&name).is_ok_and(|name| name.starts_with("sleep")) {
                assert!(started.elapsed() < Duration::from_secs(15), "sleep does not begin");
                std::thread::sleep(Duration::from_millis(5));
            }
            child
        };
        let mut child = std::thread::spawn(start).join().unwrap();
        let status = child.wait().unwrap();
        assert_eq!(std::os::unix::process::ExitStatusExt::signal(&status), Some(9), "{status}");
    }

    /// As long as it is allowed to.
    #[test]
    fn a_thread_that_works_is_waited_for() {
        let mut busy = Command::new("sh").args(["-c", "while :; do :; done"]).spawn().unwrap();
        let mut threads = Threads::of(busy.id());
        let start = Instant::now();
        threads.wait_until_idle();
        let waited = start.elapsed();
        busy.kill().unwrap();
        busy.wait().unwrap();
        assert!(!cfg!(target_os = "linux") || waited >= LONGEST, "{waited:?}");
    }
}
