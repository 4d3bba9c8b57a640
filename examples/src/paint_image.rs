//! The job of `paint-image`: a picture in, sprays and figures out.

mod colour;
mod command_line;
mod commands;
mod compare;
mod cpu_timer;
mod equal_sprays;
mod job;
mod progress_strip;
mod run;
mod training;

use std::path::{Path, PathBuf};

use paint_net::thesis::Network;
use paint_net::{Error, Image, metrics};
use serde::Serialize;

use crate::pictures::{PictureError, Rgb};

pub use colour::{ColourFigures, Glazes, compare_colours, read_picture};
pub use command_line::Arguments;
pub use commands::NOZZLE_SPEED;
pub use compare::{Row, compare, table};
pub use equal_sprays::{EqualSprays, equal_sprays, print_equal_sprays};
pub use job::{Figures, Job, PainterKind};
pub use run::run;
pub use training::{ThesisTrainingRun, TrainingImages, TrainingRun, train_painter, train_thesis};

/// What is wrong with painting a picture.
#[derive(Debug, thiserror::Error)]
pub enum PaintImageError {
    /// The file is not a picture that can be painted.
    #[error("{path}: {why}; give a PNG or JPEG file")]
    Unreadable {
        /// The file.
        path: String,
        /// Why.
        why: String,
    },
    /// The painter refused.
    #[error("{0}")]
    Painter(#[from] Error),
    /// What was asked for does not go together.
    #[error("{0}")]
    Settings(String),
    /// A result could not be drawn or written.
    #[error("{0}")]
    Picture(#[from] PictureError),
    /// A file could not be written or read.
    #[error("{path}: {why}")]
    File {
        /// The file.
        path: String,
        /// What the system said.
        why: String,
    },
    /// A figure is not finite.
    #[error("{0}: a figure is not finite, the result is not usable")]
    NotFinite(&'static str),
}

/// Reads a picture of any size and depth as ink: dark is paint, transparency shows the white wall.
pub fn read_ink(path: &Path) -> Result<Image, PaintImageError> {
    let unreadable = |why: String| PaintImageError::Unreadable { path: path.display().to_string(), why };
    let picture = image::open(path).map_err(|e| unreadable(format!("cannot be read as a picture ({e})")))?;
    let rgba = picture.to_rgba32f();
    let ink = rgba.pixels().map(|p| {
        let [r, g, b, a] = p.0.map(f64::from);
        a.clamp(0.0, 1.0) * ink_of([r, g, b])
    });
    Image::new(rgba.width() as usize, rgba.height() as usize, ink.collect()).map_err(|e| unreadable(e.to_string()))
}

/// The thesis' network of a file.
fn read_network(path: &Path) -> Result<Network, PaintImageError> {
    let file_error = |why: String| PaintImageError::File { path: path.display().to_string(), why };
    let bytes = std::fs::read(path).map_err(|e| file_error(format!("cannot be read ({e})")))?;
    Network::from_safetensors(&bytes).map_err(|e| file_error(e.to_string()))
}

/// The ink that looks as dark as a colour: 1 less its luma, the weights of BT.709 on values as stored.
fn ink_of([r, g, b]: [f64; 3]) -> f64 {
    // 0.2126 + 0.7152 + 0.0722 is 1 only up to rounding.
    (1.0 - (0.2126 * r + 0.7152 * g + 0.0722 * b)).clamp(0.0, 1.0)
}

/// Structural similarity; 0 for pictures smaller than its window, which have none.
fn ssim(ink: &Image, wanted: &Image) -> Result<f64, Error> {
    if wanted.width().min(wanted.height()) < 7 { Ok(0.0) } else { metrics::ssim(ink, wanted, None) }
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

/// Mean CIEDE2000 between two pictures of ink, shown as the greys of sRGB.
fn colour_difference(ink: &Image, wanted: &Image) -> f64 {
    // The lightness of every grey level once; differences below a level do not show.
    let lightness: Vec<f64> = (0..=u8::MAX)
        .map(|level| {
            let y = paint_sim::colour::decode_srgb8(level);
            if y > 216.0 / 24389.0 { 116.0 * y.cbrt() - 16.0 } else { y * 24389.0 / 27.0 }
        })
        .collect();
    let lab = |ink: f64| [lightness[usize::from(level(ink))], 0.0, 0.0];
    let pairs = ink.data().iter().zip(wanted.data());
    pairs.map(|(&a, &b)| paint_sim::ciede2000(lab(a), lab(b))).sum::<f64>() / ink.data().len() as f64
}

fn level(ink: f64) -> u8 {
    (255.0 * (1.0 - ink.clamp(0.0, 1.0))).round() as u8
}

fn grey(ink: &Image) -> Rgb {
    Rgb::from_pixels(ink.width(), ink.height(), ink.data().iter().map(|&a| [level(a); 3]))
}

/// White where right, red where too light, blue where too dark; full colour at an error of a quarter.
fn error_map(ink: &Image, wanted: &Image) -> Rgb {
    let colour = |(a, y): (&f64, &f64)| {
        let error = ((a - y) / 0.25).clamp(-1.0, 1.0);
        let fade = (255.0 * (1.0 - error.abs())).round() as u8;
        if error < 0.0 { [255, fade, fade] } else { [fade, fade, 255] }
    };
    Rgb::from_pixels(ink.width(), ink.height(), ink.data().iter().zip(wanted.data()).map(colour))
}

pub(crate) fn write_json(path: &Path, value: &impl Serialize) -> Result<(), PaintImageError> {
    let failed = |why: String| PaintImageError::File { path: path.display().to_string(), why };
    let text = serde_json::to_string(value).map_err(|e| failed(e.to_string()))?;
    write_text(path, &(text + "\n"))
}

fn write_text(path: &Path, text: &str) -> Result<(), PaintImageError> {
    let failed = |why: String| PaintImageError::File { path: path.display().to_string(), why };
    std::fs::write(path, text).map_err(|e| failed(format!("cannot be written ({e})")))
}
