//! From shots to paint on texels: density, shadows, and rounding that loses nothing.

use std::array::from_fn;

use nalgebra::Vector3;

use super::texel::{Texel, check_unit};
use super::texel_index::TexelIndex;
use crate::error::{Error, check_not_negative};
use crate::spray::{Cone, QUANTUM, Shot, SprayModel};
use crate::surface::Surface;

/// Shots that are worked on between two calls of `progress`; bounds the memory of the hit lists.
pub(super) const SHOTS_PER_BATCH: usize = 1024;

/// Up to this size, in deviations of the spot, a texel is one sample.
const SINGLE_SAMPLE_SIZE: f64 = 0.125;

/// Larger texels are cut into pieces of at most this size, in deviations; each takes two by two Gauss points, which
/// leaves a relative error of about 5e-5.
const MAX_PIECE_SIZE: f64 = 0.5;

/// Most pieces per side of one texel.
const MAX_PIECES_PER_SIDE: f64 = 8.0;

/// Radius of a ball around all samples of a texel, in its sides: half a diagonal, and a little for rounding.
const REACH: f64 = 0.75;

/// Gauss points of order two on -1/2..1/2: `+- 1/sqrt(12)`.
const GAUSS: f64 = 0.288_675_134_594_812_9;

/// Quanta that the shots emit in total.
pub(super) fn count_quanta(shots: &[Shot]) -> Result<u64, Error> {
    let mut emitted = 0_u64;
    for (index, shot) in shots.iter().enumerate() {
        if !(shot.origin.iter().chain(shot.axis.iter()).all(|v| v.is_finite()) && shot.volume.is_finite()) {
            return Err(Error::NotFinite { what: "shot", index });
        }
        check_unit("length of a shot's axis", &shot.axis)?;
        check_not_negative("shot volume", shot.volume)?;
        // The cast saturates, so an absurd volume ends in the overflow error as well.
        emitted = emitted.checked_add(quanta(shot.volume)).ok_or(Error::MassOverflow)?;
    }
    if emitted == u64::MAX { Err(Error::MassOverflow) } else { Ok(emitted) }
}

fn quanta(volume: f64) -> u64 {
    (volume / QUANTUM).round() as u64
}

/// The hit list of a batch: (texel, quanta). Integer sums do not depend on the order, so the threads need no other care.
pub(super) fn deposit_batch(
    texels: &TexelIndex,
    batch: &[Shot],
    spray: &SprayModel,
    surface: &dyn Surface,
    threads: usize,
) -> Vec<(u32, u64)> {
    let work = |shots: &[Shot]| {
        let mut scratch = Scratch::default();
        for shot in shots {
            deposit_shot(texels, shot, spray, surface, &mut scratch);
        }
        scratch.hits
    };
    in_chunks(batch, threads, &work)
}

/// The results of `work` on parts of the shots, one for each thread, joined in their order.
fn in_chunks<T: Send>(shots: &[Shot], threads: usize, work: &(dyn Fn(&[Shot]) -> Vec<T> + Sync)) -> Vec<T> {
    if threads == 1 || shots.len() < 2 {
        return work(shots);
    }
    std::thread::scope(|scope| {
        let chunks = shots.chunks(shots.len().div_ceil(threads));
        let workers: Vec<_> = chunks.map(|chunk| scope.spawn(move || work(chunk))).collect();
        let join = |worker: std::thread::ScopedJoinHandle<'_, Vec<T>>| {
            worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        workers.into_iter().flat_map(join).collect()
    })
}

/// Buffers that live as long as a thread's work, so that the loop over shots does not allocate.
#[derive(Default)]
struct Scratch {
    stack: Vec<u32>,
    shares: Vec<(u32, f64)>,
    remainders: Vec<(f64, usize)>,
    hits: Vec<(u32, u64)>,
}

fn deposit_shot(texels: &TexelIndex, shot: &Shot, spray: &SprayModel, surface: &dyn Surface, scratch: &mut Scratch) {
    let emitted = quanta(shot.volume);
    if emitted > 0 {
        let Scratch { stack, shares, .. } = scratch;
        find_shares(texels, shot, spray, surface, stack, shares);
        round_shot(emitted, spray.efficiency, scratch);
    }
}

/// The shares of each shot's paint that texels catch; texels that catch none are left out.
pub(super) fn shot_shares(
    texels: &TexelIndex,
    shots: &[Shot],
    spray: &SprayModel,
    surface: &dyn Surface,
    threads: usize,
) -> Vec<Vec<(u32, f64)>> {
    let work = |shots: &[Shot]| -> Vec<Vec<(u32, f64)>> {
        let mut stack = Vec::new();
        let one = |shot: &Shot| {
            let mut shares = Vec::new();
            find_shares(texels, shot, spray, surface, &mut stack, &mut shares);
            let scale = kept(&shares, spray.efficiency);
            for (_, share) in &mut shares {
                *share *= scale;
            }
            shares
        };
        shots.iter().map(one).collect()
    };
    in_chunks(shots, threads, &work)
}

