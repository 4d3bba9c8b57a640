//! The droplets of path simulation cast on a GPU; the processor counts them and decides about the valve, as without one.

use super::super::directions::Droplets;
use super::super::step::{StepCast, StepHits};
use super::super::texel_surface::TexelSurface;
use super::casts::{Casts, settings, slopes, source};
use crate::error::Error;
use crate::gpu::{GpuOptions, Input, Program};

/// A GPU that knows the sets of droplets of a [`PathSimulation`](crate::droplets::PathSimulation).
///
/// At most one droplet in a thousand lands on another texel than on the processor, because a device may contract products and sums. From
/// the hits on everything is counted in whole femtolitres, so that equal hits give equal paths.
pub struct GpuHits {
    program: Program,
    sets: Vec<Droplets>,
    slopes: Vec<u8>,
}

impl GpuHits {
    /// Opens an adapter.
    ///
    /// # Errors
    /// No sets, or sets of unequal size; [`Error::Gpu`]: there is no adapter, or it refuses.
    pub fn new(sets: &[Droplets], options: &GpuOptions) -> Result<Self, Error> {
        let Some(first) = sets.first() else {
            return Err(Error::Empty { what: "sets of droplets" });
        };
        if let Some(other) = sets.iter().find(|set| set.len() != first.len()) {
            let (value, allowed) = (other.len() as f64, "the same for all sets");
            return Err(Error::OutOfRange { what: "size of a set of droplets", value, allowed });
        }
        let program = Program::new(options, &source(include_str!("hits.wgsl")), "hits")?;
        Ok(Self { program, sets: sets.to_vec(), slopes: slopes(sets) })
    }

    /// Name and driver of the adapter.
    pub fn name(&self) -> &str {
        self.program.adapter()
    }

    /// Hits of each step, in order.
    ///
    /// # Errors
    /// A step with a set that there is not; [`Error::Gpu`]: the device failed.
    pub fn cast(&self, surface: &TexelSurface, steps: &[StepCast]) -> Result<Vec<StepHits>, Error> {
        let droplets = self.sets[0].len();
        if let Some(step) = steps.iter().find(|step| step.set >= self.sets.len()) {
            let (value, allowed) = (step.set as f64, "below the number of sets");
            return Err(Error::OutOfRange { what: "set of droplets of a step", value, allowed });
        }
        let uniform = settings(surface, &self.sets[0], false);
        let mut hits = Vec::with_capacity(steps.len());
        for batch in steps.chunks(self.program.most_groups(droplets)) {
            let mut casts = Casts::default();
            for step in batch {
                casts.push(surface, &step.nozzle, &self.sets[step.set], 0, (step.set * droplets) as u32);
            }
            let [candidates, places] = casts.buffers();
            let inputs = [&self.slopes, &candidates, &places].map(|bytes| Input::Sent(bytes));
            let texels = self.program.run(&uniform, &inputs, batch.len(), batch.len() * droplets)?;
            hits.extend(texels.chunks(droplets).map(|texels| {
                let landed = texels.iter().copied().filter(|texel| *texel != u32::MAX);
                StepHits::of_texels(landed.collect(), droplets)
            }));
        }
        Ok(hits)
    }
}
