//! A robot that finds itself before it takes off, while it stands and time goes on.

use paint_sim::Error;
use paint_sim::flight::{FlightSample, LocalisedPose, PoseSource, Vehicle};

use super::localisation::LocalisationError;
use super::localised_flight::{LocalisedFlight, milliseconds};

/// It looks for its place so long, ms.
const LONGEST_SEARCH_MS: i64 = 10_000;

/// A [`LocalisedFlight`] of a robot that stands where its camera sees the surface, with motors off. Times begin with the first image; there is no
/// pose before it is found.
pub struct StandingStart<'a, 'b>(pub &'a mut LocalisedFlight<'b>);

impl StandingStart<'_, '_> {
    fn sense(&mut self, time: f64, truth: &Vehicle) -> Result<(), LocalisationError> {
        let ms = milliseconds(time);
        if ms > LONGEST_SEARCH_MS {
            return Err(LocalisationError::NotHere { seconds: 1e-3 * LONGEST_SEARCH_MS as f64 });
        }
        if self.0.look(ms, truth, true)? {
            self.0.found();
        }
        Ok(())
    }
}

impl PoseSource for StandingStart<'_, '_> {
    fn moved(&mut self, time: f64, truth: &Vehicle) -> Result<(), Error> {
        if self.0.is_found() {
            return self.0.moved(time, truth);
        }
        self.sense(time, truth).map_err(|why| Error::Localisation { time, why: why.to_string() })
    }

    fn sprayed(&mut self, sample: &FlightSample, interval: f64) {
        self.0.sprayed(sample, interval);
    }

    fn pose(&mut self, time: f64, truth: &Vehicle) -> Result<Option<LocalisedPose>, Error> {
        if self.0.is_found() { self.0.pose(time, truth) } else { Ok(None) }
    }
}
