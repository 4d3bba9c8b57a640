//! Layouts that are good but for a few places: what is flipped is untangled, what is stretched too much relaxed where it is, and what lies on
//! other faces given up.

use crate::atlas::parametrize::fit::{Bounds, Distortion, POWER, SHARE_BEYOND, stretches};
use crate::atlas::parametrize::simple_boundary::boundary_is_simple;
use crate::chart::overlapping_faces;
use crate::disk::Disk;
use crate::half_edges::{BORDER, grouped, half_edge};
use crate::parametrizer::StoppingCriterion;
use crate::parametrizer::symmetric_dirichlet::{Penalty, minimise_penalty};
use crate::triangle::{Frame, orientation};

/// Rings of faces around flipped ones in which vertices move to the middle of their neighbours, and sweeps of it.
const UNFLIPPED_RINGS: [usize; 3] = [1, 2, 4];
const SWEEPS: usize = 40;
/// Rings of faces around stretched ones that are laid out anew, one after the other, and Newton iterations for them.
const RELAXED_RINGS: [usize; 2] = [4, 10];
const RELAXING_ITERATIONS: usize = 10;
/// Rings of faces around added faces that are laid out anew with them, relative to the square root of their number, and at least.
const ADDED_RINGS: f64 = 0.5;
const LEAST_RINGS: usize = 10;
/// Newton iterations for these, and their relative gain below which they stop.
const ITERATIONS: usize = 4;
const TOLERANCE: f64 = 1e-3;
/// They are given up unless each leaves at most this share of the faces beyond the bound.
const SLOW_GAIN: f64 = 0.8;
/// Rings of faces that are parted together with one that is stretched too much.
const PARTED_RINGS: usize = 2;
/// Cells along the side of a layout in which faces that lie on others are looked for.
const CELLS: usize = 256;
/// Share of a chart that may be parted from it.
const MAX_PARTED: f64 = 0.2;

/// A layout of which all faces but the parted ones keep the bounds and lie on no other.
pub(in crate::atlas) struct PartialLayout {
    pub(in crate::atlas) uv: Vec<[f64; 2]>,
    pub(in crate::atlas) parted: Vec<bool>,
}

/// Makes good what is wrong in few places of a layout. Faces for which `added` holds have just come to the others, which keep the bounds and lie on
/// none: only what is near added faces is laid out anew, and where two faces lie on each other, an added one is parted first. Without added faces all faces are
/// looked at. `None` where too much would have to be parted.
pub(in crate::atlas) fn untangle(
    disk: &Disk,
    mut uv: Vec<[f64; 2]>,
    added: &[bool],
    bounds: Bounds,
) -> Option<PartialLayout> {
    let frames = disk.frames();
    let count_added = added.iter().filter(|added| **added).count();
    let rings = (ADDED_RINGS * (count_added as f64).sqrt()) as usize;
    let near_added =
        if count_added > 0 { dilated(disk, added, rings.max(LEAST_RINGS)) } else { vec![true; added.len()] };
    unflip(disk, &mut uv);
    let count = |parted: &[bool]| parted.iter().filter(|parted| **parted).count() as f64;
    let most = MAX_PARTED * disk.faces.len() as f64;
    let mut parted = flipped(disk, &uv);
    if parted.contains(&true) {
        parted = dilated(disk, &parted, 1);
    }
    for rings in RELAXED_RINGS {
        let limit = if is_beyond(disk, &frames, &uv, &parted, bounds) { bounds.stretch } else { bounds.worst };
        let broken: Vec<bool> = stretches(disk, &frames, &uv).iter().map(|&stretch| stretch > limit).collect();
        let mut near = dilated(disk, &broken, rings);
        near.iter_mut().zip(&parted).zip(&near_added).for_each(|((near, parted), added)| *near &= !parted && *added);
        if count(&near) > most {
            break;
        }
        let is_enough = |distortion: &Distortion| distortion.worst <= limit;
        relax(disk, &near, &mut uv, bounds, RELAXING_ITERATIONS, is_enough);
    }
    if count_added > 0 && is_beyond(disk, &frames, &uv, &parted, bounds) {
        let mut last = f64::INFINITY;
        let is_enough = |distortion: &Distortion| {
            let slow = distortion.beyond > SLOW_GAIN * std::mem::replace(&mut last, distortion.beyond);
            slow || distortion.within(bounds)
        };
        let near: Vec<bool> = near_added.iter().zip(&parted).map(|(near, parted)| *near && !parted).collect();
        relax(disk, &near, &mut uv, bounds, ITERATIONS, is_enough);
    }
    let broken: Vec<bool> = stretches(disk, &frames, &uv).iter().map(|&stretch| stretch > bounds.worst).collect();
    parted.iter_mut().zip(dilated(disk, &broken, PARTED_RINGS)).for_each(|(parted, broken)| *parted |= broken);
    if count(&parted) > most || is_beyond(disk, &frames, &uv, &parted, bounds) {
        return None;
    }
    if parted.contains(&true) || !boundary_is_simple(disk, &uv) {
        let over = covered(disk, &uv, &parted, added, &near_added);
        parted.iter_mut().zip(dilated(disk, &over, 1)).for_each(|(parted, over)| *parted |= over);
    }
    (count(&parted) <= most).then_some(PartialLayout { uv, parted })
}

