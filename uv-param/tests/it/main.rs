//! What the crate promises, seen from outside.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking")]

mod atlas;
mod common;
mod cuts;
mod data;
mod disk;
mod mapping;
mod min_area_rectangle;
mod own_parametrizer;
mod unwrap;
