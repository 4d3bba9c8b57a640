//! Reflectance of one wet film of mixed paints over a substrate, in one band (Kubelka and Munk 1931).

/// Reflectance of a film and its derivatives by absorption and scattering.
pub(super) struct Reflectance {
    pub(super) value: f64,
    pub(super) by_absorption: f64,
    pub(super) by_scattering: f64,
}

/// Reflectance of a film over a substrate of reflectance `g`, with the absorption `k` and the scattering `s` of its whole thickness:
///
/// ```text
/// R = (g + T (s - g (k + s))) / (1 + T (k + s - s g)),   T = tanh β / β,   β² = k (k + 2 s)
/// ```
///
/// which is the solution of Kubelka and Munk's equation without a pole anywhere; without scattering it is Beer-Lambert,
/// `g exp(-2 k)`.
pub(super) fn reflectance(k: f64, s: f64, g: f64) -> Reflectance {
    let (t, slope) = tanhc(k * (k + 2.0 * s));
    let (above, below) = (s - g * (k + s), k + s - s * g);
    let (numerator, denominator) = (g + t * above, 1.0 + t * below);
    let value = numerator / denominator;
    let by = |squared: f64, above_by: f64, below_by: f64| {
        let numerator_by = slope * squared * above + t * above_by;
        let denominator_by = slope * squared * below + t * below_by;
        (numerator_by - value * denominator_by) / denominator
    };
    Reflectance { value, by_absorption: by(2.0 * (k + s), -g, 1.0), by_scattering: by(2.0 * k, 1.0 - g, 1.0 - g) }
}

/// `tanh √q / √q` and its derivative by `q`.
fn tanhc(q: f64) -> (f64, f64) {
    if q < 1e-4 {
        return (1.0 - q / 3.0 + 2.0 * q * q / 15.0, -1.0 / 3.0 + 4.0 * q / 15.0);
    }
    let root = q.sqrt();
    let t = root.tanh() / root;
    (t, (1.0 - q * t * t - t) / (2.0 * q))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn films_solve_the_equation_of_kubelka_and_munk() {
        // dR/dx = S - 2 (K + S) R + S R², R(0) = g, by Runge and Kutta's fourth order.
        for (k, s, g) in
            [(0.4, 1.3, 0.1), (2.0, 0.2, 0.9), (0.0, 3.0, 0.3), (1.5, 0.0, 0.8), (1e-4, 1e-4, 0.5), (3.0, 8.0, 1.0)]
        {
            let rate = |r: f64| s - 2.0 * (k + s) * r + s * r * r;
            let (mut r, step): (f64, f64) = (g, 1e-4);
            for _ in 0..10_000 {
                let a = rate(r);
                let b = rate(r + 0.5 * step * a);
                let c = rate(r + 0.5 * step * b);
                let d = rate(r + step * c);
                r += step / 6.0 * (a + 2.0 * b + 2.0 * c + d);
            }
            assert!(
                (reflectance(k, s, g).value - r).abs() < 1e-9,
                "K {k} S {s} over {g}: {} {r}",
                reflectance(k, s, g).value
            );
        }
    }

    #[test]
    fn derivatives_are_those_of_differences() {
        let h = 1e-6;
        for (k, s, g) in [(0.4, 1.3, 0.1), (2.0, 0.2, 0.9), (1.5, 0.0, 0.8), (5e-3, 4e-3, 0.5), (3.0, 8.0, 1.0)] {
            let one = reflectance(k, s, g);
            let by_k = (reflectance(k + h, s, g).value - reflectance(k - h, s, g).value) / (2.0 * h);
            let by_s = (reflectance(k, s + h, g).value - reflectance(k, s - h, g).value) / (2.0 * h);
            assert!((one.by_absorption - by_k).abs() < 1e-7, "{k} {s} {g}: {} {by_k}", one.by_absorption);
            assert!((one.by_scattering - by_s).abs() < 1e-7, "{k} {s} {g}: {} {by_s}", one.by_scattering);
        }
    }

    #[test]
    fn without_scattering_it_is_beer_and_lambert() {
        for k in [0.0, 1e-6, 0.03, 0.7, 20.0, 400.0] {
            assert!((reflectance(k, 0.0, 0.9).value - 0.9 * (-2.0 * k).exp()).abs() < 1e-12);
        }
    }
}
