//! Fewer charts and cheaper seams: charts are merged as long as what they make keeps the bounds.

pub(in crate::atlas) mod merge_charts;
pub(in crate::atlas) mod merge_small;
pub(in crate::atlas) mod ruin_and_recreate;
