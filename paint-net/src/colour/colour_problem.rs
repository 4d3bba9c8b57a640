//! The painting problem in several paints.

use super::colour_image::ColourImage;
use super::palette::Palette;
use crate::image::Image;
use crate::model::SprayKernel;
use crate::problem::Limits;
use crate::problem::defaults::{KERNEL, LIMITS};

/// What is wanted, in colour, on a bare wall, and with what it is painted; as [`crate::PaintProblem`].
#[derive(Debug, Clone, Copy)]
pub struct ColourProblem<'a> {
    /// Wanted colours.
    pub wanted: &'a ColourImage,
    /// The paints and the substrate.
    pub palette: &'a Palette,
    /// How much each pixel matters, same size, not negative; `None`: all alike.
    pub weight: Option<&'a Image>,
    /// Pixels over which the nozzle may spray, row by row; `None`: everywhere.
    pub paintable: Option<&'a [bool]>,
    /// Footprint of a spray. Default: the thesis' nozzle.
    pub kernel: &'a SprayKernel,
    /// Limits of each paint. Default: [`Limits::default`].
    pub limits: &'a Limits,
}

impl<'a> ColourProblem<'a> {
    /// The whole image, with the defaults of the other fields.
    pub fn new(wanted: &'a ColourImage, palette: &'a Palette) -> Self {
        Self { wanted, palette, weight: None, paintable: None, kernel: &KERNEL, limits: &LIMITS }
    }

    /// The same with another nozzle.
    #[must_use]
    pub fn with_kernel(self, kernel: &'a SprayKernel) -> Self {
        Self { kernel, ..self }
    }

    /// The same within other limits.
    #[must_use]
    pub fn with_limits(self, limits: &'a Limits) -> Self {
        Self { limits, ..self }
    }
}
