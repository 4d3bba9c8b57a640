//! The light in which a painted surface is shown.

mod moment;

use std::fmt;
use std::str::FromStr;

use nalgebra::{Point3, UnitVector3, Vector3};
use paint_sim::Error;
use paint_sim::render::{Lamp, Lights, Sky};
use serde::{Deserialize, Serialize};

use self::moment::Moment;

/// Turbidity of clear air.
const TURBIDITY: f64 = 3.0;
/// Albedo of the ground: soil and grass.
const GROUND: f64 = 0.2;
/// Luminance of a covered sky above, cd/m²; after dark, of the sky over a town.
const OVERCAST: f64 = 5000.0;
const NIGHT: f64 = 0.05;
/// A street lamp: lm and K.
const LAMP: (f64, f64) = (8000.0, 3000.0);
/// Brightest channel of a white card in the middle of the surface that faces the light.
const CARD: f32 = 0.9;

/// The light in which a painted surface is shown.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Light {
    /// `noon`: a clear sky, the sun 45° high, 30° to the side of the surface's front.
    Noon,
    /// `dusk`: a clear sky, the sun 6° high, 40° to the other side.
    Dusk,
    /// `overcast`: a covered sky.
    Overcast,
    /// `lamp`: night, and a street lamp of 8000 lm and 3000 K before the surface, above its upper edge.
    Lamp,
    /// `[DATE T]HH:MM@LATITUDE[,LONGITUDE][/FACING]`: a clear sky, the sun at a moment and a place.
    Sun(Moment),
}

impl Light {
    /// The light before a surface between two corners of its box, of which `facing` is the level direction of the side that is painted.
    ///
    /// # Errors
    /// Nothing that a [`Light`] can be; what the simulator refuses.
    pub fn lights(&self, facing: &Vector3<f64>, [low, high]: [Point3<f64>; 2]) -> Result<Lights, Error> {
        let middle = nalgebra::center(&low, &high);
        let lights = match self {
            Self::Noon => Lights::daylight(aside(facing, 30.0, 45.0), TURBIDITY, GROUND)?,
            Self::Dusk => Lights::daylight(aside(facing, -40.0, 6.0), TURBIDITY, GROUND)?,
            Self::Overcast => Lights::without_sun(Sky::overcast(OVERCAST, GROUND)?, Vec::new()),
            Self::Lamp => {
                let size = high - low;
                let before = 0.5 * size.x.hypot(size.y).max(size.z).max(1.0);
                let mut position = middle + facing * before;
                position.z = high.z + 0.2 * before;
                let lamp = Lamp::new(position, LAMP.0, LAMP.1)?;
                Lights::without_sun(Sky::overcast(NIGHT, GROUND)?, vec![lamp])
            }
            Self::Sun(moment) => {
                let sun = moment.sun()?;
                let from_front = sun.azimuth.to_degrees() - moment.facing;
                Lights::daylight(aside(facing, from_front, sun.elevation.to_degrees()), TURBIDITY, GROUND)?
            }
        };
        lights.exposed_at(&middle, CARD)
    }
}

/// A direction so many degrees clockwise, from above, of a level one, and above the horizon.
fn aside(facing: &Vector3<f64>, clockwise: f64, elevation: f64) -> UnitVector3<f64> {
    let (sine, cosine) = clockwise.to_radians().sin_cos();
    let level = facing * cosine + facing.cross(&Vector3::z()) * sine;
    let (up, along) = elevation.to_radians().sin_cos();
    UnitVector3::new_normalize(level * along + Vector3::z() * up)
}

impl FromStr for Light {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Ok(match text {
            "noon" => Self::Noon,
            "dusk" => Self::Dusk,
            "overcast" => Self::Overcast,
            "lamp" => Self::Lamp,
            moment => Self::Sun(moment.parse()?),
        })
    }
}

impl fmt::Display for Light {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Noon => f.write_str("noon"),
            Self::Dusk => f.write_str("dusk"),
            Self::Overcast => f.write_str("overcast"),
            Self::Lamp => f.write_str("lamp"),
            Self::Sun(moment) => write!(f, "{moment}"),
        }
    }
}

