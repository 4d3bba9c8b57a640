//! What to spray of each paint of a picture: all of them at once.

use paint_net::colour::ColourFit;
use paint_net::painters::SurfaceFootprint;
use paint_net::path::Stroke;
use paint_net::{Image, Painting, Spray};

use super::decide::UNPAINTABLE_WEIGHT;
use super::error::MissionError;
use super::footprints::Footprints;
use super::painting_task::PaintingTask;
use super::picture_task::PictureTask;
use super::settings::MissionSettings;
use crate::progress::Stage;

/// What a unit of depth costs beside the square of a colour difference.
pub(super) const PAINT_WEIGHT: f64 = 0.3;
/// Least volume of a spray: strong paints show at a hundredth of the depth that hides a wall.
pub(super) const LEAST_VOLUME: f64 = 0.0025;
const ITERATIONS: usize = 80;
const TOLERANCE: f64 = 3e-4;

/// Decides the sprays of every paint of a picture on the grid of the settings; the best colours that they leave are kept with the picture.
pub(super) fn decide_colours(task: &PaintingTask, picture: &mut PictureTask) -> Result<Vec<Painting>, MissionError> {
    let stage = Stage::start("decide");
    let settings = &task.settings;
    let rows = rows_of_cells(task);
    let footprints = Footprints::new(&task.surface, settings)?;
    let of_cells = footprints.on_texels(&rows);
    let of_cells = footprints.checked(Ok(of_cells))?;
    let mut volumes: Vec<Vec<f64>> =
        picture.separated.iter().map(|depths| means(&of_cells, depths, settings)).collect();
    let model = picture.model();
    let fit = ColourFit {
        wanted: &picture.aims(),
        weight: &weights(task, picture),
        model: &model,
        footprints: &vec![of_cells.as_slice(); picture.paints.len()],
        min_volume: 0.0,
        max_volume: settings.limits.max_volume,
        paint_weight: PAINT_WEIGHT,
        iterations: ITERATIONS,
        tolerance: TOLERANCE,
        threads: settings.threads,
    };
    let depths = fit.solve(&mut volumes, &mut |share| stage.share(share))?;
    let optimum = looks(picture, &depths);
    let blank = task.coverage.map(|_| 0.0);
    let painting = |(volumes, depths): (&Vec<f64>, &Vec<f64>)| {
        let cells = rows.iter().flat_map(|row| &row.sprays);
        let worth = cells.zip(volumes).filter(|(_, volume)| **volume >= LEAST_VOLUME);
        let sprays: Vec<Spray> = worth.map(|(cell, &volume)| Spray { volume, ..*cell }).collect();
        Painting::new(sprays, on_page(&blank, &picture.pixels, depths), task.appearance.ink())
    };
    let paintings: Vec<Painting> = volumes.iter().zip(&depths).map(painting).collect();
    picture.optimum = optimum;
    let sprays: usize = paintings.iter().map(|painting| painting.sprays.len()).sum();
    if sprays == 0 {
        return Err(MissionError::NothingToPaint("every colour of it is that of the wall"));
    }
    stage.done(&format!("{} paints, {sprays} sprays", paintings.len()));
    Ok(paintings)
}

/// How much each texel matters.
pub(super) fn weights(task: &PaintingTask, picture: &PictureTask) -> Vec<f64> {
    let weigh = |&pixel: &usize| if task.in_reach[pixel] { 1.0 } else { UNPAINTABLE_WEIGHT };
    picture.pixels.iter().map(weigh).collect()
}

/// CIELAB of every texel with these depths, paint after paint.
pub(super) fn looks(picture: &PictureTask, depths: &[Vec<f64>]) -> Vec<[f64; 3]> {
    use paint_net::colour::MixingModel as _;
    let model = picture.model();
    let look = |k: usize| {
        let of_texel: Vec<f64> = depths.iter().map(|of_paint| of_paint[k]).collect();
        model.lab(k, &of_texel, &mut [])
    };
    (0..picture.pixels.len()).map(look).collect()
}

