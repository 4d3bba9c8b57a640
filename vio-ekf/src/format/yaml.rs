//! As much YAML as calibration files are written in: nested keys, numbers, words, and lists of them.
//!
//! A document becomes a table from dotted keys to the words of their values; nested lists are flattened, which loses
//! nothing where every list has a known length.

use crate::Error;

const FORMAT: &str = "calibration";

/// Keys in the order of the file.
pub(super) struct Document {
    entries: Vec<Entry>,
}

struct Entry {
    key: String,
    line: usize,
    words: Vec<String>,
}

impl Document {
    pub(super) fn read(text: &str) -> Result<Self, Error> {
        let mut entries: Vec<Entry> = Vec::new();
        // Indentation and length of the key of each level that is open.
        let mut open: Vec<(usize, String)> = Vec::new();
        let mut brackets = 0_i32;
        for (index, raw) in text.trim_start_matches('\u{feff}').lines().enumerate() {
            let line = index + 1;
            // A comment starts at the line's start or after a space: the name of a topic may hold the sign.
            let content = raw.find(" #").map_or(raw, |at| &raw[..at]);
            let trimmed = content.trim();
            if trimmed.is_empty() || trimmed.starts_with(['#', '%']) || trimmed == "---" || trimmed == "..." {
                continue;
            }
            let refuse = |what: &str| Error::Line { format: FORMAT, line, what: what.into() };
            let mut value = trimmed;
            if brackets == 0 && !trimmed.starts_with('-') {
                let (key, rest) = trimmed.split_once(':').ok_or_else(|| refuse("expected `key: value`"))?;
                let indentation = content.len() - content.trim_start().len();
                open.retain(|(level, _)| *level < indentation);
                let parent = open.last().map_or(String::new(), |(_, key)| format!("{key}."));
                let key = parent + key.trim().trim_matches(['"', '\'']);
                open.push((indentation, key.clone()));
                entries.push(Entry { key, line, words: Vec::new() });
                value = rest;
            } else if brackets == 0 {
                value = trimmed.trim_start_matches('-');
            }
            let Some(entry) = entries.last_mut() else { return Err(refuse("a list without a key")) };
            let count = |c: char| value.matches(c).count() as i32;
            brackets += count('[') - count(']');
            if brackets < 0 {
                return Err(refuse("a bracket is closed that was not opened"));
            }
            let words = value.split(['[', ']', ',', ' ', '\t', '"', '\'']);
            entry.words.extend(words.filter(|word| !word.is_empty()).map(str::to_owned));
        }
        if brackets > 0 {
            let line = entries.last().map_or(0, |entry| entry.line);
            return Err(Error::Line { format: FORMAT, line, what: "a list is not closed".into() });
        }
        Ok(Self { entries })
    }

    /// Keys without a dot.
    pub(super) fn top(&self) -> impl Iterator<Item = &str> {
        self.entries.iter().map(|entry| entry.key.as_str()).filter(|key| !key.contains('.'))
    }

    fn entry(&self, key: &str) -> Option<&Entry> {
        self.entries.iter().find(|entry| entry.key == key)
    }

    pub(super) fn word(&self, key: &str) -> Result<&str, Error> {
        match self.entry(key).map(|entry| entry.words.as_slice()) {
            Some([word]) => Ok(word),
            Some(_) => Err(self.refuse(key, "expected one word")),
            None => Err(self.refuse(key, "is missing")),
        }
    }

    /// Exactly `N` finite numbers.
    pub(super) fn numbers<const N: usize>(&self, key: &str) -> Result<[f64; N], Error> {
        let entry = self.entry(key).ok_or_else(|| self.refuse(key, "is missing"))?;
        let mut out = [0.0; N];
        if entry.words.len() != N {
            return Err(self.refuse(key, &format!("expected {N} numbers, found {}", entry.words.len())));
        }
        for (value, word) in out.iter_mut().zip(&entry.words) {
            *value = match word.parse::<f64>() {
                Ok(number) if number.is_finite() => number,
                _ => return Err(self.refuse(key, &format!("`{word}` is not a finite number"))),
            };
        }
        Ok(out)
    }

    /// One number, if the key is there.
    pub(super) fn optional(&self, key: &str) -> Result<Option<f64>, Error> {
        self.entry(key).map(|_| self.numbers::<1>(key).map(|[value]| value)).transpose()
    }

    pub(super) fn has(&self, key: &str) -> bool {
        self.entry(key).is_some()
    }

    pub(super) fn refuse(&self, key: &str, what: &str) -> Error {
        let line = self.entry(key).map_or(0, |entry| entry.line);
        Error::Line { format: FORMAT, line, what: format!("`{key}`: {what}") }
    }
}
