//! A moment at a place, as `[DATE T]HH:MM@LATITUDE[,LONGITUDE][/FACING]`.

use std::fmt;
use std::str::FromStr;

use paint_sim::Error;
use paint_sim::render::SunPosition;

const USAGE: &str = "give noon, dusk, lamp, overcast, or the sun as [YYYY-MM-DDT]HH:MM@LATITUDE[,LONGITUDE][/FACING]: degrees, north and east \
                     positive; the time is UTC with a longitude, else that of the place's own sun; FACING is where the surface looks, north, east, \
                     south (default), west or degrees clockwise from north; the date of 2026-06-21 if not given";
/// A day of long light, and of short light south of the equator.
const SOLSTICE: Date = Date { year: 2026, month: 6, day: 21 };
const COMPASS: [(&str, f64); 4] = [("north", 0.0), ("east", 90.0), ("south", 180.0), ("west", 270.0)];
const SOUTH: f64 = 180.0;

#[derive(Debug, Clone, Copy, PartialEq)]
struct Date {
    year: i64,
    month: i64,
    day: i64,
}

/// A moment at a place before a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    date: Date,
    /// Minutes of the day.
    minutes: u32,
    /// Degrees.
    latitude: f64,
    longitude: Option<f64>,
    /// Where the surface looks, degrees clockwise from north.
    pub(super) facing: f64,
}

impl Moment {
    /// Where the sun stands.
    pub(super) fn sun(&self) -> Result<SunPosition, Error> {
        let time = 86_400.0 * self.date.since_1970() as f64 + 60.0 * f64::from(self.minutes);
        // The mean sun passes Greenwich's meridian at noon of its time, and any other at noon of its own.
        SunPosition::new(time, self.latitude.to_radians(), self.longitude.unwrap_or(0.0).to_radians())
    }
}

impl FromStr for Moment {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let usage = || format!("\"{text}\": {USAGE}");
        let moment = parse(text).ok_or_else(usage)?;
        let sun = moment.sun().map_err(|error| format!("\"{text}\": {error}; {USAGE}"))?;
        if sun.elevation <= 0.0 {
            let below = -sun.elevation.to_degrees();
            return Err(format!(
                "\"{text}\": the sun is {below:.1} degrees below the horizon then: give a time of day, or lamp"
            ));
        }
        Ok(moment)
    }
}

fn parse(text: &str) -> Option<Moment> {
    let (time, place) = text.split_once('@')?;
    let (date, clock) = match time.split_once('T') {
        Some((date, clock)) => (Date::parse(date)?, clock),
        None => (SOLSTICE, time),
    };
    let (hours, minutes) = clock.split_once(':')?;
    let (hours, minutes): (u32, u32) = (hours.parse().ok()?, minutes.parse().ok()?);
    let (place, facing) = match place.split_once('/') {
        Some((place, facing)) => (place, bearing(facing)?),
        None => (place, SOUTH),
    };
    let (latitude, longitude) = match place.split_once(',') {
        Some((latitude, longitude)) => (latitude, Some(degrees(longitude, 180.0)?)),
        None => (place, None),
    };
    let latitude = degrees(latitude, 90.0)?;
    (hours < 24 && minutes < 60).then_some(Moment { date, minutes: 60 * hours + minutes, latitude, longitude, facing })
}

fn bearing(text: &str) -> Option<f64> {
    let named = COMPASS.into_iter().find(|(name, _)| *name == text).map(|(_, degrees)| degrees);
    named.or_else(|| degrees(text, 360.0))
}

fn degrees(text: &str, most: f64) -> Option<f64> {
    text.parse().ok().filter(|v: &f64| v.abs() <= most)
}

impl Date {
    fn parse(text: &str) -> Option<Self> {
        let mut parts = text.splitn(3, '-').map(|part| part.parse::<i64>().ok());
        let date = Self { year: parts.next()??, month: parts.next()??, day: parts.next()?? };
        let leap = date.year % 4 == 0 && (date.year % 100 != 0 || date.year % 400 == 0);
        let length = match date.month {
            2 => 28 + i64::from(leap),
            4 | 6 | 9 | 11 => 30,
            1..=12 => 31,
            _ => 0,
        };
        ((1950..=2050).contains(&date.year) && (1..=length).contains(&date.day)).then_some(date)
    }

    /// Days since 1970-01-01 (Fliegel and Van Flandern 1968).
    fn since_1970(self) -> i64 {
        let Self { year, month, day } = self;
        let march = (month - 14) / 12;
        let julian = 1461 * (year + 4800 + march) / 4 + 367 * (month - 2 - 12 * march) / 12
            - 3 * ((year + 4900 + march) / 100) / 4
            + day
            - 32_075;
        julian - 2_440_588
    }
}

impl fmt::Display for Moment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Date { year, month, day } = self.date;
        write!(f, "{year:04}-{month:02}-{day:02}T{:02}:{:02}@{}", self.minutes / 60, self.minutes % 60, self.latitude)?;
        if let Some(longitude) = self.longitude {
            write!(f, ",{longitude}")?;
        }
        if self.facing == SOUTH { Ok(()) } else { write!(f, "/{}", self.facing) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_are_counted_from_1970() {
        for (text, days) in [("1970-01-01", 0), ("2000-02-29", 11_016), ("2026-06-21", 20_625), ("1950-01-01", -7305)] {
            assert_eq!(Date::parse(text).unwrap().since_1970(), days, "{text}");
        }
        assert_eq!(Date::parse("2025-02-29"), None);
    }
}
