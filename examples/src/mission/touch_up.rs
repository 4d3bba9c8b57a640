//! Painting again what is missing: what was decided against what the robot sees.

use paint_net::{Image, Painting};
use paint_sim::film::inspection::FilmEstimate;

use super::decide::decide;
use super::error::MissionError;
use super::fly::{Flown, LayerFlight, fly};
use super::flyer::Flyer;
use super::look::look;
use super::painting_task::PaintingTask;
use super::plan::plan;
use super::settings::PainterChoice;
use super::wet_surface::DriedSurface;
use crate::appearance::UNIT_THICKNESS;

/// Depth of paint below which nothing was meant to lie, and below which nothing is missing.
const NONE: f64 = 0.02;
const LEAST: f64 = 0.08;
/// Nor is a smaller share of what was decided: an error of the robot's pose shifts what it sees.
const SHARE: f64 = 0.2;
/// What is missing must be so many deviations of what is seen.
const CERTAIN: f64 = 3.0;
/// Share of the paint below which nothing is painted again.
const WORTH: f64 = 0.01;

/// What looking found, and what was done about it.
#[derive(Debug, Clone, Copy)]
pub(super) struct TouchUpFigures {
    /// Error of the thickness that was seen, root mean square over that of the thickness, on texels with a tenth of a unit of paint or more.
    pub(super) film_error: f64,
    /// Share of those texels whose film was seen and not opaque.
    pub(super) film_seen: f64,
    /// Paint that was missing, m³.
    pub(super) missing: f64,
}

/// Looks at what flights have left, decides about what is missing of it, plans it and flies it.
pub(super) fn touch_up(
    task: &mut PaintingTask,
    flights: &[LayerFlight],
    DriedSurface { film, pixels, .. }: &DriedSurface,
    flyer: &mut dyn Flyer,
) -> Result<(Flown, TouchUpFigures), MissionError> {
    let expected = expected_depth(task);
    let bare: Vec<bool> = pixels.iter().map(|&pixel| expected.data()[pixel] < NONE).collect();
    let told = look(task, flights, &bare, flyer)?;
    let mut missing = expected.map(|_| 0.0);
    let (mut lacking, mut all) = (0.0, 0.0);
    for ((told, &pixel), texel) in told.iter().zip(pixels).zip(film.texels()) {
        let expected = expected.data()[pixel];
        all += expected * texel.area;
        let Some(FilmEstimate { thickness, sigma, .. }) = told.filter(|told| !told.opaque) else { continue };
        if let Some(lack) = certain_lack(expected, thickness / UNIT_THICKNESS, sigma / UNIT_THICKNESS) {
            missing.data_mut()[pixel] = lack;
            lacking += lack * texel.area;
        }
    }
    let truth: Vec<f64> = (0..told.len()).map(|k| film.thickness(k)).collect();
    let figures = figures(&truth, &told, lacking * UNIT_THICKNESS);
    if lacking < WORTH * all {
        return Ok((Flown::default(), figures));
    }
    let wanted = missing.map(|depth| task.appearance.ink().forward(depth));
    let decided = decide(&wanted, &task.canvas());
    let layers = match decided {
        Err(MissionError::NothingToPaint(_)) => return Ok((Flown::default(), figures)),
        other => other?,
    };
    // Doses are fitted to what is wanted of these flights.
    let first = std::mem::replace(&mut task.layers, layers);
    let whole = std::mem::replace(&mut task.wanted, wanted);
    let flown = plan(task).and_then(|planned| fly(planned, task, flights, flyer));
    (task.layers, task.wanted) = (first, whole);
    Ok((flown?, figures))
}

/// What is missing of an expected depth of which `seen` is there within a standard deviation of `sigma`, if that is sure.
fn certain_lack(expected: f64, seen: f64, sigma: f64) -> Option<f64> {
    let lack = expected - seen;
    (lack > LEAST.max(CERTAIN * sigma).max(SHARE * expected)).then_some(lack)
}

/// Depth of the paint as it was decided, per pixel: what no spray can reach is not missing.
fn expected_depth(task: &PaintingTask) -> Image {
    let decided = task.layers.last().map(|Painting { ink, .. }| ink);
    // A coat's doses are decided on the surface, not on the canvas.
    let ink = decided.filter(|_| task.settings.painter != PainterChoice::Fill).unwrap_or(&task.wanted);
    ink.map(|ink| task.appearance.ink().inverse(ink))
}

