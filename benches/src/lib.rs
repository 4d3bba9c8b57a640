//! Criterion benches live in `benches/`; this library holds the scenes they share.
