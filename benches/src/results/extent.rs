//! The whole of a rerun, or enough to see that it runs.

/// How much is rerun.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// All that the book shows.
    Whole,
    /// As little as tells that each part still runs.
    Quick,
}
