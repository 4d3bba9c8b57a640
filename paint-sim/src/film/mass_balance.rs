//! The account of the paint.

/// Where the paint went, in quanta of one femtolitre. `emitted == deposited + overspray + dripped` always holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MassBalance {
    /// Paint that left the nozzle.
    pub emitted: u64,
    /// Paint on the texels.
    pub deposited: u64,
    /// Paint that met no texel.
    pub overspray: u64,
    /// Paint that has run off a lower edge of the surface ([`wet`](super::wet)).
    pub dripped: u64,
}

impl MassBalance {
    /// Whether nothing was lost or invented.
    pub fn balanced(&self) -> bool {
        self.deposited.checked_add(self.overspray).and_then(|sum| sum.checked_add(self.dripped)) == Some(self.emitted)
    }
}
