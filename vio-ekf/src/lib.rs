//! Visual-inertial odometry: a camera, or a pair, and an inertial sensor in an iterated extended Kalman filter; trajectories, their
//! file formats and their evaluation.
//!
//! [`Vio`] takes inertial samples and grey images, and gives pose, velocity and covariance at the rate of the samples. It
//! compares patches of the image directly and keeps landmarks as bearing and inverse distance in the camera's axes; position and
//! yaw are unobservable, and no measurement of its own changes what it knows of them. Over whole flights on
//! images most of its covariances are consistent and the others mostly too large; in the first seconds before a scene that is much
//! farther away than expected they are too small. The tests hold the figures per sequence, the book prints them. Beside it the crate holds poses over time with exact nanosecond
//! stamps, reads and writes them as TUM, EuRoC and KITTI text, and measures how well one trajectory agrees with another: pairing in
//! time, alignment, absolute and relative errors, consistency of covariances. A B-spline gives smooth motion with exact rates and
//! accelerations, which is what ideal inertial sensors read.
//!
//! ```text
//! p' = R v    v' = f − ω × v + Rᵀ g    R' = R hat(ω)    μ' = −ω_c × μ − (I − μμᵀ) v_c ρ    ρ' = ρ² μ·v_c
//! δ ← K (y + H δ)    K = P Hᵀ (H P Hᵀ + S)⁻¹    P ← P − K H P
//! ATE² = mean |g_i − (s R e_i + t)|²          E_ij = (G_i⁻¹ G_j)⁻¹ (E_i⁻¹ E_j)          NEES = eᵀ P⁻¹ e
//! ```
//!
//! ```
//! use vio_ekf::{Alignment, EvaluationSettings, evaluate, tum};
//!
//! let reference = tum::read("0.0 0 0 0 0 0 0 1\n0.1 1 0 0 0 0 0 1\n0.2 1 1 0 0 0 0 1\n0.3 1 1 1 0 0 0 1\n")?;
//! // The same path seen from a frame that is shifted and turned by a quarter about the vertical.
//! let estimate = tum::read("0.0 5 0 0 0 0 0.7071 0.7071\n0.1 5 1 0 0 0 0.7071 0.7071\n\
//!                           0.2 4 1 0 0 0 0.7071 0.7071\n0.3 4 1 1 0 0 0.7071 0.7071\n")?;
//! let report = evaluate(&reference, &estimate, &EvaluationSettings::default())?;
//! assert!(report.ate.position.rmse < 1e-12 && report.ate.orientation.max < 1e-7);
//!
//! let raw = EvaluationSettings { alignment: Alignment::None, ..Default::default() };
//! assert!(evaluate(&reference, &estimate, &raw)?.ate.position.rmse > 3.0);
//! # Ok::<(), vio_ekf::Error>(())
//! ```
//!
//! | what | source | item |
//! |---|---|---|
//! | robocentric filter on images | after ROVIO, Bloesch et al. 2017 (thesis, Paper I, section 4.1) | [`Vio`], [`Vio::image`] |
//! | distances by a second camera | ours | [`Vio::stereo`], [`Vio::image_pair`], [`Vio::point_pairs`] |
//! | the same on a caller's points | ours | [`Vio::points`] |
//! | motion between images, its noise | Forster et al. 2017 | [`Vio::imu`], [`ImuNoise`] |
//! | bearing with a tangent basis | Hertzberg et al. 2013; Bloesch et al. 2017 | [`Bearing`] |
//! | iterated update | Bell and Cathey 1993 | [`UpdateSettings`] |
//! | start in motion | gyroscope: Kneip and Lynen 2013; closed form: Martinelli 2014; refined: ours | [`DynamicInitializationSettings`] |
//! | any other sensor: position, height, range, wheel | the update of the literature; the trait: ours | [`Measurement`], [`Vio::update`] |
//! | a lens of the caller's own | ours | [`CameraModel`] |
//! | noise that samples show | ours | [`ImuSettings`] |
//! | inertial sensor and foreign poses | Weiss and Siegwart 2011; Lynen et al. 2013 (thesis, Paper II, section 4) | [`PoseFusion`] |
//! | poses as measurements of the odometry | thesis, outlook: one estimator instead of two; ours | [`Vio::pose`], [`UnifiedVio`] |
//! | two inertial sensors as one | ours | [`ImuPair`] |
//! | axes and units of inertial samples | ours | [`validate_samples`] |
//! | the same beside images | gyroscope: Kneip and Lynen 2013; accelerometer: after Martinelli 2014 | [`check_imu_axes`] |
//! | one-call evaluation | ours | [`evaluate`] |
//! | least-squares alignment | Umeyama 1991, Eqs. (40)-(42); Horn 1987 | [`align`] |
//! | alignment of position and yaw | closed form, ours; Zhang and Scaramuzza 2018 for the choice of mode | [`Alignment::PosYaw`] |
//! | absolute trajectory error | Sturm et al. 2012, section VI | [`ate`] |
//! | relative pose error | Sturm et al. 2012, section VI; Geiger et al. 2012 for path lengths | [`rpe`] |
//! | normalised estimation error squared | Bar-Shalom, Li, Kirubarajan 2001, section 5.4 | [`nees`], [`chi2`] |
//! | cumulative B-spline and its derivatives | Sommer et al. 2020 | [`Spline`] |
//! | exponentials and Jacobians | Barfoot 2017, chapter 7 | [`so3`], [`se3`] |
//!
//! The thesis prints no equations for these; its odometry is judged by trajectory error (Paper I, section 4.2).
//!
//! Frames: poses are `world_from_body`, world `z` up where [`Alignment::PosYaw`] or gravity is meant. Metres, radians,
//! nanoseconds. Quaternions are Hamilton's; TUM files put the scalar last, EuRoC files first.

pub mod camera;
mod error;
pub mod eval;
pub mod filter;
pub mod format;
pub mod fusion;
pub mod imu_check;
pub mod inertial;
pub mod lie;
pub mod run;
mod samples;
pub mod sim;
mod stamp;
#[cfg(test)]
mod test_random;
mod trace;
pub mod trajectory;
#[cfg(feature = "tune")]
pub mod tune;

pub use camera::Camera;
pub use error::Error;
pub use filter::{Settings, Status, Vio};
pub use inertial::Odometry;
pub use nalgebra;
pub use run::Runner;
pub use samples::{ImageView, Imu, ImuNoise};
pub use stamp::Stamp;
pub use trajectory::Trajectory;

/// The recipe of the README, as a test.
#[cfg(all(doctest, feature = "yaml"))]
#[doc = include_str!("../README.md")]
struct Readme;
