//! The paint of flights on a surface.

use paint_net::Image;
use paint_sim::Shot;

use super::error::MissionError;
use super::painting_task::PaintingTask;
use super::wet_surface::{DriedSurface, WetSurface};
use crate::progress::Stage;

/// Flights that overlap by less than this, s, follow each other: a log ends with its last step.
const TOUCH: f64 = 0.1;
/// Parts of the spraying after which the surface is shown.
const PARTS: usize = 3;

/// What a flight sprays.
pub(super) struct FlownPaint<'a> {
    /// Shots with their times since it began, s.
    pub(super) shots: &'a [(f64, Shot)],
    /// How long it takes, s.
    pub(super) duration: f64,
    /// When it begins, s.
    pub(super) start: f64,
    /// Whether the paint before it is dry then.
    pub(super) on_dry: bool,
}

/// Shots of flights at the same time, with their times since the first of them began.
struct Round {
    begun: f64,
    duration: f64,
    shots: Vec<(f64, Shot)>,
    on_dry: bool,
}

/// Flights in the order in which they begin; those that overlap in time spray together.
fn rounds<'a>(flights: impl Iterator<Item = FlownPaint<'a>>) -> Vec<Round> {
    let mut flights: Vec<FlownPaint> = flights.collect();
    flights.sort_by(|a, b| a.start.total_cmp(&b.start));
    let mut rounds: Vec<Round> = Vec::new();
    for FlownPaint { shots, duration, start, on_dry } in flights {
        match rounds.last_mut().filter(|round| start + TOUCH < round.begun + round.duration && !on_dry) {
            Some(round) => {
                let late = start - round.begun;
                round.shots.extend(shots.iter().map(|(time, shot)| (late + time, *shot)));
                round.duration = round.duration.max(late + duration);
            }
            None => rounds.push(Round { begun: start, duration, shots: shots.to_vec(), on_dry }),
        }
    }
    for round in &mut rounds {
        round.shots.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    rounds
}

/// Flights' paint on a surface.
pub(super) struct Sprayed {
    /// The paint.
    pub(super) surface: DriedSurface,
    /// Depth per pixel after each of equal parts of the spraying but the last; none of a picture's paint.
    pub(super) before: Vec<Image>,
}

/// Puts the paint of flights onto the texels; before those marked so what is there dries.
pub(super) fn spray<'a>(
    flights: impl Iterator<Item = FlownPaint<'a>>,
    task: &PaintingTask,
) -> Result<Sprayed, MissionError> {
    let stage = Stage::start("spray");
    let mut surface = WetSurface::new(task)?;
    let rounds = rounds(flights);
    let total: usize = rounds.iter().map(|round| round.shots.len()).sum();
    let part = total.div_ceil(PARTS).max(1);
    let (mut before, mut sprayed) = (Vec::new(), 0);
    for (k, Round { shots, duration, .. }) in rounds.iter().enumerate() {
        let mut rest = &shots[..];
        while !rest.is_empty() {
            let (now, later) = rest.split_at(rest.len().min(part - sprayed % part));
            surface.spray(now, task, &|done| stage.share((sprayed + done) as f64 / total as f64))?;
            (sprayed, rest) = (sprayed + now.len(), later);
            // A picture's paints are shown together.
            if sprayed % part == 0 && sprayed < total && !task.of_picture {
                before.push(surface.depth(task));
            }
        }
        surface.land(*duration, rounds.get(k + 1).is_some_and(|next| next.on_dry))?;
    }
    let surface = surface.dry()?;
    let balance = surface.film.mass_balance();
    let share = 100.0 * balance.deposited as f64 / balance.emitted.max(1) as f64;
    let ran = if surface.ran.contains(&true) { ", some of which ran: see sagging.png" } else { "" };
    stage.done(&format!("{share:.1} % of the paint on the surface{ran}"));
    Ok(Sprayed { surface, before })
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};
    use paint_sim::Film;

    use super::super::nozzle::spray_model;
    use super::super::settings::MissionSettings;
    use super::super::test_panel;
    use super::*;
    use crate::region::Scene;
    use crate::simulated_sensors::SHOT_STEP;

    /// After each third of the shots their paint lies there, and in the end what one call would have sprayed.
    #[test]
    fn the_paint_grows_by_thirds() {
        let settings = MissionSettings { threads: 1, ..MissionSettings::default() };
        let log = test_panel::flown(&settings).1;
        let task = PaintingTask::undecided("wall", &Scene::whole(test_panel::mesh()), settings.clone()).unwrap();
        let Sprayed { surface: DriedSurface { film, pixels, .. }, before } = spray(
            [FlownPaint { shots: &log.timed_shots(SHOT_STEP), duration: 60.0, start: 0.0, on_dry: false }].into_iter(),
            &task,
        )
        .unwrap();
        let mut at_once = Film::new(task.film_texels().0).unwrap();
        let shots = log.shots(SHOT_STEP);
        at_once.deposit(&shots, &spray_model(&settings), task.met(), 1, &mut |_, _| ()).unwrap();
        assert_eq!(film.mass_balance(), at_once.mass_balance());
        let painted = task.depth_of(&film, &pixels);
        assert_eq!(painted, task.depth_of(&at_once, &pixels));
        let sum = |depth: &Image| depth.data().iter().sum::<f64>();
        assert_eq!(before.len(), 2);
        for (part, depth) in before.iter().enumerate() {
            let sprayed = |shots: &[Shot]| shots.iter().map(|shot| shot.volume).sum::<f64>();
            let share = sprayed(&shots[..(part + 1) * shots.len().div_ceil(3)]) / sprayed(&shots);
            assert!((sum(depth) / sum(&painted) - share).abs() < 0.01, "{share} after part {part}");
            assert!(depth.data().iter().zip(painted.data()).all(|(then, end)| then <= end));
        }
    }

    /// Two robots spray at the same time, a third flight begins when both have ended, a fourth on what is dry by then although it overlaps.
    #[test]
    fn flights_at_the_same_time_spray_together_in_the_order_of_time() {
        let shots = |times: [f64; 2]| {
            times.map(|time| (time, Shot { origin: Point3::new(time, 0.0, 0.0), axis: Vector3::x_axis(), volume: 1.0 }))
        };
        let shots = [[0.0, 5.0], [1.0, 2.0], [0.0, 1.0], [3.0, 4.0]].map(shots);
        let flight = |k: usize, start, duration, on_dry| FlownPaint { shots: &shots[k], duration, start, on_dry };
        let flights = [
            flight(0, 0.0, 10.0, false),
            flight(2, 14.0, 5.0, false),
            flight(1, 4.0, 10.0, false),
            flight(3, 15.0, 9.0, true),
        ];
        let rounds = rounds(flights.into_iter());
        let told: Vec<(f64, f64, bool)> =
            rounds.iter().map(|round| (round.begun, round.duration, round.on_dry)).collect();
        assert_eq!(told, [(0.0, 14.0, false), (14.0, 5.0, false), (15.0, 9.0, true)]);
        let times: Vec<Vec<f64>> =
            rounds.iter().map(|round| round.shots.iter().map(|(time, _)| *time).collect()).collect();
        assert_eq!(times, [vec![0.0, 5.0, 5.0, 6.0], vec![0.0, 1.0], vec![3.0, 4.0]]);
        // The second robot's first shot, a second after it has begun at 4 s.
        assert_eq!(rounds[0].shots[2].1.origin.x, 1.0);
    }
}
