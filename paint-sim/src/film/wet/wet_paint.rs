//! What a paint is as a liquid.

use nalgebra::UnitVector3;

use crate::error::{Error, check_not_negative, check_positive, check_range};

/// Acceleration of gravity, m/s².
pub(super) const GRAVITY: f64 = 9.81;

/// A paint as a Bingham fluid whose viscosity and yield stress grow as its solvent leaves.
///
/// The defaults are engineering values of a thinned acrylic: measure one's own with a viscometer, or by the thickness at which it runs.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct WetPaint {
    /// Density, kg/m³. Default 1200.
    pub density: f64,
    /// Plastic viscosity in the can, Pa s. Default 0.5.
    pub viscosity: f64,
    /// Yield stress in the can, Pa; zero for a Newtonian liquid. Default 3: a wet film of a quarter of a millimetre stays on a vertical wall
    /// (10 mils in the test of ASTM D4400).
    pub yield_stress: f64,
    /// Surface tension, N/m: how large the bead of a lower edge grows before it drips, and what levels ripples. Default 0.03.
    pub surface_tension: f64,
    /// Solids in the can, share by volume. Default 0.35; with 1 there is nothing to dry, and the paint stays where it lands.
    pub solids: f64,
    /// Solids of the paint that is dry to touch, share by volume. Default 0.55.
    pub touch_dry: f64,
    /// Solids at which nothing moves any more, share by volume. Default 0.64, spheres packed at random.
    pub packing: f64,
    /// Thickness of solvent that the air takes, m/s. Default 5e-8: 0.1 mm of wet paint is dry to touch in a quarter of an hour.
    pub evaporation: f64,
}

impl Default for WetPaint {
    fn default() -> Self {
        Self {
            density: 1200.0,
            viscosity: 0.5,
            yield_stress: 3.0,
            surface_tension: 0.03,
            solids: 0.35,
            touch_dry: 0.55,
            packing: 0.64,
            evaporation: 5e-8,
        }
    }
}

impl WetPaint {
    /// The default paint with another share of solids in the can, and those of its dry states as far along to all solids.
    #[must_use]
    pub fn of_solids(solids: f64) -> Self {
        let usual = Self::default();
        let along = |share: f64| 1.0 - (1.0 - share) * (1.0 - solids) / (1.0 - usual.solids);
        Self { solids, touch_dry: along(usual.touch_dry), packing: along(usual.packing), ..usual }
    }

    /// Wet thickness up to which fresh paint stays where it is, m: `tau / (rho g sin(slope))`. Infinite on what is level, zero for a
    /// Newtonian liquid elsewhere. `normal` is the outward unit normal, z up.
    pub fn sag_thickness(&self, normal: &UnitVector3<f64>) -> f64 {
        // Sine of the slope.
        let steepness = normal.x.hypot(normal.y);
        if steepness > 0.0 { self.yield_stress / (self.density * GRAVITY * steepness) } else { f64::INFINITY }
    }

    /// The same as a thickness of the dry film that it leaves, m.
    pub fn dry_sag_thickness(&self, normal: &UnitVector3<f64>) -> f64 {
        self.solids * self.sag_thickness(normal)
    }

    /// Time in which a wet film on a sealed ground is dry to touch, s; infinite without evaporation.
    pub fn drying_time(&self, thickness: f64) -> f64 {
        let leaves = thickness * (1.0 - self.solids / self.touch_dry);
        if leaves > 0.0 { leaves / self.evaporation } else { 0.0 }
    }

    /// By what viscosity and yield stress have grown at a share of solids (Maron and Pierce 1956; Krieger and Dougherty 1959 with an
    /// exponent of 2): `((1 - solids / packing) / (1 - share / packing))^2`.
    pub fn stiffening(&self, share: f64) -> f64 {
        ((self.packing - self.solids) / (self.packing - share)).powi(2)
    }

    /// Flux of a film under its own weight per width, m²/s: `rho g y² (3 h - y) / 6 mu` with `y = h - h_s` (the film above the sag
    /// thickness; Bingham 1922, thin film). `weight` is `rho g sin(slope)`, Pa/m.
    pub fn flux(&self, thickness: f64, weight: f64, stiffening: f64) -> f64 {
        let sheared = thickness - self.yield_stress * stiffening / weight;
        if sheared > 0.0 {
            weight * sheared * sheared * (3.0 * thickness - sheared) / (6.0 * self.viscosity * stiffening)
        } else {
            0.0
        }
    }

    /// Solvent that comes with solids.
    pub(super) fn solvent_of(&self, solids: u64) -> u64 {
        (solids as f64 * (1.0 / self.solids - 1.0)).round() as u64
    }

    /// Solvent per solids at which it is dry to touch.
    pub(super) fn solvent_left(&self) -> f64 {
        1.0 / self.touch_dry - 1.0
    }

    /// Refuses what makes no sense.
    ///
    /// # Errors
    /// The first value out of range, by its name.
    pub fn check(&self) -> Result<(), Error> {
        check_positive("wet.density", self.density)?;
        check_positive("wet.viscosity", self.viscosity)?;
        check_not_negative("wet.yield_stress", self.yield_stress)?;
        check_not_negative("wet.surface_tension", self.surface_tension)?;
        check_not_negative("wet.evaporation", self.evaporation)?;
        check_range("wet.solids", self.solids, 0.01, 1.0, "a share between 0.01 and 1")?;
        check_range("wet.touch_dry", self.touch_dry, self.solids, 1.0, "between wet.solids and 1")?;
        check_range("wet.packing", self.packing, self.touch_dry, 1.0, "between wet.touch_dry and 1")
    }
}
