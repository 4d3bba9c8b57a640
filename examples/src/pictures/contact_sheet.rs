//! Pictures side by side with captions.

use std::path::Path;

use image::RgbImage;
use image::imageops::{FilterType, resize};
use plotters::element::BitMapElement;
use plotters::prelude::*;

use super::{PictureError, Rgb, draw};

/// A picture and what stands above it.
pub struct Tile {
    /// One short line.
    pub caption: String,
    /// Any size: it is fitted into the tile.
    pub picture: Rgb,
}

/// Usual longer side of a picture in its tile, pixels.
pub const TILE_SIDE: u32 = 256;
const GAP: u32 = 12;
const CAPTION: u32 = 26;

/// Draws pictures side by side, one row after the other, and saves the sheet. `side`: longer side of a picture in its tile, pixels.
pub fn save_contact_sheet(path: &Path, rows: &[Vec<Tile>], side: u32) -> Result<(), PictureError> {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0) as u32;
    let pictures: Vec<Vec<_>> =
        rows.iter().map(|tiles| tiles.iter().map(|tile| fitted(&tile.picture, side)).collect()).collect();
    let height = |pictures: &[Fitted]| CAPTION + GAP + pictures.iter().map(|(size, _)| size.1).max().unwrap_or(0);
    let all: u32 = pictures.iter().map(|pictures| height(pictures)).sum();
    let sheet = draw(columns * (side + GAP) + GAP, all + GAP, |area| {
        let mut top = GAP as i32;
        for (tiles, pictures) in rows.iter().zip(pictures) {
            let below = top + height(&pictures) as i32;
            for (column, (tile, (size, data))) in (0..).zip(tiles.iter().zip(pictures)) {
                let left = (GAP + column * (side + GAP)) as i32;
                area.draw(&Text::new(tile.caption.as_str(), (left, top), ("sans-serif", 20)))?;
                let element = BitMapElement::with_owned_buffer((left, top + CAPTION as i32), size, data);
                area.draw(&element.ok_or("a picture with fewer pixels than it says")?)?;
            }
            top = below;
        }
        Ok(())
    })?;
    sheet.save(path)
}

/// Size and pixels.
type Fitted = ((u32, u32), Vec<u8>);

/// Size and pixels with this longer side: averaged when made smaller; square pixels stay visible when made larger.
fn fitted(picture: &Rgb, side: u32) -> Fitted {
    let longer = picture.width.max(picture.height).max(1);
    let scaled = |length: u32| ((f64::from(length) * f64::from(side) / f64::from(longer)).round() as u32).max(1);
    let (width, height) = (scaled(picture.width), scaled(picture.height));
    let filter = if longer > side { FilterType::Triangle } else { FilterType::Nearest };
    let resized = RgbImage::from_raw(picture.width, picture.height, picture.data.clone())
        .map(|source| resize(&source, width, height, filter).into_raw());
    ((width, height), resized.unwrap_or_default())
}
