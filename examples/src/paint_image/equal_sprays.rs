//! The thesis' network beside other painters at the same number of sprays.

use std::path::Path;

use paint_net::painters::FreeSprays;
use paint_net::procedural::Texture;
use paint_net::thesis::ThesisPainter;
use paint_net::{Feedback, Image, Limits, PaintProblem, Painter, SprayKernel, metrics};

use super::error::PaintImageError;
use super::files::read_network;

/// Side of the built-in textures, pixels, and their seed.
const SIDE: usize = 128;
const TEXTURE_SEED: u64 = 1000;

/// Two painters beside the thesis' network, on one picture, none with more sprays than that.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EqualSprays {
    /// Sprays of the thesis' network.
    pub sprays: usize,
    /// PSNR of the thesis' network, dB.
    pub thesis_db: f64,
    /// PSNR of the feedback painter, dB.
    pub feedback_db: f64,
    /// PSNR of free sprays, dB.
    pub free_sprays_db: f64,
}

/// A built-in texture, as the painters are compared on it.
pub fn texture_picture(texture: Texture) -> Image {
    texture.image(TEXTURE_SEED, SIDE)
}

/// Paints every picture with the network of a file, or the shipped one, and with the others at its number of sprays. All have one nozzle: σ = 2 px,
/// cut at 4 σ; the thesis' network chooses its spreads itself.
pub fn equal_sprays(weights: Option<&Path>, pictures: &[Image]) -> Result<Vec<EqualSprays>, PaintImageError> {
    let thesis = match weights {
        Some(file) => ThesisPainter::new(read_network(file)?),
        None => ThesisPainter::shipped()?,
    };
    let (feedback, free_sprays) = (Feedback::shipped()?, FreeSprays { sprays: 1_000_000, ..FreeSprays::default() });
    let kernel = SprayKernel::new(2.0, 4.0)?;
    pictures
        .iter()
        .map(|wanted| {
            let paint = |painter: &dyn Painter, limits: &Limits| -> Result<(usize, f64), PaintImageError> {
                let painting = painter.paint(&PaintProblem::new(wanted).with_kernel(&kernel).with_limits(limits))?;
                Ok((painting.sprays.len(), metrics::psnr(&painting.ink, wanted, None)?))
            };
            let (sprays, thesis_db) = paint(&thesis, &Limits::default())?;
            let as_many = Limits { max_sprays: Some(sprays), ..Limits::default() };
            let (_, feedback_db) = paint(&feedback, &as_many)?;
            let (_, free_sprays_db) = paint(&free_sprays, &as_many)?;
            Ok(EqualSprays { sprays, thesis_db, feedback_db, free_sprays_db })
        })
        .collect()
}

/// A table for people, with the means last.
pub fn print_equal_sprays(rows: &[EqualSprays]) -> String {
    let count = rows.len().max(1) as f64;
    let mean = |of: &dyn Fn(&EqualSprays) -> f64| rows.iter().map(of).sum::<f64>() / count;
    let line = |name: &str, sprays: f64, [thesis, feedback, free]: [f64; 3]| {
        format!("{name:8} {sprays:8.0} {thesis:11.2} {feedback:13.2} {free:17.2}\n")
    };
    let head = "picture    sprays  thesis, dB  feedback, dB  free sprays, dB\n".to_string();
    let numbered = rows.iter().enumerate();
    let body: String = numbered
        .map(|(k, r)| line(&(k + 1).to_string(), r.sprays as f64, [r.thesis_db, r.feedback_db, r.free_sprays_db]))
        .collect();
    let means = [mean(&|r| r.thesis_db), mean(&|r| r.feedback_db), mean(&|r| r.free_sprays_db)];
    head + &body + &line("mean", mean(&|r| r.sprays as f64), means)
}
