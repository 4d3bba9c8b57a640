//! Files in and out.

use std::path::{Path, PathBuf};

use paint_net::thesis::Network;
use serde::Serialize;

use super::error::PaintImageError;

use crate::whole_file;

/// Memory that painting takes for every pixel, bytes: measured with the painter that takes most (pictures of 1 and 4 million pixels).
const BYTES_PER_PIXEL: f64 = 140.0;
/// The same in colours.
const BYTES_PER_PIXEL_IN_COLOURS: f64 = 420.0;

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

/// Refuses a picture that would need more memory than allowed, by the size in its header: before it is decoded, since nothing could be said afterwards.
pub(super) fn check_memory(path: &Path, in_colours: bool, limit_gib: f64) -> Result<(), PaintImageError> {
    let reader = image::ImageReader::open(path).and_then(image::ImageReader::with_guessed_format);
    // What is no picture is refused where it is read.
    let Some((width, height)) = reader.ok().and_then(|reader| reader.into_dimensions().ok()) else { return Ok(()) };
    let each = if in_colours { BYTES_PER_PIXEL_IN_COLOURS } else { BYTES_PER_PIXEL };
    let need_gib = each * f64::from(width) * f64::from(height) / f64::from(1 << 30);
    if need_gib > limit_gib {
        let path = path.display().to_string();
        return Err(PaintImageError::TooLarge { path, width, height, need_gib, limit_gib });
    }
    Ok(())
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
