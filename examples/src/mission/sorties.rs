//! The flights that a plan is cut into, joined.

use paint_planner::onboard::Sortie;
use paint_sim::flight::FlightLog;

use super::error::MissionError;
use super::grounded::Grounded;
use crate::onboard::LocalisationFigures;

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

/// A flight of a piece, or of all of the plan, after what was flown of it.
type FlyPiece<'a> = dyn FnMut(usize, Option<Sortie>, Option<&FlightLog>) -> Result<(FlightLog, Option<LocalisationFigures>), MissionError>
    + 'a;

/// Flies the pieces of a plan of a duration (s) one after another. Where one cannot be flown, those before it are the flight; the error of the
/// first is that of all.
pub(super) fn in_pieces(
    pieces: &[Option<Sortie>],
    duration: f64,
    fly: &mut FlyPiece,
) -> Result<(FlightLog, Sorties), MissionError> {
    let mut told = Sorties::default();
    let mut whole: Option<FlightLog> = None;
    for (k, &piece) in pieces.iter().enumerate() {
        match fly(k, piece, whole.as_ref()) {
            Ok((part, figures)) => {
                told.count += 1;
                told.localisation = told.localisation.into_iter().chain(figures).reduce(LocalisationFigures::and);
                match &mut whole {
                    Some(whole) => whole.samples.extend(part.samples),
                    None => whole = Some(part),
                }
            }
            Err(error) if whole.is_some() => {
                let begins = piece.map_or(0.0, |piece| piece.from);
                told.ended = Some(Grounded::by(&error, duration - begins));
                break;
            }
            Err(error) => return Err(error),
        }
    }
    whole.map(|whole| (whole, told)).ok_or(MissionError::NothingToPaint("the plan has no pieces"))
}

#[cfg(test)]
mod tests {
    use super::super::settings::MissionSettings;
    use super::super::test_panel;
    use super::*;

    fn pieces() -> Vec<Option<Sortie>> {
        (0..3).map(|k| f64::from(k) * 7.0).map(|from| Some(Sortie { from, until: from + 7.0, paint: 0.0 })).collect()
    }

    /// Three pieces of 7 s, of which the second cannot be flown: the first is kept, the third not tried.
    #[test]
    fn what_was_flown_before_a_sortie_that_could_not_be_is_kept() {
        let flight = test_panel::flown(&MissionSettings::default()).1;
        let mut tried = 0;
        let (log, told) = in_pieces(&pieces(), 21.0, &mut |k, _, flown| {
            tried += 1;
            assert_eq!(flown.is_some(), k > 0);
            if k == 1 { Err(MissionError::NoMap) } else { Ok((flight.clone(), None)) }
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
