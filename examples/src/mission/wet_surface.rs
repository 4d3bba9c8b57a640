//! The paint of a mission on its surface while it is wet: where it would run, and how many coats keep it from that.

use paint_net::Image;
use paint_sim::film::wet::{Side, WetFilm};
use paint_sim::spray::air::drifted;
use paint_sim::{Film, Shot, Texel};

use super::error::MissionError;
use super::nozzle::spray_model;
use super::painting_task::PaintingTask;
use super::settings::PainterChoice;
use crate::appearance::UNIT_THICKNESS;

/// Paint of so many seconds lands at once.
const WINDOW_S: f64 = 10.0;
/// Share of the thickness at which paint runs that a coat may have.
const BELOW_SAG: f64 = 0.9;
/// Share of the painted area that may run before another coat is flown over all of it.
const SLIVER: f64 = 0.02;

/// Brings shots onto a film, and says how many of them are done.
pub(super) type Deposit<'a> =
    &'a dyn Fn(&mut WetFilm, &[Shot], &mut dyn FnMut(usize, usize)) -> Result<(), paint_sim::Error>;

/// The texels of a task with their paint.
pub(super) struct WetSurface {
    film: WetFilm,
    /// Pixel of every texel of the film.
    pixels: Vec<usize>,
    /// Time of the flight until which paint has dried and run, s.
    clock: f64,
    /// Time on the ground between coats, s.
    waited: f64,
}

impl WetSurface {
    /// Without paint.
    pub(super) fn new(task: &PaintingTask) -> Result<Self, MissionError> {
        let (texels, pixels) = task.film_texels();
        let sides = sides(task, &pixels);
        let film = WetFilm::new(Film::new(texels)?, &sides, task.paint.liquid, task.settings.ground)?;
        Ok(Self { film, pixels, clock: 0.0, waited: 0.0 })
    }

    /// Sprays shots of a flight with their times, which rise; `progress` hears how many.
    pub(super) fn spray(
        &mut self,
        shots: &[(f64, Shot)],
        task: &PaintingTask,
        progress: &dyn Fn(usize),
    ) -> Result<(), MissionError> {
        let (settings, spray) = (&task.settings, spray_model(&task.settings));
        let deposit: Deposit =
            &|film, shots, told| film.deposit(shots, &spray, task.met(), settings.threads, told).map(|_| ());
        self.spray_by(deposit, shots, task, progress)
    }

    /// The same where shots that fly straight come onto the film by `deposit`.
    pub(super) fn spray_by(
        &mut self,
        deposit: Deposit,
        shots: &[(f64, Shot)],
        task: &PaintingTask,
        progress: &dyn Fn(usize),
    ) -> Result<(), MissionError> {
        let settings = &task.settings;
        let mut rest = shots;
        while let Some(&(start, _)) = rest.first() {
            self.film.step((start - self.clock).max(0.0))?;
            self.clock = start;
            let (now, later) = rest.split_at(rest.partition_point(|(time, _)| *time < start + WINDOW_S).max(1));
            let before = shots.len() - rest.len();
            rest = later;
            let now: Vec<Shot> = now.iter().map(|(_, shot)| *shot).collect();
            if let Some(moving) = settings.air {
                let (spray, air) = (spray_model(settings), moving.air());
                let sprays = drifted(&now, &spray, &moving.droplets, task.met(), &mut |_| air)?;
                self.film.deposit_each(&sprays, task.met(), settings.threads)?;
                progress(before + now.len());
            } else {
                deposit(&mut self.film, &now, &mut |done, _| progress(before + done))?;
            }
        }
        Ok(())
    }

    /// After a flight, before another whose times begin anew; the second waits until the paint of the first is dry to touch if it shall.
    pub(super) fn land(&mut self, duration: f64, until_dry: bool) -> Result<(), MissionError> {
        self.film.step((duration - self.clock).max(0.0))?;
        self.clock = 0.0;
        if until_dry {
            let drying = self.film.time_to_dry();
            self.film.step(drying)?;
            self.waited += drying;
        }
        Ok(())
    }

    /// All that will run has run.
    pub(super) fn dry(self) -> Result<DriedSurface, MissionError> {
        let Self { mut film, pixels, waited, .. } = self;
        let drying = film.time_to_dry();
        film.step(drying)?;
        Ok(DriedSurface { ran: film.ran().to_vec(), film: film.into_film(), pixels, waited, drying })
    }

