//! What the crate promises, seen from outside. `own_*`: what the trait asks of whoever brings his own.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking")]

mod atlas;
mod common;
mod cuts;
mod data;
mod disk;
mod examples;
mod mapping;
mod min_area_rectangle;
mod own_parametrizer;
mod region;
mod unwrap;
