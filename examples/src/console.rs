//! What a program says: results on stdout, everything else on stderr, as loud as it was told.

use std::sync::atomic::{AtomicBool, Ordering};

static QUIET: AtomicBool = AtomicBool::new(false);
static ONLY_REPORT: AtomicBool = AtomicBool::new(false);

/// From now on only warnings and errors are said; with `only_report` nothing else than the report is a result.
pub(crate) fn configure(quiet: bool, only_report: bool) {
    QUIET.store(quiet, Ordering::Relaxed);
    ONLY_REPORT.store(only_report, Ordering::Relaxed);
}

/// Whether only warnings and errors are said.
pub fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// Whether nothing but the report goes to stdout.
pub fn is_only_report() -> bool {
    ONLY_REPORT.load(Ordering::Relaxed)
}

/// A line for a person, on stderr; nothing with `--quiet`. Warnings are said in any case, by `eprintln!`.
#[macro_export]
macro_rules! say {
    ($($text:tt)*) => {
        if !$crate::console::is_quiet() {
            eprintln!($($text)*);
        }
    };
}

/// A line of the result, on stdout; nothing with `--json`.
#[macro_export]
macro_rules! result {
    ($($text:tt)*) => {
        if !$crate::console::is_only_report() {
            println!($($text)*);
        }
    };
}
