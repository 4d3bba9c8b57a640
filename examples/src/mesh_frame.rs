//! Unit and up axis of a mesh file: what the switches say, else what the file says, else what the mesh tells. All programs take them here, and
//! say what they took and which switch changes it.

use std::ops::RangeInclusive;
use std::path::Path;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use uv_param::surface::file_frame::{Unit, UpEvidence, up_axis};

use crate::mesh_io::TriangleMesh;
use crate::mesh_placement::{LONGEST_SIDE, UpAxis};

/// Metres per unit of a mesh file. In files and on the command line a number, a unit (`m`, `cm`, `mm`, `ft`, `in`), or `fit`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "NumberOrText", into = "NumberOrText")]
pub enum MeshScale {
    /// Metres per unit.
    Factor(f64),
    /// Whatever makes the longest side 3 m.
    Fit,
}

/// What a scale is written as.
#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum NumberOrText {
    Number(f64),
    Text(String),
}

impl TryFrom<NumberOrText> for MeshScale {
    type Error = String;

    fn try_from(written: NumberOrText) -> Result<Self, String> {
        match written {
            NumberOrText::Number(factor) => Ok(Self::Factor(factor)),
            NumberOrText::Text(text) => text.parse(),
        }
    }
}

impl From<MeshScale> for NumberOrText {
    fn from(scale: MeshScale) -> Self {
        match scale {
            MeshScale::Factor(factor) => Self::Number(factor),
            MeshScale::Fit => Self::Text("fit".into()),
        }
    }
}

impl FromStr for MeshScale {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "fit" {
            return Ok(Self::Fit);
        }
        let unit = || text.parse::<Unit>().ok().map(Unit::metres);
        let factor = text.parse().ok().or_else(unit);
        factor.map(Self::Factor).ok_or_else(|| "give metres per unit, or m, cm, mm, ft, in, or fit".to_owned())
    }
}

/// What a mesh is to the program, which says how long it may be.
#[derive(Debug, Clone, Copy)]
pub enum Subject {
    /// What a flying robot paints.
    Object,
    /// A place of which it paints a part.
    Place,
    /// What a person paints with a nozzle in the hand.
    Handheld,
}

impl Subject {
    /// Plausible longest sides, metres.
    fn lengths(self) -> RangeInclusive<f64> {
        match self {
            Self::Object => 0.4..=40.0,
            Self::Place => 0.4..=1000.0,
            Self::Handheld => 0.02..=2.0,
        }
    }
}

/// Metres per unit of a mesh, and why, in words.
pub fn scale_of(mesh: &TriangleMesh, asked: Option<MeshScale>, subject: Subject) -> (f64, String) {
    let (low, high) = mesh.bounds();
    let longest = (0..3).map(|c| f64::from(high[c]) - f64::from(low[c])).fold(0.0, f64::max);
    let long = |factor: f64| format!("{} m long", rounded(factor * longest));
    // A mesh without extent is refused where it is placed.
    let fit = if longest > 0.0 { LONGEST_SIDE / longest } else { 1.0 };
    match (asked, mesh.unit) {
        (Some(MeshScale::Factor(factor)), _) => (factor, format!("{} (--scale)", long(factor))),
        (Some(MeshScale::Fit), _) => (fit, format!("made {LONGEST_SIDE} m long (--scale fit)")),
        (None, Some(metres)) => (metres, format!("{}, in the unit that its file names", long(metres))),
        (None, None) => match (Unit::guess(longest, &subject.lengths()), subject) {
            (Some(unit), _) => {
                let (factor, name) = (unit.metres(), unit.symbol());
                (factor, format!("taken to be in {name}, {} (else --scale m, cm, mm, ft, in)", long(factor)))
            }
            (None, Subject::Place | Subject::Handheld) => {
                (1.0, format!("taken to be in m, {} (else --scale m, cm, mm, ft, in)", long(1.0)))
            }
            (None, Subject::Object) => {
                let why = format!("no unit makes a side of {} one to paint", rounded(longest));
                (fit, format!("{why}: made {LONGEST_SIDE} m long (else --scale m, cm, mm, ft, in)"))
            }
        },
    }
}

