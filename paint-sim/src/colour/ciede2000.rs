//! The colour difference CIEDE2000.

/// CIEDE2000 between two CIELAB colours (CIE 142-2001, in the formulation of Sharma, Wu and Dalal 2005), with all
/// parametric factors one. Both colours are finite numbers.
pub fn ciede2000(lab1: [f64; 3], lab2: [f64; 3]) -> f64 {
    let [l1, a1, b1] = lab1;
    let [l2, a2, b2] = lab2;
    let mean_chroma7 = (0.5 * (a1.hypot(b1) + a2.hypot(b2))).powi(7);
    let g = 0.5 * (1.0 - (mean_chroma7 / (mean_chroma7 + 25.0_f64.powi(7))).sqrt());
    let (a1, a2) = ((1.0 + g) * a1, (1.0 + g) * a2);
    let (c1, c2) = (a1.hypot(b1), a2.hypot(b2));
    let (h1, h2) = (hue(a1, b1), hue(a2, b2));

    let grey = c1 * c2 == 0.0;
    let turn = h2 - h1;
    let dh = match turn {
        _ if grey => 0.0,
        t if t > 180.0 => t - 360.0,
        t if t < -180.0 => t + 360.0,
        t => t,
    };
    let mean_hue = match h1 + h2 {
        sum if grey => sum,
        sum if turn.abs() <= 180.0 => 0.5 * sum,
        sum if sum < 360.0 => 0.5 * (sum + 360.0),
        sum => 0.5 * (sum - 360.0),
    };
    let cosine = |times: f64, shift: f64| (times * mean_hue + shift).to_radians().cos();
    let t =
        1.0 - 0.17 * cosine(1.0, -30.0) + 0.24 * cosine(2.0, 0.0) + 0.32 * cosine(3.0, 6.0) - 0.20 * cosine(4.0, -63.0);

    let mean_lightness50 = (0.5 * (l1 + l2) - 50.0).powi(2);
    let mean_c = 0.5 * (c1 + c2);
    let s_l = 1.0 + 0.015 * mean_lightness50 / (20.0 + mean_lightness50).sqrt();
    let s_c = 1.0 + 0.045 * mean_c;
    let s_h = 1.0 + 0.015 * mean_c * t;
    let rotation = 60.0 * (-((mean_hue - 275.0) / 25.0).powi(2)).exp();
    let mean_c7 = mean_c.powi(7);
    let r_t = -2.0 * (mean_c7 / (mean_c7 + 25.0_f64.powi(7))).sqrt() * rotation.to_radians().sin();

    let lightness = (l2 - l1) / s_l;
    let chroma = (c2 - c1) / s_c;
    let hue = 2.0 * (c1 * c2).sqrt() * (0.5 * dh).to_radians().sin() / s_h;
    (lightness * lightness + chroma * chroma + hue * hue + r_t * chroma * hue).sqrt()
}

/// Hue angle in 0..360 degrees, zero for grey.
fn hue(a: f64, b: f64) -> f64 {
    if a == 0.0 && b == 0.0 { 0.0 } else { b.atan2(a).to_degrees().rem_euclid(360.0) }
}
