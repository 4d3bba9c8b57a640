//! The job of `paint-image`: a picture in, sprays and figures out.

mod clock;
mod colour;
mod commands;
mod compare;
mod equal_sprays;
mod learn;

use std::path::{Path, PathBuf};

use paint_net::{
    Coats, Deconvolution, Error, Feedback, FreeSplats, Image, Layered, Limits, MatchingPursuit, Painter, Painting,
    Route, Saturation, SlewLimited, SprayKernel, Task, metrics, slew_violations,
};
use serde::Serialize;

use self::clock::Clock;
use crate::pictures::{PictureError, Rgb};

pub use colour::{ColourFigures, Glazes, compare_colours, read_picture};
pub use commands::NOZZLE_SPEED;
pub use compare::{Row, compare, table};
pub use equal_sprays::{EqualSprays, equal_sprays, print_equal_sprays};
pub use learn::{Lesson, Pictures, ThesisLesson, learn, learn_thesis};

/// Who decides the sprays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Choice {
    /// The network that looks at its canvas.
    Feedback,
    /// The same in three coats, each of which stays on the wall.
    Coats,
    /// Projected L-BFGS.
    Deconvolution,
    /// Greedy matching pursuit.
    Pursuit,
    /// Few sprays at free places, of free spreads.
    Splats,
}

impl Choice {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Feedback, Self::Coats, Self::Deconvolution, Self::Pursuit, Self::Splats];
}

/// How a picture is painted.
#[derive(Debug, Clone)]
pub struct Job {
    /// Who decides.
    pub painter: Choice,
    /// Looks of the network at its canvas.
    pub passes: usize,
    /// The nozzle, pixels.
    pub kernel: SprayKernel,
    /// Where sprays may lie.
    pub limits: Limits,
    /// Largest change of volume from one cell of the path to the next; `None` for any.
    pub largest_change: Option<f64>,
    /// The path for which that holds.
    pub route: Route,
    /// Whether to paint in layers, a base coat first (thesis, Paper IV, section 3.2).
    pub layers: bool,
    /// Threads of the network.
    pub threads: usize,
}

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

/// The figures of one picture; flat, units in the names.
#[derive(Debug, Clone, Serialize)]
pub struct Figures {
    /// Name of the painter.
    pub painter: &'static str,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Peak signal-to-noise ratio of the ink.
    pub psnr_db: f64,
    /// Structural similarity, 7x7 window; pictures smaller than the window have none, which is given as 0.
    pub ssim: f64,
    /// Cross-entropy.
    pub bce_nats_per_px: f64,
    /// Mean colour difference, ink taken as the grey values of sRGB.
    pub ciede2000_mean: f64,
    /// Number of sprays.
    pub sprays: usize,
    /// Looks of the network; 0 for painters that have none.
    pub passes: usize,
    /// Places on the path where the volume changes faster than was allowed; 0 if any change is allowed.
    pub slew_violations: usize,
    /// Sum of the volumes.
    pub volume_total: f64,
    /// CPU time of deciding on one thread, wall time on several.
    pub cpu_ms: f64,
    /// Threads.
    pub threads: usize,
}

impl Job {
    /// The painter that was chosen.
    pub fn painter(&self) -> Result<Box<dyn Painter>, Error> {
        let feedback = || Feedback::shipped().map(|f| Feedback { passes: self.passes, threads: self.threads, ..f });
        let painter: Box<dyn Painter> = match self.painter {
            Choice::Feedback => Box::new(feedback()?),
            Choice::Coats => Box::new(Coats::new(feedback()?)),
            Choice::Deconvolution => Box::new(Deconvolution::default()),
            Choice::Pursuit => Box::new(MatchingPursuit::default()),
            Choice::Splats => Box::new(FreeSplats {
                sprays: self.limits.max_sprays.unwrap_or(FreeSplats::default().sprays),
                ..FreeSplats::default()
            }),
        };
        Ok(if self.layers { Box::new(Layered::new(painter)) } else { painter })
    }

    /// Decides the sprays for a wanted picture of ink.
    pub fn paint(&self, wanted: &Image, progress: &mut dyn FnMut(f64)) -> Result<(Painting, Figures), PaintImageError> {
        let painter = self.painter()?;
        let name = painter.name();
        let clock = Clock::start(self.threads);
        let task = Task::on_bare_wall(wanted);
        let (kernel, ink, limits) = (&self.kernel, &Saturation::Tanh, &self.limits);
        let (painting, slew_violations) = match self.largest_change {
            None => (painter.paint(&task, kernel, ink, limits, progress)?, 0),
            Some(most) => {
                let slow = SlewLimited { route: self.route, ..SlewLimited::new(painter, most) };
                let (waypoints, painting) = slow.fly(&task, kernel, ink, limits, progress)?;
                (painting, slew_violations(&waypoints, most))
            }
        };
        let cpu_ms = clock.milliseconds();
        let passes = match self.painter {
            Choice::Feedback | Choice::Coats => self.passes,
            Choice::Deconvolution | Choice::Pursuit | Choice::Splats => 0,
        };
        let figures = Figures {
            painter: name,
            width: wanted.width(),
            height: wanted.height(),
            psnr_db: metrics::psnr(&painting.ink, wanted, None)?,
            ssim: ssim(&painting.ink, wanted)?,
            bce_nats_per_px: metrics::binary_cross_entropy(&painting.ink, wanted)?,
            ciede2000_mean: colour_difference(&painting.ink, wanted),
            sprays: painting.sprays.len(),
            passes,
            slew_violations,
            volume_total: painting.sprays.iter().map(|s| s.volume).sum(),
            cpu_ms,
            threads: self.threads,
        };
        let numbers = [figures.psnr_db, figures.ssim, figures.bce_nats_per_px, figures.ciede2000_mean, cpu_ms];
        if numbers.iter().any(|f| !f.is_finite()) {
            return Err(PaintImageError::NotFinite("report"));
        }
        Ok((painting, figures))
    }

    /// Writes `commands.json`, `commands.mcap`, `rendered.png`, `error.png` and `report.json`.
    pub fn save(
        &self,
        folder: &Path,
        wanted: &Image,
        painting: &Painting,
        figures: &Figures,
    ) -> Result<(), PaintImageError> {
        let model = serde_json::json!({
            "ink": "tanh(sum of volume * exp(-d^2 / (2 sigma_px^2)))", "cut_sigma": self.kernel.cut(),
            "footprint": "pixels no more than cut_sigma * sigma_px away along each axis",
        });
        let sprays: Vec<_> = commands::commands(&painting.sprays, 0).collect();
        commands::save(folder, (wanted.width(), wanted.height()), &model, &["black"], &sprays)?;
        write_json(&folder.join("report.json"), figures)?;
        grey(&painting.ink).save(&folder.join("rendered.png"))?;
        error_map(&painting.ink, wanted).save(&folder.join("error.png"))?;
        Ok(())
    }
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
