//! Doses of all paints of a picture for where the nozzle is planned to be: what one paint leaves wrong, another may mend.

use paint_net::colour::{ColourFit, FootprintSet};
use paint_planner::{Plan, Target};
use paint_sim::Film;

use super::decide_colours::{LEAST_VOLUME, PAINT_WEIGHT, looks, weights};
use super::dose_correction::{shares, sprayed};
use super::error::MissionError;
use super::nozzle::kernel;
use super::painting_task::PaintingTask;
use super::picture_task::PictureTask;
use super::plan::Draft;
use crate::appearance::UNIT_THICKNESS;
use crate::progress::Stage;

const ITERATIONS: usize = 50;
const TOLERANCE: f64 = 3e-4;

/// Changes the doses of all flights, those of one paint after those of another.
pub(super) fn correct_colours(
    drafts: &mut [(&PaintingTask, &mut Draft)],
    picture: &PictureTask,
) -> Result<(), MissionError> {
    let stage = Stage::start("doses");
    let Some(task) = drafts.first().map(|(task, _)| *task) else { return Ok(()) };
    let (film, settings) = (Film::new(task.surface.film_texels().0)?, &task.settings);
    let area = kernel(settings)?.mass() * settings.texel * settings.texel;
    let unit = area * UNIT_THICKNESS;
    let depth = |&(place, share): &(u32, f64)| (place, (share * area / film.texels()[place as usize].area) as f32);
    let (mut footprints, mut volumes, mut all_sprayed) = (Vec::new(), Vec::new(), Vec::new());
    for (task, draft) in &mut *drafts {
        let flights = &mut draft.mission.flights;
        let parts: Vec<(&mut [Target], &Plan)> =
            flights.iter_mut().map(|f| (f.route.targets.as_mut_slice(), &f.plan)).collect();
        let sprayed = sprayed(&parts);
        let of_paint = shares(&parts, &sprayed, &film, task)?;
        let of_paint = FootprintSet::of(of_paint.iter().map(|of_target| of_target.iter().map(depth).collect()))?;
        volumes.push(sprayed.iter().map(|&(f, k, length)| parts[f].0[k].dose * length / unit).collect::<Vec<f64>>());
        footprints.push(of_paint);
        all_sprayed.push(sprayed);
    }
    let model = picture.model();
    let fit = ColourFit {
        wanted: &picture.aims(),
        weight: &weights(task, picture),
        model: &model,
        footprints: &footprints.iter().collect::<Vec<_>>(),
        min_volume: LEAST_VOLUME,
        max_volume: settings.limits.max_volume,
        paint_weight: PAINT_WEIGHT,
        prices: &[],
        iterations: ITERATIONS,
        tolerance: TOLERANCE,
        threads: settings.threads,
    };
    let depths = fit.solve(&mut volumes, &mut |share| stage.share(share))?;
    for (((_, draft), sprayed), volumes) in drafts.iter_mut().zip(&all_sprayed).zip(&volumes) {
        for (&(flight, k, length), volume) in sprayed.iter().zip(volumes) {
            draft.mission.flights[flight].route.targets[k].dose = volume * unit / length;
        }
    }
    let expected = looks(picture, &depths);
    let difference = picture.difference_in_gamut(&task.in_reach, |k| Some(expected[k]));
    stage.done(&format!("CIEDE2000 {difference:.2} expected where paints show the picture"));
    Ok(())
}
