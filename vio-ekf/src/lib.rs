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
//! A flight, here a simulated one, from samples and images to poses:
//!
//! ```
//! use vio_ekf::run::{Event, RunnerSettings};
//! use vio_ekf::sim::{RoomSettings, Scenario, SimulatedCamera, Simulation, camera_ahead, painting_flight};
//! use vio_ekf::{ImuNoise, Runner, Settings, Vio};
//!
//! let cameras = vec![SimulatedCamera { camera: camera_ahead(), ..SimulatedCamera::default() }];
//! let room = RoomSettings { texture_size: 512, ..RoomSettings::default() };
//! let driver = Simulation::new(painting_flight(1, 3.0)?, Scenario { cameras, room, ..Scenario::default() })?;
//!
//! let vio = Vio::new(camera_ahead(), ImuNoise::default(), Settings::default())?;
//! let mut runner = Runner::new(vio, RunnerSettings::default());
//! let mut samples = driver.imu(0)?.samples.into_iter();
//! for frame in driver.frames(0) {
//!     let frame = frame?;
//!     runner.imu_until(frame.stamp, &mut samples)?; // or `runner.imu(&sample)` for each as it comes
//!     let outcome = runner.image(frame.stamp, &frame.view())?;
//!     for event in outcome.events {
//!         assert_eq!(event, Event::Started); // or lost, poses withdrawn, image skipped: each with its reason
//!     }
//!     if let Some(now) = outcome.odometry {
//!         println!("{} m, {} m/s", now.world_from_body.translation, now.velocity_in_body);
//!     }
//! }
//! let run = runner.finish()?;
//! assert!(run.poses() > 20 && run.tracking_at_end);
//! # Ok::<(), vio_ekf::Error>(())
//! ```
//!
//! Where to look: [`run`] holds the odometry's whole protocol, [`Vio`] the filter alone and [`filter`] what it is set and answers with;
//! [`camera`] lenses, [`format`](mod@format) files, [`fusion`] poses of others and second inertial sensors, [`imu_check`] tests of
//! inertial samples, [`inertial`] dead reckoning, [`eval`] trajectory errors, [`sim`] a test bed, `tune` (a feature) the search
//! for noise settings.
//!
//! | what | source | item |
//! |---|---|---|
//! | start, withdrawal of poses, segments, losses | ours | [`Runner`], [`run_recording`](run::run_recording) |
//! | robocentric filter on images | after ROVIO, Bloesch et al. 2017 (thesis, Paper I, section 4.1) | [`Vio`], [`Vio::image`] |
//! | distances by a second camera | ours | [`Vio::stereo`], [`Vio::image_pair`], [`Vio::point_pairs`] |
//! | the same on a caller's points | ours | [`Vio::points`] |
//! | motion between images, its noise | Forster et al. 2017 | [`Vio::imu`], [`ImuNoise`] |
//! | bearing with a tangent basis | Hertzberg et al. 2013; Bloesch et al. 2017 | [`Bearing`](filter::Bearing) |
//! | iterated update | Bell and Cathey 1993 | [`UpdateSettings`](filter::UpdateSettings) |
//! | start in motion | gyroscope: Kneip and Lynen 2013; closed form: Martinelli 2014; refined: ours | [`DynamicInitializationSettings`](filter::DynamicInitializationSettings) |
//! | any other sensor: position, height, range, wheel | the update of the literature; the trait: ours | [`Measurement`](filter::Measurement), [`Vio::update`] |
//! | a lens of the caller's own | ours | [`CameraModel`](camera::CameraModel) |
//! | noise that samples show | ours | [`ImuSettings`](inertial::ImuSettings) |
//! | inertial sensor and foreign poses | Weiss and Siegwart 2011; Lynen et al. 2013 (thesis, Paper II, section 4) | [`PoseFusion`](fusion::PoseFusion) |
//! | poses as measurements of the odometry | thesis, outlook: one estimator instead of two; ours | [`Vio::pose`], [`UnifiedVio`](fusion::UnifiedVio) |
//! | two inertial sensors as one | ours | [`ImuPair`](fusion::ImuPair) |
//! | axes and units of inertial samples | ours | [`validate_samples`](imu_check::validate_samples) |
//! | the same beside images | gyroscope: Kneip and Lynen 2013; accelerometer: after Martinelli 2014 | [`check_imu_axes`](imu_check::check_imu_axes) |
//! | one-call evaluation | ours | [`evaluate`](eval::evaluate) |
//! | least-squares alignment | Umeyama 1991, Eqs. (40)-(42); Horn 1987 | [`align`](eval::align) |
//! | alignment of position and yaw | closed form, ours; Zhang and Scaramuzza 2018 for the choice of mode | [`Alignment::PosYaw`](eval::Alignment::PosYaw) |
//! | absolute trajectory error | Sturm et al. 2012, section VI | [`ate`](eval::ate) |
//! | relative pose error | Sturm et al. 2012, section VI; Geiger et al. 2012 for path lengths | [`rpe`](eval::rpe) |
//! | normalised estimation error squared | Bar-Shalom, Li, Kirubarajan 2001, section 5.4 | [`nees`](eval::nees), [`chi2`](eval::chi2) |
//! | cumulative B-spline and its derivatives | Sommer et al. 2020 | [`Spline`](trajectory::Spline) |
//! | exponentials and Jacobians | Barfoot 2017, chapter 7 | [`so3`](lie::so3), [`se3`](lie::se3) |
//!
//! The thesis prints no equations for these; its odometry is judged by trajectory error (Paper I, section 4.2).
//!
//! Frames: poses are `world_from_body`, world `z` up where [`Alignment::PosYaw`](eval::Alignment::PosYaw) or gravity is meant. Metres, radians,
//! nanoseconds. Quaternions are Hamilton's; TUM files put the scalar last, EuRoC files first.
//!
//! | feature | brings |
//! |---|---|
//! | `tune` | search for noise settings, `tune` |
//! | `yaml` | calibration files of EuRoC folders and of Kalibr |
//! | `serde` | settings and results can be stored |
//! | `tracing` | spans and events for subscribers of `tracing` |

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
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
