//! Files of a mission: whole, or an error that names them.

use std::path::Path;

use super::error::MissionError;
use crate::whole_file;

pub(super) fn write(path: &Path, text: &str) -> Result<(), MissionError> {
    whole_file::write(path, text).map_err(unwritable(path))
}

pub(super) fn unwritable(path: &Path) -> impl FnOnce(std::io::Error) -> MissionError {
    let path = path.display().to_string();
    |source| MissionError::Unwritable { path, source }
}
