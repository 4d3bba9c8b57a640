//! A ray cast through the active blocks, in bands of rows.

use crate::blocks::active_blocks::ActiveBlocks;
use crate::parallel::in_chunks;
use crate::ray_cast::camera::Camera;
use crate::ray_cast::march;
use crate::ray_cast::pixel::Band;
use crate::ray_cast::settings::RayCastSettings;
use crate::ray_cast::tiles;
use crate::ray_cast::view::View;

/// Fills a view of the camera's size.
pub(crate) fn fill(active: &ActiveBlocks, camera: &Camera, settings: &RayCastSettings, view: &mut View) {
    let (width, height) = (camera.width, camera.height);
    let mut scratch = std::mem::take(&mut view.scratch);
    scratch.blocks.select(active, camera, settings);
    scratch.tiles.fill(&scratch.blocks.visible, camera);
    let rows = height.div_ceil(settings.threads).next_multiple_of(tiles::SIDE);
    let chunk = rows * width;
    let mut bands: Vec<Band> = (view.depth.chunks_mut(chunk).zip(view.normals.chunks_mut(chunk)))
        .zip(view.colours.chunks_mut(chunk).zip(view.weights.chunks_mut(chunk)))
        .enumerate()
        .map(|(k, ((depth, normals), (colours, weights)))| Band { first: k * rows, depth, normals, colours, weights })
        .collect();
    in_chunks(&mut bands, settings.threads, |bands| {
        for band in bands {
            march::fill(band, camera, &scratch.blocks, &scratch.tiles, settings.colour);
        }
    });
    view.scratch = scratch;
}