/// One of every two faces, none of them parted, that lie on each other: an added one if one is, else the later. Both are only looked for where a face lies
/// for which `near` holds.
fn covered(disk: &Disk, uv: &[[f64; 2]], parted: &[bool], added: &[bool], near: &[bool]) -> Vec<bool> {
    let mut cells = Cells::new(uv);
    let corners = |f: usize| disk.faces[f].map(|v| uv[v as usize]);
    (0..near.len()).filter(|&f| near[f] && !parted[f]).for_each(|f| cells.mark(corners(f)));
    let kept: Vec<usize> = (0..parted.len()).filter(|&f| !parted[f] && cells.is_marked(corners(f))).collect();
    let faces: Vec<[u32; 3]> = kept.iter().map(|&f| disk.faces[f]).collect();
    let mut over = vec![false; parted.len()];
    for [f, g] in overlapping_faces(uv, &faces) {
        let (f, g) = (kept[f as usize], kept[g as usize]);
        let later = if added[f] == added[g] { f.max(g) } else { [g, f][usize::from(added[f])] };
        over[later] = true;
    }
    over
}

/// Places in the plane, by cells of a grid.
struct Cells {
    low: [f64; 2],
    per_metre: [f64; 2],
    marked: Vec<bool>,
}

impl Cells {
    fn new(uv: &[[f64; 2]]) -> Self {
        let bound = |k: usize, pick: fn(f64, f64) -> f64| uv.iter().map(|p| p[k]).reduce(pick).unwrap_or(0.0);
        let low = [0, 1].map(|k| bound(k, f64::min));
        let size = [0, 1].map(|k| bound(k, f64::max) - low[k]);
        let per_metre = size.map(|size| CELLS as f64 / size.max(f64::MIN_POSITIVE));
        Self { low, per_metre, marked: vec![false; CELLS * CELLS] }
    }

    fn covering(&self, corners: [[f64; 2]; 3]) -> impl Iterator<Item = usize> + use<> {
        let [across, up] = [0, 1].map(|k| {
            let cell = |x: f64| (((x - self.low[k]) * self.per_metre[k]) as usize).min(CELLS - 1);
            let [a, b, c] = corners.map(|p| p[k]);
            cell(a.min(b).min(c))..=cell(a.max(b).max(c))
        });
        up.flat_map(move |row| across.clone().map(move |column| row * CELLS + column))
    }

    fn mark(&mut self, corners: [[f64; 2]; 3]) {
        for cell in self.covering(corners) {
            self.marked[cell] = true;
        }
    }

    fn is_marked(&self, corners: [[f64; 2]; 3]) -> bool {
        self.covering(corners).any(|cell| self.marked[cell])
    }
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
fn unflip(disk: &Disk, uv: &mut [[f64; 2]]) {
    let mut outer = vec![false; uv.len()];
    for &v in disk.loops.iter().flatten() {
        outer[v as usize] = true;
    }
    for rings in UNFLIPPED_RINGS {
        let flipped = flipped(disk, uv);
        if !flipped.contains(&true) {
            return;
        }
        let near = dilated(disk, &flipped, rings);
        let faces: Vec<[u32; 3]> =
            disk.faces.iter().zip(&near).filter(|(_, near)| **near).map(|(face, _)| *face).collect();
        let mut moving: Vec<u32> = faces.iter().flatten().copied().filter(|&v| !outer[v as usize]).collect();
        moving.sort_unstable();
        moving.dedup();
        // All faces of a vertex that moves are neighbours of faces near.
        let around = dilated(disk, &near, 2);
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

/// Faces, and those around them, so many rings far.
fn dilated(disk: &Disk, faces: &[bool], rings: usize) -> Vec<bool> {
    let mut near = faces.to_vec();
    let mut front: Vec<u32> = (0..faces.len() as u32).filter(|&f| faces[f as usize]).collect();
    for _ in 0..rings {
        let mut next = Vec::new();
        for &f in &front {
            let beside = disk.twins[3 * f as usize..3 * f as usize + 3].iter().filter(|twin| **twin != BORDER);
            next.extend(beside.map(|twin| twin / 3).filter(|&g| !std::mem::replace(&mut near[g as usize], true)));
        }
        front = next;
    }
    near
}
