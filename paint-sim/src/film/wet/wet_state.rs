//! What is wet on the texels.

use super::super::Film;
use super::descents::Descents;
use super::ground::Ground;
use super::liquid_balance::LiquidBalance;
use super::wet_paint::WetPaint;

/// The film with what is wet of it, texel by texel.
#[derive(Debug, Clone)]
pub(super) struct WetState {
    pub(super) film: Film,
    pub(super) paint: WetPaint,
    pub(super) ground: Ground,
    pub(super) descents: Descents,
    /// Solids that are dry to touch, per texel.
    pub(super) dry: Vec<u64>,
    pub(super) solvent: Vec<u64>,
    /// Liquid in the pores of the ground.
    pub(super) soaked: Vec<u64>,
    pub(super) ran: Vec<bool>,
    pub(super) balance: LiquidBalance,
    /// The largest rate of a wave over a texel, 1/s, where nothing has come since.
    pub(super) fastest: Option<f64>,
}

impl WetState {
    /// The film, and what is to be told of solids that land on it: the can's solvent comes with them.
    pub(super) fn filled(&mut self) -> (&mut Film, impl FnMut(u32, u64)) {
        self.fastest = None;
        let Self { film, paint, solvent, balance, .. } = self;
        let landed = |texel: u32, solids: u64| {
            let with = paint.solvent_of(solids);
            solvent[texel as usize] += with;
            balance.landed += with;
        };
        (film, landed)
    }
}
