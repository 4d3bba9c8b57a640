//! Kinematics of a spray gun that hangs from a flying robot: an airframe, an arm, a pan-tilt unit and a nozzle.
//!
//! The chain has three fixed offsets, all constants of the hardware: `b` from the body origin to the pan axis, `a` from
//! there to the tilt axis (in the panned frame), `c` from there to the nozzle tip (in the tilted frame). With the body at
//! `r`, rotated by `R`, pan `θ₁` and tilt `θ₂` (up is positive), the tip `p` and the unit spray direction `h` are
//!
//! ```text
//! p = r + R [ b + Rz(θ₁) ( a + Ry(−θ₂) c ) ]        h = R Rz(θ₁) Ry(−θ₂−μ) e_x
//! ```
//!
//! where `μ` is the angle at which the gun is mounted. In hover `R = Rz(ψ)`, and the inverse is a closed form with one
//! solution: any tip, any direction and any heading fix the body position and both joints.
//!
//! ```
//! use nalgebra::{Isometry3, Point3, Vector3};
//! use ptu_kinematics::{Joints, Ptu, PtuSettings};
//!
//! let ptu = Ptu::new(PtuSettings::default())?;
//! // The robot hovers, rolled by three degrees in the wind; where must the gun point to hit this spot of the wall?
//! let world_from_body = Isometry3::new(Vector3::new(0.0, 0.0, 2.0), Vector3::new(0.05, 0.0, 0.0));
//! let aim = ptu.aim(&world_from_body, &Point3::new(0.8, 0.1, 2.1))?;
//! assert!(aim.miss < 1e-12 && !aim.clamped);
//! let nozzle = ptu.forward(&world_from_body, aim.joints);
//! let hit = nozzle.tip + nozzle.direction.into_inner() * aim.distance;
//! assert!((hit - Point3::new(0.8, 0.1, 2.1)).norm() < 1e-12);
//! # Ok::<(), ptu_kinematics::Error>(())
//! ```
//!
//! | what | where in the thesis | item |
//! |---|---|---|
//! | axes of the pan-tilt unit | Paper II, Fig. 6.3 | [`PtuSettings`] |
//! | forward kinematics | not printed; ours, from Fig. 6.3 | [`Ptu::forward`] |
//! | inverse kinematics in hover | not printed; ours | [`Ptu::inverse`] |
//! | pointing at a target | Eq. (6.1), of which only the symbols survive | [`Ptu::aim`] |
//! | servo (AX-12A) | Paper II, section 3 | [`Servo`] |
//! | identification of `a`, `b`, `c`, `μ` | ours | [`calibrate`] |
//!
//! Frames: world `z` up; body `x` forward, `y` left, `z` up. Metres, radians, seconds.

mod aim;
mod calibrate;
mod error;
mod forward;
mod inverse;
mod jacobian;
mod servo;
mod settings;
#[cfg(feature = "urdf")]
mod urdf;

pub use aim::Aim;
pub use calibrate::{Calibration, Observation, calibrate};
pub use error::Error;
pub use forward::Nozzle;
pub use inverse::Hover;
pub use jacobian::Jacobian;
pub use nalgebra;
pub use servo::{Servo, ServoSettings};
pub use settings::{Joints, Ptu, PtuSettings, Range};
#[cfg(feature = "urdf")]
pub use urdf::UrdfJointSigns;

/// Wraps an angle in radians into `(-π, π]`.
///
/// ```
/// use std::f64::consts::PI;
/// assert!((ptu_kinematics::wrap(1.5 * PI) + 0.5 * PI).abs() < 1e-15);
/// assert_eq!(ptu_kinematics::wrap(-PI), PI);
/// ```
pub fn wrap(angle: f64) -> f64 {
    let turns = (angle / std::f64::consts::TAU).round();
    let wrapped = angle - turns * std::f64::consts::TAU;
    if wrapped <= -std::f64::consts::PI { wrapped + std::f64::consts::TAU } else { wrapped }
}
