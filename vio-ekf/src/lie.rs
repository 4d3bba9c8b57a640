//! The rotation group, the group of rigid motions, and the functions their exponentials are made of.

pub mod se3;
pub mod so3;

/// Stumpff functions `c_n(x²) = Σ_k (−x²)^k / (2k+n)!` for `n` up to 5.
///
/// They are the coefficients of every exponential and Jacobian of rotations: `c_0 = cos x`, `c_1 = sin x / x`,
/// `c_2 = (1 − cos x)/x²`, `c_3 = (x − sin x)/x³`, ...; in this form nothing cancels near zero.
pub(crate) fn stumpff(x_squared: f64) -> [f64; 6] {
    let x = x_squared.sqrt();
    if x_squared < 1.0 {
        // The last term kept, 1/(24)!, is far below rounding.
        std::array::from_fn(|n| {
            let mut term = 1.0 / (1..=n).product::<usize>() as f64;
            let mut sum = term;
            for k in 1..=10 {
                term *= -x_squared / ((2 * k + n - 1) * (2 * k + n)) as f64;
                sum += term;
            }
            sum
        })
    } else {
        let (c0, c1) = (x.cos(), x.sin() / x);
        let (c2, c3) = ((1.0 - c0) / x_squared, (1.0 - c1) / x_squared);
        [c0, c1, c2, c3, (0.5 - c2) / x_squared, (1.0 / 6.0 - c3) / x_squared]
    }
}
