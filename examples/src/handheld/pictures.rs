//! Pictures of a run: textures, the difference, the density with the chosen path.

use std::path::Path;

use image::{Rgb, RgbImage};
use paint_planner::gantry::GantryPlan;
use paint_sim::droplets::Coverage;
use uv_param::texture::TexelMap;

use super::error::HandheldError;
use crate::pictures::{DensityPicture, save_density, write_png};

/// Beside the surface.
const PAPER: [u8; 3] = [200, 205, 210];
/// Side of a texel in the pictures, pixels.
const ZOOM: u32 = 4;

/// Darkness of a coat: bare is white, a full coat black.
fn grey(share: f64) -> [u8; 3] {
    [(255.0 * (1.0 - share.clamp(0.0, 1.0))).round() as u8; 3]
}

/// Missing paint is blue, too much is red, what is right is white.
fn difference(share: f64) -> [u8; 3] {
    let strength = (share.abs().min(1.0) * 235.0).round() as u8;
    let faded = 255 - strength;
    if share < 0.0 { [faded, faded, 255] } else { [255, faded, faded] }
}

/// Writes `target.png`, `painted.png` and `difference.png`.
pub(super) fn save_textures(texels: &TexelMap, coverage: &Coverage, folder: &Path) -> Result<(), HandheldError> {
    let full = coverage.full_thickness();
    let share = |volume: u64, texel: usize| volume as f64 * paint_sim::spray::QUANTUM / (texels.area_m2[texel] * full);
    let (target, current) = (coverage.target(), coverage.current());
    let draw = |zoom: u32, colour: &dyn Fn(usize) -> [u8; 3], name: &str| {
        let (width, height) = (texels.width as u32, texels.height as u32);
        let picture = RgbImage::from_fn(width * zoom, height * zoom, |x, y| {
            let texel = (y / zoom) as usize * texels.width + (x / zoom) as usize;
            Rgb(if texels.area_m2[texel] > 0.0 { colour(texel) } else { PAPER })
        });
        let path = folder.join(name);
        write_png(&path, &picture, picture.dimensions().into()).map_err(|e| HandheldError::unwritable(&path, &e))
    };
    draw(ZOOM, &|k| grey(share(target[k], k)), "target.png")?;
    draw(ZOOM, &|k| grey(share(current[k], k)), "painted.png")?;
    draw(ZOOM, &|k| difference(share(current[k], k) - share(target[k], k)), "difference.png")
}

/// Writes `density.png`: the required paint over time and gantry position, with the chosen path (handheld paper, Fig. 2).
pub(super) fn save_plan(plan: &GantryPlan, folder: &Path) -> Result<(), HandheldError> {
    let samples: Vec<([f64; 2], f64)> =
        plan.density.samples().map(|([time, position], value)| ([time, 1e3 * position], f64::from(value))).collect();
    let path = plan.path();
    let corners =
        path.iter().map(|s| (s.start, 1e3 * s.from)).chain(path.last().map(|s| (s.start + s.duration, 1e3 * s.to)));
    let [position, time] = plan.density.spacing();
    let picture = DensityPicture {
        title: "Required paint density and the chosen path",
        horizontal: "time after the decision, s",
        vertical: "position along the gantry, mm",
        samples: &samples,
        cell: [time, 1e3 * position],
        path: corners.collect(),
    };
    Ok(save_density(&folder.join("density.png"), &picture)?)
}
