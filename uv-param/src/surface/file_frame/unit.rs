//! Units of length that mesh files are in.

use std::ops::RangeInclusive;
use std::str::FromStr;

/// A unit of length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// Metre.
    Metre,
    /// Centimetre.
    Centimetre,
    /// Millimetre.
    Millimetre,
    /// International foot, 0.3048 m.
    Foot,
    /// Inch, 0.0254 m.
    Inch,
}

impl Unit {
    /// Its length, metres.
    pub fn metres(self) -> f64 {
        match self {
            Self::Metre => 1.0,
            Self::Centimetre => 0.01,
            Self::Millimetre => 0.001,
            Self::Foot => 0.3048,
            Self::Inch => 0.0254,
        }
    }

    /// Its short name: `m`, `cm`, `mm`, `ft` or `in`.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Metre => "m",
            Self::Centimetre => "cm",
            Self::Millimetre => "mm",
            Self::Foot => "ft",
            Self::Inch => "in",
        }
    }

    /// The unit in which a mesh with this longest side has one of the `plausible` lengths, metres: the first of metres, millimetres and centimetres.
    /// Feet and inches are never guessed: what is plausible in them is so in metres or centimetres as well. `None`: no unit fits.
    pub fn guess(longest_side: f64, plausible: &RangeInclusive<f64>) -> Option<Self> {
        [Self::Metre, Self::Millimetre, Self::Centimetre]
            .into_iter()
            .find(|unit| plausible.contains(&(unit.metres() * longest_side)))
    }

    /// The unit that a line of comment names, as in `units: feet` or `metres, z up`; `None` where it names none.
    pub fn in_comment(comment: &str) -> Option<Self> {
        let lower = comment.to_ascii_lowercase();
        let words: Vec<&str> = lower.split(|c: char| !c.is_ascii_alphanumeric()).filter(|w| !w.is_empty()).collect();
        let announced = words.iter().position(|w| ["unit", "units"].contains(w));
        let ours = words.len() == 3 && words[2] == "up" && words[1].len() == 1;
        match announced {
            // The name follows the word, or, as in "units are in mm", comes soon after it.
            Some(k) => words[k + 1..]
                .iter()
                .take(4)
                .filter(|w| **w != "in" || words.len() == k + 2)
                .find_map(|w| w.parse().ok()),
            None if ours => words[0].parse().ok(),
            None => None,
        }
    }
}

impl FromStr for Unit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Ok(match text.to_ascii_lowercase().as_str() {
            "m" | "metre" | "metres" | "meter" | "meters" => Self::Metre,
            "cm" | "centimetre" | "centimetres" | "centimeter" | "centimeters" => Self::Centimetre,
            "mm" | "millimetre" | "millimetres" | "millimeter" | "millimeters" => Self::Millimetre,
            "ft" | "foot" | "feet" => Self::Foot,
            "in" | "inch" | "inches" => Self::Inch,
            _ => return Err(format!("{text} is no unit of length: give m, cm, mm, ft or in")),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_of_surfaces_tell_metres_centimetres_and_millimetres() {
        let range = 0.4..=40.0;
        for (side, unit) in
            [(0.4, "m"), (3.0, "m"), (39.0, "m"), (41.0, "cm"), (300.0, "cm"), (400.0, "mm"), (3e4, "mm")]
        {
            assert_eq!(Unit::guess(side, &range).map(Unit::symbol), Some(unit), "{side}");
        }
        for side in [0.0, 0.39, 4.1e4, f64::INFINITY, f64::NAN] {
            assert_eq!(Unit::guess(side, &range), None, "{side}");
        }
    }

    #[test]
    fn comments_that_name_a_unit_are_read_and_others_are_not() {
        for (comment, unit) in [
            (" units: feet", Some(Unit::Foot)),
            ("UNITS=mm", Some(Unit::Millimetre)),
            ("Unit: in", Some(Unit::Inch)),
            ("units are in centimeters", Some(Unit::Centimetre)),
            (" metres, z up", Some(Unit::Metre)),
            ("12 feet of rope", None),
            ("made in Rome", None),
            ("units unknown", None),
        ] {
            assert_eq!(Unit::in_comment(comment), unit, "{comment}");
        }
    }
}
