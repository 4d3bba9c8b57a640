//! The account of the solvent.

/// Where the solvent went, in quanta of one femtolitre.
/// `landed == on_surface + soaked + evaporated + dripped` always holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LiquidBalance {
    /// Solvent that has come onto the texels.
    pub landed: u64,
    /// Still in the wet paint.
    pub on_surface: u64,
    /// In the pores of the ground.
    pub soaked: u64,
    /// Gone into the air; with the last of a film that is dry to touch.
    pub evaporated: u64,
    /// Dripped off lower edges.
    pub dripped: u64,
}

impl LiquidBalance {
    /// Whether nothing was lost or invented.
    pub fn balanced(&self) -> bool {
        let parts = [self.on_surface, self.soaked, self.evaporated, self.dripped];
        parts.iter().try_fold(0_u64, |sum, &part| sum.checked_add(part)) == Some(self.landed)
    }
}
