//! SIGINT, SIGTERM and SIGHUP: what is under way and cannot be had again is finished and written; otherwise the program leaves at once.
//! A second signal always makes it leave at once. No file is broken by that: see [`crate::whole_file`].
//!
//! A signal belongs to the process, so its state does too.

use std::process::exit;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use crate::whole_file;

/// Exit code of a program that was interrupted: 128 and the number of SIGINT.
pub const EXIT_CODE: u8 = 130;

static REQUESTED: AtomicBool = AtomicBool::new(false);
static FINISHING: AtomicUsize = AtomicUsize::new(0);

/// From now on signals are heard; `program` is its name for messages.
pub fn watch(program: &str) {
    let program = program.to_string();
    let heard = ctrlc::set_handler(move || {
        let again = REQUESTED.swap(true, Ordering::SeqCst);
        if !again && FINISHING.load(Ordering::SeqCst) > 0 {
            eprintln!("{program}: interrupted: finishes what is there (once more: leaves at once)");
            return;
        }
        let _none_begins = whole_file::remove_parts();
        eprintln!("{program}: interrupted");
        exit(EXIT_CODE.into());
    });
    if let Err(error) = heard {
        eprintln!("warning: an interruption will not be orderly: {error}");
    }
}

/// Whether a signal has come.
pub fn is_requested() -> bool {
    REQUESTED.load(Ordering::SeqCst)
}

/// While one of these lives, a signal is a request to finish, which its owner looks for with [`is_requested`].
pub struct Finishing(());

impl Finishing {
    /// Begins work that can be finished early.
    #[must_use]
    pub fn begin() -> Self {
        FINISHING.fetch_add(1, Ordering::SeqCst);
        Self(())
    }
}

impl Drop for Finishing {
    fn drop(&mut self) {
        FINISHING.fetch_sub(1, Ordering::SeqCst);
    }
}
