//! Progress of the long stages: bars on a terminal, otherwise a plain line per stage, and one every ten seconds of it.

use std::io::IsTerminal;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};

use crate::{cancellation, console, say};

/// One stage under way.
pub struct Stage {
    name: String,
    bar: Option<ProgressBar>,
    started: Instant,
    /// Largest share so far, thousandths: of several threads or rounds the one that is behind does not turn the bar back.
    most: AtomicU64,
    /// Plain lines so far.
    told: AtomicU64,
}

/// Seconds between plain lines.
const INTERVAL_S: u64 = 10;

impl Stage {
    /// Announces a stage.
    pub fn start(name: &str) -> Self {
        cancellation::check();
        let bar = (std::io::stderr().is_terminal() && !console::is_quiet() && !console::is_heard()).then(|| {
            let bar = ProgressBar::new(1000);
            if let Ok(style) = ProgressStyle::with_template("{msg:28} [{bar:40}] {percent:>3} % {elapsed:>4}") {
                bar.set_style(style.progress_chars("=> "));
            }
            bar.set_message(name.to_string());
            bar
        });
        Self { name: name.to_string(), bar, started: Instant::now(), most: AtomicU64::new(0), told: AtomicU64::new(0) }
    }

    /// Moves the bar to a share in `[0, 1]`.
    pub fn share(&self, share: f64) {
        cancellation::check();
        let now = (1000.0 * share.clamp(0.0, 1.0)) as u64;
        let most = self.most.fetch_max(now, Ordering::Relaxed).max(now);
        if let Some(bar) = &self.bar {
            bar.set_position(most);
            return;
        }
        self.line(&format!("{:.0} %", most as f64 / 10.0));
    }

    /// Says what is being done where nobody knows how much of it is left.
    pub fn tell(&self, what: &str) {
        match &self.bar {
            Some(bar) => {
                bar.set_message(format!("{}: {what}", self.name));
                bar.tick();
            }
            None => self.line(what),
        }
    }

    /// A plain line, if none was printed for a while.
    fn line(&self, what: &str) {
        if console::is_heard() {
            return;
        }
        let seconds = self.started.elapsed().as_secs();
        if self.told.fetch_max(seconds / INTERVAL_S, Ordering::Relaxed) < seconds / INTERVAL_S {
            say!("{:28} {what} ({seconds} s)", self.name);
        }
    }

    /// Ends the stage with what it found.
    pub fn done(self, result: &str) {
        let line = format!("{:28} {result} ({:.1} s)", self.name, self.started.elapsed().as_secs_f64());
        match self.bar {
            Some(bar) => {
                bar.finish_and_clear();
                bar.suspend(|| say!("{line}"));
            }
            None if console::is_heard() => {}
            None => say!("{line}"),
        }
    }
}
