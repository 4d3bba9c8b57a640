//! The chi-square distribution: bounds for consistency tests and gates.

use crate::error::Error;

/// Probability that a chi-square variable of `dof` degrees of freedom is at most `x`; 0 for `x ≤ 0` and for NaN. Without
/// any degree of freedom the variable is zero.
pub fn cdf(x: f64, dof: usize) -> f64 {
    if x.is_nan() || x <= 0.0 {
        return 0.0;
    }
    if dof == 0 {
        return 1.0;
    }
    if x == f64::INFINITY {
        return 1.0;
    }
    lower_gamma(dof as f64 / 2.0, x / 2.0)
}

/// The value that a chi-square variable of `dof ≥ 1` degrees of freedom exceeds with probability `1 − p`, `0 < p < 1`.
///
/// ```
/// // The gate of a two-dimensional residual at 99 %.
/// assert!((vio_ekf::eval::chi2::quantile(0.99, 2)? - 9.210_340_371_976_18).abs() < 1e-10);
/// # Ok::<(), vio_ekf::Error>(())
/// ```
pub fn quantile(p: f64, dof: usize) -> Result<f64, Error> {
    if !(p > 0.0 && p < 1.0) {
        return Err(Error::InvalidSetting { name: "p", value: p, rule: "must be between 0 and 1, both excluded" });
    }
    if !(1..=MAX_DOF).contains(&dof) {
        return Err(Error::InvalidSetting { name: "dof", value: dof as f64, rule: "must be from 1 to 1,000,000" });
    }
    let (mut low, mut high) = (0.0, dof as f64);
    while cdf(high, dof) < p {
        (low, high) = (high, 2.0 * high);
    }
    // Halving until the two are neighbours among the f64 (or nearly so): no tolerance to choose, cannot fail.
    for _ in 0..200 {
        let middle = f64::midpoint(low, high);
        if middle <= low || middle >= high {
            break;
        }
        if cdf(middle, dof) < p { low = middle } else { high = middle }
    }
    Ok(high)
}

/// Band in which the mean of `runs` independent chi-square variables of `dof` lies with probability `confidence`.
///
/// With `dof` 3 and 95 %: `[2.024, 4.165]` for 20 runs. A mean normalised squared error above it means an overconfident
/// covariance, below it a timid one.
pub fn mean_band(dof: usize, runs: usize, confidence: f64) -> Result<(f64, f64), Error> {
    if runs == 0 {
        return Err(Error::TooFew { what: "runs to average", got: 0, need: 1 });
    }
    if !(confidence > 0.0 && confidence < 1.0) {
        let rule = "must be between 0 and 1, both excluded";
        return Err(Error::InvalidSetting { name: "confidence", value: confidence, rule });
    }
    let (tail, total) = ((1.0 - confidence) / 2.0, dof.saturating_mul(runs));
    Ok((quantile(tail, total)? / runs as f64, quantile(1.0 - tail, total)? / runs as f64))
}

/// Beyond this many degrees of freedom the normal distribution serves as well, and the series grows long.
const MAX_DOF: usize = 1_000_000;

/// Regularised lower incomplete gamma function `P(a, x)` for positive arguments (DLMF 8.11.4 and 8.9.2).
fn lower_gamma(a: f64, x: f64) -> f64 {
    let front = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        // Σ x^k / (a (a+1) … (a+k)): positive terms, ratio below one from the start.
        let (mut term, mut sum, mut k) = (1.0 / a, 1.0 / a, a);
        while term > sum * f64::EPSILON * 0.1 {
            k += 1.0;
            term *= x / k;
            sum += term;
        }
        (sum * front).min(1.0)
    } else {
        // The continued fraction of the upper function, by Lentz's method.
        let mut b = x + 1.0 - a;
        let (mut c, mut d) = (1e300, 1.0 / b);
        let mut fraction = d;
        for k in 1..100_000 {
            let k = f64::from(k);
            b += 2.0;
            d = 1.0 / (b - k * (k - a) * d);
            c = b - k * (k - a) / c;
            let factor = c * d;
            fraction *= factor;
            if (factor - 1.0).abs() < f64::EPSILON {
                break;
            }
        }
        (1.0 - front * fraction).clamp(0.0, 1.0)
    }
}

/// `ln Γ(a)` for positive `a`: recurrence up to 16, then Stirling's series (DLMF 5.11.1).
fn ln_gamma(mut a: f64) -> f64 {
    let mut product = 1.0;
    while a < 16.0 {
        product *= a;
        a += 1.0;
    }
    let r = 1.0 / (a * a);
    let tail = (1.0 / 12.0 - r * (1.0 / 360.0 - r * (1.0 / 1260.0 - r * (1.0 / 1680.0 - r / 1188.0)))) / a;
    (a - 0.5) * a.ln() - a + 0.5 * std::f64::consts::TAU.ln() + tail - f64::ln(product)
}
