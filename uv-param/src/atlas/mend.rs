//! Layouts that are good but for a few places: what is flipped is untangled, what is stretched too much relaxed where it is, and what lies on
//! other faces given up.

use super::fit::{Bounds, Distortion, POWER, SHARE_BEYOND, stretches};
use super::simple_boundary::boundary_is_simple;
use crate::chart::overlapping_faces;
use crate::disk::Disk;
use crate::half_edges::{BORDER, grouped, half_edge};
use crate::parametrizer::StoppingCriterion;
use crate::symmetric_dirichlet::{Penalty, minimise_penalty};
use crate::triangle::{Frame, orientation};

/// Rings of faces around flipped ones in which vertices move to the middle of their neighbours, and sweeps of it.
const UNTANGLED_RINGS: [usize; 3] = [1, 2, 4];
const SWEEPS: usize = 40;
/// Rings of faces around stretched ones that are laid out anew, one after the other, and Newton iterations for them.
const MENDED_RINGS: [usize; 2] = [4, 10];
const MENDING_ITERATIONS: usize = 10;
/// Newton iterations of a whole chart, and their relative gain below which they stop.
const ITERATIONS: usize = 4;
const TOLERANCE: f64 = 1e-3;
/// They are given up unless each leaves at most this share of the faces beyond the bound.
const SLOW_GAIN: f64 = 0.8;
/// Rings of faces that are parted together with one that is stretched too much.
const PARTED_RINGS: usize = 2;
/// Times that faces which lie on others are taken away.
const OVERLAP_ROUNDS: usize = 4;
/// Share of a chart that may be parted from it.
const MAX_PARTED: f64 = 0.2;

/// A layout of which all faces but the parted ones keep the bounds and lie on no other.
pub(super) struct Parted {
    pub(super) uv: Vec<[f64; 2]>,
    pub(super) parted: Vec<bool>,
}

/// Makes good what is wrong in few places of a layout. Where two faces lie on each other, one for which `goes` holds is parted first.
/// `None` where too much would have to be parted.
pub(super) fn mend(disk: &Disk, mut uv: Vec<[f64; 2]>, goes: &[bool], bounds: Bounds) -> Option<Parted> {
    let frames = disk.frames();
    untangle(disk, &mut uv);
    let count = |parted: &[bool]| parted.iter().filter(|parted| **parted).count() as f64;
    let most = MAX_PARTED * disk.faces.len() as f64;
    let mut parted = flipped(disk, &uv);
    if count(&parted) > 0.0 {
        parted = with_neighbours(disk, &parted);
    }
    for rings in MENDED_RINGS {
        let limit = if is_beyond(disk, &frames, &uv, &parted, bounds) { bounds.stretch } else { bounds.worst };
        let mut near: Vec<bool> = stretches(disk, &frames, &uv).iter().map(|&stretch| stretch > limit).collect();
        for _ in 0..rings {
            near = with_neighbours(disk, &near);
        }
        near.iter_mut().zip(&parted).for_each(|(near, parted)| *near &= !parted);
        if count(&near) > most {
            break;
        }
        let is_enough = |distortion: &Distortion| distortion.worst <= limit;
        relax(disk, &near, &mut uv, bounds, MENDING_ITERATIONS, is_enough);
    }
    if is_beyond(disk, &frames, &uv, &parted, bounds) {
        let mut last = f64::INFINITY;
        let is_enough = |distortion: &Distortion| {
            let slow = distortion.beyond > SLOW_GAIN * std::mem::replace(&mut last, distortion.beyond);
            slow || distortion.within(bounds)
        };
        let all: Vec<bool> = parted.iter().map(|parted| !parted).collect();
        relax(disk, &all, &mut uv, bounds, ITERATIONS, is_enough);
    }
    let mut broken: Vec<bool> = stretches(disk, &frames, &uv).iter().map(|&stretch| stretch > bounds.worst).collect();
    for _ in 0..PARTED_RINGS {
        broken = with_neighbours(disk, &broken);
    }
    parted.iter_mut().zip(broken).for_each(|(parted, broken)| *parted |= broken);
    if is_beyond(disk, &frames, &uv, &parted, bounds) {
        return None;
    }
    for _ in 0..OVERLAP_ROUNDS {
        if count(&parted) > most {
            return None;
        }
        if count(&parted) == 0.0 && boundary_is_simple(disk, &uv) {
            break;
        }
        let kept: Vec<usize> = (0..parted.len()).filter(|&f| !parted[f]).collect();
        let faces: Vec<[u32; 3]> = kept.iter().map(|&f| disk.faces[f]).collect();
        let mut over = vec![false; parted.len()];
        for [f, g] in overlapping_faces(&uv, &faces) {
            let (f, g) = (kept[f as usize], kept[g as usize]);
            over[if goes[f] == goes[g] {
                f.max(g)
            } else if goes[f] {
                f
            } else {
                g
            }] = true;
        }
        if count(&over) == 0.0 {
            break;
        }
        for (parted, over) in parted.iter_mut().zip(with_neighbours(disk, &over)) {
            *parted |= over;
        }
    }
    Some(Parted { uv, parted })
}

