//! The flights that a plan is cut into, joined.

use std::collections::VecDeque;

use paint_planner::onboard::Sortie;
use paint_sim::flight::FlightLog;

use super::error::MissionError;
use super::grounded::Grounded;
use crate::onboard::LocalisationFigures;
use crate::say;

/// What is told of the sorties of a plan.
#[derive(Default)]
pub(super) struct Sorties {
    /// What the robot's own localisation was worth in them.
    pub(super) localisation: Option<LocalisationFigures>,
    /// How many were flown.
    pub(super) count: usize,
    /// Why those after them were not.
    pub(super) ended: Option<Grounded>,
}

/// What was flown of a piece.
pub(super) struct FlownPiece {
    /// By the time of the plan.
    pub(super) log: FlightLog,
    /// What the robot's own localisation was worth.
    pub(super) localisation: Option<LocalisationFigures>,
    /// What has ended it in the air, before its end.
    pub(super) ended: Option<MissionError>,
}

/// A flight of a piece, or of all of the plan, after what was flown of it.
type FlyPiece<'a> = dyn FnMut(usize, Option<Sortie>, Option<&FlightLog>) -> Result<FlownPiece, MissionError> + 'a;

/// A sortie that has painted for less than this, s of the plan, before it ended in the air is the last: the next would do no better.
const WORTHWHILE: f64 = 5.0;

/// Flies the pieces of a plan of a duration (s) one after another. What is left of one that ends in the air is flown as another. Where one cannot
/// be flown, those before it are the flight; the error before any paint is that of all.
pub(super) fn in_pieces(
    pieces: &[Option<Sortie>],
    duration: f64,
    fly: &mut FlyPiece,
) -> Result<(FlightLog, Sorties), MissionError> {
    let mut told = Sorties::default();
    let mut whole: Option<FlightLog> = None;
    let mut waiting: VecDeque<Option<Sortie>> = pieces.iter().copied().collect();
    while let Some(piece) = waiting.pop_front() {
        let from = piece.map_or(0.0, |piece| piece.from);
        let FlownPiece { mut log, localisation, ended } = match fly(told.count, piece, whole.as_ref()) {
            Ok(flown) => flown,
            Err(error) if whole.is_some() => {
                told.ended = Some(Grounded::by(&error, duration - from));
                break;
            }
            Err(error) => return Err(error),
        };
        told.count += 1;
        told.localisation = told.localisation.into_iter().chain(localisation).reduce(LocalisationFigures::and);
        if let Some(error) = ended {
            let painted = painted_until(&mut log, from);
            if whole.is_none() && log.samples.is_empty() {
                return Err(error);
            }
            say!("at {painted:.0} s of the plan a flight has ended: {error}");
            if painted - from < WORTHWHILE {
                told.ended = Some(Grounded::by(&error, duration - painted));
                waiting.clear();
            } else {
                let until = piece.map_or(duration, |piece| piece.until);
                waiting.push_front(Some(Sortie { from: painted, until, paint: 0.0 }));
            }
        }
        match &mut whole {
            Some(whole) => whole.samples.extend(log.samples),
            None => whole = Some(log),
        }
    }
    whole.map(|whole| (whole, told)).ok_or(MissionError::NothingToPaint("the plan has no pieces"))
}

/// Cuts what follows the last paint off the log of a flight that began at a time of the plan: there the valve was shut by what has ended it.
/// Returns when that was.
fn painted_until(log: &mut FlightLog, from: f64) -> f64 {
    let painted = log.samples.iter().rposition(|sample| sample.flow > 0.0).map_or(0, |last| last + 1);
    log.samples.truncate(painted);
    log.samples.last().map_or(from, |last| last.time + log.interval)
}

#[cfg(test)]
mod tests {
    use paint_planner::timing::TimingPolicy;

    use super::super::settings::MissionSettings;
    use super::super::test_panel;
    use super::*;

    fn pieces() -> Vec<Option<Sortie>> {
        (0..3).map(|k| f64::from(k) * 7.0).map(|from| Some(Sortie { from, until: from + 7.0, paint: 0.0 })).collect()
    }

    fn whole(log: &FlightLog) -> FlownPiece {
        FlownPiece { log: log.clone(), localisation: None, ended: None }
    }

    /// A flight that ends in the air at 12 s, with the valve shut since 10 s: the next begins there, and together they paint as one does. One
    /// that paints for less than 5 s is the last.
    #[test]
    fn what_is_left_of_a_sortie_that_ends_in_the_air_is_flown_as_another() {
        let mut settings = MissionSettings::default();
        settings.planner.timing.policy = TimingPolicy::Uniform { speed: 0.05 };
        let flight = test_panel::flown(&settings).1;
        let duration = flight.samples.last().unwrap().time;
        let part = |from: f64, until: f64| {
            let mut log = flight.clone();
            log.samples.retain(|sample| sample.time > from - 0.5 * log.interval && sample.time < until);
            log
        };
        let ending = |from: f64, at: f64| {
            let mut log = part(from, at + 2.0);
            log.samples.iter_mut().filter(|sample| sample.time > at).for_each(|sample| sample.flow = 0.0);
            FlownPiece { log, localisation: None, ended: Some(MissionError::NoMap) }
        };
        let mut begun = Vec::new();
        let (log, told) = in_pieces(&[None], duration, &mut |k, piece, _| {
            begun.push(piece.map(|piece| (piece.from, piece.until)));
            let from = piece.map_or(0.0, |piece| piece.from);
            Ok(if k == 0 { ending(from, 10.0) } else { whole(&part(from, f64::INFINITY)) })
        })
        .unwrap();
        let [None, Some((from, until))] = begun[..] else { panic!("{begun:?}") };
        assert!((from - 10.0).abs() < 2.0 * log.interval && until == duration, "{begun:?}");
        assert_eq!((log, told.count, told.ended), (flight.clone(), 2, None));
        let (_, told) = in_pieces(&[None], duration, &mut |k, piece, _| {
            let from = piece.map_or(0.0, |piece| piece.from);
            Ok(ending(from, if k == 0 { 10.0 } else { 12.0 }))
        })
        .unwrap();
        assert_eq!(told.count, 2);
        assert!((told.ended.unwrap().left_s - (duration - 12.0)).abs() < 0.2);
        // Before any paint it is an error.
        let none = in_pieces(&[None], duration, &mut |_, _, _| Ok(ending(0.0, -1.0)));
        assert!(matches!(none, Err(MissionError::NoMap)));
    }

    /// Three pieces of 7 s, of which the second cannot be flown: the first is kept, the third not tried.
    #[test]
    fn what_was_flown_before_a_sortie_that_could_not_be_is_kept() {
        let flight = test_panel::flown(&MissionSettings::default()).1;
        let mut tried = 0;
        let (log, told) = in_pieces(&pieces(), 21.0, &mut |k, _, flown| {
            tried += 1;
            assert_eq!(flown.is_some(), k > 0);
            if k == 1 { Err(MissionError::NoMap) } else { Ok(whole(&flight)) }
        })
        .unwrap();
        assert_eq!((log, told.count, tried), (flight, 1, 2));
        let ended = told.ended.unwrap();
        assert_eq!((ended.left_s, ended.why), (14.0, MissionError::NoMap.to_string()));
        assert!(matches!(
            in_pieces(&pieces(), 21.0, &mut |_, _, _| Err(MissionError::NoMap)),
            Err(MissionError::NoMap)
        ));
    }
}
