use crate::error::{Error, require};
use crate::footprints::Footprints;
use crate::image::Image;
use crate::kernel::SprayKernel;
use crate::saturation::Saturation;

/// What is wanted and what is there.
#[derive(Debug, Clone, Copy)]
pub struct Task<'a> {
    /// Wanted ink in `[0, 1]`: 0 bare wall, 1 as dark as paint can be.
    pub reference: &'a Image,
    /// Paint depth already on the wall, same size; `None` for a bare wall.
    pub canvas: Option<&'a Image>,
    /// How much each pixel matters, same size, not negative; 0 outside the surface. `None`: all alike.
    pub weight: Option<&'a Image>,
    /// Pixels over which the nozzle may spray, row by row; `None`: everywhere.
    pub paintable: Option<&'a [bool]>,
}

impl<'a> Task<'a> {
    /// The whole reference on a bare wall.
    pub fn on_bare_wall(reference: &'a Image) -> Self {
        Self { reference, canvas: None, weight: None, paintable: None }
    }

    /// Refuses what does not fit together or lies out of range.
    pub(crate) fn check(&self) -> Result<(), Error> {
        self.reference.check_range("reference", 0.0, 1.0, "ink in [0, 1]")?;
        let expected = self.reference.size();
        for (what, image, range) in
            [("canvas", self.canvas, "a depth of 0 or more"), ("weight", self.weight, "a weight of 0 or more")]
        {
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
                return Err(Error::EmptyTask("no pixel is paintable"));
            }
        }
        if self.weight.is_some_and(|w| w.data().iter().all(|&v| v == 0.0)) {
            return Err(Error::EmptyTask("every pixel has weight 0"));
        }
        Ok(())
    }

    /// The canvas before painting.
    pub(crate) fn bare(&self) -> Image {
        self.canvas.cloned().unwrap_or_else(|| self.reference.map(|_| 0.0))
    }

    /// The weight of pixel `k`.
    pub(crate) fn weight(&self, k: usize) -> f64 {
        self.weight.map_or(1.0, |w| w.data()[k])
    }
}

/// Where sprays may lie and how large they may be.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Limits {
    /// Distance between sprays along a row, 1 to 1000 pixels. Default 2 (σ of the thesis' nozzle).
    pub along: usize,
    /// Distance between rows, 1 to 1000 pixels. Default 2.
    pub row_spacing: usize,
    /// Largest depth of one spray. Default 3: beyond it ink no longer shows a difference.
    pub max_volume: f64,
    /// Sprays smaller than this are not worth opening the valve for; they are dropped and the others refitted. Default 0.
    pub min_volume: f64,
    /// Largest number of sprays, 0 to leave the wall as it is; `None` for no limit.
    pub max_sprays: Option<usize>,
}

impl Default for Limits {
    fn default() -> Self {
        Self { along: 2, row_spacing: 2, max_volume: 3.0, min_volume: 0.0, max_sprays: None }
    }
}

impl Limits {
    pub(crate) fn check(&self) -> Result<(), Error> {
        // Work is done in whole cells: one far larger than the picture is only empty work.
        for (name, spacing) in [("along", self.along), ("row_spacing", self.row_spacing)] {
            require(name, spacing as f64, (1..=1000).contains(&spacing), "it must lie in 1..=1000 pixels")?;
        }
        let max = self.max_volume;
        require("max_volume", max, max > 0.0 && max.is_finite(), "it must be positive and finite")?;
        let min = self.min_volume;
        require("min_volume", min, (0.0..=max).contains(&min), "it must lie in [0, max_volume]")
    }
}

/// One spray: the nozzle over a point for long enough to add a depth there.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Spray {
    /// Column, pixels.
    pub x: f64,
    /// Row, pixels.
    pub y: f64,
    /// Depth added at the centre, in the unit of the saturation curve.
    pub volume: f64,
    /// Standard deviation, pixels: the kernel's, unless a painter may open the cone.
    pub sigma: f64,
}

/// What a painter decided.
#[derive(Debug, Clone, PartialEq)]
pub struct Painting {
    /// The sprays, row by row.
    pub sprays: Vec<Spray>,
    /// Paint depth afterwards, the earlier canvas included.
    pub canvas: Image,
    /// Ink afterwards: `f(canvas)`.
    pub ink: Image,
}

