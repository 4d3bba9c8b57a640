//! A picture with several of its pixels as one.

use super::colour_fit::ColourFit;
use super::footprint_set::FootprintSet;
use super::mixing_model::MixingModel;
use crate::error::Error;

/// The pixels of a fit in groups: wanted colours by weight, weights as sums, depths as means, the wall as it is on the first pixel. What is finer
/// than a spot no spray can follow, and the means of a group cost the same however its pixels differ.
pub(super) struct CoarsePicture {
    wanted: Vec<[f64; 3]>,
    weight: Vec<f64>,
    footprints: Vec<FootprintSet>,
    /// First pixel of each group.
    first: Vec<usize>,
}

/// What films look like on the first pixel of each group.
pub(super) struct CoarseModel<'a> {
    model: &'a dyn MixingModel,
    first: &'a [usize],
}

impl MixingModel for CoarseModel<'_> {
    fn paints(&self) -> usize {
        self.model.paints()
    }

    fn lab(&self, pixel: usize, depths: &[f64], slopes: &mut [[f64; 3]]) -> [f64; 3] {
        self.model.lab(self.first[pixel], depths, slopes)
    }
}

impl CoarsePicture {
    /// # Errors
    /// Not a group for each pixel of the fit; groups without pixels; footprints beside the pixels.
    pub(super) fn new(fit: &ColourFit, group: &[u32]) -> Result<Self, Error> {
        let pixels = fit.wanted.len();
        let under = fit.footprints.iter().map(|of_paint| of_paint.pixels()).max().unwrap_or(0);
        let sizes = [("coarse pixels", group.len()), ("weight", fit.weight.len())];
        if let Some((what, found)) = sizes.into_iter().find(|(_, found)| *found != pixels) {
            return Err(Error::Mismatch { what, found: (found, 1), expected: (pixels, 1) });
        }
        if under > pixels {
            return Err(Error::Mismatch { what: "pixels under footprints", found: (under, 1), expected: (pixels, 1) });
        }
        let groups = group.iter().max().map_or(0, |last| *last as usize + 1);
        let range = "a pixel in each of the coarse pixels up to the last";
        if groups > pixels {
            return Err(Error::Pixel { what: "coarse pixel", x: groups - 1, y: 0, value: 0.0, range });
        }
        let mut first = vec![usize::MAX; groups];
        let (mut wanted, mut weight) = (vec![[0.0; 3]; groups], vec![0.0; groups]);
        for (k, &g) in group.iter().enumerate().rev() {
            let g = g as usize;
            first[g] = k;
            weight[g] += fit.weight[k];
            wanted[g].iter_mut().zip(fit.wanted[k]).for_each(|(sum, value)| *sum += fit.weight[k] * value);
        }
        if let Some(empty) = first.iter().position(|k| *k == usize::MAX) {
            return Err(Error::Pixel { what: "coarse pixel", x: empty, y: 0, value: 0.0, range });
        }
        for ((wanted, weight), &k) in wanted.iter_mut().zip(&weight).zip(&first) {
            *wanted = if *weight > 0.0 { wanted.map(|sum| sum / weight) } else { fit.wanted[k] };
        }
        let footprints: Result<Vec<_>, _> = fit.footprints.iter().map(|set| set.coarse(group, groups)).collect();
        Ok(Self { wanted, weight, footprints: footprints?, first })
    }

    pub(super) fn model<'a>(&'a self, model: &'a dyn MixingModel) -> CoarseModel<'a> {
        CoarseModel { model, first: &self.first }
    }

    pub(super) fn footprints(&self) -> Vec<&FootprintSet> {
        self.footprints.iter().collect()
    }

    /// The fit on the groups.
    pub(super) fn fit<'a>(
        &'a self,
        fit: &ColourFit<'a>,
        model: &'a CoarseModel,
        footprints: &'a [&FootprintSet],
    ) -> ColourFit<'a> {
        ColourFit { wanted: &self.wanted, weight: &self.weight, model, footprints, ..*fit }
    }
}
