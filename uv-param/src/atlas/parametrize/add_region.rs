//! A region becomes a chart, or several.

use crate::atlas::charts::Charts;
use crate::atlas::parametrize::fit::{Bounds, fit, projection};
use crate::atlas::segment::shape_approximation::halves;
use crate::parametrizer::Parametrizer;
use crate::parametrizer::tutte::tutte_layout;

/// A region as one chart, or, as long as it cannot be laid out, its halves. A single face always can.
pub(in crate::atlas) fn add_region(
    charts: &mut Charts,
    faces: Vec<u32>,
    bounds: Bounds,
    parametrizer: Option<&dyn Parametrizer>,
) {
    let mut stack = vec![faces];
    while let Some(faces) = stack.pop() {
        let laid_out = charts.disk(&faces).and_then(|disk| {
            let flat = fit(&disk, projection(&disk), bounds, parametrizer);
            flat.or_else(|| {
                let (_, start) = tutte_layout(&disk, &mut |_| ()).ok()?;
                fit(&disk, start, bounds, parametrizer)
            })
            .map(|uv| (disk, uv))
        });
        if let Some((disk, uv)) = laid_out {
            charts.add(faces, &disk, &uv);
        } else {
            let member: std::collections::HashSet<u32> = faces.iter().copied().collect();
            let surface = charts.surface;
            let joined = |h: usize| {
                !charts.wanted[h] && surface.twin(h).is_some_and(|twin| member.contains(&((twin / 3) as u32)))
            };
            stack.extend(halves(surface, &faces, joined));
        }
    }
}
