//! The same picture by several painters, on a primed wall and with limits: what a better likeness costs in sprays.

use paint_net::metrics::{psnr, ssim};
use paint_net::painters::{Centrelines, MatchingPursuit, SlewLimited};
use paint_net::{Deconvolution, Error, Feedback, Image, Limits, PaintProblem, Painter, SprayKernel};

/// The painters, each with its likeness in decibels and the number of its sprays.
pub(crate) fn compare() -> Result<Vec<(&'static str, f64, usize)>, Error> {
    let wanted = Image::from_fn(64, 64, |x, y| 0.4 + 0.3 * (0.2 * x as f64).sin() * (0.1 * y as f64).cos());
    let (primed, kernel) = (Image::filled(64, 64, 0.05), SprayKernel::new(2.0, 3.5)?);
    let limits = Limits { row_spacing: 3, max_volume: 0.8, ..Limits::default() };
    let problem = PaintProblem::new(&wanted).with_canvas(&primed).with_kernel(&kernel).with_limits(&limits);
    let painters: [(&str, Box<dyn Painter>); 5] = [
        ("network", Box::new(Feedback::shipped()?)),
        ("deconvolution", Box::new(Deconvolution::default())),
        ("centrelines", Box::new(Centrelines::default())),
        ("matching pursuit", Box::new(MatchingPursuit::default())),
        ("network with a slow valve", Box::new(SlewLimited::new(Feedback::shipped()?, 0.05))),
    ];
    let mut rows = Vec::new();
    for (name, painter) in painters {
        let painting = painter.paint(&problem)?;
        let likeness = psnr(&painting.ink, &wanted, None)?;
        println!(
            "{name}: {likeness:.1} dB, SSIM {:.3}, {} sprays",
            ssim(&painting.ink, &wanted, None)?,
            painting.sprays.len()
        );
        rows.push((name, likeness, painting.sprays.len()));
    }
    Ok(rows)
}

fn main() -> Result<(), Error> {
    compare()?;
    Ok(())
}
