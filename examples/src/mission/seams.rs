//! How good the painting is at seams: where the plane of the picture is cut, and the surface is not.

use paint_net::{Image, metrics};
use paint_planner::mission::upright_steps;
use paint_sim::Film;

use super::error::MissionError;
use super::nozzle::{kernel, shot, spray_model};
use super::painting_task::PaintingTask;
use super::plan::layer_route;
use super::run::Mission;
use crate::appearance::UNIT_THICKNESS;
use crate::simulated_sensors::SHOT_STEP;

/// Half the width of the band about the seams, metres.
const BAND: f64 = 0.03;

/// The painted surface in a band of 3 cm about the seams, and elsewhere. Windows go on beyond the seams.
pub(super) struct SeamLikeness {
    /// Structural similarity to the wanted picture where the robot can paint, in the band.
    pub(super) near: f64,
    /// The same elsewhere.
    pub(super) far: f64,
}

/// What the painter expects beside what the simulator's spray deposits along the strokes when it stands upright and hits. Means of the difference
/// of thickness over the mean thickness, by area.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DepositError {
    /// In a band of 3 cm about the seams.
    pub(super) near: f64,
    /// There, if what a spray puts beyond a seam counted as lost.
    pub(super) naive: f64,
    /// Elsewhere.
    pub(super) far: f64,
}

/// `None` on a surface without seams.
pub(super) fn likeness(mission: &Mission) -> Result<Option<SeamLikeness>, MissionError> {
    let task = &mission.task;
    let Some(at_seams) = band(task) else { return Ok(None) };
    let ghosts = &task.surface.beyond_seams;
    let continued = |mut image: Image| {
        ghosts.gather(image.data_mut());
        image
    };
    let (painted, wanted) = (continued(mission.painted_ink()), continued(task.wanted.clone()));
    let weight = continued(task.coverage_in_reach()).map(|share| f64::from(u8::from(share > 0.999)));
    // Ghosts are where windows end, not where they lie.
    let own = own_texels(task);
    let [near, far] =
        [true, false].map(|side| own.iter().zip(&at_seams).map(|(&o, &n)| o && n == side).collect::<Vec<_>>());
    Ok(Some(SeamLikeness {
        near: metrics::ssim_at(&painted, &wanted, Some(&weight), &near)?,
        far: metrics::ssim_at(&painted, &wanted, Some(&weight), &far)?,
    }))
}

/// `None` on a surface without seams.
pub(super) fn deposit_error(task: &PaintingTask) -> Result<Option<DepositError>, MissionError> {
    let (Some(at_seams), Some(last)) = (band(task), task.layers.last()) else { return Ok(None) };
    let PaintingTask { surface, settings, .. } = task;
    let kernel = kernel(settings)?;
    let mut naive = task.wanted.map(|_| 0.0);
    let mut shots = Vec::new();
    for layer in &task.layers {
        layer.sprays.iter().for_each(|spray| kernel.stamp(spray, &mut naive));
        let targets = layer_route(layer, surface, settings, None)?.targets;
        let stand_off = settings.planner.nozzle.stand_off;
        let ways = targets.windows(2).flat_map(|pair| upright_steps(&pair[0], &pair[1], stand_off, SHOT_STEP));
        shots.extend(ways.map(|spray| shot(&spray.nozzle, spray.volume)));
    }
    let (texels, pixels) = surface.film_texels();
    let mut film = Film::new(texels)?;
    film.deposit(&shots, &spray_model(settings), &surface.world, settings.threads, &mut |_, _| ())?;
    let own = own_texels(task);
    let error = |expected: &Image, near: bool| {
        let (mut off, mut all) = (0.0, 0.0);
        for (k, (&pixel, texel)) in pixels.iter().zip(film.texels()).enumerate() {
            if own[pixel] && at_seams[pixel] == near {
                let there = film.thickness(k) / UNIT_THICKNESS;
                off += texel.area * (expected.data()[pixel] - there).abs();
                all += texel.area * there;
            }
        }
        off / f64::max(all, f64::MIN_POSITIVE)
    };
    Ok(Some(DepositError {
        near: error(&last.canvas, true),
        naive: error(&naive, true),
        far: error(&last.canvas, false),
    }))
}

/// Texels of the surface that show nothing else.
fn own_texels(task: &PaintingTask) -> Vec<bool> {
    let mut own: Vec<bool> = task.coverage.data().iter().map(|&covered| covered > 0.0).collect();
    for (ghost, _) in task.surface.beyond_seams.ghosts() {
        own[*ghost] = false;
    }
    own
}

/// Texels nearer to a seam than the band is wide; `None` on a surface without seams.
fn band(task: &PaintingTask) -> Option<Vec<bool>> {
    let ghosts = task.surface.beyond_seams.ghosts();
    if ghosts.is_empty() {
        return None;
    }
    let (width, height) = (task.surface.width(), task.surface.height());
    // The seam lies half a texel before the first centre beyond it.
    let reach = BAND / task.settings.texel + 0.5;
    let steps = reach.floor() as i64;
    let mut near = vec![false; width * height];
    for &(ghost, _) in ghosts {
        for dy in -steps..=steps {
            for dx in -steps..=steps {
                let (x, y) = ((ghost % width) as i64 + dx, (ghost / width) as i64 + dy);
                let inside = x >= 0 && y >= 0 && x < width as i64 && y < height as i64;
                if inside && ((dx * dx + dy * dy) as f64) <= reach * reach {
                    near[y as usize * width + x as usize] = true;
                }
            }
        }
    }
    Some(near)
}
