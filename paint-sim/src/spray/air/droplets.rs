//! The droplets of a nozzle: their sizes, and how air takes hold of them.

use super::{AIR_DENSITY, AIR_VISCOSITY};
use crate::error::{Error, check_not_negative, check_range};

/// Reynolds number from which the drag coefficient is Newton's 0.44.
const NEWTON: f64 = 1000.0;

/// Time in which a small droplet takes on the speed of the air, s: `rho d² / 18 mu` (Stokes). `diameter` in m, `density` of the paint in kg/m³.
pub fn relaxation_time(diameter: f64, density: f64) -> f64 {
    density * diameter * diameter / (18.0 * AIR_VISCOSITY)
}

/// Drag of a sphere over Stokes' drag: `1 + 0.15 Re^0.687` (Schiller and Naumann 1933), beyond a Reynolds number of 1000 `0.44 Re / 24`
/// (Newton).
pub fn drag_factor(reynolds: f64) -> f64 {
    if reynolds > NEWTON { 0.44 / 24.0 * reynolds } else { 1.0 + 0.15 * reynolds.powf(0.687) }
}

/// Mean diameter of Sauter, m, of an airless fan nozzle (Snyder, Senser and Lefebvre 1989, measured with paint, oils and water):
///
/// ```text
/// SMD / d = 2.83 (s mu² / rho_a d³ p²)^¼ + 0.26 (s rho / rho_a d p)^¼
/// ```
///
/// with the nozzle's hydraulic diameter `d` (m), the pressure `p` (Pa), and the paint's surface tension `s` (N/m), viscosity `mu` (Pa s) and
/// density `rho` (kg/m³).
/// [`DropletSettings::size`] is `SMD Gamma(1 - 1 / uniformity)`: 1.49 times as much at the default uniformity.
pub fn fan_mean_diameter(nozzle: f64, pressure: f64, surface_tension: f64, viscosity: f64, density: f64) -> f64 {
    let viscous = surface_tension * (viscosity / pressure).powi(2) / (AIR_DENSITY * nozzle.powi(3));
    let inertial = surface_tension * density / (AIR_DENSITY * nozzle * pressure);
    nozzle * (2.83 * viscous.powf(0.25) + 0.26 * inertial.powf(0.25))
}

/// What leaves the nozzle, as droplets and the air that goes with them.
///
/// Sizes are those of Rosin and Rammler (1933): of the paint's volume, the share `1 - exp(-(d / size)^uniformity)` is in droplets smaller than
/// `d`. No size or speed of the vehicle's nozzle is printed; the defaults are engineering values for paint at 1 to 4 bar (Paper II, Section
/// 7.1).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct DropletSettings {
    /// Diameter than which 63 % of the volume is finer, m. Default 60 µm.
    pub size: f64,
    /// The larger, the more equal the droplets. Most sprays have 1.5 to 4 (Lefebvre, Atomization and Sprays, 1989). Default 2.5.
    pub uniformity: f64,
    /// Density of the paint, kg/m³. Default 1200.
    pub density: f64,
    /// Speed at the nozzle, m/s. Default 20, as `sqrt(2 p / rho)` (Bernoulli) has it at 2.4 bar.
    pub speed: f64,
    /// Momentum per second of the spray with its atomising air, N: flow times density times speed of both. It is what drags air along; with
    /// zero the air is the surroundings' alone. Default 0.05: 2 ml/s of paint at 20 m/s.
    pub momentum: f64,
}

impl Default for DropletSettings {
    fn default() -> Self {
        Self { size: 60e-6, uniformity: 2.5, density: 1200.0, speed: 20.0, momentum: 0.05 }
    }
}

impl DropletSettings {
    /// Diameter than which a share of the volume, 0 to 1, is finer, m.
    pub fn diameter(&self, share: f64) -> f64 {
        self.size * (-(-share).ln_1p()).powf(1.0 / self.uniformity)
    }

    /// Refuses what makes no sense.
    ///
    /// # Errors
    /// The first value out of range, by its name.
    pub fn check(&self) -> Result<(), Error> {
        check_range("droplets.size", self.size, 1e-6, 1e-2, "a diameter between 1e-6 and 1e-2 m")?;
        check_range("droplets.uniformity", self.uniformity, 0.5, 20.0, "between 0.5 and 20")?;
        check_range("droplets.density", self.density, 1.0, 1e5, "between 1 and 1e5 kg/m³")?;
        check_range("droplets.speed", self.speed, 0.1, 300.0, "between 0.1 and 300 m/s")?;
        check_not_negative("droplets.momentum", self.momentum)
    }
}
