//! Spans of the main steps, and events for what is dropped, refused or decided, for subscribers of `tracing`. Without the feature of
//! that name nothing of it is compiled.

/// Opens a span that lasts until the end of the block.
macro_rules! span {
    ($name:literal) => {
        #[cfg(feature = "tracing")]
        let _span = tracing::debug_span!($name).entered();
    };
}

/// Tells of something: the level, then as the macros of `tracing` have it.
macro_rules! event {
    ($level:ident, $($what:tt)+) => {
        #[cfg(feature = "tracing")]
        tracing::$level!($($what)+);
    };
}

pub(crate) use {event, span};