/// The axis of a mesh file that points up, and why, in words.
pub fn up_of(mesh: &TriangleMesh, path: &Path, asked: Option<UpAxis>) -> (UpAxis, String) {
    let named = |up: UpAxis, why: &str| (up, format!("{} up ({why})", up.name()));
    if let Some(up) = asked {
        return named(up, "--up");
    }
    if let Some(direction) = mesh.up {
        return named(UpAxis::of_direction(direction), "as its file says; else --up");
    }
    if let Some(found) = up_axis(&mesh.positions, &mesh.faces, mesh.origin) {
        let why = match found.evidence {
            UpEvidence::Base => "it has a base there; else --up",
            UpEvidence::Surveyed => "its coordinates are those of a map; else --up",
        };
        return named(UpAxis::of_direction(found.direction), why);
    }
    named(UpAxis::of_file(path), "usual in such files, the shape does not tell; else --up")
}

/// Three digits.
fn rounded(value: f64) -> String {
    let digits = if value > 0.0 { (2.0 - value.log10().floor()).clamp(0.0, 9.0) } else { 0.0 };
    format!("{value:.*}", digits as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A side of 2 units, whose file says that it is in centimetres with y up.
    fn named_mesh() -> TriangleMesh {
        TriangleMesh {
            positions: vec![[0.0; 3], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            faces: vec![[0, 1, 2]],
            unit: Some(0.01),
            up: Some([0.0, 1.0, 0.0]),
            ..TriangleMesh::default()
        }
    }

    #[test]
    fn switches_come_before_the_file_and_the_file_before_the_shape() {
        let mesh = named_mesh();
        let up = |asked| up_of(&mesh, Path::new("mesh.ply"), asked);
        assert_eq!(up(Some(UpAxis::X)), (UpAxis::X, "x up (--up)".to_owned()));
        assert_eq!(up(None).0, UpAxis::Y);
        let unnamed = TriangleMesh { up: None, ..named_mesh() };
        assert_eq!(up_of(&unnamed, Path::new("mesh.ply"), None).0, UpAxis::Z);
        assert_eq!(up_of(&unnamed, Path::new("mesh.obj"), None).0, UpAxis::Y);

        let scale = |asked| scale_of(&mesh, asked, Subject::Object).0;
        assert_eq!(scale(Some(MeshScale::Factor(0.5))), 0.5);
        assert_eq!(scale(Some(MeshScale::Fit)), 0.5 * LONGEST_SIDE);
        assert_eq!(scale(None), 0.01);
    }

    /// Two units are metres for an object; 2000 are millimetres; what no unit makes plausible is made as long as a wall.
    #[test]
    fn a_unit_that_nobody_names_is_guessed_by_the_length() {
        let of = |factor: f32, subject| {
            let mut mesh = TriangleMesh { unit: None, ..named_mesh() };
            mesh.positions.iter_mut().flatten().for_each(|c| *c *= factor);
            scale_of(&mesh, None, subject)
        };
        assert_eq!(of(1.0, Subject::Object).0, 1.0);
        assert_eq!(of(1e3, Subject::Object).0, 1e-3);
        assert!((of(1e9, Subject::Object).0 * 2e9 - LONGEST_SIDE).abs() < 1e-9);
        assert_eq!(of(1e9, Subject::Place).0, 1.0);
    }

    #[test]
    fn scales_are_numbers_units_or_fit() {
        let scale = |text: &str| text.parse::<MeshScale>();
        assert_eq!(scale("0.25"), Ok(MeshScale::Factor(0.25)));
        assert_eq!(scale("mm"), Ok(MeshScale::Factor(1e-3)));
        assert_eq!(scale("ft"), Ok(MeshScale::Factor(0.3048)));
        assert_eq!(scale("fit"), Ok(MeshScale::Fit));
        assert!(scale("furlong").is_err());
        let written = |scale| NumberOrText::from(scale);
        assert_eq!(MeshScale::try_from(written(MeshScale::Fit)), Ok(MeshScale::Fit));
        assert_eq!(MeshScale::try_from(written(MeshScale::Factor(2.0))), Ok(MeshScale::Factor(2.0)));
    }

    #[test]
    fn lengths_are_said_with_three_digits() {
        assert_eq!([0.0, 0.012_345, 1.234_5, 123.45, 12_345.0].map(rounded), ["0", "0.0123", "1.23", "123", "12345"]);
    }
}
