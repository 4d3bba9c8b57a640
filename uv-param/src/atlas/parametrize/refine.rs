//! Charts that were found on a coarser surface, laid out on the fine one. Faces at which a layout breaks the bounds are parted from it.

use std::collections::HashSet;

use crate::atlas::charts::Charts;
use crate::atlas::parametrize::fit::{Bounds, Distortion, SHARE_BEYOND};
use crate::atlas::parametrize::simple_boundary::boundary_is_simple;
use crate::atlas::parametrize::untangle::{PartialLayout, untangle};
use crate::atlas::segment::shape_approximation::halves;
use crate::disk::Disk;
use crate::laplacian::Laplacian;
use crate::parametrizer::arap::{fit_jacobians, iterate_bounded};
use crate::triangle::flips;

/// Times that a chart is halved before it is charted anew.
const MAX_ROUNDS: usize = 3;

/// Local/global iterations that bring faces to this share of the bound, at most, and the share of the faces that may be beyond it in the end, over what may:
/// the repair afterwards takes some of it.
const BOUNDED_ITERATIONS: usize = 20;
const BOUNDED_STRETCH: f64 = 0.7;
const ENOUGH: f64 = 0.5;
/// Share of the faces of a large chart beyond the bound above which the iterations would not do.
const HOPELESS: f64 = 0.03;

/// Faces of a small chart at most, as a share of all.
const SMALL: f64 = 0.01;

/// Whether a chart of so many faces is small.
pub(in crate::atlas) fn is_small(charts: &Charts, faces: usize) -> bool {
    faces as f64 <= SMALL * charts.surface.faces().len() as f64
}

/// Lays out the faces of a chart so that every one comes near the shape that `charts.corner_uv` has for it on its own. Adds charts for what
/// can be laid out; returns the rest as connected lists of faces. `heard` is called
/// after every layout.
pub(in crate::atlas) fn refine(
    charts: &mut Charts,
    faces: &[u32],
    bounds: Bounds,
    heard: &mut dyn FnMut(),
) -> Vec<Vec<u32>> {
    let mut left = Vec::new();
    let together = vec![false; faces.len()];
    let mut stack: Vec<_> = charts.pieces(faces, &together).into_iter().map(|(piece, _)| (piece, 0)).collect();
    while let Some((faces, round)) = stack.pop() {
        let laid_out = charts.disk(&faces).and_then(|disk| {
            let targets: Vec<[[f64; 2]; 3]> =
                faces.iter().map(|&f| [0, 1, 2].map(|k| charts.corner_uv[3 * f as usize + k])).collect();
            let layout = lay_out(&disk, &targets, is_small(charts, faces.len()), bounds)?;
            Some((disk, layout))
        });
        heard();
        match laid_out {
            Some((disk, layout)) => left.extend(keep(charts, faces, &disk, &layout, bounds)),
            None if round < MAX_ROUNDS && !is_small(charts, faces.len()) => {
                let member: HashSet<u32> = faces.iter().copied().collect();
                let joined = |h: usize| {
                    let twin = charts.surface.twin(h);
                    !charts.wanted[h]
                        && !charts.cut[h]
                        && twin.is_some_and(|twin| member.contains(&((twin / 3) as u32)))
                };
                stack.extend(halves(charts.surface, &faces, joined).map(|half| (half, round + 1)));
            }
            None => left.push(faces),
        }
    }
    left
}

/// Adds charts for those pieces of a layout that were not parted and keep the bounds where they lie; returns the others.
pub(in crate::atlas) fn keep(
    charts: &mut Charts,
    faces: Vec<u32>,
    disk: &Disk,
    layout: &PartialLayout,
    bounds: Bounds,
) -> Vec<Vec<u32>> {
    if !layout.parted.contains(&true) && keeps(disk, &layout.uv, bounds) {
        charts.add(faces, disk, &layout.uv);
        return Vec::new();
    }
    charts.place(&faces, disk, &layout.uv);
    let mut left = Vec::new();
    for (piece, is_parted) in charts.pieces(&faces, &layout.parted) {
        let disk = charts.disk(&piece).filter(|_| !is_parted);
        match disk.map(|disk| (charts.uv(&piece, &disk), disk)) {
            Some((uv, disk)) if keeps(&disk, &uv, bounds) => {
                charts.add(piece, &disk, &uv);
            }
            _ => left.push(piece),
        }
    }
    left
}

/// Whether a layout keeps the bounds, without flips or overlaps.
pub(in crate::atlas) fn keeps(disk: &Disk, uv: &[[f64; 2]], bounds: Bounds) -> bool {
    Distortion::measure(disk, &disk.frames(), uv, bounds).within(bounds)
        && flips(uv, &disk.faces) == 0
        && boundary_is_simple(disk, uv)
}

/// A layout from the shapes that its faces should have. A large chart that begins with too many faces beyond the bound is given up.
fn lay_out(disk: &Disk, targets: &[[[f64; 2]; 3]], is_small: bool, bounds: Bounds) -> Option<PartialLayout> {
    let frames = disk.frames();
    let mut laplacian = Laplacian::new(disk).ok()?;
    laplacian.factorize_cotangent(disk, &frames, disk.loops[0][0]).ok()?;
    let jacobians: Vec<_> = frames.iter().zip(targets).map(|(frame, &uv)| frame.jacobian(uv)).collect();
    let mut uv = fit_jacobians(disk, &frames, &jacobians, &mut laplacian);
    let start = Distortion::measure(disk, &frames, &uv, bounds).beyond;
    if start > HOPELESS && !is_small {
        return None;
    }
    let mut enough = |stretches: &[f64]| Distortion::of(&frames, stretches, bounds).beyond <= ENOUGH * SHARE_BEYOND;
    let stretch = 1.0 + BOUNDED_STRETCH * (bounds.stretch - 1.0);
    iterate_bounded(disk, &frames, &mut laplacian, &mut uv, stretch, BOUNDED_ITERATIONS, &mut enough);
    untangle(disk, uv, &vec![false; frames.len()], bounds)
}