/// Whether more faces than may be, of those that are not parted, are stretched beyond the bound.
fn is_beyond(disk: &Disk, frames: &[Frame], uv: &[[f64; 2]], parted: &[bool], bounds: Bounds) -> bool {
    let (mut count, mut beyond_area, mut area) = (0.0, 0.0, 0.0);
    for ((stretch, frame), _) in
        stretches(disk, frames, uv).iter().zip(frames).zip(parted).filter(|(_, parted)| !**parted)
    {
        area += frame.area;
        if *stretch > bounds.stretch {
            count += 1.0;
            beyond_area += frame.area;
        }
    }
    count > SHARE_BEYOND * frames.len() as f64 || beyond_area > SHARE_BEYOND * area
}

/// Newton's method on some faces, everything else staying where it is.
fn relax(
    disk: &Disk,
    faces: &[bool],
    uv: &mut [[f64; 2]],
    bounds: Bounds,
    iterations: usize,
    mut is_enough: impl FnMut(&Distortion) -> bool,
) {
    if !faces.contains(&true) {
        return;
    }
    let part = disk.part(faces);
    let mut fixed = vec![false; part.positions.len()];
    // The part's half-edges in the whole.
    let whole = |h: usize| 3 * part.face_source[h / 3] as usize + h % 3;
    for h in (0..part.twins.len()).filter(|&h| part.twins[h] == BORDER && disk.twins[whole(h)] != BORDER) {
        let (a, b) = half_edge(&part.faces, h);
        (fixed[a as usize], fixed[b as usize]) = (true, true);
    }
    let mut moving: Vec<[f64; 2]> = part.vertex_source.iter().map(|&v| uv[v as usize]).collect();
    let frames = part.frames();
    let stopping = StoppingCriterion { iterations, tolerance: TOLERANCE };
    let penalty = Penalty::beyond(bounds.stretch, POWER);
    let mut done = |_, uv: &[[f64; 2]]| is_enough(&Distortion::measure(&part, &frames, uv, bounds));
    if minimise_penalty(&part, &frames, &mut moving, penalty, &fixed, &stopping, &mut done).is_ok() {
        for (&v, at) in part.vertex_source.iter().zip(moving) {
            uv[v as usize] = at;
        }
    }
}

fn flipped(disk: &Disk, uv: &[[f64; 2]]) -> Vec<bool> {
    disk.faces.iter().map(|face| orientation(face.map(|v| uv[v as usize])) <= 0.0).collect()
}

/// Tutte's layout in place around flipped faces: vertices that are not on the boundary go to the middle of their neighbours.
fn untangle(disk: &Disk, uv: &mut [[f64; 2]]) {
    let mut outer = vec![false; uv.len()];
    for &v in disk.loops.iter().flatten() {
        outer[v as usize] = true;
    }
    for rings in UNTANGLED_RINGS {
        let mut near = flipped(disk, uv);
        if !near.contains(&true) {
            return;
        }
        for _ in 0..rings {
            near = with_neighbours(disk, &near);
        }
        let faces: Vec<[u32; 3]> =
            disk.faces.iter().zip(&near).filter(|(_, near)| **near).map(|(face, _)| *face).collect();
        let mut moving: Vec<u32> = faces.iter().flatten().copied().filter(|&v| !outer[v as usize]).collect();
        moving.sort_unstable();
        moving.dedup();
        // All faces of a vertex that moves are neighbours of faces near.
        let around = with_neighbours(disk, &with_neighbours(disk, &near));
        let around = disk.faces.iter().zip(&around).filter(|(_, near)| **near).map(|(face, _)| face);
        let pairs = around.flat_map(|face| (0..3).map(|k| (face[k], [face[(k + 1) % 3], face[(k + 2) % 3]])));
        let pairs: Vec<(u32, [u32; 2])> =
            pairs.filter_map(|(v, others)| moving.binary_search(&v).ok().map(|i| (i as u32, others))).collect();
        let (starts, others) = grouped(moving.len(), pairs.into_iter());
        for _ in 0..SWEEPS {
            for (i, &v) in moving.iter().enumerate() {
                let others = &others[starts[i] as usize..starts[i + 1] as usize];
                let sum = others.iter().flatten().fold([0.0; 2], |sum, &w| [0, 1].map(|k| sum[k] + uv[w as usize][k]));
                uv[v as usize] = sum.map(|x| x / (2 * others.len()) as f64);
            }
        }
    }
}

fn with_neighbours(disk: &Disk, faces: &[bool]) -> Vec<bool> {
    let beside = |f: usize| disk.twins[3 * f..3 * f + 3].iter().any(|&twin| twin != BORDER && faces[twin as usize / 3]);
    (0..faces.len()).map(|f| faces[f] || beside(f)).collect()
}
