//! The thread that estimates: the newest design, which cancels the one before.

use std::sync::mpsc::{Receiver, Sender, channel};

use super::estimator::{Estimator, Found, Job};
use crate::cancellation::Cancellation;

/// What goes to the thread and what comes back.
pub(super) struct Worker {
    jobs: Sender<(Job, Cancellation)>,
    /// What is found.
    pub(super) found: Receiver<Found>,
    current: Cancellation,
}

impl Worker {
    /// Starts the thread; it ends with its owner.
    pub(super) fn start() -> Self {
        let (jobs, work) = channel::<(Job, Cancellation)>();
        let (tell, found) = channel();
        std::thread::spawn(move || {
            let mut estimator = Estimator::default();
            while let Ok((job, cancellation)) = work.recv() {
                // Nobody hears what is found: the next receive ends the thread.
                estimator.estimate(&job, &cancellation, &mut |found| drop(tell.send(found)));
            }
        });
        Self { jobs, found, current: Cancellation::default() }
    }

    /// Estimates a design instead of the one before.
    pub(super) fn estimate(&mut self, job: Job) {
        self.current.cancel();
        self.current = Cancellation::default();
        // The thread ends only with this sender.
        let _ = self.jobs.send((job, self.current.clone()));
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.current.cancel();
    }
}