impl TryFrom<String> for Light {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<Light> for String {
    fn from(light: Light) -> Self {
        light.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOX: [[f64; 3]; 2] = [[-0.2, -2.0, 1.0], [0.2, 2.0, 3.0]];

    fn lights(text: &str, facing: Vector3<f64>) -> Lights {
        text.parse::<Light>().unwrap().lights(&facing, BOX.map(Point3::from)).unwrap()
    }

    #[test]
    fn every_light_falls_on_the_front_and_shows_a_white_card() {
        for facing in [-Vector3::x(), Vector3::y(), Vector3::new(0.6, -0.8, 0.0)] {
            for text in ["noon", "dusk", "overcast", "lamp", "12:00@47.4"] {
                let lights = lights(text, facing);
                let middle = Point3::new(0.0, 0.0, 2.0);
                let front = lights.on_card(&middle, &facing).into_iter().fold(0.0, f32::max);
                let back = lights.on_card(&middle, &-facing).into_iter().fold(0.0, f32::max);
                assert!(front > 0.25 && front < 0.901 && front > 0.99 * back, "{text}: {front} {back}");
            }
        }
        let [noon, dusk] = ["noon", "dusk"].map(|text| lights(text, -Vector3::x()));
        assert!((noon.towards_sun.z - 0.5_f64.sqrt()).abs() < 1e-12);
        // Dusk is redder, and from the other side.
        assert!(dusk.sun[0] / dusk.sun[2] > 3.0 * noon.sun[0] / noon.sun[2]);
        assert!(noon.towards_sun.y * dusk.towards_sun.y < 0.0);
    }

    /// A wall that faces south has the sun before it at noon, to its east side in the morning, and the other way round on the other half of the globe.
    #[test]
    fn the_sun_goes_round_the_wall_by_the_compass() {
        // The world's -x is south: east is -y, as z is up.
        let sun = |text| lights(text, -Vector3::x()).towards_sun;
        let noon = sun("2026-03-20T12:00@47.4");
        assert!(noon.x < -0.7 && noon.y.abs() < 0.05, "{noon:?}");
        assert!((noon.z.asin().to_degrees() - 42.6).abs() < 0.3);
        assert!(sun("2026-03-20T08:00@47.4").y < -0.7);
        assert!(sun("2026-03-20T16:00@47.4").y > 0.7);
        assert!(sun("2026-03-20T12:00@-30").x > 0.4);
        // Facing west, it has the evening sun before it.
        assert!(sun("2026-03-20T17:00@47.4/west").x < -0.9);
        assert!(sun("2026-03-20T17:00@47.4/270").x < -0.9);
        // With a longitude the time is UTC: at 12:00 it is evening 75 degrees farther east.
        assert!((sun("2026-03-20T12:00@47.4,75").y - sun("2026-03-20T17:00@47.4").y).abs() < 0.01);
    }

    #[test]
    fn what_is_written_is_read_and_the_rest_is_refused_with_the_forms() {
        for text in ["noon", "dusk", "lamp", "overcast", "18:30@47.4", "2026-06-21T04:30@47.4,8.5/90", "09:05@-12/225"]
        {
            let light: Light = text.parse().unwrap();
            assert_eq!(light.to_string().parse::<Light>().unwrap(), light, "{text}");
        }
        for bad in [
            "night",
            "",
            "25:00@47",
            "12:61@47",
            "12:00@91",
            "12:00@nan",
            "12:00",
            "2026-13-01T12:00@4",
            "2026-02-30T12:00@4",
            "12:00@47/up",
            "12:00@47,181",
            "1949-12-31T12:00@4",
            "12@4",
            "é:00@4",
        ] {
            let error = bad.parse::<Light>().unwrap_err();
            assert!(error.contains("noon, dusk, lamp, overcast"), "{bad}: {error}");
        }
        assert!("23:00@47.4".parse::<Light>().unwrap_err().contains("below the horizon"));
    }
}
