//! The thesis' network as it is shipped, beside the painters of this project at its number of sprays (Paper IV, section 3.3).

use std::error::Error;

use paint_net::Image;
use paint_net::procedural::Texture;
use paint_net::thesis::Architecture;
use paintcopter::paint_image::{EqualSprays, equal_sprays, held_out_patch, texture_picture};

use super::Extent;
use super::table::{Table, number};

/// Seed of its training.
const SEED: u64 = 1;
/// What an empty picture that stays empty counts, dB.
const MOST: f64 = 60.0;

/// The means, and the five textures.
///
/// # Errors
/// What the painters refuse.
pub fn tables(extent: Extent) -> Result<Vec<Table>, Box<dyn Error>> {
    let (count, textures) = match extent {
        Extent::Whole => (200, &Texture::ALL[..]),
        Extent::Quick => (5, &Texture::ALL[..1]),
    };
    let held = (0..count).map(|k| held_out_patch(SEED, k, &Architecture::PAINT));
    let patches = equal_sprays(None, &held.collect::<Result<Vec<Image>, _>>()?)?;
    let pictures: Vec<Image> = textures.iter().copied().map(texture_picture).collect();
    let painted = equal_sprays(None, &pictures)?;

    let head = ["pictures", "sprays", "thesis network; dB", "feedback network; dB", "free sprays; dB"];
    let mut means = Table::new("thesis_network", &head);
    means.row(mean("its own patches; held out", &patches));
    means.row(mean("five textures", &painted));
    let mut each = Table::new("equal_sprays", &["texture", "sprays", "thesis_db", "feedback_db", "free_db"]);
    for (texture, row) in textures.iter().zip(&painted) {
        each.row(mean(name(*texture), std::slice::from_ref(row)));
    }
    each.row(mean("mean", &painted));
    Ok(vec![means, each])
}

fn name(texture: Texture) -> &'static str {
    match texture {
        Texture::Fbm => "clouds",
        Texture::Worley => "cells",
        Texture::Brick => "bricks",
        Texture::Stripes => "stripes",
        Texture::Glyph => "strokes",
    }
}

fn mean(name: &str, rows: &[EqualSprays]) -> [String; 5] {
    let of = |value: &dyn Fn(&EqualSprays) -> f64| rows.iter().map(value).sum::<f64>() / rows.len() as f64;
    [
        name.into(),
        number(of(&|row| row.sprays as f64), 0),
        number(of(&|row| row.thesis_db.min(MOST)), 1),
        number(of(&|row| row.feedback_db.min(MOST)), 1),
        number(of(&|row| row.free_sprays_db.min(MOST)), 1),
    ]
}
