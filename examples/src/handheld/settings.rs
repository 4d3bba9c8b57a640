//! All numbers of a handheld robot.

use paint_planner::gantry::{BeamSettings, GantrySettings};
use paint_sim::SprayModel;
use paint_sim::droplets::{DepositSettings, Droplets, Flux, GantryGeometry};

use super::error::HandheldError;

/// Sets of droplets that time steps take in turns.
const DROPLET_SETS: u64 = 16;

/// Robot, spray and planner.
#[derive(Debug, Clone, PartialEq)]
pub struct HandheldSettings {
    /// Lattice and horizon; its flux and travel follow from the fields below.
    pub planner: GantrySettings,
    /// Simulated candidates; `None` takes the graph's best path as it is.
    pub beam: Option<BeamSettings>,
    /// The spray cone.
    pub spray: SprayModel,
    /// Flow and time step.
    pub deposit: DepositSettings,
    /// The slide on the robot.
    pub geometry: GantryGeometry,
    /// Distance from nozzle to object that a person keeps, m.
    pub stand_off: f64,
    /// Rays of a density sample (1024, handheld paper, Section IV-A).
    pub density_rays: usize,
    /// Eqs. (1) and (3) as they are printed.
    pub paper_literal: bool,
    /// Threads of the density map.
    pub threads: usize,
}

impl Default for HandheldSettings {
    fn default() -> Self {
        Self {
            planner: GantrySettings::default(),
            beam: None,
            // An airbrush with a fine needle: a spot of 0.84 mm sigma from 60 mm. None is published.
            spray: SprayModel { sigma: 0.8_f64.to_radians(), range: 0.3, ..SprayModel::default() },
            deposit: DepositSettings::default(),
            geometry: GantryGeometry::default(),
            stand_off: 0.06,
            density_rays: 1024,
            paper_literal: false,
            threads: 2,
        }
    }
}

impl HandheldSettings {
    /// What the density is compared with.
    pub fn flux(&self) -> Flux {
        if self.paper_literal { Flux::PaperLiteral } else { Flux::Physical }
    }

    /// The planner's settings with the flux of this nozzle on this slide.
    pub fn planner(&self) -> GantrySettings {
        let planner = GantrySettings { travel: self.geometry.travel, ..self.planner };
        planner.with_spray(self.deposit.flow, self.spray.sigma, self.deposit.punishment, self.paper_literal)
    }

    /// The droplets of the time steps.
    ///
    /// # Errors
    /// A spray or a number of droplets out of range.
    pub fn droplet_sets(&self) -> Result<Vec<Droplets>, HandheldError> {
        Ok(Droplets::sets(&self.spray, self.deposit.droplets, DROPLET_SETS)?)
    }

    /// The rays of the density.
    ///
    /// # Errors
    /// A spray or a number of rays out of range.
    pub fn density_droplets(&self) -> Result<Droplets, HandheldError> {
        Ok(Droplets::new(&self.spray, self.density_rays, 0)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flux_is_the_papers_where_that_is_asked_for() {
        let flux = |paper_literal| HandheldSettings { paper_literal, ..HandheldSettings::default() }.flux();
        assert!(matches!((flux(true), flux(false)), (Flux::PaperLiteral, Flux::Physical)));
    }
}
