//! Droplets in moving air: how wind and rotor wash shift, widen and thin the spot of a spray.
//!
//! A nozzle throws droplets of many sizes, and the air that they drag along ([`Jet`]). A droplet of diameter `d` and density `rho_p` in air of
//! velocity `u` obeys
//!
//! ```text
//! dv/dt = (u - v) f(Re) / tau,   tau = rho_p d^2 / 18 mu,   f = 1 + 0.15 Re^0.687
//! ```
//!
//! (Stokes; Schiller and Naumann 1933). Coarse ones fly nearly straight, fine ones go with the air. Those too fine to leave it where the jet
//! turns along the wall never land ([`DropletSettings::path`]). [`drifted`] turns shots and the air before the wall into shots with sprays of
//! their own, which [`Film::deposit_each`](crate::Film::deposit_each) sprays: the paint that lands and that which is lost are what was sprayed,
//! to the femtolitre.
//!
//! Left out: evaporation on the way, gravity (half a millimetre in ten milliseconds), the wall's own boundary layer in the wind, the speed of
//! the nozzle, and that the jet bends and spreads around what drifts in it (at 10 cm some tenth of the shift). What a spray loses in still air
//! is a matter of [`SprayModel::efficiency`](crate::SprayModel), which calibration finds together with the flow: here losses are relative to
//! still air.
//!
//! ```
//! use paint_sim::nalgebra::{Point3, Vector3};
//! use paint_sim::spray::air::{Air, DropletSettings, drifted};
//! use paint_sim::{Shot, SprayModel, TriangleSurface};
//!
//! // A wall at x = 0, a shot from 10 cm, a breeze of 2 m/s along the wall.
//! let corners = [[0.0, -1.0, -1.0], [0.0, 1.0, -1.0], [0.0, 0.0, 1.0]];
//! let wall = TriangleSurface::new(&corners, &[[0, 2, 1]])?;
//! let shot = Shot { origin: Point3::new(-0.1, 0.0, 0.0), axis: Vector3::x_axis(), volume: 2e-9 };
//! let breeze = Air { velocity: Vector3::y() * 2.0, turbulence: 0.3 };
//! let spray = SprayModel::default();
//! let sprays = drifted(&[shot], &spray, &DropletSettings::default(), &wall, &mut |_| breeze)?;
//! // The jet arrives some millimetres downwind, wider along the wind than across.
//! let (_, main) = sprays[0];
//! assert!(main.yaw > 0.01 && main.yaw < 0.1 && main.sigma > spray.sigma && main.aspect > 1.0);
//! # Ok::<(), paint_sim::Error>(())
//! ```

mod carried;
mod drift;
mod droplets;
mod jet;
mod path;
mod rotor_wash;

pub use carried::{Air, WallPoint, drifted};
pub use drift::{Drift, Spot, drift};
pub use droplets::{DropletSettings, drag_factor, fan_mean_diameter, relaxation_time};
pub use jet::Jet;
pub use path::Landing;
pub use rotor_wash::RotorWash;

/// Density of air, kg/m³ (20 °C, sea level).
pub const AIR_DENSITY: f64 = 1.204;
/// Viscosity of air, Pa s (20 °C).
pub const AIR_VISCOSITY: f64 = 1.82e-5;
