//! From reflectance spectra to colours: CIE XYZ under D65, CIELAB, sRGB.

mod ciede2000;
mod spectrum;
mod srgb;
mod tables;
mod upsampling;

pub use ciede2000::ciede2000;
pub use spectrum::{BANDS, Spectrum, wavelength};
pub(crate) use srgb::Srgb8Table;
pub use srgb::{decode_srgb, decode_srgb8, encode_srgb, encode_srgb8};
pub use upsampling::spectrum_of_linear_srgb;

/// Tristimulus values of the D65 white that sRGB is defined for (IEC 61966-2-1).
pub const WHITE: [f64; 3] = [0.95047, 1.0, 1.08883];

/// Tristimulus values of a reflecting surface under D65 for the 2 degree observer, `Y = 1` for the perfect white: the
/// plain sum over the bands, whose own white is (0.950119, 1, 1.088161), see [`band_white`].
pub fn xyz(reflectance: &Spectrum) -> [f64; 3] {
    let mut sum = [0.0; 3];
    let mut white = 0.0;
    for ((&r, observer), &power) in reflectance.iter().zip(&tables::OBSERVER).zip(&tables::D65) {
        for (total, weight) in sum.iter_mut().zip(observer) {
            *total += r * power * weight;
        }
        white += power * observer[1];
    }
    sum.map(|total| total / white)
}

/// Tristimulus values of light that has a spectrum per nm: the plain sum over the bands, 10 nm each; times 683 lm/W they are luminous.
pub fn emission_xyz(power: &Spectrum) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (power, observer) in power.iter().zip(&tables::OBSERVER) {
        for (total, weight) in sum.iter_mut().zip(observer) {
            *total += 10.0 * power * weight;
        }
    }
    sum
}

/// Linear sRGB of [`emission_xyz`], the bands' own D65 scaled to [`WHITE`]. Not clipped: light may be outside of the gamut of sRGB.
pub fn linear_srgb_of_emission(power: &Spectrum) -> [f64; 3] {
    let (values, white) = (emission_xyz(power), band_white());
    linear_srgb(std::array::from_fn(|i| values[i] / white[i] * WHITE[i]))
}

/// [`xyz`] of the perfect white.
pub fn band_white() -> [f64; 3] {
    xyz(&[1.0; BANDS])
}

/// CIELAB (L, a, b) of tristimulus values against a white.
pub fn lab(xyz: [f64; 3], white: [f64; 3]) -> [f64; 3] {
    let f = |i: usize| {
        let t = xyz[i] / white[i];
        if t > (6.0_f64 / 29.0).powi(3) { t.cbrt() } else { t * (29.0_f64 / 6.0).powi(2) / 3.0 + 4.0 / 29.0 }
    };
    let (x, y, z) = (f(0), f(1), f(2));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// CIELAB of a reflectance under D65, against the white of the same 36 bands.
pub fn spectrum_lab(reflectance: &Spectrum) -> [f64; 3] {
    lab(xyz(reflectance), band_white())
}

/// Linear sRGB components of tristimulus values that refer to [`WHITE`]; outside 0..=1 where sRGB cannot show the colour.
pub fn linear_srgb(xyz: [f64; 3]) -> [f64; 3] {
    let row = |m: [f64; 3]| m[0] * xyz[0] + m[1] * xyz[1] + m[2] * xyz[2];
    [
        row([3.2404542, -1.5371385, -0.4985314]),
        row([-0.969266, 1.8760108, 0.041556]),
        row([0.0556434, -0.2040259, 1.0572252]),
    ]
}

/// Linear sRGB of a reflectance under D65, the white of the bands scaled to [`WHITE`]. Not clipped.
pub fn spectrum_linear_srgb(reflectance: &Spectrum) -> [f64; 3] {
    let (values, white) = (xyz(reflectance), band_white());
    linear_srgb(std::array::from_fn(|i| values[i] / white[i] * WHITE[i]))
}

/// What a reflectance of 1 in one band alone adds to [`spectrum_linear_srgb`], band by band.
pub(crate) fn linear_srgb_weights() -> [[f64; 3]; BANDS] {
    std::array::from_fn(|band| spectrum_linear_srgb(&std::array::from_fn(|other| f64::from(u8::from(other == band)))))
}

/// CIELAB against [`WHITE`] of linear sRGB (IEC 61966-2-1).
pub fn linear_srgb_lab(linear: [f64; 3]) -> [f64; 3] {
    let row = |m: [f64; 3]| m[0] * linear[0] + m[1] * linear[1] + m[2] * linear[2];
    let xyz = [
        row([0.4124564, 0.3575761, 0.1804375]),
        row([0.2126729, 0.7151522, 0.072175]),
        row([0.0193339, 0.119192, 0.9503041]),
    ];
    lab(xyz, WHITE)
}

/// A colour for the screen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Srgb8 {
    /// Red, green, blue, 0..=255.
    pub rgb: [u8; 3],
    /// Whether the colour lies outside the gamut of sRGB and was clipped.
    pub clipped: bool,
}

/// The screen colour of a reflectance under D65.
pub fn spectrum_srgb8(reflectance: &Spectrum) -> Srgb8 {
    let encoded = spectrum_linear_srgb(reflectance).map(encode_srgb8);
    Srgb8 { rgb: encoded.map(|(value, _)| value), clipped: encoded.iter().any(|&(_, clipped)| clipped) }
}
