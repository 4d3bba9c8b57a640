//! The light of a scene over a surface: smooth in the place and in the normal.

use nalgebra::{SMatrix, SVector, Vector3};

use crate::film::Texel;

/// Terms of the logarithm of the light: a constant, place, normal, and squares of what is level and upright in the normal.
const TERMS: usize = 10;
type Terms = SVector<f64, TERMS>;
/// Rounds of reweighting.
const ROUNDS: usize = 10;
/// Huber's constant: 95 % efficient on normal errors.
const HUBER: f64 = 1.345;
/// A median absolute deviation of normal errors is this part of their standard deviation.
const MAD: f64 = 0.6745;
/// Share of the mean of the diagonal that is added to it: on a plane all normals are the same.
const RIDGE: f64 = 1e-9;

/// A term is fitted if it varies among the texels that were observed by this share of what it does among all, and is left out otherwise: a
/// slope along a strip of bare wall says nothing of the far end.
const SPANNED: f64 = 0.5;

pub(super) struct Lighting {
    centre: Vector3<f64>,
    scale: f64,
    coefficients: Terms,
}

impl Lighting {
    /// So many texels must be seen.
    pub(super) const LEAST: usize = 2 * TERMS;

    /// Robust least squares (Huber 1964) through logarithms of light at some of all texels; `None` of too few.
    pub(super) fn fit(all: &[Texel], observed: &[(&Texel, f64)]) -> Option<Self> {
        if observed.len() < Self::LEAST {
            return None;
        }
        let count = all.len() as f64;
        let centre = all.iter().map(|texel| texel.point.coords).sum::<Vector3<f64>>() / count;
        let spread: f64 = all.iter().map(|texel| (texel.point.coords - centre).norm_squared()).sum();
        let mut lighting = Self { centre, scale: (spread / count).sqrt().max(1e-6), coefficients: Terms::zeros() };
        let mut rows: Vec<(Terms, f64)> = observed.iter().map(|(texel, log)| (lighting.terms(texel), *log)).collect();
        let [wide, seen] =
            [deviations(all.iter().map(|texel| lighting.terms(texel))), deviations(rows.iter().map(|row| row.0))];
        let spanned = Terms::from_fn(|k, _| if k == 0 || seen[k] >= SPANNED * wide[k] { 1.0 } else { 0.0 });
        for (terms, _) in &mut rows {
            terms.component_mul_assign(&spanned);
        }
        let mut widest = f64::INFINITY;
        for _ in 0..ROUNDS {
            let mut normal = SMatrix::<f64, TERMS, TERMS>::zeros();
            let mut right = Terms::zeros();
            for (terms, log) in &rows {
                let residual = (log - lighting.coefficients.dot(terms)).abs();
                let weight = if residual > widest { widest / residual } else { 1.0 };
                normal += weight * terms * terms.transpose();
                right += weight * *log * terms;
            }
            let ridge = RIDGE * normal.trace() / TERMS as f64;
            for k in 0..TERMS {
                normal[(k, k)] += ridge;
            }
            lighting.coefficients = normal.cholesky()?.solve(&right);
            let mut residuals: Vec<f64> =
                rows.iter().map(|(terms, log)| (log - lighting.coefficients.dot(terms)).abs()).collect();
            let middle = residuals.len() / 2;
            widest = HUBER / MAD * *residuals.select_nth_unstable_by(middle, f64::total_cmp).1;
        }
        Some(lighting)
    }

    /// Logarithm of the light at a texel.
    pub(super) fn log(&self, texel: &Texel) -> f64 {
        self.coefficients.dot(&self.terms(texel))
    }

    /// All terms; those that were left out have no coefficient.
    fn terms(&self, texel: &Texel) -> Terms {
        let p = (texel.point.coords - self.centre) / self.scale;
        let n = texel.normal.as_ref();
        Terms::from([1.0, p.x, p.y, p.z, n.x, n.y, n.z, n.x * n.y, n.y * n.z, n.z * n.z])
    }
}

/// Standard deviation of each term.
fn deviations(terms: impl Iterator<Item = Terms>) -> Terms {
    let (mut count, mut sum, mut squares) = (0.0, Terms::zeros(), Terms::zeros());
    for terms in terms {
        count += 1.0;
        sum += terms;
        squares += terms.component_mul(&terms);
    }
    let mean = sum / f64::max(count, 1.0);
    (squares / f64::max(count, 1.0) - mean.component_mul(&mean)).map(|variance| variance.max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Rng;
    use nalgebra::Point3;

    /// Errors of the light in the middle of a wall: as of least squares with normal errors (Huber: 95 % efficient, a median 64 %), and
    /// bounded where a fifth of the texels is far off.
    #[test]
    fn the_fit_is_efficient_and_robust() {
        let texel = |k: usize| Texel {
            point: Point3::new(0.0, 0.1 * (k % 10) as f64, 0.1 * (k / 10) as f64),
            normal: -Vector3::x_axis(),
            area: 0.01,
        };
        let all: Vec<Texel> = (0..100).map(texel).collect();
        let mut rng = Rng::new(7, 0);
        let mut squares = [0.0; 2];
        for _ in 0..300 {
            let clean: Vec<f64> = all.iter().map(|t| 0.3 + 0.5 * t.point.y - 0.2 * t.point.z + rng.normal()).collect();
            for (far, square) in [0.0, 30.0].into_iter().zip(&mut squares) {
                let log = |k: usize| clean[k] + if k % 5 == 3 { far } else { 0.0 };
                let observed: Vec<(&Texel, f64)> = all.iter().enumerate().map(|(k, t)| (t, log(k))).collect();
                let lighting = Lighting::fit(&all, &observed).unwrap();
                // The mean over the wall, which is symmetric about its middle.
                let mean = all.iter().map(|t| lighting.log(t)).sum::<f64>() / 100.0;
                *square += (mean - (0.3 + 0.5 * 0.45 - 0.2 * 0.45)).powi(2) / 300.0;
            }
        }
        // The mean of 100 normal errors has a variance of 0.01.
        assert!((0.009..0.0135).contains(&squares[0]), "{squares:?}");
        // Their mean would be off by 6.
        assert!(squares[1] < 0.5, "{squares:?}");
    }
}
