//! How well a contour was treated (VR paper, Section VI-A).

use std::path::Path;

use nalgebra::Point3;
use serde::Serialize;

use super::error::VrError;
use super::hand::{Way, place, way};
use super::session::Session;
use crate::appearance::UNIT_THICKNESS;
use crate::pictures::Rgb;
use crate::report::save_figures;

/// Half width of the mould, m, and the coat that treats it, in units of a coat.
const MOULD: f64 = 0.01;
const TREATED: f64 = 0.05;
/// Paint farther from the contour than this is over-spray, m.
const BESIDE: f64 = 0.03;
/// Colours of the mould and of what is treated.
const GREEN: [u8; 3] = [70, 92, 48];

/// `contour.json`.
#[derive(Debug, Serialize)]
struct ContourFigures {
    contour_length_m: f64,
    treated_share: f64,
    overspray_share: f64,
}

/// Writes the share of the contour that was treated and of the paint that went beside it, and pictures before and after.
pub(super) fn save_contour(session: &Session, folder: &Path) -> Result<(), VrError> {
    let world = session.world();
    let contour: Vec<Point3<f64>> =
        fine(&way(Way::Contour)).into_iter().filter_map(|at| place(world, at)).map(|hit| hit.point).collect();
    let length = contour.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
    let surface = &world.surface;
    let flown = session.canvases()[1];
    let thickness = flown.thickness();
    let (mut mould, mut treated, mut paint, mut beside) = (0_u64, 0_u64, 0.0, 0.0);
    let mut before = flown.whole();
    let bare = world.ground.srgb().rgb;
    let mut after = before.rgb.clone();
    for row in 0..surface.height() {
        for column in 0..surface.width() {
            let pixel = row * surface.width() + column;
            let colour = 3 * pixel..3 * pixel + 3;
            before.rgb[colour.clone()].copy_from_slice(&bare);
            let Some(at) = surface.texels.at(column, row) else { continue };
            let point = surface.chart.point(at);
            let distance = contour.iter().map(|c| (c - point).norm_squared()).fold(f64::MAX, f64::min).sqrt();
            let volume = thickness[pixel] * surface.texels.area_m2[pixel];
            paint += volume;
            beside += if distance > BESIDE { volume } else { 0.0 };
            if distance <= MOULD {
                mould += 1;
                before.rgb[colour.clone()].copy_from_slice(&GREEN);
                let clean = thickness[pixel] >= TREATED * UNIT_THICKNESS;
                treated += u64::from(clean);
                if !clean {
                    after[colour].copy_from_slice(&GREEN);
                }
            }
        }
    }
    let (width, height) = (u32::from(before.width), u32::from(before.height));
    Rgb { width, height, data: before.rgb }.save(&folder.join("contour_before.png"))?;
    Rgb { width, height, data: after }.save(&folder.join("contour_after.png"))?;
    let figures = ContourFigures {
        contour_length_m: length,
        treated_share: treated as f64 / mould.max(1) as f64,
        overspray_share: if paint > 0.0 { beside / paint } else { 0.0 },
    };
    let target = folder.join("contour");
    std::fs::create_dir_all(&target).map_err(VrError::unwritable(&target))?;
    Ok(save_figures(&figures, &target)?)
}

/// Two millimetres from point to point: the distance to the contour is that to its nearest point.
fn fine(way: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut points = Vec::new();
    for pair in way.windows(2) {
        let length = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
        let steps = (length / 0.002).ceil().max(1.0) as usize;
        points.extend((0..steps).map(|k| {
            let share = k as f64 / steps as f64;
            [0, 1].map(|c| pair[0][c] + share * (pair[1][c] - pair[0][c]))
        }));
    }
    points
}