/// Texels in the cone and out of the shadow, with the share of the paint that each claims.
fn find_shares(
    texels: &TexelIndex,
    shot: &Shot,
    spray: &SprayModel,
    surface: &dyn Surface,
    stack: &mut Vec<u32>,
    shares: &mut Vec<(u32, f64)>,
) {
    let cone = Cone::new(spray, &shot.origin, &shot.axis);
    shares.clear();
    texels.tree.for_each(&cone, stack, |index| {
        let share = texel_share(&cone, &texels.texels[index as usize]);
        if share > 0.0 {
            shares.push((index, share));
        }
    });
    remove_shadowed(texels, shot, spray, surface, shares);
}

/// What is left of every claim where all of them together claim more than the cone keeps.
fn kept(shares: &[(u32, f64)], efficiency: f64) -> f64 {
    let claimed: f64 = shares.iter().map(|(_, share)| share).sum();
    if claimed > efficiency { efficiency / claimed } else { 1.0 }
}

/// Share of the shot that the texel catches if nothing stands before it.
fn texel_share(cone: &Cone, texel: &Texel) -> f64 {
    let side = texel.area.sqrt();
    let deviation = (texel.point - cone.origin).dot(cone.axis) * cone.deviation;
    if side <= SINGLE_SAMPLE_SIZE * deviation {
        return cone.density(&texel.point, &texel.normal) * texel.area;
    }
    if !cone.may_intersect(&texel.point, REACH * side) {
        return 0.0;
    }
    // A texel at or behind the nozzle's height has no positive deviation; part of it may still be before the nozzle.
    let pieces = if deviation > 0.0 {
        (side / (MAX_PIECE_SIZE * deviation)).ceil().min(MAX_PIECES_PER_SIDE)
    } else {
        MAX_PIECES_PER_SIDE
    };
    let step = side / pieces;
    let (u, v) = tangents(&texel.normal);
    let row = 2 * pieces as usize;
    let mut offsets = [0.0; 2 * MAX_PIECES_PER_SIDE as usize];
    for (i, offset) in offsets[..row].iter_mut().enumerate() {
        *offset = gauss_point(i as u32) * step - 0.5 * side;
    }
    let mut sum = 0.0;
    for a in &offsets[..row] {
        let middle = texel.point + u * *a;
        for pair in offsets[..row].chunks_exact(2) {
            let points: [[f64; 2]; 3] = from_fn(|axis| from_fn(|k| middle[axis] + v[axis] * pair[k]));
            let [first, second] = cone.densities(&points, &texel.normal);
            sum += first;
            sum += second;
        }
    }
    0.25 * sum * step * step
}

/// The `i`-th Gauss point along a row of pieces of length one.
fn gauss_point(i: u32) -> f64 {
    f64::from(i / 2) + if i.is_multiple_of(2) { 0.5 - GAUSS } else { 0.5 + GAUSS }
}

/// Two unit vectors that make a right-handed frame with the normal, continuous except where the normal is -z
/// (Duff et al. 2017).
fn tangents(n: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let sign = 1.0_f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (Vector3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vector3::new(b, sign + n.y * n.y * a, -n.y))
}

/// Takes away the shares of texels which something stands before. Nothing is closer to the nozzle than the surface, so the rays start there.
fn remove_shadowed(
    texels: &TexelIndex,
    shot: &Shot,
    spray: &SprayModel,
    surface: &dyn Surface,
    shares: &mut Vec<(u32, f64)>,
) {
    let clearance = surface.distance(&shot.origin, spray.range) * (1.0 - 1e-9);
    let to_texel = |(texel, _): &(u32, f64)| {
        let ray = texels.texels[*texel as usize].point - shot.origin;
        let distance = ray.norm();
        (ray / distance, distance - clearance - spray.shadow_bias)
    };
    let rays: Vec<(Vector3<f64>, f64)> = shares.iter().map(to_texel).collect();
    let mut occluded = surface.occluded_beam(&shot.origin, clearance, &rays).into_iter();
    shares.retain(|_| occluded.next() != Some(true));
}

/// Largest remainder rounding of `shares * emitted`: whole quanta whose sum is the rounded sum.
fn round_shot(emitted: u64, efficiency: f64, scratch: &mut Scratch) {
    let Scratch { shares, remainders, hits, .. } = scratch;
    let claimed: f64 = shares.iter().map(|(_, share)| share).sum();
    if claimed <= 0.0 {
        return;
    }
    let scale = emitted as f64 * kept(shares, efficiency);
    let total = ((claimed * scale).round() as u64).min(emitted);
    remainders.clear();
    let first = hits.len();
    let mut floors = 0;
    for &(texel, share) in shares.iter() {
        let exact = share * scale;
        let whole = (exact as u64).min(total - floors);
        floors += whole;
        remainders.push((exact - whole as f64, hits.len()));
        hits.push((texel, whole));
    }
    let missing = ((total - floors) as usize).min(remainders.len());
    if missing > 0 {
        remainders.select_nth_unstable_by(missing - 1, |a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        for &(_, hit) in &remainders[..missing] {
            hits[hit].1 += 1;
        }
    }
    debug_assert!(hits[first..].iter().map(|hit| hit.1).sum::<u64>() <= emitted);
}