    /// Depth per pixel.
    pub(super) fn depth(&self, task: &PaintingTask) -> Image {
        task.depth_of(self.film.film(), &self.pixels)
    }

    /// The film as it is now.
    pub(super) fn film(&self) -> &WetFilm {
        &self.film
    }
}

/// What a flight has left in the end.
pub(super) struct DriedSurface {
    /// The paint.
    pub(super) film: Film,
    /// Pixel of every texel of the film.
    pub(super) pixels: Vec<usize>,
    /// Texels from which paint has run.
    pub(super) ran: Vec<bool>,
    /// Time on the ground between coats, s.
    pub(super) waited: f64,
    /// Time after the last flight in which it was dry to touch, s.
    pub(super) drying: f64,
}

/// Coats in which the paint of a task stays where it is sprayed, but for a sliver of it, and the time that each dries, s.
pub(super) fn coats(task: &PaintingTask) -> (usize, f64) {
    let (texels, pixels) = task.film_texels();
    let liquid = &task.paint.liquid;
    let depth = decided_depth(task);
    let thickness = pixels.iter().map(|&pixel| depth.data()[pixel] * UNIT_THICKNESS);
    // What runs at any thickness runs in any number of coats.
    let limit = |texel: &Texel| BELOW_SAG * liquid.dry_sag_thickness(&texel.normal);
    let painted = texels.iter().zip(thickness).filter(|(_, thickness)| *thickness > 0.0);
    let mut needed: Vec<[f64; 3]> = painted
        .map(|(texel, thickness)| (texel.area, thickness, limit(texel)))
        .map(|(area, thickness, limit)| [if limit > 0.0 { thickness / limit } else { 0.0 }, thickness, area])
        .collect();
    needed.sort_by(|a, b| b[0].total_cmp(&a[0]));
    let mut left = SLIVER * needed.iter().map(|[_, _, area]| area).sum::<f64>();
    let most = needed.iter().find(|[_, _, area]| {
        left -= area;
        left < 0.0
    });
    let coats = most.map_or(1.0, |[coats, _, _]| coats.ceil().max(1.0));
    let thickest = needed.iter().map(|[_, thickness, _]| *thickness).fold(0.0, f64::max);
    (coats as usize, liquid.drying_time(thickest / coats / liquid.solids))
}

/// Depth of the paint as it was decided, also where it is deeper than its colour shows.
fn decided_depth(task: &PaintingTask) -> Image {
    match task.layers.last() {
        // A coat's doses are decided on the surface, not on the canvas.
        Some(layer) if task.settings.painter != PainterChoice::Fill => layer.canvas.clone(),
        _ => task.wanted_depth(),
    }
}

/// The four sides of every texel; beyond a seam lies what the painter sees there.
fn sides(task: &PaintingTask, pixels: &[usize]) -> Vec<Side> {
    let (width, height) = (task.coverage.width(), task.coverage.height());
    let mut texel_of = vec![None; width * height];
    for (&pixel, texel) in pixels.iter().zip(0_u32..) {
        texel_of[pixel] = Some(texel);
    }
    let own = texel_of.clone();
    for (ghost, sources) in task.surface.beyond_seams.ghosts() {
        let nearest = sources.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        texel_of[*ghost] = nearest.and_then(|&(source, _)| own[source]);
    }
    let mut sides = Vec::with_capacity(4 * pixels.len());
    for (&pixel, texel) in pixels.iter().zip(0_u32..) {
        let (x, y) = (pixel % width, pixel / width);
        let beyond = [
            (x > 0).then(|| pixel - 1),
            (x + 1 < width).then(|| pixel + 1),
            (y > 0).then(|| pixel - width),
            (y + 1 < height).then(|| pixel + width),
        ];
        sides.extend(beyond.map(|pixel| Side { texel, beyond: pixel.and_then(|pixel| texel_of[pixel]) }));
    }
    sides
}

#[cfg(test)]
mod tests {
    use super::super::built_in_flyer::BuiltInFlyer;
    use super::super::planned_mission::PlannedMission;
    use super::super::run::Mission;
    use super::super::sagging::sagging_share;
    use super::super::settings::MissionSettings;
    use super::super::test_panel;
    use super::*;
    use crate::air::MovingAir;
    use crate::design::Design;
    use crate::region::Scene;
    use nalgebra::{Point3, Vector3};
    use paint_sim::spray::air::{Drift, drift};

