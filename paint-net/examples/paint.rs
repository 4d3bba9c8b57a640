//! Paints a picture by the network with its shipped weights, and writes what is wanted beside what is painted.

use std::io::Write;

use paint_net::metrics::psnr;
use paint_net::{Image, paint};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Ink from 0 (bare wall) to 1: a disc that fades to its edge, with a ring around it.
    let wanted = Image::from_fn(96, 96, |x, y| {
        let r = (x as f64 - 47.5).hypot(y as f64 - 47.5);
        if r < 24.0 { 0.8 - 0.02 * r } else { 0.7 * (-((r - 36.0) / 4.0).powi(2)).exp() }
    });
    let painting = paint(&wanted)?;
    let likeness = psnr(&painting.ink, &wanted, None)?;
    println!("{} sprays, {likeness:.1} dB", painting.sprays.len());
    assert!(likeness > 30.0);

    let path = std::env::temp_dir().join("painting.pgm");
    let mut file = std::fs::File::create(&path)?;
    writeln!(file, "P5 192 96 255")?;
    for y in 0..96 {
        let row = |image: &Image| (0..96).map(|x| (255.0 * (1.0 - image.at(x, y))) as u8).collect::<Vec<_>>();
        file.write_all(&[row(&wanted), row(&painting.ink)].concat())?;
    }
    println!("{}", path.display());
    Ok(())
}
