//! The painting problem: what is wanted, what is there, and with what it is painted.

use super::defaults::{KERNEL, LIMITS, SATURATION};
use super::ghost_pixels::GhostPixels;
use super::limits::Limits;
use crate::error::Error;
use crate::image::Image;
use crate::model::{Saturation, SprayKernel};

/// A painting problem (thesis, Paper IV, section 3.1): find sprays so that the ink `f(c₀ + G v)` comes near the reference.
///
/// All images have one size. [`PaintProblem::new`] gives the reference on a bare wall, the thesis' nozzle and `tanh`; the
/// other parts are set by the `with_` methods or as fields.
///
/// ```
/// use paint_net::{Image, Limits, PaintProblem, SprayKernel};
///
/// let (wanted, kernel) = (Image::filled(32, 32, 0.4), SprayKernel::new(2.0, 4.0)?);
/// let limits = Limits { row_spacing: 3, ..Limits::default() };
/// let problem = PaintProblem::new(&wanted).with_kernel(&kernel).with_limits(&limits);
/// assert!(problem.canvas.is_none());
/// # Ok::<(), paint_net::Error>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct PaintProblem<'a> {
    /// Wanted ink in `[0, 1]`: 0 bare wall, 1 as dark as paint can be.
    pub reference: &'a Image,
    /// Paint depth already on the wall; `None` for a bare wall.
    pub canvas: Option<&'a Image>,
    /// How much each pixel matters, not negative; 0 outside the surface. `None`: all alike.
    pub weight: Option<&'a Image>,
    /// The same while a pixel has less ink than it should, in place of `weight`; `None`: as with more. What is missing in the middle of a thin line
    /// shows, what is too much there does not. Painters that fit volumes to the ink heed it; the network does not.
    pub missing_weight: Option<&'a Image>,
    /// Ink that a pixel shall not exceed, above what is wanted; what does counts [`CEILING_WEIGHT`](Self::CEILING_WEIGHT) times more, also where
    /// little else counts. `None`: none. Heeded as `missing_weight`.
    pub ceiling: Option<&'a Image>,
    /// Pixels over which the nozzle may spray, row by row; `None`: everywhere.
    pub paintable: Option<&'a [bool]>,
    /// Pixels that show others, beyond the seams of the surface; `None`: none. Their weight must be 0, and their reference and canvas
    /// are those of what they show. Paint on them counts where it lies. [`MatchingPursuit`](crate::painters::MatchingPursuit) and
    /// [`FreeSprays`](crate::painters::FreeSprays) choose places without them.
    pub ghosts: Option<&'a GhostPixels>,
    /// Footprint of a spray. Default: the thesis' nozzle, σ = 2 px cut at 4 px.
    pub kernel: &'a SprayKernel,
    /// How ink grows with depth. Default: `tanh`.
    pub saturation: &'a Saturation,
    /// Where sprays may lie and how large they may be. Default: [`Limits::default`].
    pub limits: &'a Limits,
}

impl<'a> PaintProblem<'a> {
    /// Weight of ink above the ceiling. Ours.
    pub const CEILING_WEIGHT: f64 = 100.0;

    /// The whole reference on a bare wall, with the defaults of the other fields.
    pub fn new(reference: &'a Image) -> Self {
        Self {
            reference,
            canvas: None,
            weight: None,
            missing_weight: None,
            ceiling: None,
            paintable: None,
            ghosts: None,
            kernel: &KERNEL,
            saturation: &SATURATION,
            limits: &LIMITS,
        }
    }

    /// The same over paint that is there already.
    #[must_use]
    pub fn with_canvas(self, canvas: &'a Image) -> Self {
        Self { canvas: Some(canvas), ..self }
    }

    /// The same with pixels that matter more than others.
    #[must_use]
    pub fn with_weight(self, weight: &'a Image) -> Self {
        Self { weight: Some(weight), ..self }
    }

    /// The same with pixels on which missing ink matters more, or less, than surplus.
    #[must_use]
    pub fn with_missing_weight(self, weight: &'a Image) -> Self {
        Self { missing_weight: Some(weight), ..self }
    }

    /// The same with ink that pixels shall not exceed.
    #[must_use]
    pub fn with_ceiling(self, ceiling: &'a Image) -> Self {
        Self { ceiling: Some(ceiling), ..self }
    }

    /// The same with pixels over which the nozzle must not spray.
    #[must_use]
    pub fn with_paintable(self, paintable: &'a [bool]) -> Self {
        Self { paintable: Some(paintable), ..self }
    }

