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
//! assert!(aim.pointing_error < 1e-12 && !aim.clamped);
//! let nozzle = ptu.forward(&world_from_body, aim.joints);
//! let hit = nozzle.tip + nozzle.direction.into_inner() * aim.distance;
//! assert!((hit - Point3::new(0.8, 0.1, 2.1)).norm() < 1e-12);
//! # Ok::<(), ptu_kinematics::Error>(())
//! ```
//!
//! | what | where in the thesis | item |
//! |---|---|---|
//! | axes of the pan-tilt unit | Paper II, Fig. 6.3 | [`PtuSettings`] |
//! | forward kinematics | not printed; from Fig. 6.3 | [`Ptu::forward`] |
//! | inverse kinematics in hover | not printed; from Fig. 6.3 | [`Ptu::inverse`] |
//! | any arm in place of the pan-tilt unit | not in the thesis | [`KinematicChain`] |
//! | pan-tilt unit on a vehicle that hovers pitched | not in the thesis | [`PitchingPtu`] |
//! | serial arm, inverse by damped least squares | Wampler 1986; Nakamura and Hanafusa 1986 | [`SerialArm`] |
//! | pointing at a target | Eq. (6.1), of which only the symbols survive | [`Ptu::aim`] |
//! | servo (AX-12A) | Paper II, section 3 | [`Servo`] |
//! | identification of `a`, `b`, `c`, `μ` | not in the thesis; linear least squares | [`calibrate`] |
//!
//! Frames: world `z` up; body `x` forward, `y` left, `z` up. Metres, radians, seconds.
//!
//! | feature | brings |
//! |---|---|
//! | `urdf`, on by default | geometry from a URDF file |
//! | `serde` | settings and results can be stored |
//! | `tracing` | spans and events for subscribers of `tracing` |

mod aim;
mod angle;
mod calibrate;
mod chain;
mod collision_body;
mod error;
mod hover;
mod joints;
mod pan_tilt;
#[cfg(feature = "urdf")]
mod pan_tilt_urdf;
mod pitching_ptu;
mod serial_arm;
mod servo;
mod settings;
mod trace;
#[cfg(feature = "urdf")]
mod urdf;
mod urdf_writer;

pub use aim::Aim;
pub use angle::wrap;
pub use calibrate::{Calibration, Observation, calibrate};
pub use chain::KinematicChain;
pub use collision_body::CollisionBody;
pub use error::Error;
pub use hover::{Hover, Nozzle};
pub use joints::{Joints, Range};
pub use nalgebra;
pub use pan_tilt::{Jacobian, Ptu};
#[cfg(feature = "urdf")]
pub use pan_tilt_urdf::UrdfJointSigns;
pub use pitching_ptu::{PitchingJoints, PitchingPtu};
pub use serial_arm::{SerialArm, SerialJoint};
pub use servo::{Servo, ServoSettings};
pub use settings::PtuSettings;

/// The recipe of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
