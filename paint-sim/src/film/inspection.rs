//! Looking at the painted surface: how thick the film is, from pictures of the surface before and after the paint.
//!
//! [`Mosaic`] gathers pictures, one by one, into the light that each texel sends out, and takes the fall-off of the lens out of it;
//! [`estimate_film`] takes the light of the scene out of two of them, by the texels that stayed bare, and turns what is left into
//! thickness (Kubelka-Munk). Poses are the caller's, as his localisation has them. Ours; the thesis paints without looking.
//!
//! Assumed: a matt surface, exposure that is locked within the pictures of one mosaic, and no shadow that has moved between the two.

mod film_estimate;
mod lighting;
mod mosaic;

pub use film_estimate::{FilmEstimate, GreyPaint, estimate_film};
pub use mosaic::{Mosaic, Picture, TexelLight};
