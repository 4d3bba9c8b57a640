//! What the caller says about pages, and what comes out.

use crate::error::Error;

/// Most texels of a page: 8192 x 8192, which take 2.7 GB as points of the surface.
const MAX_TEXELS: usize = 1 << 26;

/// Which turns the packer may try.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Turns {
    /// None: charts stand as they are.
    None,
    /// Quarters of a circle.
    Quarter,
    /// Thirty-seconds of a circle.
    #[default]
    Any,
}

impl Turns {
    pub(super) fn count(self) -> usize {
        match self {
            Self::None => 1,
            Self::Quarter => 4,
            Self::Any => 32,
        }
    }
}

/// How charts are laid onto pages.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct PackSettings {
    /// Side of a texel on the surface, metres. Default 0.0125 (thesis, 8.3.1).
    pub texel_m: f64,
    /// Texels that stay free between two charts. Default 2.
    pub gutter: usize,
    /// Columns and rows of a page, texels. `None` (default): one page, the smallest rectangle that was found; seldom a square.
    pub page: Option<[usize; 2]>,
    /// Turns that may be tried. Default [`Turns::Any`]; [`Turns::None`] keeps upright charts upright.
    pub turns: Turns,
    /// Share of the pages, above 0 and below 1, that charts shall fill: as long as they fill less, charts are cut along edges into pieces that lie closer
    /// together, most room for the shortest seam first, until they do or no cut gains enough. `None` (default): no chart is cut for the page.
    pub utilisation: Option<f64>,
}

impl Default for PackSettings {
    fn default() -> Self {
        Self { texel_m: 0.0125, gutter: 2, page: None, turns: Turns::default(), utilisation: None }
    }
}

/// Where a chart lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Page, from 0.
    pub page: usize,
    /// Cosine and sine of the turn.
    pub turn: [f64; 2],
    /// What is added after the turn, metres.
    pub shift: [f64; 2],
}

impl Placement {
    /// Place on the page, metres from its lower left corner, of a point of the chart.
    pub fn apply(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let [c, s] = self.turn;
        [c * u - s * v + self.shift[0], s * u + c * v + self.shift[1]]
    }
}

/// Columns and rows of a page, texels.
pub type Page = [usize; 2];

/// Refuses what could not be packed, before anything is cut: `area_m2` is that of the whole surface.
pub(in crate::atlas) fn check(settings: &PackSettings, area_m2: f64) -> Result<(), Error> {
    if !(settings.texel_m.is_finite() && settings.texel_m > 0.0) {
        return Err(Error::Setting { name: "texel_m", value: settings.texel_m, must_be: "positive" });
    }
    if let Some(page) = settings.page
        && page.contains(&0)
    {
        return Err(Error::Setting { name: "page", value: 0.0, must_be: "at least 1 x 1 texels" });
    }
    if let Some(value) = settings.utilisation
        && !(value > 0.0 && value < 1.0)
    {
        return Err(Error::Setting { name: "utilisation", value, must_be: "above 0 and below 1" });
    }
    let side = area_m2.sqrt() / settings.texel_m;
    let [width, height] = settings.page.map_or([side; 2], |page| page.map(|side| side as f64));
    if side * side > MAX_TEXELS as f64 || width * height > MAX_TEXELS as f64 {
        return Err(Error::TooManyTexels { texel_m: settings.texel_m, width, height, limit: MAX_TEXELS });
    }
    Ok(())
}

/// Refuses pages of an earlier layout that no atlas can have.
pub(in crate::atlas) fn check_pages(pages: &[Page], texel_m: f64) -> Result<(), Error> {
    let mut texels = 0_usize;
    for &[width, height] in pages {
        texels = texels.saturating_add(width.saturating_mul(height));
        if texels > MAX_TEXELS {
            let [width, height] = [width as f64, height as f64];
            return Err(Error::TooManyTexels { texel_m, width, height, limit: MAX_TEXELS });
        }
    }
    Ok(())
}
