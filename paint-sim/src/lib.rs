//! Spray deposit with an exact mass balance, Kubelka-Munk appearance, a renderer, and the closed-loop flight that paints.
//!
//! A [`Film`] collects the paint of [`Shot`]s on texels in whole femtolitres; a [`Paint`] turns its thickness into a
//! spectrum and a colour; [`render()`] shows the result to any camera; [`fly`] simulates the vehicle, wind, hose, pan-tilt
//! unit and controller whose nozzle fires the shots. Everything is deterministic: same input and seed, same bytes, for
//! any number of threads. Lengths are metres, angles radians, volumes cubic metres; the world's z axis points up, bodies
//! have x forward, y left, z up, cameras x right, y down, z forward.
//!
//! The paint of a shot of volume `V` at a surface point `r` metres from the nozzle and `z` along its axis, seen under the
//! slope `s` and the incidence `i`, with `t = tan(sigma)`, is, per area,
//!
//! ```text
//! D = V eta exp(-|s|^2 / 2 t^2) / (2 pi t^2) * r cos(i) / z^3 * visibility
//! ```
//!
//! ```
//! use paint_sim::nalgebra::{Point3, Vector3};
//! use paint_sim::{Film, Paint, Shot, SprayModel, Substrate, Texel, TriangleSurface};
//!
//! # fn main() -> Result<(), paint_sim::Error> {
//! // A wall in the plane x = 0, a square centimetre of texels on it, one shot of 2 mm^3 from 10 cm.
//! let corners = [[0.0, -1.0, -1.0], [0.0, 1.0, -1.0], [0.0, 0.0, 1.0]];
//! let wall = TriangleSurface::new(&corners, &[[0, 2, 1]])?;
//! let texel = |i: i32| Texel { point: Point3::new(0.0, f64::from(i) * 1e-3, 0.0), normal: -Vector3::x_axis(), area: 1e-6 };
//! let mut film = Film::new((-50..=50).map(texel).collect())?;
//! let shot = Shot { origin: Point3::new(-0.1, 0.0, 0.0), axis: Vector3::x_axis(), volume: 2e-9 };
//! let balance = film.deposit(&[shot], &SprayModel::default(), &wall, 1, &mut |_, _| {})?;
//! assert!(balance.balanced());
//! let coat = Paint::yellow(50e-6)?.over(film.thickness(50), &Substrate::grey(0.3)?)?;
//! println!("{:?}", coat.srgb().rgb);
//! # Ok(())
//! # }
//! ```
//!
//! | source | equation | item |
//! |---|---|---|
//! | VR paper, Section IV (form ours) | conical Gaussian spray, per area and volume | [`SprayModel::density`] |
//! | the same as an ellipse off the axis (ours) | aspect, turn, yaw, pitch of the jet | [`SprayModel::density_from`] |
//! | Stokes; Schiller and Naumann 1933; Rosin and Rammler 1933 | droplets of a spray in moving air | [`spray::air::DropletSettings::path`] |
//! | moments of their landings (ours) | spot shifted, widened and thinned by the air | [`spray::air::drifted`], [`Film::deposit_each`] |
//! | Morton, Taylor, Turner 1956; Taylor 1940 | air that a spray drags along, and what it takes past the wall | [`spray::air::Jet`] |
//! | Froude; Albertson et al. 1950; Beltaos and Rajaratnam 1974 | wash of the rotors | [`spray::air::RotorWash`] |
//! | orifice area law; Graco's readings of worn tips | flow and fan of a tip that wears | [`spray::TipWear`] |
//! | delay and linear ramps (ours) | what a valve lets through of a flow | [`gantry_robot::ValveSettings::through`], [`flight::FlightLog::through_valve`] |
//! | Levenberg 1944, Marquardt 1963; derivatives and doubts: ours | spray and valve from photographed bursts | [`spray::calibration`] |
//! | handheld paper, Section V (ours) | paint per texel, exact mass balance | [`Film::deposit`], [`film::MassBalance`] |
//! | handheld paper, Eqs. (1), (6), (7) | required density, score of a step | [`droplets`] |
//! | handheld paper, Section VI-B | hand, sensors, slide, valve | [`gantry_robot`] |
//! | Kubelka 1948 | film of finite thickness on a ground | [`km::reflectance`] |
//! | Kubelka-Munk 1931 | opaque film, Riccati equation | [`km::opaque_reflectance`], [`km::gradient`] |
//! | Kubelka 1954 | layers on layers | [`km::Layer::over`] |
//! | Kubelka 1948, solved for two grounds | `K` and `S` from a drawdown | [`Paint::from_drawdown`] |
//! | least squares on the gradient (ours) | `K` and `S` from a chart of layers | [`Paint::from_chart`] |
//! | Riccati's equation, film by film (ours) | colour of a stack of films and its derivatives | [`paint::FilmStack`] |
//! | Jakob and Hanika 2019 | reflectance of a colour | [`colour::spectrum_of_linear_srgb`] |
//! | pictures before and after (ours) | fall-off of the lens, light of the scene, thickness of the film | [`film::inspection`] |
//! | Bingham 1922, Huppert 1982 | paint that runs on a wall | [`film::wet`] |
//! | Orchard 1962 | ripples that surface tension levels | [`film::wet::Levelling`], [`film::wet::WetPaint::levelling_time`] |
//! | Maron and Pierce 1956, Washburn 1921 | paint that dries, ground that soaks it up | [`film::wet`] |
//! | Kubelka 1948, its tangent written out (ours) | colours of a million films, also over each other | [`paint::FilmColours`] |
//! | a paint by name on a substrate, by thickness (ours) | table of colours, curve of ink | [`paint::Appearance`], [`paint::ink_curve`] |
//! | Duncan 1940 | wet mixture `K = sum c K`, `S = sum c S` | [`Paint::mix`] |
//! | Saunderson 1942 | the air above the paint | [`km::saunderson`] |
//! | CIE 015, IEC 61966-2-1 | XYZ, CIELAB, sRGB of 36 bands | [`colour`] |
//! | Sharma, Wu, Dalal 2005 | colour difference CIEDE2000 | [`colour::ciede2000`] |
//! | Astronomical Almanac, Michalsky 1988 | where the sun stands | [`render::SunPosition`] |
//! | Preetham, Shirley, Smits 1999 | sunlight through the air, clear sky | [`render::sunlight`], [`render::Sky::clear`] |
//! | CIE S 011, Moon and Spencer 1942 | covered sky | [`render::Sky::overcast`] |
//! | Ramamoorthi and Hanrahan 2001, Eqs. (8), (10) | light of a sky on a surface | [`render::Sky::on_white`] |
//! | Woop, Benthin, Wald 2013; Pineda 1988 | what rays hit, one by one and in packets | [`TriangleSurface`] |
//! | Planck | light of a colour temperature | [`render::black_body`] |
//! | Walter et al. 2007; Kelemen and Szirmay-Kalos 2001 | gloss over the paint | [`render::Coat`] |
//! | Paper II, Section 5.2 (roll and pitch), linear drag | first-order attitude, rotor drag | [`flight::Vehicle::step`] |
//! | rigid body with motor lag (textbook; PX4's thrust curve) | motor-level vehicle and its sensors | [`flight::multirotor`] |
//! | catenary (textbook) | hose force | [`flight::HoseModel::force`] |
//! | Paper II, Section 7.2 | hit error, distance error, angle errors | [`flight::FlightStatistics`] |
//!
//! | feature | brings |
//! |---|---|
//! | `gpu` | required paint of droplets, colours of films, spray deposit and rays of pictures on a GPU (wgpu) |
//! | `serde` | settings and results can be stored |
//! | `tracing` | spans and events for subscribers of `tracing` |

pub mod colour;
pub mod droplets;
mod error;
pub mod film;
pub mod flight;
pub mod gantry_robot;
#[cfg(feature = "gpu")]
mod gpu;
pub mod km;
mod least_squares;
pub mod paint;
pub mod render;
mod rng;
pub mod spray;
pub mod surface;
mod trace;

pub use error::Error;
pub use film::{Film, Texel, spray};
pub use flight::{FlightSettings, fly};
pub use nalgebra;
pub use paint::{Paint, Substrate};
pub use render::{Camera, render};
pub use spray::{Shot, SprayModel};
pub use surface::{Surface, TriangleSurface};

/// The recipe of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
