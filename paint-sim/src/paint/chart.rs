//! A paint from a chart of layers: patches of several thicknesses on one ground.

use nalgebra::{SMatrix, SVector};

use super::{Paint, Substrate};
use crate::colour::{BANDS, Spectrum};
use crate::error::{Error, check_positive, check_range};
use crate::km;
use crate::least_squares::{Minimum, Normal, minimise};

/// Optical depths of the thickest patch between which absorption and scattering are sought.
const DEPTHS: [f64; 2] = [1e-6, 1e4];
/// Absorptions, and scatterings, among which the search looks for its starts, over so many decades around one.
const GRID: usize = 12;
const DECADES: f64 = 6.0;
/// Absorptions from which it starts.
const STARTS: usize = 4;
/// Most steps of the search.
const STEPS: usize = 200;
/// A relative deviation that says that nothing is known.
const UNKNOWN: f64 = 1e3;

/// One patch of a chart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Patch {
    /// Thickness of the dry film, m.
    pub thickness: f64,
    /// Its reflectance per band without the air's interface ([`km::saunderson_inverse`]), the mean of its readings.
    pub reflectance: Spectrum,
    /// Standard deviation of that mean: of one reading, over the root of their number.
    pub noise: f64,
}

/// The paint of a chart, and how well the chart tells it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChartFit {
    /// The paint.
    pub paint: Paint,
    /// Standard deviations of the absorption per band, as shares of it; 1 and more where the chart does not tell it.
    pub absorption_deviation: Spectrum,
    /// The same of the scattering.
    pub scattering_deviation: Spectrum,
    /// Sum of the squared residuals over their variances, per band.
    pub chi_square: Spectrum,
    /// What it should be in the mean: patches less two.
    pub degrees_of_freedom: usize,
}

impl ChartFit {
    /// Whether the residuals of all bands together are noise: chi-square within five deviations of chance. Otherwise the ground, a thickness, the
    /// air's interface or the noise are other than was told.
    pub fn agrees(&self) -> bool {
        let degrees = (BANDS * self.degrees_of_freedom) as f64;
        self.chi_square.iter().sum::<f64>() <= degrees + 5.0 * (2.0 * degrees).sqrt()
    }

    /// Whether the chart tells both coefficients of a band within this share (one standard deviation).
    pub fn determines(&self, band: usize, share: f64) -> bool {
        band < BANDS && self.absorption_deviation[band].max(self.scattering_deviation[band]) <= share
    }
}

impl Paint {
    /// The paint of a chart by least squares per band, on the gradient of [`km::reflectance`].
    ///
    /// Patches from a film that lets the ground through to one that hides it tell both coefficients; what the chart leaves open in a band is
    /// said by its deviations.
    ///
    /// # Errors
    /// Fewer than two thicknesses, numbers that are not finite or out of range, [`Error::Undetermined`] where no band tells anything, as on a
    /// ground of the paint's own colour.
    pub fn from_chart(ground: &Substrate, patches: &[Patch]) -> Result<ChartFit, Error> {
        let thickest = check(patches)?;
        let mut fit = ChartFit {
            paint: Self::new(&[0.0; BANDS], &[0.0; BANDS], thickest)?,
            absorption_deviation: [UNKNOWN; BANDS],
            scattering_deviation: [UNKNOWN; BANDS],
            chi_square: [0.0; BANDS],
            degrees_of_freedom: patches.len() - 2,
        };
        let (mut absorption, mut scattering) = ([0.0; BANDS], [0.0; BANDS]);
        for band in 0..BANDS {
            let chart = BandFit { patches, band, ground: ground.reflectance()[band], thickest };
            let found = chart.fit()?;
            let [k, s] = BandFit::coefficients(&found.at);
            (absorption[band], scattering[band]) = (k, s);
            fit.chi_square[band] = found.normal.cost;
            if let Some(covariance) = found.normal.covariance() {
                let deviation = |i: usize| if covariance[(i, i)] > 0.0 { covariance[(i, i)].sqrt() } else { UNKNOWN };
                fit.absorption_deviation[band] = deviation(0).min(UNKNOWN);
                fit.scattering_deviation[band] = deviation(1).min(UNKNOWN);
            }
        }
        if !(0..BANDS).any(|band| fit.absorption_deviation[band].min(fit.scattering_deviation[band]) < 1.0) {
            return Err(Error::Undetermined {
                parameters: "absorption and scattering of the chart's paint".to_owned(),
            });
        }
        fit.paint = Self::new(&absorption, &scattering, thickest)?;
        Ok(fit)
    }
}

