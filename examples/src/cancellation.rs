//! Work that is given up when nobody wants it any more.
//!
//! The stages of a mission report their progress from deep inside the libraries, which take no "stop" for an answer. A stage of a thread whose work was
//! cancelled unwinds it from there to [`until_cancelled`], as rust-analyzer's queries are: nothing is printed, everything on the way is dropped.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Tells work to end; all clones are the same.
#[derive(Debug, Clone, Default)]
pub(crate) struct Cancellation(Arc<AtomicBool>);

/// What is thrown.
struct Cancelled;

thread_local! {
    static CURRENT: RefCell<Option<Cancellation>> = const { RefCell::new(None) };
}

impl Cancellation {
    pub(crate) fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    pub(crate) fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Gives up this thread's work if it is cancelled; called where much work is behind and before it.
pub(crate) fn check() {
    if CURRENT.with_borrow(|current| current.as_ref().is_some_and(Cancellation::is_cancelled)) {
        resume_unwind(Box::new(Cancelled));
    }
}

/// Does work unless or until it is cancelled, then `None`. The work must not leave anything half changed that outlives it.
pub(crate) fn until_cancelled<T>(cancellation: &Cancellation, work: impl FnOnce() -> T) -> Option<T> {
    if cancellation.is_cancelled() {
        return None;
    }
    let before = CURRENT.replace(Some(cancellation.clone()));
    let done = catch_unwind(AssertUnwindSafe(work));
    CURRENT.replace(before);
    match done {
        Ok(done) => Some(done),
        Err(thrown) if thrown.is::<Cancelled>() => None,
        Err(panic) => resume_unwind(panic),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Stage;

    #[test]
    fn a_stage_ends_work_that_nobody_wants() {
        let cancellation = Cancellation::default();
        let steps = |cancel_at: usize| {
            let mut done = 0;
            let whole = until_cancelled(&cancellation, || {
                let stage = Stage::start("steps");
                for step in 0..10 {
                    if step == cancel_at {
                        cancellation.cancel();
                    }
                    stage.share(step as f64 / 10.0);
                    done += 1;
                }
            });
            (whole.is_some(), done)
        };
        assert_eq!(steps(usize::MAX), (true, 10));
        assert_eq!(steps(3), (false, 3));
        // What begins afterwards is not begun, and other work goes on.
        assert_eq!(steps(usize::MAX), (false, 0));
        Stage::start("other").share(0.5);
        assert_eq!(until_cancelled(&Cancellation::default(), || 7), Some(7));
    }
}
