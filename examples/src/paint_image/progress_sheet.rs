//! The wall while it is painted, moment by moment.

use std::path::Path;

use paint_net::{Image, Spray, SprayKernel};

use super::error::PaintImageError;
use crate::pictures::{Rgb, TILE_SIDE, Tile, save_contact_sheet};

/// Moments that are shown, beside the wanted picture.
const MOMENTS: usize = 8;
const ROWS: usize = 3;

/// How the wall comes to look like the picture: what is wanted, and the wall after every eighth of the sprays, paint after
/// paint. `show`: sRGB of the depths of all paints.
pub(super) fn save_progress_sheet(
    path: &Path,
    wanted: Rgb,
    paints: &[&[Spray]],
    kernel: &SprayKernel,
    show: &dyn Fn(&[f64]) -> [u8; 3],
) -> Result<(), PaintImageError> {
    let (width, height) = (wanted.width as usize, wanted.height as usize);
    let mut tiles = vec![Tile { caption: "wanted".to_string(), picture: wanted }];
    let mut canvases = vec![Image::filled(width, height, 0.0); paints.len()];
    let count: usize = paints.iter().map(|sprays| sprays.len()).sum();
    let mut moments: Vec<usize> = (1..=MOMENTS).map(|k| k * count / MOMENTS).collect();
    moments.dedup();
    let all = paints.iter().enumerate().flat_map(|(paint, sprays)| sprays.iter().map(move |spray| (paint, spray)));
    let (mut all, mut done) = (all, 0);
    for moment in moments {
        for (paint, spray) in all.by_ref().take(moment - done) {
            kernel.stamp(spray, &mut canvases[paint]);
        }
        done = moment;
        let mut depths = vec![0.0; canvases.len()];
        let pixels = (0..width * height).map(|k| {
            depths.iter_mut().zip(&canvases).for_each(|(depth, canvas)| *depth = canvas.data()[k]);
            show(&depths)
        });
        tiles.push(Tile { caption: format!("{done} sprays"), picture: Rgb::from_pixels(width, height, pixels) });
    }
    let mut tiles = tiles.into_iter();
    let row = |_| tiles.by_ref().take((MOMENTS + 1).div_ceil(ROWS)).collect::<Vec<Tile>>();
    let rows: Vec<Vec<Tile>> = (0..ROWS).map(row).filter(|row| !row.is_empty()).collect();
    Ok(save_contact_sheet(path, &rows, TILE_SIDE)?)
}
