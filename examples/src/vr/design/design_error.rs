//! What is wrong with what the page said: a line for the page.

/// What is wrong with what the page said.
#[derive(Debug, thiserror::Error)]
pub(super) enum DesignError {
    /// It is no message of the protocol.
    #[error("this page and the program do not understand each other ({0}): reload the page")]
    Malformed(String),
    /// A number out of range.
    #[error("{what} {value}: it must be {must_be}")]
    Range {
        /// Which.
        what: &'static str,
        /// The number.
        value: f64,
        /// What is accepted.
        must_be: &'static str,
    },
    /// A name that is none.
    #[error("{0}")]
    Name(String),
    /// A picture that cannot be used.
    #[error("{name}: {why}")]
    Picture {
        /// Its file.
        name: String,
        /// What is wrong, and the way out.
        why: String,
    },
    /// A click on a surface that is not there any more.
    #[error("the surface has changed meanwhile: click again")]
    OldSurface,
    /// More parts than anybody marks by hand.
    #[error("{0} parts stay clean already: undo one, or choose larger ones")]
    TooManyParts(usize),
    /// Nothing to write.
    #[error("there is no picture yet: drop one on the surface, then write the mission")]
    NoPicture,
    /// A file.
    #[error("{path}: cannot be written ({source}): choose another --out")]
    Unwritable {
        /// The file.
        path: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The mission file.
    #[error(transparent)]
    Mission(#[from] crate::mission_file::MissionFileError),
}

impl DesignError {
    pub(super) fn unwritable(path: &std::path::Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        move |source| Self::Unwritable { path: path.display().to_string(), source }
    }
}
