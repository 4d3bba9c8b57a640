//! What a served page is for.

/// What a served page is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PageKind {
    /// To paint by hand, or to watch.
    Painting,
    /// To design a mission.
    Design,
}

impl PageKind {
    /// Longest message, bytes: half a minute of states, or a picture.
    pub(super) fn longest_message(self) -> usize {
        match self {
            Self::Painting => 1 << 20,
            Self::Design => 64 << 20,
        }
    }
}
