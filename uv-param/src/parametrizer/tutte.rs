//! Tutte's barycentric layout on a circle (Tutte 1963): injective for every disk, and the start of the minimisers.

use crate::disk::Disk;
use crate::error::Error;
use crate::laplacian::Laplacian;
use crate::parametrizer::{Layout, Parametrizer, Progress, Stage};
use crate::triangle;

/// The barycentric layout with equal weights, scaled so that its area is that of the surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Tutte;

impl Parametrizer for Tutte {
    fn parametrize(&self, disk: &Disk, progress: &mut dyn FnMut(Progress)) -> Result<Layout, Error> {
        let (_, uv) = tutte_layout(disk, progress)?;
        Ok(Layout { uv, iterations: 0 })
    }
}

/// The layout, and the Laplacian that made it for the next use.
pub(crate) fn tutte_layout(
    disk: &Disk,
    progress: &mut dyn FnMut(Progress),
) -> Result<(Laplacian, Vec<[f64; 2]>), Error> {
    let unit = disk.area().sqrt();
    let mut laplacian = Laplacian::new(disk)?;
    let uv = metric(laplacian.tutte(disk)?, disk, unit);
    progress(Progress { stage: Stage::Start, iteration: 1, energy: 0.0 });
    Ok((laplacian, uv))
}

/// The layout in the scale in which its area is that of the surface.
fn metric(mut uv: Vec<[f64; 2]>, disk: &Disk, unit: f64) -> Vec<[f64; 2]> {
    let plane: f64 = disk.faces.iter().map(|face| 0.5 * triangle::orientation(face.map(|v| uv[v as usize]))).sum();
    let scale = unit / plane.sqrt();
    for at in uv.iter_mut().flatten() {
        *at *= scale;
    }
    uv
}
