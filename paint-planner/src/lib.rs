//! From strokes on a surface to nozzle states, vehicle headings and a trajectory within limits.
//!
//! Given targets `t` with outward normals `n`, the nozzle positions `p` and directions `h` of a whole path minimise
//!
//! ```text
//! sum c_a |p' - p|^2 + c_b |h' - h|^2  +  sum c_d |n x (p - t)|^2      (VR paper, Eq. (6))
//! ```
//!
//! within the distances, incidences and spray cones of Eqs. (2)-(5). The heading follows from a shortest path over
//! (target x heading bin), Eq. (7), with every node checked against joint limits and the surface; the motion from
//! minimum-snap polynomials whose speed and acceleration are certified. What the planners need from the world are two
//! traits: [`Surface`] and [`Tool`].
//!
//! ```
//! use paint_planner::nalgebra::{Point3, UnitVector3, Vector3};
//! use paint_planner::{Hit, NozzleState, Settings, Surface, Target, Tool, VehicleState, plan};
//!
//! struct Wall; // the plane x = 0, seen from x < 0
//! impl Surface for Wall {
//!     fn cast(&self, o: &Point3<f64>, d: &UnitVector3<f64>, max: f64) -> Option<Hit> {
//!         let distance = -o.x / d.x;
//!         let normal = -Vector3::x_axis();
//!         (0.0..max).contains(&distance).then(|| Hit { point: o + d.into_inner() * distance, normal, distance })
//!     }
//!     fn distance(&self, p: &Point3<f64>, max: f64) -> f64 {
//!         p.x.abs().min(max)
//!     }
//! }
//!
//! struct Gimbal; // a nozzle in the centre of a sphere
//! impl Tool for Gimbal {
//!     fn vehicle(&self, nozzle: &NozzleState, heading: f64) -> Option<VehicleState> {
//!         let pan = (nozzle.direction.y.atan2(nozzle.direction.x) - heading).sin().asin();
//!         Some(VehicleState { position: nozzle.position, heading, pan, tilt: nozzle.direction.z.asin() })
//!     }
//!     fn spheres(&self, vehicle: &VehicleState, out: &mut Vec<(Point3<f64>, f64)>) {
//!         out.push((vehicle.position, 0.02));
//!     }
//! }
//!
//! let point = |i: usize| Point3::new(0.0, 0.025 * i as f64, 1.0);
//! let target = |i| Target { point: point(i), normal: -Vector3::x_axis(), dose: 2e-6, time: None, stand_off: None };
//! let targets: Vec<Target> = (0..40).map(target).collect();
//! let plan = plan(&targets, &Wall, &Gimbal, &Settings::default())?;
//! assert!(plan.report.normal_deviation_max < 0.01 && plan.report.extrema.acceleration <= 1.0);
//! assert!((plan.volume(3) - 2e-6 * 0.025).abs() < 1e-18);
//! # Ok::<(), paint_planner::Error>(())
//! ```
//!
//! | paper | item |
//! |---|---|
//! | VR paper, Eqs. (1)-(6) = thesis, Eqs. (7.1)-(7.6) | [`OptimalPlanner`] with [`nozzle::Mode::PaperExact`]; [`nozzle::Mode::Sequential`] is the default |
//! | VR paper, Eq. (7) = thesis, Eq. (7.7) | [`heading::HeadingSettings`], searched globally |
//! | thesis, section 7.5, timing | [`timing::TimingPolicy`] |
//! | Held and Karp 1970, travelling salesman | [`stroke_order::order_strokes`], [`stroke_order::transit_lower_bound`] |
//! | Richter et al., minimum snap | [`trajectory::Trajectory::minimum_snap`] |
//! | Paper II, section 6.2, LOWESS baseline | [`plan::SmoothingPlanner`] |
//! | Paper II, section 5.2, first-order attitude | [`control::TrackingMpc`], [`control::identify_attitude`] |
//! | VR paper, section V, deviation from the normal | [`Target::normal_deviation`] |
//! | handheld paper, section IV, Eqs. (1)-(5) | [`gantry`] |
//! | Paper II, sections 4 and 6, phases of a flight; failsafes, sorties: ours | [`onboard`] |
//! | several robots on one surface at the same time: ours | [`mission::Team`], [`mission::Cells`], [`mission::MissionPlan::schedule`] |
//! | VR paper, Algorithm 1, rules (a)-(e), latencies | [`teleop`] |
//!
//! | feature | brings |
//! |---|---|
//! | `clarabel` | Clarabel as solver of the nozzle program |
//! | `serde` | settings and results can be stored |
//! | `tracing` | spans and events for subscribers of `tracing` |

mod angle;
mod bernstein;
mod block_tridiagonal;
mod clearance;
pub mod constraints;
pub mod control;
mod error;
pub mod gantry;
mod gravity;
pub mod heading;
mod lattice;
mod lowess;
mod minimum_snap;
pub mod mission;
mod not_served;
pub mod nozzle;
pub mod onboard;
pub mod plan;
mod raise_clearance;
mod route;
mod settings;
pub mod stroke_order;
mod target;
pub mod teleop;
pub mod timing;
mod trace;
pub mod trajectory;
mod transit;
mod visibility;
mod world;

pub use error::Error;
pub use nalgebra;
pub use plan::{OptimalPlanner, Plan, Planner, plan};
pub use settings::Settings;
pub use target::{NozzleState, Target};
pub use world::{Hit, Surface, Tool, VehicleState};

/// The recipe of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
