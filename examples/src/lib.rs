//! The adapters between the PaintCopter crates, and what the binaries share.
