//! Files in and out.

use std::path::{Path, PathBuf};

use paint_net::thesis::Network;
use serde::Serialize;

use super::error::PaintImageError;

use crate::whole_file;

/// The thesis' network of a file.
pub(super) fn read_network(path: &Path) -> Result<Network, PaintImageError> {
    let file_error = |why: String| PaintImageError::File { path: path.display().to_string(), why };
    let bytes = std::fs::read(path).map_err(|e| file_error(format!("cannot be read ({e})")))?;
    Network::from_safetensors(&bytes).map_err(|e| file_error(e.to_string()))
}

/// The pictures of a folder in the order of their names, or the file itself.
pub fn pictures_in(path: &Path) -> Result<Vec<PathBuf>, PaintImageError> {
    let file_error = |why: String| PaintImageError::File { path: path.display().to_string(), why };
    if !path.is_dir() {
        return Ok(vec![path.to_path_buf()]);
    }
    let entries = std::fs::read_dir(path).map_err(|e| file_error(format!("cannot be listed ({e})")))?;
    let is_picture = |p: &PathBuf| {
        let extension = p.extension().map(|e| e.to_string_lossy().to_lowercase());
        extension.is_some_and(|e| ["png", "jpg", "jpeg"].contains(&e.as_str()))
    };
    let mut files: Vec<PathBuf> = entries.flatten().map(|e| e.path()).filter(is_picture).collect();
    files.sort();
    if files.is_empty() {
        return Err(file_error("holds no PNG or JPEG file".to_string()));
    }
    Ok(files)
}

pub(super) fn write_json(path: &Path, value: &impl Serialize) -> Result<(), PaintImageError> {
    let failed = |why: String| PaintImageError::File { path: path.display().to_string(), why };
    let text = serde_json::to_string(value).map_err(|e| failed(e.to_string()))?;
    write_text(path, &(text + "\n"))
}

pub(super) fn write_text(path: &Path, text: &str) -> Result<(), PaintImageError> {
    let failed = |why: String| PaintImageError::File { path: path.display().to_string(), why };
    whole_file::write(path, text).map_err(|e| failed(format!("cannot be written ({e})")))
}
