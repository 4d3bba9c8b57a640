//! The solver by itself.

use super::projected_lbfgs::{StoppingRule, minimise};

/// Optimality on the box: the gradient vanishes inside and points outwards at the bounds.
#[test]
fn quadratic_on_a_box_meets_the_optimality_conditions() {
    // Tridiagonal A = [4 -1], b alternating: some variables end at 0, some at the upper.
    let n = 40;
    let b: Vec<f64> = (0..n).map(|k| 5.0 * (1.3 * k as f64).sin()).collect();
    let upper = vec![0.8; n];
    let mut x = vec![0.1; n];
    let mut evaluate = |x: &[f64], g: &mut [f64]| {
        let mut value = 0.0;
        for k in 0..n {
            let neighbours = if k > 0 { x[k - 1] } else { 0.0 } + if k + 1 < n { x[k + 1] } else { 0.0 };
            let ax = 4.0 * x[k] - neighbours;
            g[k] = ax - b[k];
            value += x[k] * (0.5 * ax - b[k]);
        }
        value + 100.0
    };
    minimise(&mut x, &upper, &StoppingRule { iterations: 500, relative_decrease: 0.0 }, &mut evaluate, &mut |_| ());
    let mut g = vec![0.0; n];
    evaluate(&x, &mut g);
    let (mut at_zero, mut at_top) = (0, 0);
    for k in 0..n {
        if x[k] <= 0.0 {
            at_zero += 1;
            assert!(g[k] >= -1e-6);
        } else if x[k] >= 0.8 {
            at_top += 1;
            assert!(g[k] <= 1e-6);
        } else {
            assert!(g[k].abs() < 1e-6, "variable {k}: gradient {}", g[k]);
        }
    }
    assert!(at_zero > 5 && at_top > 5);
}
