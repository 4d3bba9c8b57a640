//! The transfer curve of sRGB (IEC 61966-2-1); its inverse is `uv_param::texture::linear_from_srgb`.

/// sRGB value of a linear one, unquantised.
pub(crate) fn srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// sRGB byte of a linear value.
pub(crate) fn srgb_byte(linear: f32) -> u8 {
    (255.0 * srgb(f64::from(linear)).clamp(0.0, 1.0)).round() as u8
}
