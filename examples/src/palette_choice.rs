//! With which paints a picture in colour is painted.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::paint_set::{NamedPaint, PaintSetError, artists_paints, read_paints};

/// Names of the built-in palettes among the artists' pigments.
const CMYK: [&str; 4] = ["phthalo blue", "quinacridone magenta", "hansa yellow", "carbon black"];
const SIX: [&str; 6] =
    ["titanium white", "carbon black", "hansa yellow", "pyrrole orange", "quinacridone magenta", "phthalo blue"];
/// What lies under the others where the wall is too dark for them.
pub(crate) const UNDERPAINT: &str = "titanium white";

/// The paints of a picture in colour.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum PaletteChoice {
    /// Cyan, magenta, yellow and black.
    Cmyk,
    /// White, black, and four hues.
    Six,
    /// As many as are said, chosen for the picture.
    Spot(usize),
    /// Those of a file.
    File(PathBuf),
}

/// The paints to use, or to choose from.
#[derive(Debug, Clone, PartialEq)]
pub struct PaletteCandidates {
    /// The paints.
    pub paints: Vec<NamedPaint>,
    /// How many to choose; all of them without.
    pub choose: Option<usize>,
    /// What may be laid under them where that helps.
    pub underpaint: Option<NamedPaint>,
}

/// Why there are no paints.
#[derive(Debug, thiserror::Error)]
pub enum PaletteError {
    /// The file of paints.
    #[error(transparent)]
    Set(#[from] PaintSetError),
    /// A built-in paint.
    #[error(transparent)]
    Paint(#[from] paint_sim::Error),
    /// Too many, or too few to choose from.
    #[error("palette {palette}: {why}")]
    Count {
        /// The palette.
        palette: String,
        /// What is wrong.
        why: String,
    },
}

impl PaletteChoice {
    /// The paints; those to choose from are of the file `available`, or the artists' pigments.
    ///
    /// # Errors
    /// A file that cannot be used; more paints than are there, or than a separation can weigh.
    pub fn candidates(&self, available: Option<&Path>) -> Result<PaletteCandidates, PaletteError> {
        let known = match available {
            Some(path) => read_paints(path)?,
            None => artists_paints()?,
        };
        let named = |names: &[&str]| {
            let of = |name: &&str| artists_paints().map(|all| all.into_iter().find(|paint| paint.name == **name));
            names.iter().map(of).filter_map(Result::transpose).collect::<Result<Vec<_>, _>>()
        };
        let (paints, choose) = match self {
            Self::Cmyk => (named(&CMYK)?, None),
            Self::Six => (named(&SIX)?, None),
            Self::Spot(count) => (known, Some(*count)),
            Self::File(path) => (read_paints(path)?, None),
        };
        let wrong = |why: String| PaletteError::Count { palette: self.to_string(), why };
        if choose.is_some_and(|count| count > paints.len()) {
            return Err(wrong(format!("there are {} paints to choose from", paints.len())));
        }
        let most = paint_sim::paint::MOST_FILMS;
        if choose.unwrap_or(paints.len()) > most {
            return Err(wrong(format!("at most {most} paints can lie over each other")));
        }
        let underpaint = if *self == Self::Cmyk { named(&[UNDERPAINT])?.pop() } else { None };
        Ok(PaletteCandidates { paints, choose, underpaint })
    }

    /// The same with its file, if it has one, at another place.
    #[must_use]
    pub fn with_file(self, place: &dyn Fn(PathBuf) -> PathBuf) -> Self {
        match self {
            Self::File(path) => Self::File(place(path)),
            other => other,
        }
    }
}

impl FromStr for PaletteChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            Some(("spot", count)) => {
                let most = paint_sim::paint::MOST_FILMS;
                let count = count.parse().ok().filter(|count| (1..=most).contains(count));
                count.map(Self::Spot).ok_or_else(|| format!("spot: give a number of paints from 1 to {most}"))
            }
            _ if text == "cmyk" => Ok(Self::Cmyk),
            _ if text == "six" => Ok(Self::Six),
            _ if text.is_empty() => Err("give cmyk, six, spot:N or a file of paints".into()),
            _ => Ok(Self::File(text.into())),
        }
    }
}

impl fmt::Display for PaletteChoice {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Cmyk => f.write_str("cmyk"),
            Self::Six => f.write_str("six"),
            Self::Spot(count) => write!(f, "spot:{count}"),
            Self::File(path) => write!(f, "{}", path.display()),
        }
    }
}

impl TryFrom<String> for PaletteChoice {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<PaletteChoice> for String {
    fn from(choice: PaletteChoice) -> Self {
        choice.to_string()
    }
}
