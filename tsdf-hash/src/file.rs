//! A map as one file.

mod blocks;

pub(crate) use blocks::{BlockFile, Entry};
