use crate::error::{Error, require};
use crate::image::Image;
use crate::kernel::SprayKernel;
use crate::painter::{Limits, Painter, Painting, Spray, Task};
use crate::saturation::Saturation;

/// How the thresholds after the base are spaced. The print, "intervals of multiples of 50", allows both.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Steps {
    /// Base, base + step, base + 2 step, …
    #[default]
    FromBase,
    /// Base, then the multiples of the step above it.
    Absolute,
}

/// How the layers share out the paint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Sharing {
    /// One plan for the whole picture, cut at the thresholds' depths: the layers add up to the joint optimum (ours).
    #[default]
    Joint,
    /// Each layer is planned by itself, to what the picture clipped at its threshold still lacks on the canvas so far
    /// (Paper IV, section 3.2).
    Sequential,
}

/// Layering by intensity: a base coat first, then darker and darker detail (thesis, Paper IV, section 3.2).
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Layered<P> {
    /// The painter of each layer.
    pub inner: P,
    /// The base reaches up to this percentile of the reference's ink. Default 20 (Paper IV, section 3.3).
    pub base_percentile: f64,
    /// Ink between thresholds. Default 50/255 (Paper IV, section 3.3).
    pub step: f64,
    /// Reading of the spacing. Default from the base.
    pub steps: Steps,
    /// Who gets which paint. Default joint.
    pub sharing: Sharing,
}

impl<P: Painter> Layered<P> {
    /// Layers over a painter with the published thresholds.
    pub fn new(inner: P) -> Self {
        Self { inner, base_percentile: 20.0, step: 50.0 / 255.0, steps: Steps::default(), sharing: Sharing::default() }
    }

    /// Upper ink of each layer, rising; the last is 1. Pixels of weight 0 do not count.
    pub fn thresholds(&self, task: &Task) -> Result<Vec<f64>, Error> {
        task.check()?;
        let percentile = self.base_percentile;
        require("base_percentile", percentile, (0.0..=100.0).contains(&percentile), "it must lie in [0, 100]")?;
        require("step", self.step, self.step >= 1e-3 && self.step <= 1.0, "it must lie in [0.001, 1]")?;
        let mut inks: Vec<f64> = (0..task.reference.data().len())
            .filter(|&k| task.weight(k) > 0.0)
            .map(|k| task.reference.data()[k])
            .collect();
        inks.sort_by(f64::total_cmp);
        let darkest = inks[inks.len() - 1];
        // Linear interpolation between order statistics.
        let rank = self.base_percentile / 100.0 * (inks.len() - 1) as f64;
        let (low, share) = (rank.floor() as usize, rank.fract());
        let base = inks[low] + share * (inks[(low + 1).min(inks.len() - 1)] - inks[low]);

        let mut thresholds = if base > 0.0 { vec![base] } else { Vec::new() };
        let mut next = match self.steps {
            Steps::FromBase => base + self.step,
            Steps::Absolute => ((base / self.step).floor() + 1.0) * self.step,
        };
        while next < darkest {
            thresholds.push(next);
            next += self.step;
        }
        thresholds.push(1.0);
        Ok(thresholds)
    }

    /// Paints the layers, the base first. Each painting's canvas includes the layers below it.
    pub fn paint_layers(
        &self,
        task: &Task,
        kernel: &SprayKernel,
        saturation: &Saturation,
        limits: &Limits,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Vec<Painting>, Error> {
        let thresholds = self.thresholds(task)?;
        match self.sharing {
            Sharing::Joint => {
                let whole = self.inner.paint(task, kernel, saturation, limits, progress)?;
                Ok(share_out(&whole, &thresholds, &task.bare(), kernel, saturation))
            }
            Sharing::Sequential => {
                let mut layers: Vec<Painting> = Vec::with_capacity(thresholds.len());
                let count = thresholds.len() as f64;
                for (k, &top) in thresholds.iter().enumerate() {
                    let slice = task.reference.map(|ink| ink.min(top));
                    let canvas = layers.last().map(|l| &l.canvas).or(task.canvas);
                    let layer = Task { reference: &slice, canvas, ..*task };
                    let painting = self
                        .inner
                        .paint(&layer, kernel, saturation, limits, &mut |s| progress((k as f64 + s) / count))?;
                    layers.push(painting);
                }
                Ok(layers)
            }
        }
    }
}

impl<P: Painter> Painter for Layered<P> {
    fn name(&self) -> &'static str {
        "layered"
    }

    fn paint(
        &self,
        task: &Task,
        kernel: &SprayKernel,
        saturation: &Saturation,
        limits: &Limits,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Painting, Error> {
        let layers = self.paint_layers(task, kernel, saturation, limits, progress)?;
        let sprays = layers.iter().flat_map(|l| l.sprays.iter().copied()).collect();
        let canvas = layers.last().map_or_else(|| task.bare(), |l| l.canvas.clone());
        let ink = canvas.map(|c| saturation.forward(c));
        Ok(Painting { sprays, canvas, ink })
    }
}

/// Cuts every spray at the thresholds: a spray over final depth `c` gives layer `k` the share of `c` that lies between the
/// depths of its thresholds. The shares of a spray add up to it.
fn share_out(
    whole: &Painting,
    thresholds: &[f64],
    bare: &Image,
    kernel: &SprayKernel,
    saturation: &Saturation,
) -> Vec<Painting> {
    let mut canvas = bare.clone();
    let mut floor = 0.0;
    let mut layers = Vec::with_capacity(thresholds.len());
    for (k, &top) in thresholds.iter().enumerate() {
        let last = k + 1 == thresholds.len();
        let ceiling = if last { f64::INFINITY } else { saturation.inverse(top) };
        let mut sprays = Vec::new();
        for spray in &whole.sprays {
            let depth = depth_at(&whole.canvas, spray);
            let share = (depth.min(ceiling) - depth.min(floor)) / depth;
            if share > 0.0 {
                let spray = Spray { volume: spray.volume * share, ..*spray };
                kernel.stamp(&spray, &mut canvas);
                sprays.push(spray);
            }
        }
        layers.push(Painting { sprays, ink: canvas.map(|c| saturation.forward(c)), canvas: canvas.clone() });
        floor = ceiling;
    }
    layers
}

/// Depth at the pixel nearest to a spray.
fn depth_at(canvas: &Image, spray: &Spray) -> f64 {
    let nearest = |at: f64, n: usize| (at.round().max(0.0) as usize).min(n - 1);
    canvas.at(nearest(spray.x, canvas.width()), nearest(spray.y, canvas.height()))
}