    fn task() -> PaintingTask {
        let settings = MissionSettings { threads: 1, ..MissionSettings::default() };
        PaintingTask::new("panel", &Scene::whole(test_panel::mesh()), &Design::Gradient, settings).unwrap()
    }

    /// What is expected of a vertical wall at its darkest over what stays there dry, `0.9 s tau / rho g`, rounded up.
    #[test]
    fn a_thin_paint_goes_on_in_coats_that_stay_and_runs_in_one() {
        let mut task = task();
        let mut depths = decided_depth(&task).data().to_vec();
        depths.sort_by(f64::total_cmp);
        // Texels are as large as each other.
        let deepest = depths[depths.len() - 1 - depths.len() / 50];
        let stays = deepest * UNIT_THICKNESS / 1.6;
        task.paint.liquid.yield_stress = stays * 1200.0 * 9.81 / (0.9 * 0.35);
        let in_one = {
            let mut strong = task.clone();
            strong.paint.liquid.yield_stress *= 2.0;
            let mut planned = PlannedMission::new(strong).unwrap();
            assert_eq!(planned.planned.coats, 1);
            planned.task.paint.liquid = task.paint.liquid;
            Mission::fly(planned, &mut BuiltInFlyer).unwrap()
        };
        let in_coats = Mission::run(task).unwrap();
        assert_eq!((in_one.flights.len(), in_coats.flights.len()), (1, 2));
        assert!(sagging_share(&[&in_one]) > 0.02, "{}", sagging_share(&[&in_one]));
        assert!(sagging_share(&[&in_coats]) < 1e-9, "{}", sagging_share(&[&in_coats]));
        assert!(in_one.ground_times[0] == 0.0 && in_coats.ground_times[0] > 60.0);
        let [one, two] = [&in_one, &in_coats].map(|mission| mission.film.mass_balance().deposited as f64);
        assert!((two / one - 1.0).abs() < 0.02, "{two} {one}");
    }

    /// A shot before the middle of the wall in wind along it lands where the simulation has the spots of its droplets.
    #[test]
    fn spray_drifts_in_the_air_of_the_settings() {
        let sprayed = |air: Option<MovingAir>| {
            let mut task = task();
            task.settings.air = air;
            let shot = Shot { origin: Point3::new(-0.1, 0.0, 2.0), axis: Vector3::x_axis(), volume: 2e-9 };
            let mut surface = WetSurface::new(&task).unwrap();
            surface.spray(&[(0.0, shot)], &task, &|_| ()).unwrap();
            let film = surface.film().film();
            let paint: Vec<f64> = film.volumes().iter().map(|volume| *volume as f64).collect();
            let moment = paint.iter().zip(film.texels()).map(|(v, texel)| v * texel.point.y).sum::<f64>();
            (moment / paint.iter().sum::<f64>(), spray_model(&task.settings))
        };
        let air = MovingAir { wind: [0.0, 2.0, 0.0], ..MovingAir::default() };
        let ((still, spray), (blown, _)) = (sprayed(None), sprayed(Some(air)));
        assert!(still.abs() < 1e-4, "{still}");
        let Drift { main, fog, .. } = drift(&air.droplets, &spray, 0.1, [0.0, 2.0], 0.0).unwrap();
        let spots = std::iter::once(main).chain(fog);
        let (shift, share) = spots.fold((0.0, 0.0), |(s, n), spot| (s + spot.share * spot.shift, n + spot.share));
        assert!(shift > 2e-3 && (blown - shift / share).abs() < 5e-4, "{blown} {shift} {share}");
        assert_eq!(sprayed(Some(MovingAir::default())).0, still);
    }

    /// On one chart the sides are those of the grid; every texel has four, and what lies beyond is a neighbour.
    #[test]
    fn the_sides_of_texels_lead_to_their_neighbours() {
        let task = task();
        let (texels, pixels) = task.film_texels();
        let sides = sides(&task, &pixels);
        assert_eq!(sides.len(), 4 * texels.len());
        let edge = task.settings.texel;
        let mut rim = 0;
        for side in &sides {
            match side.beyond {
                Some(beyond) => {
                    let way = (texels[beyond as usize].point - texels[side.texel as usize].point).norm();
                    assert!((way / edge - 1.0).abs() < 0.05, "{way}");
                }
                None => rim += 1,
            }
        }
        let around = 2.0 * (2.0 + 2.0) / edge;
        assert!((f64::from(rim) / around - 1.0).abs() < 0.05, "{rim} of {around}");
    }
}