/// Of true thicknesses and what was told of them, m, and of what was missing, m³.
fn figures(truth: &[f64], told: &[Option<FilmEstimate>], missing: f64) -> TouchUpFigures {
    let (mut errors, mut squares, mut seen, mut painted) = (0.0, 0.0, 0, 0);
    for (&truth, told) in truth.iter().zip(told) {
        if truth < 0.1 * UNIT_THICKNESS {
            continue;
        }
        painted += 1;
        if let Some(told) = told.filter(|told| !told.opaque) {
            seen += 1;
            errors += (told.thickness - truth).powi(2);
            squares += truth * truth;
        }
    }
    let film_error = if squares > 0.0 { f64::sqrt(errors / squares) } else { 0.0 };
    TouchUpFigures { film_error, film_seen: f64::from(seen) / f64::from(painted.max(1)), missing }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use paint_sim::flight::{Clog, Faults, FlightLog, Mislocalised, PoseSource};

    use super::super::built_in_flyer::BuiltInFlyer;
    use super::super::flyer::{Flight, Purpose};
    use super::super::planned_mission::PlannedMission;
    use super::super::run::Mission;
    use super::super::settings::MissionSettings;
    use super::*;
    use crate::design::Design;
    use crate::region::Scene;
    use crate::world::{CENTRE, rock_wall};

    /// A rough wall of 1.6 m by 0.8 m with a gradient, flown with faults.
    fn flown(faults: Faults, look: bool) -> Mission {
        flown_by(&mut Noting::default(), faults, look)
    }

    fn flown_by(flyer: &mut dyn Flyer, faults: Faults, look: bool) -> Mission {
        let mut mesh = rock_wall(1);
        for [x, y, z] in &mut mesh.positions {
            (*x, *y, *z) = (0.35 * *x, 0.35 * *y, (CENTRE + 0.35 * (f64::from(*z) - CENTRE)) as f32);
        }
        let settings = MissionSettings { look, faults, ..MissionSettings::default() };
        let task = PaintingTask::new("wall", &Scene::whole(mesh), &Design::Gradient, settings).unwrap();
        PlannedMission::new(task).and_then(|mission| Mission::fly(mission, flyer)).unwrap()
    }

    /// The built-in flyer, and what it flew for.
    #[derive(Default)]
    struct Noting(Vec<Purpose>);

    impl Flyer for Noting {
        fn fly(
            &mut self,
            flight: &Flight,
            poses: &mut dyn PoseSource,
            tell: &dyn Fn(f64),
        ) -> Result<(FlightLog, Option<MissionError>), MissionError> {
            self.0.push(flight.purpose);
            BuiltInFlyer.fly(flight, poses, tell)
        }
    }

    /// Texels where a quarter of what should be there is missing, and the mean of differences in colour there.
    fn where_missing(whole: &Image, left: &Image, differences: [&[Option<f64>]; 2]) -> (u32, [f64; 2]) {
        let (mut sums, mut count) = ([0.0; 2], 0);
        let depths = whole.data().iter().zip(left.data());
        for ((whole, left), (before, after)) in depths.zip(differences[0].iter().zip(differences[1])) {
            if let (Some(before), Some(after)) = (before, after)
                && *whole > 0.2
                && *left < 0.75 * whole
            {
                count += 1;
                sums[0] += before;
                sums[1] += after;
            }
        }
        (count, sums.map(|sum| sum / f64::from(count)))
    }

    /// Five centimetres too high for a quarter of the flight, which nobody knows at the time.
    ///
    /// `cargo test --release -p paintcopter --all-features --lib -- --ignored --nocapture a_band_that_was_painted`
    #[test]
    #[ignore = "three missions"]
    fn a_band_that_was_painted_beside_its_place_is_seen_and_painted() {
        let sound = flown(Faults::default(), false);
        let duration: f64 = sound.flights[0].plan.trajectory.duration();
        let shift = Vector3::new(0.0, 0.0, -0.05);
        let wrong = Mislocalised { from: 0.4 * duration, until: 0.65 * duration, shift };
        let faults = Faults { mislocalised: Some(wrong), ..Faults::default() };
        let [damaged, repaired] = [false, true].map(|look| flown(faults, look));
        let [whole, left] = [&sound, &damaged].map(Mission::painted_depth);
        let (before, after) = (damaged.colour_difference(), repaired.colour_difference());
        let (count, [before, after]) = where_missing(&whole, &left, [&before, &after]);
        println!("{count} texels: CIEDE2000 {before:.2}, {after:.2}; {:?}", repaired.looked);
        assert!(count > 100 && after < 0.5 * before, "{count} {before} {after}");
    }

    /// Each of the three bounds by itself: 0.08 of a unit, a fifth of what was decided, three deviations.
    #[test]
    fn paint_is_missing_where_that_is_sure() {
        assert!(certain_lack(0.3, 0.21, 0.0).is_some_and(|lack| (lack - 0.09).abs() < 1e-12));
        assert_eq!(certain_lack(0.3, 0.23, 0.0), None);
        assert!(certain_lack(1.0, 0.79, 0.0).is_some() && certain_lack(1.0, 0.81, 0.0).is_none());
        assert!(certain_lack(0.3, 0.1, 0.06).is_some() && certain_lack(0.3, 0.1, 0.07).is_none());
        assert_eq!(certain_lack(0.3, 0.5, 0.0), None);
    }

    /// Four texels: sound, wrong by a tenth, opaque, not seen; and one with hardly any paint, on which ten times as much is seen.
    #[test]
    fn the_error_of_the_film_counts_painted_texels() {
        let truth = 0.5 * UNIT_THICKNESS;
        let told = |thickness: f64, opaque: bool| Some(FilmEstimate { thickness, sigma: 0.01 * truth, opaque });
        let told = [told(truth, false), told(1.1 * truth, false), told(3.0 * truth, true), None, told(truth, false)];
        let found = figures(&[truth, truth, truth, truth, 0.05 * UNIT_THICKNESS], &told, 2e-9);
        // Root of (0 + 0.1^2) / 2.
        assert!((found.film_error - 0.1 / 2.0_f64.sqrt()).abs() < 1e-9, "{found:?}");
        assert!((found.film_seen - 0.5).abs() < 1e-12 && found.missing == 2e-9, "{found:?}");
    }

    /// Half of the difference in colour where the nozzle was clogged is the goal. The error of the film is that of motion capture's poses, which
    /// shift spots, and of roughness below a texel; the tenth that is wanted holds on smoother walls (tests of `paint-sim`).
    #[test]
    fn what_a_clogged_nozzle_has_left_out_is_seen_and_painted() {
        let sound = flown(Faults::default(), true);
        let duration: f64 = sound.flights[0].plan.trajectory.duration();
        let clog = Clog { from: 0.4 * duration, until: 0.4 * duration + 60.0, flow: 0.6 };
        let faults = Faults { clogged: Some(clog), ..Faults::default() };
        let damaged = flown(faults, false);
        let mut flyer = Noting::default();
        let repaired = flown_by(&mut flyer, faults, true);
        // What another gave up is a flight of its own.
        assert_eq!(flyer.0, [Purpose::Paint, Purpose::Paint, Purpose::Look, Purpose::Look, Purpose::Paint]);
        let looked = repaired.looked.unwrap();
        let [whole, left, again] = [&sound, &damaged, &repaired].map(Mission::painted_depth);
        let (before, after) = (damaged.colour_difference(), repaired.colour_difference());
        let (count, [before, after]) = where_missing(&whole, &left, [&before, &after]);
        println!("{count} texels: CIEDE2000 {before:.2}, {after:.2}; {looked:?}; sound {:?}", sound.looked);
        assert!(count > 500 && after < 0.5 * before, "{count} {before} {after}");
        assert!(looked.film_error < 0.16 && looked.film_seen > 0.9, "{looked:?}");
        // Nothing is added where nothing is missing.
        let grown = |k: &usize| left.data()[*k] > 0.95 * whole.data()[*k] && again.data()[*k] > left.data()[*k] + 0.15;
        let grown = (0..whole.data().len()).filter(grown).count();
        assert!(grown < count as usize / 20, "{grown}");
        let [missed, missing] = [&sound, &repaired].map(|mission| mission.looked.unwrap().missing);
        assert!(missed < 0.15 * missing, "{missed} {missing}");
    }
}
