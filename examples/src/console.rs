//! What a program says: results on stdout, everything else on stderr, as loud as it was told.

use std::cell::RefCell;
use std::sync::atomic::{AtomicBool, Ordering};

static QUIET: AtomicBool = AtomicBool::new(false);
static ONLY_REPORT: AtomicBool = AtomicBool::new(false);

/// From now on only warnings and errors are said; with `only_report` nothing else than the report is a result.
pub(crate) fn configure(quiet: bool, only_report: bool) {
    QUIET.store(quiet, Ordering::Relaxed);
    ONLY_REPORT.store(only_report, Ordering::Relaxed);
}

thread_local! {
    /// What this thread says while somebody else hears it.
    static HEARD: RefCell<Option<Vec<String>>> = const { RefCell::new(None) };
}

/// Work of which the lines for a person are for somebody else than the terminal; they come with its result.
#[cfg_attr(not(feature = "vr"), allow(dead_code, reason = "only a page hears it"))]
pub(crate) fn heard<T>(work: impl FnOnce() -> T) -> (T, Vec<String>) {
    let before = HEARD.replace(Some(Vec::new()));
    let result = work();
    (result, HEARD.replace(before).unwrap_or_default())
}

/// Says a line for a person: where it is heard, else on stderr, if at all; see [`say!`](crate::say).
pub fn say_line(line: std::fmt::Arguments) {
    let on_terminal = HEARD.with_borrow_mut(|heard| match heard {
        Some(lines) => {
            lines.push(line.to_string());
            false
        }
        None => !is_quiet(),
    });
    if on_terminal {
        eprintln!("{line}");
    }
}

/// Whether this thread says things to the terminal.
pub(crate) fn is_heard() -> bool {
    HEARD.with_borrow(Option::is_some)
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
        $crate::console::say_line(format_args!($($text)*))
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
