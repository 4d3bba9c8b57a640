//! Locally weighted regression (Cleveland's LOWESS, degree 1), the filter of the smoothing planner.

use crate::settings::LowessSettings;

/// Smooths several series over one increasing abscissa `x` (m). Each fit sees the points nearest to it, as many as cover
/// the span at the mean spacing; robust weights are shared by all series, since they are coordinates of one path.
pub(crate) fn lowess<const K: usize>(x: &[f64], y: &[[f64; K]], settings: &LowessSettings) -> Vec<[f64; K]> {
    let count = x.len();
    let mean_spacing = (x[count - 1] - x[0]) / (count - 1).max(1) as f64;
    let wanted = if mean_spacing > 0.0 { (settings.span / mean_spacing).round() } else { 1.0 };
    let neighbours = (wanted.min(count as f64) as usize).max(3).min(count);
    let mut robust = vec![1.0; count];
    let mut smooth = fits(x, y, &robust, neighbours);
    for _ in 0..settings.passes {
        if !reweight(y, &smooth, &mut robust) {
            break;
        }
        smooth = fits(x, y, &robust, neighbours);
    }
    smooth
}

fn fits<const K: usize>(x: &[f64], y: &[[f64; K]], robust: &[f64], neighbours: usize) -> Vec<[f64; K]> {
    let mut first = 0;
    (0..x.len())
        .map(|i| {
            // The window of nearest points only moves forward as x grows.
            while first + neighbours < x.len() && x[first + neighbours] - x[i] < x[i] - x[first] {
                first += 1;
            }
            let window = first..first + neighbours;
            let radius = (x[i] - x[first]).max(x[window.end - 1] - x[i]);
            local_line(&x[window.clone()], &y[window.clone()], &robust[window], x[i], radius).unwrap_or(y[i])
        })
        .collect()
}

/// Weighted straight line through the window, evaluated at `at`; `None` when all weights vanish.
fn local_line<const K: usize>(x: &[f64], y: &[[f64; K]], robust: &[f64], at: f64, radius: f64) -> Option<[f64; K]> {
    let weight = |j: usize| {
        let u = if radius > 0.0 { (x[j] - at).abs() / radius } else { 0.0 };
        robust[j] * (1.0 - u * u * u).max(0.0).powi(3)
    };
    let total: f64 = (0..x.len()).map(weight).sum();
    if total <= 0.0 {
        return None;
    }
    let centre = (0..x.len()).map(|j| weight(j) * x[j]).sum::<f64>() / total;
    let spread = (0..x.len()).map(|j| weight(j) * (x[j] - centre).powi(2)).sum::<f64>();
    // All weight on one abscissa: the mean is the fit.
    let leaning = if spread > 1e-12 * radius * radius * total { (at - centre) / spread } else { 0.0 };
    let mut value = [0.0; K];
    for (j, row) in y.iter().enumerate() {
        let share = weight(j) * (1.0 / total + leaning * (x[j] - centre));
        for k in 0..K {
            value[k] += share * row[k];
        }
    }
    Some(value)
}

/// Bisquare weights of the residuals at six times their median; false when the fit is exact.
fn reweight<const K: usize>(y: &[[f64; K]], smooth: &[[f64; K]], robust: &mut [f64]) -> bool {
    let size = |a: &[f64; K], b: &[f64; K]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    let residuals: Vec<f64> = y.iter().zip(smooth).map(|(a, b)| size(a, b)).collect();
    let mut sorted = residuals.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let half = sorted.len() / 2;
    let median = if sorted.len().is_multiple_of(2) { 0.5 * (sorted[half - 1] + sorted[half]) } else { sorted[half] };
    if median < 1e-12 {
        return false;
    }
    for (weight, residual) in robust.iter_mut().zip(&residuals) {
        let u = (residual / (6.0 * median)).min(1.0);
        *weight = (1.0 - u * u).powi(2);
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_statsmodels() {
        // statsmodels.nonparametric.lowess(y, x, frac=0.5, it=0 and it=2, delta=0) for y = sin(2 x), y[7] += 1.
        let x: Vec<f64> = (0..STEPS).map(|i| 0.1 * i as f64).collect();
        let mut y: Vec<[f64; 1]> = x.iter().map(|x| [(2.0 * x).sin()]).collect();
        y[7][0] += 1.0;
        for (passes, expected) in [(0, PLAIN), (2, ROBUST)] {
            let settings = LowessSettings { span: 1.0, passes };
            for (value, expected) in lowess(&x, &y, &settings).iter().zip(expected) {
                assert!((value[0] - expected).abs() < 1e-9, "{} {expected}", value[0]);
            }
        }
    }

    #[test]
    fn lines_pass_unchanged() {
        let x: Vec<f64> = (0..30).map(|i| f64::from(i).powf(1.2)).collect();
        let y: Vec<[f64; 2]> = x.iter().map(|x| [2.0 * x - 1.0, -0.5 * x]).collect();
        for (a, b) in lowess(&x, &y, &LowessSettings { span: 12.0, passes: 2 }).iter().zip(&y) {
            assert!((a[0] - b[0]).abs() < 1e-9 && (a[1] - b[1]).abs() < 1e-9);
        }
    }

    const STEPS: usize = 20;
    const PLAIN: [f64; STEPS] = [
        0.0002520307215375262,
        0.1831853007288079,
        0.36855606650347944,
        0.5575831892740364,
        0.7501397521651643,
        0.923937136660803,
        1.0351119716949453,
        1.0888783045221802,
        1.0978956361948937,
        1.0470014790823978,
        0.9285785855280452,
        0.771697336452416,
        0.6279463531685356,
        0.47923738230192486,
        0.3114227293239484,
        0.13119263487907784,
        -0.05655766978422805,
        -0.24469987928805542,
        -0.43340879524718157,
        -0.6223616305859324,
    ];
    const ROBUST: [f64; STEPS] = [
        0.029225954653935633,
        0.19936243119078026,
        0.3673533779033807,
        0.5326905171561279,
        0.6907651465638732,
        0.7848951966006072,
        0.8332171118997348,
        0.8727549753535617,
        0.8993958095508573,
        0.9164738092368446,
        0.874786928321176,
        0.7649058623181391,
        0.6300258452972455,
        0.47841067042037766,
        0.3112006657886348,
        0.13137232738312427,
        -0.05649310672025264,
        -0.244753160015329,
        -0.4335547927824074,
        -0.6225746145762199,
    ];
}
