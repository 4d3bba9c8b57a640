//! A picture in several paints.

use std::path::Path;

use clap::ValueEnum;
use paint_net::colour::{ColourImage, ColourPainting, ColourProblem, ColourSeparation, Paint, Palette};
use paint_net::{Error, Image, Spray, metrics};
use paint_sim::colour::lab;
use serde::Serialize;

use super::commands;
use super::cpu_timer::CpuTimer;
use super::error::PaintImageError;
use super::files::write_json;
use super::ink::{ink_of, ssim};
use super::job::Job;
use super::progress_sheet::save_progress_sheet;
use crate::picture_file::open_upright;
use crate::pictures::{COLOUR_DIFFERENCE, Rgb, save_error_map};
use crate::report::check_finite;

/// Which glazes are in the guns, on a white wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Glazes {
    /// Cyan, magenta, yellow.
    Cmy,
    /// The same and black.
    Cmyk,
    /// The same, red and green.
    Six,
}

impl Glazes {
    /// The palette; what unit depth over white looks like is that of the peers (`paint_baselines.py colour`).
    pub fn palette(self) -> Result<Palette, PaintImageError> {
        let all = [
            ("cyan", [0.04, 0.52, 0.75]),
            ("magenta", [0.75, 0.04, 0.35]),
            ("yellow", [0.92, 0.85, 0.05]),
            ("black", [0.06; 3]),
            ("red", [0.8, 0.15, 0.05]),
            ("green", [0.1, 0.45, 0.15]),
        ];
        let count = match self {
            Self::Cmy => 3,
            Self::Cmyk => 4,
            Self::Six => 6,
        };
        let paints = all[..count].iter().map(|(name, colour)| Paint::glaze(name, *colour)).collect();
        Ok(Palette::new([1.0; 3], paints)?)
    }
}

/// The figures of one picture in colour; flat, units in the names.
#[derive(Debug, Clone, Serialize)]
pub struct ColourFigures {
    /// Name of the painter.
    pub painter: &'static str,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Peak signal-to-noise ratio over the stored values of all three bands.
    pub psnr_db: f64,
    /// Structural similarity, 7x7 window, of the ink that a painting in black would be measured by (1 less the luma); 0 for
    /// pictures smaller than the window.
    pub ssim: f64,
    /// Cross-entropy of the same ink.
    pub bce_nats_per_px: f64,
    /// Mean colour difference.
    pub ciede2000_mean: f64,
    /// The colour difference that 5 % of the pixels exceed.
    pub ciede2000_p95: f64,
    /// Number of sprays, all paints.
    pub sprays: usize,
    /// Number of paints.
    pub paints: usize,
    /// Sum of the volumes.
    pub volume_total: f64,
    /// CPU time of deciding on one thread.
    pub cpu_ms: f64,
    /// Threads.
    pub threads: usize,
}

/// Reads a picture of any size and depth; transparency shows the white wall.
pub fn read_picture(path: &Path) -> Result<ColourImage, PaintImageError> {
    let unreadable = |why: String| PaintImageError::Unreadable { path: path.display().to_string(), why };
    let picture =
        open_upright(path).map_err(|e| unreadable(format!("cannot be read as a picture ({e})")))?.to_rgba32f();
    let over_white = |p: &image::Rgba<f32>| {
        let [r, g, b, a] = p.0.map(f64::from);
        [r, g, b].map(|v| (a * v + 1.0 - a).clamp(0.0, 1.0))
    };
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    ColourImage::new(width, height, picture.pixels().map(over_white).collect()).map_err(|e| unreadable(e.to_string()))
}

/// Peak signal-to-noise ratio, and mean and 95th percentile of CIEDE2000; both pictures in sRGB as stored.
pub fn compare_colours(painted: &ColourImage, wanted: &ColourImage) -> (f64, f64, f64) {
    let pairs = painted.data().iter().zip(wanted.data());
    let squared: f64 = pairs.flat_map(|(a, b)| a.iter().zip(b)).map(|(a, b)| (a - b).powi(2)).sum();
    let mut differences = differences(painted, wanted);
    let mean = differences.iter().sum::<f64>() / differences.len() as f64;
    differences.sort_unstable_by(f64::total_cmp);
    let p95 = differences[(0.95 * (differences.len() - 1) as f64) as usize];
    (-10.0 * (squared / (3 * differences.len()) as f64 + 1e-20).log10(), mean, p95)
}

fn byte(stored: f64) -> u8 {
    (255.0 * stored.clamp(0.0, 1.0)).round() as u8
}

fn rgb(picture: &ColourImage) -> Rgb {
    Rgb::from_pixels(picture.width(), picture.height(), picture.data().iter().map(|c| c.map(byte)))
}

/// CIEDE2000 of every pixel.
fn differences(painted: &ColourImage, wanted: &ColourImage) -> Vec<f64> {
    let pairs = painted.data().iter().zip(wanted.data());
    pairs.map(|(a, b)| paint_sim::colour::ciede2000(lab_of(*a), lab_of(*b))).collect()
}

fn ink(picture: &ColourImage) -> Result<Image, Error> {
    Image::new(picture.width(), picture.height(), picture.data().iter().map(|c| ink_of(*c)).collect())
}

