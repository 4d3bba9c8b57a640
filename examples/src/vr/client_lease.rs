//! The one place before the wall: who has it, and who may come back to it.

use std::sync::{Mutex, PoisonError};

/// One person paints at a time.
#[derive(Default)]
pub(super) struct ClientLease(Mutex<LeaseHolder>);

#[derive(Default)]
struct LeaseHolder {
    key: String,
    /// Number of the connection that has the lease; 0 while it is free.
    connection: u64,
    latest: u64,
}

impl ClientLease {
    /// Takes the lease: while another person has it only with that person's key, who has lost the connection. The number of the
    /// connection, and the key to come back with.
    pub(super) fn take(&self, shown: Option<&str>, fresh_key: String) -> Option<(u64, String)> {
        let mut holder = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let returns = shown.is_some_and(|shown| !holder.key.is_empty() && same(shown, &holder.key));
        if holder.connection != 0 && !returns {
            return None;
        }
        holder.latest += 1;
        holder.connection = holder.latest;
        if !returns {
            holder.key = fresh_key;
        }
        Some((holder.connection, holder.key.clone()))
    }

    /// Whether the connection still has the lease.
    pub(super) fn holds(&self, connection: u64) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).connection == connection
    }

    /// Whether nobody has it.
    pub(super) fn is_free(&self) -> bool {
        self.holds(0)
    }

    /// Gives the lease back, unless somebody has come back to it meanwhile.
    pub(super) fn leave(&self, connection: u64) {
        let mut holder = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if holder.connection == connection {
            holder.connection = 0;
        }
    }
}

/// Compares in a time that does not tell how much was right.
pub(super) fn same(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |difference, (a, b)| difference | (a ^ b)) == 0
}