/// Values of texels on the page, 0 beside them.
fn on_page(blank: &Image, pixels: &[usize], values: &[f64]) -> Image {
    let mut image = blank.clone();
    pixels.iter().zip(values).for_each(|(&pixel, &value)| image.data_mut()[pixel] = value);
    image
}

/// The cells over which the nozzle may spray, as runs along the rows.
fn rows_of_cells(task: &PaintingTask) -> Vec<Stroke> {
    let (width, height) = (task.surface.width(), task.surface.height());
    let MissionSettings { limits, spot, texel, .. } = &task.settings;
    let first = |stride: usize| (stride - 1) / 2;
    let mut strokes = Vec::new();
    for y in (first(limits.row_spacing)..height).step_by(limits.row_spacing) {
        let free = |x: &usize| task.in_reach[y * width + x];
        let columns: Vec<usize> =
            (first(limits.spray_spacing)..width).step_by(limits.spray_spacing).filter(free).collect();
        for run in columns.chunk_by(|a, b| b - a == limits.spray_spacing) {
            let spray = |&x: &usize| Spray { x: x as f64, y: y as f64, volume: 1.0, sigma: spot / texel };
            strokes.push(Stroke { sprays: run.iter().map(spray).collect() });
        }
    }
    strokes
}

/// For a start, the mean under each footprint of the depth that its texels would need by themselves.
fn means(footprints: &[SurfaceFootprint], depths: &[f64], settings: &MissionSettings) -> Vec<f64> {
    let sigma = settings.spot / settings.texel;
    let cell = (settings.limits.spray_spacing * settings.limits.row_spacing) as f64;
    let depth_per_volume = std::f64::consts::TAU * sigma * sigma / cell;
    let mean = |footprint: &SurfaceFootprint| {
        let (sum, mass) = footprint.iter().fold((0.0, 0.0), |(sum, mass), &(k, share)| {
            (sum + f64::from(share) * depths[k as usize], mass + f64::from(share))
        });
        if mass > 0.0 { sum / mass / depth_per_volume } else { 0.0 }
    };
    footprints.iter().map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::Design;
    use crate::mesh_io::TriangleMesh;
    use crate::region::Scene;

    /// The first cell begins at the border of a wall, the others follow a spacing apart to its other end.
    #[test]
    fn cells_cover_the_wall_from_its_border_on() {
        let corner = |k: u32| [0.0, 0.5 - 0.25 * (k % 5) as f32, 1.0 + 0.25 * (k / 5) as f32];
        let quad = |a: u32| [[a, a + 1, a + 6], [a, a + 6, a + 5]];
        let faces = (0..16).flat_map(|k| quad(5 * (k / 4) + k % 4)).collect();
        let mesh = TriangleMesh { positions: (0..25).map(corner).collect(), faces, ..TriangleMesh::default() };
        let mut settings = MissionSettings::default();
        (settings.limits.spray_spacing, settings.limits.row_spacing) = (3, 5);
        let task = PaintingTask::new("wall", &Scene::whole(mesh), &Design::Gradient, settings).unwrap();
        assert!(task.in_reach.iter().all(|reached| *reached));
        let strokes = rows_of_cells(&task);
        let first = strokes[0].sprays[0];
        assert_eq!((first.x, first.y), (1.0, 2.0));
        let last = strokes[strokes.len() - 1].sprays.last().unwrap();
        let (width, height) = (task.surface.width() as f64, task.surface.height() as f64);
        assert!(width - 1.0 - last.x <= 3.0 && height - 1.0 - last.y <= 5.0, "{last:?} of {width} x {height}");
        let steps = |k: usize| strokes[k].sprays.windows(2).all(|pair| pair[1].x - pair[0].x == 3.0);
        assert!((0..strokes.len()).all(steps));
        assert!(strokes.windows(2).all(|pair| pair[1].sprays[0].y - pair[0].sprays[0].y == 5.0));
    }
}