/// Stored sRGB to Lab (IEC 61966-2-1, D65).
fn lab_of(stored: [f64; 3]) -> [f64; 3] {
    let [r, g, b] = stored.map(|v| if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) });
    let xyz = [
        0.4124564 * r + 0.3575761 * g + 0.1804375 * b,
        0.2126729 * r + 0.7151522 * g + 0.0721750 * b,
        0.0193339 * r + 0.1191920 * g + 0.9503041 * b,
    ];
    lab(xyz, [0.95047, 1.0, 1.08883])
}

/// Decides the sprays of every paint for a wanted picture.
pub fn paint_colours(
    job: &Job,
    wanted: &ColourImage,
    palette: &Palette,
    progress: &mut dyn FnMut(f64),
) -> Result<(ColourPainting, ColourFigures), PaintImageError> {
    let timer = CpuTimer::start(1);
    let problem = ColourProblem::new(wanted, palette).with_kernel(&job.kernel).with_limits(&job.limits);
    let painting = ColourSeparation::default().paint_observed(&problem, &mut |share| progress(share))?;
    let cpu_ms = timer.milliseconds();
    let (psnr_db, ciede2000_mean, ciede2000_p95) = compare_colours(&painting.image, wanted);
    let (painted_ink, wanted_ink) = (ink(&painting.image)?, ink(wanted)?);
    let figures = ColourFigures {
        painter: "coloured",
        width: wanted.width(),
        height: wanted.height(),
        psnr_db,
        ssim: ssim(&painted_ink, &wanted_ink)?,
        bce_nats_per_px: metrics::binary_cross_entropy(&painted_ink, &wanted_ink)?,
        ciede2000_mean,
        ciede2000_p95,
        sprays: painting.sprays.iter().map(Vec::len).sum(),
        paints: palette.paints().len(),
        volume_total: painting.sprays.iter().flatten().map(|s| s.volume).sum(),
        cpu_ms,
        threads: 1,
    };
    check_finite(&figures)?;
    Ok((painting, figures))
}

/// Writes `commands.json`, `commands.mcap`, `rendered.png`, `error.png` (CIEDE2000 of every pixel), `progress.png` and
/// `report.json`.
pub fn save_colours(
    job: &Job,
    folder: &Path,
    wanted: &ColourImage,
    palette: &Palette,
    painting: &ColourPainting,
    figures: &ColourFigures,
) -> Result<(), PaintImageError> {
    // Paint by paint: a nozzle is washed as seldom as can be, and wet paints mix in any order.
    let of_paint = |(paint, sprays): (usize, &Vec<Spray>)| commands::commands(sprays, paint).collect::<Vec<_>>();
    let sprays: Vec<_> = painting.sprays.iter().enumerate().flat_map(of_paint).collect();
    let model = serde_json::json!({
        "colour": "Kubelka-Munk film of the depths sum of volume * exp(-d^2 / (2 sigma_px^2)) over the wall",
        "wall": palette.substrate(), "cut_sigma": job.kernel.cut(),
        "absorption": palette.paints().iter().map(|p| p.absorption).collect::<Vec<_>>(),
        "scattering": palette.paints().iter().map(|p| p.scattering).collect::<Vec<_>>(),
    });
    let names: Vec<_> = palette.paints().iter().map(|p| p.name.as_str()).collect();
    commands::save(folder, (figures.width, figures.height), &model, &names, &sprays)?;
    write_json(&folder.join("report.json"), figures)?;
    rgb(&painting.image).save(&folder.join("rendered.png"))?;
    let map: Vec<_> = differences(&painting.image, wanted).into_iter().map(Some).collect();
    save_error_map(&folder.join("error.png"), figures.width, &map, (1.0, "px"), &COLOUR_DIFFERENCE)?;
    let paints: Vec<&[Spray]> = painting.sprays.iter().map(Vec::as_slice).collect();
    let show = |depths: &[f64]| palette.colour(depths).map(byte);
    save_progress_sheet(&folder.join("progress.png"), rgb(wanted), &paints, &job.kernel, &show)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of 100 pixels 10 are black where white is wanted: 100 CIEDE2000 each, and a squared error of one in each channel.
    #[test]
    fn pictures_are_compared_pixel_by_pixel() {
        let picture = |black: usize| {
            let pixels = (0..100).map(|k| if k < black { [0.0; 3] } else { [1.0; 3] }).collect();
            ColourImage::new(10, 10, pixels).unwrap()
        };
        let (psnr, mean, p95) = compare_colours(&picture(10), &picture(0));
        assert!((psnr - 10.0).abs() < 1e-9, "{psnr}");
        assert!((mean - 10.0).abs() < 0.01 && (p95 - 100.0).abs() < 0.1, "{mean} {p95}");
        let (psnr, mean, p95) = compare_colours(&picture(3), &picture(3));
        assert!(psnr > 190.0 && mean == 0.0 && p95 == 0.0, "{psnr} {mean} {p95}");
        assert_eq!(compare_colours(&picture(3), &picture(0)).2, 0.0);
    }
}
