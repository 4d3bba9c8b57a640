//! Painters: given the picture that is wanted and the paint that is already there, what to spray where.
//!
//! A spray at pixel `μ` adds the depth `v exp(-|p - μ|² / 2σ²)` to the canvas `c`; the eye sees the ink `a = f(c)`, where `f`
//! saturates: `tanh` in the thesis, Beer-Lambert, or any rising curve, for instance one sampled from Kubelka-Munk.
//! Painting is then deconvolution with a sign: paint can be added, never taken away,
//!
//! ```text
//! min  ½ Σ_p w_p ( f(c₀ + G v)_p - y_p )²     subject to  0 ≤ v ≤ v_max
//! ```
//!
//! with `G` the sum of footprints, `y` the wanted ink and `c₀` the paint already on the wall.
//!
//! ```
//! use paint_net::{Deconvolution, Image, Limits, Painter, Saturation, SprayKernel, Task, metrics};
//!
//! // A soft disc of ink on a bare wall.
//! let wanted = Image::from_fn(48, 48, |x, y| {
//!     let r = (x as f64 - 24.0).hypot(y as f64 - 24.0);
//!     0.7 / (1.0 + ((r - 12.0) / 1.5).exp())
//! });
//! let task = Task::on_bare_wall(&wanted);
//! let kernel = SprayKernel::new(2.0, 4.0)?;
//! let painting =
//!     Deconvolution::default().paint(&task, &kernel, &Saturation::Tanh, &Limits::default(), &mut |_| ())?;
//! assert!(metrics::psnr(&painting.ink, &wanted, None)? > 35.0);
//! # Ok::<(), paint_net::Error>(())
//! ```
//!
//! | thesis, Paper IV | item |
//! |---|---|
//! | 3.1 reference, canvas, sprays | [`Task`], [`Painting`], [`Spray`] |
//! | 3.2 layers by intensity | [`Layered`] |
//! | 3.3 spray footprint, ink `tanh c` | [`SprayKernel`], [`Saturation`] |
//! | 3.3 the "ideal": Gaussian of the reference | [`ideal`] |
//! | 3.3 the network: READ, PAINT, learned stop | [`thesis::Network`] |
//! | (ours) non-negative deconvolution | [`Deconvolution`] |
//! | (ours) greedy matching pursuit | [`MatchingPursuit`] |
//! | (ours) few sprays at free places, of free spreads | [`FreeSplats`] |
//! | (ours) a network that looks at its canvas | [`Feedback`], [`Network`] |
//! | (ours) coats, with a look at the wall after each | [`Coats`] |
//! | (ours) a valve of limited speed, and a path that suits it | [`SlewLimited`], [`Route`] |
//! | (ours) several paints that mix (Kubelka-Munk) | [`Palette`], [`Coloured`] |
//! | (ours) strokes a robot can fly | [`boustrophedon`] |
//!
//! Pixels: centres at integers, `x` = column, `y` = row, row 0 at the top. Lengths are in pixels, depths in the unit of the
//! saturation curve. Every result is the same bytes for the same input.

mod coats;
mod coloured;
mod deconvolution;
mod error;
mod feedback;
mod footprints;
mod ideal;
mod image;
mod kernel;
mod layers;
pub mod metrics;
mod network;
mod painter;
mod palette;
pub mod procedural;
mod projected_lbfgs;
mod pursuit;
mod route;
mod saturation;
mod slew;
mod splats;
mod strokes;
// The way back is needed only to train.
#[cfg_attr(not(feature = "train"), allow(dead_code))]
pub mod thesis;
#[cfg(feature = "train")]
pub mod train;

pub use coats::{Coated, Coats};
pub use coloured::{ColourPainting, ColourTask, Coloured, Judge, Picture};
pub use deconvolution::Deconvolution;
pub use error::Error;
pub use feedback::Feedback;
pub use ideal::ideal;
pub use image::Image;
pub use kernel::SprayKernel;
pub use layers::{Layered, Sharing, Steps};
pub use network::{Network, Shape};
pub use painter::{Limits, Painter, Painting, Spray, Task};
pub use palette::{MOST_PAINTS, Paint, Palette};
pub use pursuit::MatchingPursuit;
pub use route::Route;
pub use saturation::{MonotoneCurve, Saturation};
pub use slew::{SlewLimited, slew_violations};
pub use splats::FreeSplats;
pub use strokes::{Stroke, StrokeSettings, boustrophedon};
