//! The transfer curve of sRGB (IEC 61966-2-1); its inverse is `uv_param::texture::linear_from_srgb`.

use paint_sim::colour::encode_srgb8;

/// sRGB byte of a linear value.
pub(crate) fn srgb_byte(linear: f32) -> u8 {
    encode_srgb8(f64::from(linear)).0
}
