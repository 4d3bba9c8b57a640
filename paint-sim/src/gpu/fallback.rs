//! What becomes of work whose GPU fails: the processor does it.

use std::sync::OnceLock;

use crate::error::Error;
use crate::trace::event;

/// The fault after which a GPU is not asked again.
#[derive(Default)]
pub(crate) struct Fallback(OnceLock<Error>);

impl Fallback {
    /// What the GPU made of it; `None` where it failed, now or earlier.
    pub(crate) fn attempt<T>(&self, work: impl FnOnce() -> Result<T, Error>) -> Option<T> {
        if self.0.get().is_some() {
            return None;
        }
        work()
            .map_err(|error| {
                event!(warn, %error, "the processor goes on alone");
                self.0.get_or_init(|| error);
            })
            .ok()
    }

    /// Why the GPU is not asked any more.
    pub(crate) fn fault(&self) -> Option<&Error> {
        self.0.get()
    }
}
