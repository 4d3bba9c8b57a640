use crate::error::{Error, require};
use crate::image::Image;
use crate::kernel::SprayKernel;
use crate::painter::{Limits, Painter, Painting, Spray, Task};
use crate::saturation::Saturation;

/// Paints in coats and looks at the wall after each: what a valve or a gust did wrong in one coat is made good by the next.
/// Ours.
///
/// Paint cannot be taken away, so every coat but the last sprays a share of what is still missing; the flow of the nozzle
/// relative to what it is thought to be, its gain, is estimated on the way,
///
/// ```text
/// gain = Σ w Δc_seen / Σ w Δc_planned,   w = f'(c)²
/// ```
///
/// (the ratio of sums, as sprays that miss their place blur the paint but lose none),
/// and the next coats are sprayed accordingly. With a painter that may change its mind within a plan this is also the way to
/// spray additively only: whatever has been sprayed stays.
#[derive(Debug, Clone, PartialEq)]
pub struct Coats<P> {
    /// Who plans every coat.
    pub painter: P,
    /// Share of the missing paint that each coat sprays, in `(0, 1]`.
    pub shares: Vec<f64>,
}

/// What came of painting in coats.
#[derive(Debug, Clone, PartialEq)]
pub struct Coated {
    /// The sprays of each coat, as the nozzle was told.
    pub coats: Vec<Vec<Spray>>,
    /// Paint depth after the last coat, as it was seen.
    pub canvas: Image,
    /// Paint that came out over paint that was asked for.
    pub gain: f64,
}

impl<P: Painter> Coats<P> {
    /// Three coats: 60 % of the paint, 75 % of what is then missing, and the rest (ours).
    pub fn new(painter: P) -> Self {
        Self { painter, shares: vec![0.6, 0.75, 1.0] }
    }

    /// Paints with somebody watching: `spray` sprays what it is told and returns the ink of the wall as it then is, of the
    /// size of the reference. Ink near the law's end says little about depth and has little weight.
    pub fn paint_watched(
        &self,
        task: &Task,
        kernel: &SprayKernel,
        saturation: &Saturation,
        limits: &Limits,
        spray: &mut dyn FnMut(&[Spray]) -> Result<Image, Error>,
    ) -> Result<Coated, Error> {
        for &share in &self.shares {
            require("shares", share, share > 0.0 && share <= 1.0, "every share must lie in (0, 1]")?;
        }
        let mut canvas = task.canvas.cloned().unwrap_or_else(|| task.reference.map(|_| 0.0));
        let (mut gain, mut seen, mut asked) = (1.0, 0.0, 0.0);
        let mut coats = Vec::with_capacity(self.shares.len());
        for &share in &self.shares {
            let now = Task { canvas: Some(&canvas), ..*task };
            let plan = self.painter.paint(&now, kernel, saturation, limits, &mut |_| ())?;
            let sprays: Vec<Spray> = plan
                .sprays
                .iter()
                .map(|s| Spray { volume: (share * s.volume / gain).min(limits.max_volume), ..*s })
                .filter(|s| s.volume >= limits.min_volume)
                .collect();
            let ink = spray(&sprays)?;
            let after = depth_of(&ink, task, saturation)?;
            for (k, (&c, &before)) in after.data().iter().zip(canvas.data()).enumerate() {
                // What this coat would have added, had the nozzle given just what it was asked for.
                let planned = share * (plan.canvas.data()[k] - before) / gain;
                // Weighed by where the paint was to be: by where it is, too much of it would count for less than too little.
                let slope = saturation.derivative(before + gain * planned);
                let weight = task.weight.map_or(1.0, |w| w.data()[k]) * slope * slope;
                seen += weight * (c - before);
                asked += weight * planned;
            }
            if asked > 0.0 && seen > 0.0 {
                // A nozzle further off than this is broken, not badly calibrated.
                gain = (seen / asked).clamp(0.2, 5.0);
            }
            canvas = after;
            coats.push(sprays);
        }
        Ok(Coated { coats, canvas, gain })
    }
}

/// Depth that shows as this ink.
fn depth_of(ink: &Image, task: &Task, saturation: &Saturation) -> Result<Image, Error> {
    let (found, expected) = (ink.size(), task.reference.size());
    if found != expected {
        return Err(Error::Mismatch { what: "ink seen after a coat", found, expected });
    }
    ink.check_range("ink seen after a coat", -1.0, 2.0, "about [0, 1]")?;
    Ok(ink.map(|a| saturation.inverse(a)))
}

impl<P: Painter> Painter for Coats<P> {
    fn name(&self) -> &'static str {
        "coats"
    }

    /// The plan of all coats for a nozzle that does what it is told: the sprays coat by coat, nothing ever taken back.
    fn paint(
        &self,
        task: &Task,
        kernel: &SprayKernel,
        saturation: &Saturation,
        limits: &Limits,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Painting, Error> {
        let mut painting: Option<Painting> = None;
        for (k, &share) in self.shares.iter().enumerate() {
            require("shares", share, share > 0.0 && share <= 1.0, "every share must lie in (0, 1]")?;
            progress(k as f64 / self.shares.len() as f64);
            let canvas = painting.as_ref().map(|p| &p.canvas).or(task.canvas);
            let plan = self.painter.paint(&Task { canvas, ..*task }, kernel, saturation, limits, &mut |_| ())?;
            let before = |k: usize| canvas.map_or(0.0, |c| c.data()[k]);
            let mut after = plan.canvas;
            for (k, c) in after.data_mut().iter_mut().enumerate() {
                *c = before(k) + share * (*c - before(k));
            }
            let mut sprays = painting.take().map_or_else(Vec::new, |p| p.sprays);
            sprays.extend(plan.sprays.iter().map(|s| Spray { volume: share * s.volume, ..*s }));
            let ink = after.map(|c| saturation.forward(c));
            painting = Some(Painting { sprays, canvas: after, ink });
        }
        progress(1.0);
        painting.ok_or(Error::EmptyTask("there are no coats"))
    }
}
