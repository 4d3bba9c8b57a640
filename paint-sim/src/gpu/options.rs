//! Which GPU to use.

/// Which adapter may be used, and how.
///
/// The processor does the same as each program on a GPU, and is what they are tested against. They differ in what of it is equal:
///
/// | on the GPU | against the processor | because |
/// |---|---|---|
/// | [`Film::deposit_on`](crate::Film::deposit_on) | same femtolitres on every texel, same balance | double precision in integers, certain shadows |
/// | [`render()`](crate::render()) of a [`GpuSurface`](crate::surface::GpuSurface) | same bytes | triangles that are certain; distances and light are the processor's |
/// | [`GpuFilmColours`](crate::paint::GpuFilmColours) | within 2e-6 of linear sRGB | single precision on both |
/// | [`GpuDensity`](crate::droplets::GpuDensity), [`GpuHits`](crate::droplets::GpuHits) | one droplet in a thousand elsewhere | single precision on both |
///
/// *Certain* is what single precision decides with a bound of its errors; the rest is left to the processor.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct GpuOptions {
    /// Part of the adapter's name; empty for the best one (discrete before integrated).
    pub adapter: String,
    /// Whether an adapter may be a program on the processor, such as Mesa's lavapipe: meant for tests.
    pub software: bool,
    /// The largest single buffer, bytes; the adapter's own limit holds in any case (ours: none). Larger work is done in parts.
    pub max_buffer_bytes: u64,
}

impl Default for GpuOptions {
    fn default() -> Self {
        Self { adapter: String::new(), software: false, max_buffer_bytes: u64::MAX }
    }
}