/// The greatest thickness.
fn check(patches: &[Patch]) -> Result<f64, Error> {
    let (mut thinnest, mut thickest) = (f64::INFINITY, 0.0_f64);
    for (index, patch) in patches.iter().enumerate() {
        check_positive("thickness of a patch", patch.thickness)?;
        check_positive("noise of a patch", patch.noise)?;
        if patch.reflectance.iter().any(|r| !r.is_finite()) {
            return Err(Error::NotFinite { what: "reflectance of patch", index });
        }
        for &value in &patch.reflectance {
            let allowed = "between 0 and 1, but for five deviations of its noise";
            check_range("reflectance of a patch", value, -5.0 * patch.noise, 1.0 + 5.0 * patch.noise, allowed)?;
        }
        (thinnest, thickest) = (thinnest.min(patch.thickness), thickest.max(patch.thickness));
    }
    if thinnest >= thickest {
        let found = usize::from(!patches.is_empty());
        return Err(Error::WrongLength { what: "different thicknesses of a chart", expected: 2, found });
    }
    Ok(thickest)
}

/// One band of a chart, in the logarithms of `K d` and `S d` of the thickest patch.
struct BandFit<'a> {
    patches: &'a [Patch],
    band: usize,
    ground: f64,
    thickest: f64,
}

impl BandFit<'_> {
    /// Beyond the bounds nothing changes that a chart could tell.
    fn coefficients(at: &SVector<f64, 2>) -> [f64; 2] {
        [0, 1].map(|i| at[i].exp().clamp(DEPTHS[0], DEPTHS[1]))
    }

    /// Sum of squares in single precision, which is enough to choose a start.
    fn cost(&self, [k, s]: [f64; 2]) -> f64 {
        let (k, s, ground) = (k as f32, s as f32, self.ground as f32);
        let square = |patch: &Patch| {
            let predicted = km::reflectance_f32(k, s, (patch.thickness / self.thickest) as f32, ground);
            ((patch.reflectance[self.band] - f64::from(predicted)) / patch.noise).powi(2)
        };
        self.patches.iter().map(square).sum()
    }

    fn fit(&self) -> Result<Minimum<2>, Error> {
        // The sum of squares has flat parts, where one coefficient vanishes beside the other, and a narrow bend between them: one start is
        // not enough.
        let place = |i: usize| 10.0_f64.powf(DECADES * (i as f64 / (GRID - 1) as f64 - 0.5));
        let best_of = |i: usize| {
            let costs = (0..GRID).map(|j| (self.cost([place(i), place(j)]), [place(i), place(j)]));
            costs.fold((f64::INFINITY, [1.0; 2]), |best, one| if one.0 < best.0 { one } else { best })
        };
        let mut starts: Vec<(f64, [f64; 2])> = (0..GRID).map(best_of).collect();
        starts.sort_by(|a, b| a.0.total_cmp(&b.0));
        let from = |(_, pair): &(f64, [f64; 2])| {
            minimise(SVector::from(pair.map(f64::ln)), STEPS, |at| Some(self.linearise(at)))
        };
        let found = starts.iter().take(STARTS).filter_map(from);
        let least = found.min_by(|a, b| a.normal.cost.total_cmp(&b.normal.cost));
        least.ok_or(Error::NoConvergence { what: "a chart" })
    }

    fn linearise(&self, at: &SVector<f64, 2>) -> Normal<2> {
        let [k, s] = Self::coefficients(at);
        let mut normal = Normal::zero();
        for patch in self.patches {
            let depth = patch.thickness / self.thickest;
            let residual = (patch.reflectance[self.band] - km::reflectance(k, s, depth, self.ground)) / patch.noise;
            let gradient = km::gradient(k, s, depth, self.ground);
            let by = SVector::from([k * gradient.absorption / patch.noise, s * gradient.scattering / patch.noise]);
            normal.cost += residual * residual;
            normal.slope += by * residual;
            normal.information += SMatrix::from_fn(|i, j| by[i] * by[j]);
        }
        normal
    }
}
