//! What is wrong at which place of a mesh file.

/// A fault at a place in a file, before the path is known.
pub(super) struct Fault {
    pub(super) place: String,
    pub(super) what: String,
}

impl Fault {
    pub(super) fn at_line(line: usize, what: impl Into<String>) -> Self {
        Self { place: format!("line {line}"), what: what.into() }
    }
}

/// Parses the next number of a line.
pub(super) fn number<'a, T: std::str::FromStr>(
    words: &mut impl Iterator<Item = &'a str>,
    line: usize,
    what: &str,
) -> Result<T, Fault> {
    let word = words.next().ok_or_else(|| Fault::at_line(line, format!("{what} is missing")))?;
    word.parse().map_err(|_| Fault::at_line(line, format!("{what} \"{word}\" is not a number of the expected kind")))
}
