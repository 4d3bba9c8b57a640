//! The multirotor at the level of its motors: what an autopilot flies, where [`Vehicle`](super::Vehicle) already has one inside.
//!
//! A rigid body under the thrusts of four or more rotors that follow their commands with a first-order lag, the drag of rotors and
//! body in moving air, and loads at points of the body (hose, recoil of the spray), with paint that leaves:
//!
//! ```text
//! p' = v,  m v' = R (sum_i T_i e_z + f_drag) + sum_k F_k - m g e_z
//! q' = 1/2 q (0, w),  J w' = sum_i (r_i x T_i e_z - s_i c_i T_i e_z) + sum_k r_k x R^T F_k - w x J w
//! x_i' = (u_i - x_i) / tau_i,  T_i = T_max,i (k x_i^2 + (1 - k) x_i),  m' = -outflow
//! ```
//!
//! (rigid-body textbooks; the thrust curve is the one that PX4 documents for its parameter `THR_MDL_FAC`). World z up, body x
//! forward, y left, z up; SI units.

mod barometer;
mod derivative;
mod gps;
mod imu;
mod magnetometer;
mod rotor;
mod settings;
mod surroundings;
mod vehicle;

pub use barometer::{Barometer, BarometerReading, BarometerSettings};
pub use gps::{GeodeticOrigin, Gps, GpsReading, GpsSettings};
pub use imu::{Imu, ImuReading, ImuSettings};
pub use magnetometer::{Magnetometer, MagnetometerSettings};
pub use rotor::{Rotor, hexarotor_x, quadrotor_x};
pub use settings::MultirotorSettings;
pub use surroundings::{Load, Surroundings};
pub use vehicle::Multirotor;
