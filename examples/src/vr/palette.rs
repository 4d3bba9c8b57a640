//! The paints to choose from.

use paint_sim::paint::PaintName;
use paint_sim::{Paint, Substrate};

use crate::appearance::UNIT_THICKNESS;

/// A paint with a name. The number of a paint in a session is its place in [`PaintName::ALL`].
pub(super) struct PaletteEntry {
    pub(super) name: PaintName,
    pub(super) paint: Paint,
    /// Colour of a thick coat, sRGB.
    pub(super) srgb: [u8; 3],
}

/// The palette, the first paint preset.
pub(super) fn palette() -> Result<Vec<PaletteEntry>, paint_sim::Error> {
    let ground = Substrate::sandstone();
    let entry = |name: PaintName| {
        let paint = name.paint(UNIT_THICKNESS)?;
        let srgb = paint.over(4.0 * UNIT_THICKNESS, &ground)?.srgb().rgb;
        Ok(PaletteEntry { name, paint, srgb })
    };
    PaintName::ALL.into_iter().map(entry).collect()
}
