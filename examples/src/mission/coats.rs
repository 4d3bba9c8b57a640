//! Several paints: a mission for each, flown one after another, their films over each other.

use std::path::PathBuf;

use paint_net::Image;
use paint_sim::colour::spectrum_linear_srgb;
use paint_sim::{Paint, Substrate};

use super::error::MissionError;
use super::painting_task::PaintingTask;
use super::planned_mission::PlannedMission;
use super::run::Mission;
use crate::appearance::UNIT_THICKNESS;

/// What was decided about one paint.
pub struct Coat {
    /// Where its results belong.
    pub folder: PathBuf,
    /// The sprays.
    pub task: PaintingTask,
}

/// The missions of all paints, flown. Each is complete in itself; its pictures show its paint alone.
pub struct Coats {
    pub(super) missions: Vec<(PathBuf, Mission)>,
}

impl Coats {
    /// Plans all paints, then flies them in their order.
    ///
    /// # Errors
    /// As [`Mission::run`]; the error of one of several paints names it.
    pub fn run(coats: Vec<Coat>) -> Result<Self, MissionError> {
        let several = coats.len() > 1;
        let each = |Coat { folder, task }| {
            let paint = task.settings.paint;
            let named = |error: MissionError| if several { error.in_paint(paint) } else { error };
            Ok((folder, PlannedMission::new(task).map_err(named)?))
        };
        // What cannot be planned is known before anything is flown.
        let planned: Vec<(PathBuf, PlannedMission)> =
            coats.into_iter().map(each).collect::<Result<_, MissionError>>()?;
        let fly = |(folder, planned)| Ok((folder, Mission::fly(planned)?));
        Ok(Self { missions: planned.into_iter().map(fly).collect::<Result<_, MissionError>>()? })
    }

    /// The missions in flying order, each with the folder of its results.
    pub fn missions(&self) -> impl Iterator<Item = (&PathBuf, &Mission)> {
        self.missions.iter().map(|(folder, mission)| (folder, mission))
    }

    /// The wall on every pixel under the depths that a mission stands for, the first paint lowest; `None` beside the surface.
    pub(super) fn walls(&self, depth: impl Fn(&Mission) -> Image) -> Result<Vec<Option<Substrate>>, MissionError> {
        let ground = paint_sim::Substrate::sandstone();
        let layers: Vec<(Paint, Image)> = self
            .missions
            .iter()
            .map(|(_, mission)| Ok((mission.task.settings.paint.paint(UNIT_THICKNESS)?, depth(mission))))
            .collect::<Result<_, MissionError>>()?;
        let Some((_, first)) = self.missions.first() else { return Ok(Vec::new()) };
        let covered = first.task.coverage.data();
        let wall = |(k, covered): (usize, &f64)| {
            let films = layers.iter().map(|(paint, depth)| (paint, depth.data()[k] * UNIT_THICKNESS));
            (*covered > 0.0).then(|| over_each_other(films, &ground)).transpose()
        };
        covered.iter().enumerate().map(wall).collect::<Result<_, paint_sim::Error>>().map_err(MissionError::from)
    }
}

/// Linear sRGB as three pictures; the bare wall beside the surface, so that its edge is not darker.
pub(super) fn linear(walls: &[Option<Substrate>], width: usize, height: usize) -> Result<[Image; 3], MissionError> {
    let bare = spectrum_linear_srgb(paint_sim::Substrate::sandstone().reflectance());
    let colours: Vec<[f64; 3]> =
        walls.iter().map(|wall| wall.as_ref().map_or(bare, |wall| spectrum_linear_srgb(wall.reflectance()))).collect();
    let channel = |c: usize| Image::new(width, height, colours.iter().map(|colour| colour[c]).collect());
    Ok([channel(0)?, channel(1)?, channel(2)?])
}

/// Films in metres over a ground, each dry before the next (Kubelka-Munk: each film with its ground is the ground of the next).
fn over_each_other<'a>(
    films: impl IntoIterator<Item = (&'a Paint, f64)>,
    ground: &Substrate,
) -> Result<Substrate, paint_sim::Error> {
    films.into_iter().try_fold(*ground, |below, (paint, thickness)| paint.over(thickness, &below))
}

#[cfg(test)]
mod tests {
    use super::*;
    use paint_sim::colour::spectrum_lab;
    use paint_sim::paint::PaintName;

    #[test]
    fn the_upper_film_hides_the_lower_one() {
        let [charcoal, white] = [PaintName::Charcoal, PaintName::White].map(|name| name.paint(UNIT_THICKNESS).unwrap());
        let (ground, thick) = (paint_sim::Substrate::sandstone(), 40.0 * UNIT_THICKNESS);
        let lightness =
            |films: [(&Paint, f64); 2]| spectrum_lab(over_each_other(films, &ground).unwrap().reflectance())[0];
        let (white_above, white_below) =
            (lightness([(&charcoal, thick), (&white, thick)]), lightness([(&white, thick), (&charcoal, thick)]));
        let alone = |paint: &Paint| lightness([(paint, thick), (paint, 0.0)]);
        assert!((white_above - alone(&white)).abs() < 0.5, "{white_above}");
        assert!((white_below - alone(&charcoal)).abs() < 0.5 && white_below < 40.0, "{white_below}");
    }
}
