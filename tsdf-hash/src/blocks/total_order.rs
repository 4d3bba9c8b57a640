//! Times and distances as keys of a sort.

/// Finite numbers in their order.
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct TotalOrder(pub(crate) f64);

impl Eq for TotalOrder {}

impl Ord for TotalOrder {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for TotalOrder {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
