//! What sprays and casts the rays of shadows and pictures: the processor, or a GPU that leaves the same bytes.

use paint_sim::film::wet::WetFilm;
use paint_sim::{Film, Shot, Surface, TriangleSurface};
#[cfg(feature = "gpu")]
use paint_sim::{
    film::GpuSpray,
    surface::{GpuOptions, GpuRayCount, GpuSurface},
};

use super::error::MissionError;
use super::nozzle::spray_model;
use super::painting_task::PaintingTask;

/// What sprays the surface of a task.
pub enum SprayDevice<'a> {
    /// The processor.
    Processor(&'a TriangleSurface),
    /// A GPU that has the triangles.
    #[cfg(feature = "gpu")]
    Gpu(Box<GpuSurface<'a>>),
}

/// What of a device knows the texels of a film.
pub(super) enum Sprayer {
    Processor,
    #[cfg(feature = "gpu")]
    Gpu(Box<GpuSpray>),
}

impl<'a> SprayDevice<'a> {
    /// The processor.
    pub fn processor(task: &'a PaintingTask) -> Self {
        Self::Processor(task.met())
    }

    /// The best GPU; a program that stands in for one is slower than the processor, but shows that all of it works.
    ///
    /// # Errors
    /// There is none, or it cannot hold the triangles.
    #[cfg(feature = "gpu")]
    pub fn gpu(task: &'a PaintingTask) -> Result<Self, MissionError> {
        Ok(Self::Gpu(Box::new(GpuSurface::new(task.met(), &options())?)))
    }

    /// Everything there is to hit.
    pub fn surface(&self) -> &dyn Surface {
        match self {
            Self::Processor(surface) => *surface,
            #[cfg(feature = "gpu")]
            Self::Gpu(surface) => surface.as_ref(),
        }
    }

    /// What it has done with a sprayer, in words; nothing of the processor.
    pub(super) fn told(&self, sprayer: &Sprayer) -> Option<String> {
        match (self, sprayer) {
            #[cfg(feature = "gpu")]
            (Self::Gpu(surface), Sprayer::Gpu(spray)) => {
                let GpuRayCount { asked, left, .. } = surface.rays();
                let fault = spray.fault().or(surface.fault());
                let fault = fault.map(|why| format!(", until it failed: {why}")).unwrap_or_default();
                Some(format!("{}: {asked} rays, {left} of them left to the processor{fault}", surface.name()))
            }
            _ => None,
        }
    }

    /// What sprays onto a film.
    #[cfg(feature = "gpu")]
    pub(super) fn sprayer(&self, film: &Film) -> Result<Sprayer, MissionError> {
        match self {
            Self::Processor(_) => Ok(Sprayer::Processor),
            Self::Gpu(_) => Ok(Sprayer::Gpu(Box::new(film.gpu_spray(&options())?))),
        }
    }

    /// What sprays onto a film.
    #[cfg(not(feature = "gpu"))]
    #[expect(clippy::unused_self, clippy::unnecessary_wraps, reason = "a GPU has texels to hold")]
    pub(super) fn sprayer(&self, _film: &Film) -> Result<Sprayer, MissionError> {
        Ok(Sprayer::Processor)
    }

    /// Brings shots onto the film of a sprayer.
    pub(super) fn deposit(
        &self,
        sprayer: &Sprayer,
        film: &mut WetFilm,
        shots: &[Shot],
        task: &PaintingTask,
        told: &mut dyn FnMut(usize, usize),
    ) -> Result<(), paint_sim::Error> {
        let (spray, threads) = (spray_model(&task.settings), task.settings.threads);
        match sprayer {
            Sprayer::Processor => film.deposit(shots, &spray, self.surface(), threads, told)?,
            #[cfg(feature = "gpu")]
            Sprayer::Gpu(gpu) => film.deposit_on(gpu, shots, &spray, self.surface(), threads, told)?,
        };
        Ok(())
    }
}

#[cfg(feature = "gpu")]
fn options() -> GpuOptions {
    GpuOptions { software: true, ..GpuOptions::default() }
}
