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
