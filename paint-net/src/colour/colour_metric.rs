//! Measures of the difference of two colours.

/// By what the difference of two colours is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ColourMetric {
    /// CIEDE2000, linearised around the wanted colour; bands are the stored values of sRGB.
    #[default]
    Ciede2000,
    /// The sum of squares over the bands.
    Euclidean,
}

impl ColourMetric {
    /// The rows `B` for which `|B (other - colour)|` is the difference between a colour and others near it.
    pub(super) fn jacobian(self, colour: [f64; 3]) -> [[f64; 3]; 3] {
        match self {
            Self::Ciede2000 => ciede2000_jacobian(colour),
            Self::Euclidean => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        }
    }
}

/// White of D65, 2°.
const WHITE: [f64; 3] = [0.95047, 1.0, 1.08883];
/// Linear sRGB to XYZ (IEC 61966-2-1).
const XYZ: [[f64; 3]; 3] =
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]];

/// The rows `B` for which `|B (other - colour)|` is CIEDE2000 between a colour and others near it, both in sRGB as stored: the
/// formula's own terms at the colour (Sharma, Wu and Dalal 2005, equations 2 to 22), times the derivative of Lab. The rotation
/// term for blues, `c² + h² + R c h`, is `(c + R h / 2)² + (1 - R² / 4) h²`.
fn ciede2000_jacobian(colour: [f64; 3]) -> [[f64; 3]; 3] {
    let mut lab = [0.0; 3];
    let mut lab_by_colour = [[0.0; 3]; 3];
    let (mut f, mut f_by) = ([0.0; 3], [[0.0; 3]; 3]);
    let linear = colour.map(decode);
    for row in 0..3 {
        let xyz: f64 = (0..3).map(|c| XYZ[row][c] * linear[c].0).sum::<f64>() / WHITE[row];
        let (value, slope) = if xyz > 216.0 / 24389.0 {
            let root = xyz.cbrt();
            (root, 1.0 / (3.0 * root * root))
        } else {
            (24389.0 / 27.0 / 116.0 * xyz + 16.0 / 116.0, 24389.0 / 27.0 / 116.0)
        };
        f[row] = value;
        f_by[row] = std::array::from_fn(|c| slope * XYZ[row][c] / WHITE[row] * linear[c].1);
    }
    for (row, of) in [[0.0, 116.0, 0.0], [500.0, -500.0, 0.0], [0.0, 200.0, -200.0]].into_iter().enumerate() {
        lab[row] = (0..3).map(|k| of[k] * f[k]).sum();
        lab_by_colour[row] = std::array::from_fn(|c| (0..3).map(|k| of[k] * f_by[k][c]).sum());
    }
    let by_lab = ciede2000_rows([lab[0] - 16.0, lab[1], lab[2]]);
    by_lab.map(|row| std::array::from_fn(|c| (0..3).map(|k| row[k] * lab_by_colour[k][c]).sum()))
}

/// The same between colours in CIELAB.
pub(super) fn ciede2000_rows([lightness, a, b]: [f64; 3]) -> [[f64; 3]; 3] {
    let seventh = a.hypot(b).powi(7);
    let a_scale = 1.5 - 0.5 * (seventh / (seventh + 25.0_f64.powi(7))).sqrt();
    let a = a_scale * a;
    let (chroma, hue) = (a.hypot(b), b.atan2(a));
    let squared = (lightness - 50.0).powi(2);
    let cosine = |times: f64, degrees: f64| (times * hue + degrees.to_radians()).cos();
    let t =
        1.0 - 0.17 * cosine(1.0, -30.0) + 0.24 * cosine(2.0, 0.0) + 0.32 * cosine(3.0, 6.0) - 0.20 * cosine(4.0, -63.0);
    let (s_lightness, s_chroma, s_hue) =
        (1.0 + 0.0149 * squared / (20.0 + squared).sqrt(), 1.0 + 0.045 * chroma, 1.0 + 0.015 * chroma * t);
    let (sin, cos) = hue.sin_cos();
    let seventh = chroma.powi(7);
    let rotation = 30.0 * (-((hue.to_degrees().rem_euclid(360.0) - 275.0) / 25.0).powi(2)).exp();
    let rotation_term = -(2.0 * rotation).to_radians().sin() * 2.0 * (seventh / (seventh + 25.0_f64.powi(7))).sqrt();
    let by_chroma = [0.0, cos * a_scale / s_chroma, sin / s_chroma];
    let by_hue = [0.0, -sin * a_scale / s_hue, cos / s_hue];
    [
        [1.0 / s_lightness, 0.0, 0.0],
        std::array::from_fn(|k| by_chroma[k] + 0.5 * rotation_term * by_hue[k]),
        by_hue.map(|v| (1.0 - 0.25 * rotation_term * rotation_term).sqrt() * v),
    ]
}

/// A stored value of sRGB made linear, and the slope there.
fn decode(stored: f64) -> (f64, f64) {
    if stored <= 0.04045 {
        (stored / 12.92, 1.0 / 12.92)
    } else {
        let base = (stored + 0.055) / 1.055;
        let value = base.powf(2.4);
        (value, 2.4 / 1.055 * value / base)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The difference per step, from steps of 1e-4 to both sides by another implementation of CIEDE2000 (scikit-image).
    #[test]
    fn small_differences_are_those_of_ciede2000() {
        for (colour, by, expected) in [
            ([0.2, 0.5, 0.7], [0.4, -0.3, 0.2], 51.977_31),
            ([0.8, 0.75, 0.7], [-0.2, 0.3, 0.4], 58.537_15),
            ([0.05, 0.04, 0.06], [0.3, 0.2, -0.3], 57.746_98),
            ([0.9, 0.2, 0.1], [0.3, 0.4, 0.2], 25.550_21),
            ([0.3, 0.6, 0.25], [0.0, -0.4, 0.3], 39.454_13),
            ([0.15, 0.2, 0.85], [0.3, 0.1, -0.4], 12.065_49),
            ([0.6, 0.55, 0.1], [-0.1, 0.4, 0.3], 46.946_43),
            ([0.7, 0.3, 0.75], [0.2, 0.3, -0.4], 31.411_81),
        ] {
            let rows = ciede2000_jacobian(colour).map(|row| (0..3).map(|c| row[c] * by[c]).sum::<f64>());
            let found = rows.iter().map(|v| v * v).sum::<f64>().sqrt();
            assert!((found / expected - 1.0).abs() < 1e-3, "at {colour:?}: {found}, expected {expected}");
        }
    }
}
