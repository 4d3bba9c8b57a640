//! How the thesis' network paints, as in its figure 8.8.

use paint_net::thesis::{Network, Step};
use paint_net::{Error, Image, SprayKernel};

use crate::pictures::Rgb;

/// Moments that are shown, beside the wanted picture.
const MOMENTS: usize = 10;
/// Pixels of the rollout picture per pixel of the picture.
const ENLARGED: u32 = 4;
const READ: [u8; 3] = [213, 40, 30];
const SPRAY: [u8; 3] = [0, 150, 70];
const GAP: usize = 2;

/// One row per picture: the wanted ink, then the canvas while it is painted, evenly over the steps that it took, with READ's
/// window in red and the spray in green (two standard deviations each way). `bright`: paint is white on black.
pub(super) fn rollout_picture(network: &Network, pictures: &[Image], bright: bool) -> Result<Rgb, Error> {
    let tasks: Vec<(Image, Option<Image>)> = pictures.iter().map(|p| (p.clone(), None)).collect();
    let side = network.architecture().side;
    let cell = (side + GAP) * ENLARGED as usize;
    let (width, height) = (cell * (MOMENTS + 1), cell * pictures.len());
    let mut strip = Rgb::from_pixels(width, height, (0..width * height).map(|_| [128; 3]));
    for (row, (picture, steps)) in pictures.iter().zip(network.paint(&tasks)?).enumerate() {
        let mut put = |column: usize, ink: &Image, step: Option<&Step>| {
            draw(&mut strip, (column * cell, row * cell), ink, step, bright);
        };
        put(0, picture, None);
        let mut canvas = picture.map(|_| 0.0);
        let mut shown = 0;
        for (t, step) in steps.iter().enumerate() {
            stamp(step, &mut canvas)?;
            // The moment that this step brings about, if any: the last one at the last step.
            while shown < MOMENTS && (t + 1) * MOMENTS >= (shown + 1) * steps.len() {
                shown += 1;
                put(shown, &canvas.map(f64::tanh), Some(step));
            }
        }
    }
    Ok(strip)
}

/// Adds a step's spray, uncut, to a canvas.
pub(super) fn stamp(step: &Step, canvas: &mut Image) -> Result<(), Error> {
    let (x, y) = step.position;
    let spray = paint_net::Spray { x, y, volume: step.volume, sigma: step.sigma };
    SprayKernel::new(step.sigma, 100.0)?.stamp(&spray, canvas);
    Ok(())
}

fn draw(strip: &mut Rgb, (left, top): (usize, usize), ink: &Image, step: Option<&Step>, bright: bool) {
    let shades = ink.data().iter().map(|&a| {
        let level = (255.0 * if bright { a } else { 1.0 - a }).round() as u8;
        [level; 3]
    });
    let mut tile = Rgb::from_pixels(ink.width(), ink.height(), shades).enlarged(ENLARGED);
    if let Some(step) = step {
        let sigma = 2.0 * step.sigma;
        frame(&mut tile, step.window.centre, 0.5 * step.window.extent + step.window.sigma, READ);
        frame(&mut tile, step.position, sigma, SPRAY);
    }
    let (film_width, width) = (strip.width as usize, tile.width as usize);
    for (j, row) in tile.data.chunks_exact(3 * width).enumerate() {
        let at = 3 * ((top + j) * film_width + left);
        strip.data[at..at + row.len()].copy_from_slice(row);
    }
}

/// The border of a square, as far as it lies in the tile; places in pixels of the picture.
fn frame(tile: &mut Rgb, (x, y): (f64, f64), half: f64, colour: [u8; 3]) {
    let scale = f64::from(ENLARGED);
    // Pixel centres are at whole numbers.
    let at = |v: f64| (scale * (v + 0.5)).round().clamp(-1e6, 1e6) as i64;
    let (left, right, top, bottom) = (at(x - half), at(x + half), at(y - half), at(y + half));
    let (width, height) = (i64::from(tile.width), i64::from(tile.height));
    for j in 0..height {
        for i in 0..width {
            let inside = (left..=right).contains(&i) && (top..=bottom).contains(&j);
            if inside && (i == left || i == right || j == top || j == bottom) {
                let at = 3 * (j * width + i) as usize;
                tile.data[at..at + 3].copy_from_slice(&colour);
            }
        }
    }
}
