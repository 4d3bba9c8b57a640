//! What all programs on a GPU share: the adapter, its buffers, and what becomes of faults.
//!
//! The processor does the same as each of them, and is what they are tested against. They differ in what of it is equal:
//!
//! | on the GPU | against the processor | because |
//! |---|---|---|
//! | [`Film::deposit_on`](crate::Film::deposit_on) | same femtolitres on every texel, same balance | double precision in integers, certain shadows |
//! | [`render()`](crate::render()) of a [`GpuSurface`](crate::surface::GpuSurface) | same bytes | triangles that are certain; distances and light are the processor's |
//! | [`GpuFilmColours`](crate::paint::GpuFilmColours) | within 2e-6 of linear sRGB | single precision on both |
//! | [`GpuDensity`](crate::droplets::GpuDensity), [`GpuHits`](crate::droplets::GpuHits) | one droplet in a thousand elsewhere | single precision on both |
//!
//! *Certain* is what single precision decides with a bound of its errors; the rest is left to the processor.

mod device;
mod double;
mod fallback;
mod options;
#[cfg(test)]
pub(crate) mod test_adapter;

pub(crate) use device::{Input, MOST_GROUPS, Program, floats, words};
pub(crate) use double::{DOUBLE, doubles};
pub(crate) use fallback::Fallback;
pub use options::GpuOptions;
