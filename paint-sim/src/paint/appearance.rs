//! What a paint looks like on a substrate, by the thickness of its film: tabulated once, then looked up.

use super::{Paint, Substrate};
use crate::colour::{encode_srgb, encode_srgb8, spectrum_lab, spectrum_linear_srgb, xyz};
use crate::error::{Error, check_positive};

/// Thicknesses in a table.
const SAMPLES: usize = 400;

/// Colours of a paint on a substrate. Depths are thicknesses over a unit of the caller's choice; beyond the deepest, the deepest counts.
///
/// ```
/// use paint_sim::Substrate;
/// use paint_sim::paint::{Appearance, PaintName};
///
/// let (charcoal, wall) = (PaintName::Charcoal.paint(20e-6)?, Substrate::sandstone());
/// let coat = Appearance::new(&charcoal, &wall, 20e-6, 4.0)?;
/// assert!(coat.lab(1.0)[0] < coat.lab(0.0)[0]);
/// # Ok::<(), paint_sim::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Appearance {
    deepest: f64,
    /// At evenly spaced depths from 0 to the deepest.
    table: Vec<Shade>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Shade {
    linear: [f64; 3],
    lab: [f64; 3],
}

impl Appearance {
    /// Tabulates depths from 0 to `deepest`; a depth of 1 is a film of `unit_thickness` metres.
    ///
    /// # Errors
    /// A thickness or depth that is not positive.
    pub fn new(paint: &Paint, substrate: &Substrate, unit_thickness: f64, deepest: f64) -> Result<Self, Error> {
        let shade = |depth: f64| {
            let film = paint.over(depth * unit_thickness, substrate)?;
            Ok(Shade { linear: spectrum_linear_srgb(film.reflectance()), lab: spectrum_lab(film.reflectance()) })
        };
        let table = depths(unit_thickness, deepest)?.map(shade).collect::<Result<_, Error>>()?;
        Ok(Self { deepest, table })
    }

    /// Linear sRGB at a depth.
    pub fn linear(&self, depth: f64) -> [f64; 3] {
        self.mix(depth, |s| s.linear)
    }

    /// sRGB bytes at a depth.
    pub fn srgb(&self, depth: f64) -> [u8; 3] {
        self.linear(depth).map(|c| encode_srgb8(c).0)
    }

    /// CIELAB at a depth.
    pub fn lab(&self, depth: f64) -> [f64; 3] {
        self.mix(depth, |s| s.lab)
    }

    fn mix(&self, depth: f64, of: impl Fn(&Shade) -> [f64; 3]) -> [f64; 3] {
        let at = (depth / self.deepest).clamp(0.0, 1.0) * (self.table.len() - 1) as f64;
        let k = (at as usize).min(self.table.len() - 2);
        let (a, b, t) = (of(&self.table[k]), of(&self.table[k + 1]), at - k as f64);
        std::array::from_fn(|i| a[i] + t * (b[i] - a[i]))
    }
}

/// Knots of ink over depth, as [`Appearance::new`] takes depths: ink is the share of the way from the grey of the bare substrate to that of
/// opaque paint, in sRGB greys. For a paint that darkens its substrate the knots rise from (0, 0).
///
/// # Errors
/// As [`Appearance::new`].
pub fn ink_curve(
    paint: &Paint,
    substrate: &Substrate,
    unit_thickness: f64,
    deepest: f64,
) -> Result<Vec<(f64, f64)>, Error> {
    let grey = |s: &Substrate| encode_srgb(xyz(s.reflectance())[1]);
    let at = |depth: f64| paint.over(depth * unit_thickness, substrate);
    let bare = grey(substrate);
    // Ten times the deepest knot is opaque to rounding.
    let darkest = grey(&at(10.0 * deepest)?);
    let knot = |depth: f64| Ok((depth, if depth > 0.0 { (bare - grey(&at(depth)?)) / (bare - darkest) } else { 0.0 }));
    depths(unit_thickness, deepest)?.map(knot).collect()
}

fn depths(unit_thickness: f64, deepest: f64) -> Result<impl Iterator<Item = f64>, Error> {
    check_positive("unit thickness of a paint", unit_thickness)?;
    check_positive("deepest film of a table", deepest)?;
    Ok((0..SAMPLES).map(move |k| deepest * k as f64 / (SAMPLES - 1) as f64))
}