/// Decides what to spray where.
pub trait Painter {
    /// Short name for tables and command lines.
    fn name(&self) -> &'static str;

    /// Decides the sprays for a task. `progress` is told the share done in `[0, 1]`. Deterministic.
    fn paint(
        &self,
        task: &Task,
        kernel: &SprayKernel,
        saturation: &Saturation,
        limits: &Limits,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Painting, Error>;
}

/// So that painters that wrap others can wrap one that is chosen while running.
impl<P: Painter + ?Sized> Painter for Box<P> {
    fn name(&self) -> &'static str {
        (**self).name()
    }

    fn paint(
        &self,
        task: &Task,
        kernel: &SprayKernel,
        saturation: &Saturation,
        limits: &Limits,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Painting, Error> {
        (**self).paint(task, kernel, saturation, limits, progress)
    }
}

impl<P: Painter + ?Sized> Painter for &P {
    fn name(&self) -> &'static str {
        (**self).name()
    }

    fn paint(
        &self,
        task: &Task,
        kernel: &SprayKernel,
        saturation: &Saturation,
        limits: &Limits,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Painting, Error> {
        (**self).paint(task, kernel, saturation, limits, progress)
    }
}

/// A checked task on its grid of cells: what all painters start from.
pub(crate) struct Board {
    pub(crate) footprints: Footprints,
    /// Largest volume per cell; 0 where the nozzle may not spray.
    pub(crate) ceiling: Vec<f64>,
    pub(crate) bare: Image,
    /// Standard deviation of every spray.
    sigma: f64,
}

impl Board {
    pub(crate) fn new(
        task: &Task,
        kernel: &SprayKernel,
        saturation: &Saturation,
        limits: &Limits,
    ) -> Result<Self, Error> {
        task.check()?;
        limits.check()?;
        saturation.check()?;
        let footprints = Footprints::new(kernel, task.reference.size(), limits.along, limits.row_spacing);
        let width = task.reference.width();
        // A spray that reaches no pixel of positive weight would only waste paint, and nothing would hold it down.
        let mut seen = vec![1.0; footprints.cells()];
        if let Some(weight) = task.weight {
            footprints.gather(weight.data(), &mut seen);
        }
        let allowed = |x: usize, y: usize| task.paintable.is_none_or(|mask| mask[y * width + x]);
        let ceiling = footprints
            .rows
            .iter()
            .flat_map(|&y| footprints.columns.iter().map(move |&x| (x, y)))
            .zip(seen)
            .map(|((x, y), seen)| if seen > 0.0 && allowed(x, y) { limits.max_volume } else { 0.0 })
            .collect();
        Ok(Self { footprints, ceiling, bare: task.bare(), sigma: kernel.sigma() })
    }

    /// The canvas after spraying `volumes`.
    pub(crate) fn canvas(&self, volumes: &[f64]) -> Image {
        let mut canvas = self.bare.clone();
        self.footprints.add(volumes, canvas.data_mut());
        canvas
    }

    pub(crate) fn painting(&self, volumes: &[f64], saturation: &Saturation) -> Painting {
        let canvas = self.canvas(volumes);
        let ink = canvas.map(|c| saturation.forward(c));
        let sprays = (0..volumes.len()).filter(|&k| volumes[k] > 0.0).map(|k| self.spray(k, volumes[k])).collect();
        Painting { sprays, canvas, ink }
    }

    /// The volume of every cell; sprays that lie on none are left out.
    pub(crate) fn volumes(&self, sprays: &[Spray]) -> Vec<f64> {
        let (columns, rows) = (&self.footprints.columns, &self.footprints.rows);
        let mut volumes = vec![0.0; self.footprints.cells()];
        for s in sprays {
            let (i, j) = (columns.binary_search(&(s.x as usize)), rows.binary_search(&(s.y as usize)));
            if let (Ok(i), Ok(j)) = (i, j) {
                volumes[j * columns.len() + i] += s.volume;
            }
        }
        volumes
    }

    /// The spray of a cell.
    pub(crate) fn spray(&self, cell: usize, volume: f64) -> Spray {
        let (columns, rows) = (&self.footprints.columns, &self.footprints.rows);
        let (x, y) = (columns[cell % columns.len()] as f64, rows[cell / columns.len()] as f64);
        Spray { x, y, volume, sigma: self.sigma }
    }
}