    /// The same with pixels that show what lies beyond seams.
    #[must_use]
    pub fn with_ghosts(self, ghosts: &'a GhostPixels) -> Self {
        Self { ghosts: Some(ghosts), ..self }
    }

    /// The same with another nozzle.
    #[must_use]
    pub fn with_kernel(self, kernel: &'a SprayKernel) -> Self {
        Self { kernel, ..self }
    }

    /// The same with another saturation.
    #[must_use]
    pub fn with_saturation(self, saturation: &'a Saturation) -> Self {
        Self { saturation, ..self }
    }

    /// The same within other limits.
    #[must_use]
    pub fn with_limits(self, limits: &'a Limits) -> Self {
        Self { limits, ..self }
    }

    /// Refuses what does not fit together or lies out of range. Every painter calls it first.
    pub fn check(&self) -> Result<(), Error> {
        self.reference.check_range("reference", 0.0, 1.0, "ink in [0, 1]")?;
        let expected = self.reference.size();
        for (what, image, range) in [
            ("canvas", self.canvas, "a depth of 0 or more"),
            ("weight", self.weight, "a weight of 0 or more"),
            ("missing_weight", self.missing_weight, "a weight of 0 or more"),
            ("ceiling", self.ceiling, "ink of 0 or more"),
        ] {
            if let Some(image) = image {
                if image.size() != expected {
                    return Err(Error::Mismatch { what, found: image.size(), expected });
                }
                image.check_range(what, 0.0, f64::MAX, range)?;
            }
        }
        if let Some(mask) = self.paintable {
            if mask.len() != self.reference.data().len() {
                return Err(Error::Mismatch { what: "paintable", found: (mask.len(), 1), expected });
            }
            if !mask.contains(&true) {
                return Err(Error::EmptyProblem("no pixel is paintable"));
            }
        }
        if self.weight.is_some_and(|w| w.data().iter().all(|&v| v == 0.0)) {
            return Err(Error::EmptyProblem("every pixel has weight 0"));
        }
        if let Some(ghosts) = self.ghosts.filter(|ghosts| !ghosts.ghosts().is_empty()) {
            if ghosts.size() != expected {
                return Err(Error::Mismatch { what: "picture of the ghosts", found: ghosts.size(), expected });
            }
            if let Some(&(pixel, _)) = ghosts.ghosts().iter().find(|(pixel, _)| self.weight(*pixel) > 0.0) {
                return Err(Error::Ghost {
                    pixel,
                    why: "has a weight: what it shows counts already, give it weight 0",
                });
            }
        }
        self.limits.check()?;
        self.saturation.check()
    }

    /// Paint depth before painting: the canvas, or a bare wall. Ghosts are bare, since what they show lies elsewhere.
    pub fn initial_canvas(&self) -> Image {
        let mut canvas = self.canvas.cloned().unwrap_or_else(|| self.reference.map(|_| 0.0));
        if let Some(ghosts) = self.ghosts {
            ghosts.clear(canvas.data_mut());
        }
        canvas
    }

    /// Turns a canvas that the plane's sprays were added to, over `initial`, into that of the surface: what they put beyond a seam lies at the
    /// rim of the other side, and ghosts show what lies there.
    pub(crate) fn settle(&self, initial: &[f64], canvas: &mut [f64]) {
        if let Some(ghosts) = self.ghosts {
            let deposit: Vec<f64> = canvas.iter().zip(initial).map(|(after, before)| after - before).collect();
            for (pixel, depth) in ghosts.spill(&deposit) {
                canvas[pixel] += depth;
            }
            ghosts.gather(canvas);
        }
    }

    /// The transpose of [`Self::settle`] for a field that is 0 on ghosts: what lies beyond a seam counts for the rim there.
    pub(crate) fn settle_adjoint(&self, field: &mut [f64]) {
        if let Some(ghosts) = self.ghosts {
            ghosts.spill_adjoint(field);
        }
    }

    /// The weight of pixel `k`.
    pub(crate) fn weight(&self, k: usize) -> f64 {
        self.weight.map_or(1.0, |w| w.data()[k])
    }

    /// The weight of pixel `k` for this much more ink than wanted.
    pub(crate) fn weight_of(&self, k: usize, surplus: f64) -> f64 {
        match self.missing_weight {
            Some(weight) if surplus < 0.0 => weight.data()[k],
            _ => self.weight(k),
        }
    }

    /// How far ink stands above the ceiling of pixel `k`.
    pub(crate) fn above_ceiling(&self, k: usize, ink: f64) -> f64 {
        self.ceiling.filter(|_| self.weight(k) > 0.0).map_or(0.0, |ceiling| (ink - ceiling.data()[k]).max(0.0))
    }
}
