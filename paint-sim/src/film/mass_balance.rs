//! The account of the paint.

/// Where the paint went, in quanta of one femtolitre. `emitted == deposited + overspray` always holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MassBalance {
    /// Paint that left the nozzle.
    pub emitted: u64,
    /// Paint on the texels.
    pub deposited: u64,
    /// Paint that met no texel.
    pub overspray: u64,
}

impl MassBalance {
    /// Whether nothing was lost or invented.
    pub fn balanced(&self) -> bool {
        self.deposited.checked_add(self.overspray) == Some(self.emitted)
    }
}
