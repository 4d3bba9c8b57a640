//! Paints a surface end to end.
fn main() {}
