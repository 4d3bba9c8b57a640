//! What goes wrong anywhere.

pub(crate) type AnyError = Box<dyn std::error::Error + Send + Sync>;
