//! The transfer curve of sRGB (IEC 61966-2-1); its inverse is `uv_param::texture::linear_from_srgb`.

use paint_sim::colour::encode_srgb;

/// sRGB byte of a linear value.
pub(crate) fn srgb_byte(linear: f32) -> u8 {
    (255.0 * encode_srgb(f64::from(linear)).clamp(0.0, 1.0)).round() as u8
}
