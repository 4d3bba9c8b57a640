//! From rest to rest with the least jerk (Flash and Hogan 1985).

/// Share of the way at a share `s` of the time, cut to 0..=1, with its first and second derivative by `s`: `10 s³ - 15 s⁴ + 6 s⁵`.
pub(crate) fn minimum_jerk(s: f64) -> [f64; 3] {
    let s = s.clamp(0.0, 1.0);
    let left = 1.0 - s;
    [s * s * s * (10.0 + s * (6.0 * s - 15.0)), 30.0 * s * s * left * left, 60.0 * s * left * (1.0 - 2.0 * s)]
}
