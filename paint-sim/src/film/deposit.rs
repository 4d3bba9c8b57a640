//! From shots to paint on texels: density, shadows, and rounding that loses nothing.

use nalgebra::Vector3;

use super::texel::check_unit;
use super::texel_index::TexelIndex;
use super::texel_share::{Points, vectorised};
use super::waiting::Waiting;
use crate::error::{Error, check_not_negative};
use crate::spray::{Cone, QUANTUM, Shot, SprayModel};
use crate::surface::Surface;

/// Shots that are worked on between two calls of `progress`; bounds the memory of the hit lists.
pub(super) const SHOTS_PER_BATCH: usize = 1024;

/// Quanta that the shots emit in total.
pub(super) fn count_quanta<'a>(shots: impl IntoIterator<Item = &'a Shot>) -> Result<u64, Error> {
    let mut emitted = 0_u64;
    for (index, shot) in shots.into_iter().enumerate() {
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

pub(super) fn quanta(volume: f64) -> u64 {
    (volume / QUANTUM).round() as u64
}

/// Texels and the quanta that come onto them.
pub(super) type HitList = Vec<(u32, u64)>;

/// The hit list of a batch. Integer sums do not depend on the order, so the threads need no other care.
pub(super) fn deposit_batch(
    texels: &TexelIndex,
    batch: &[Shot],
    spray: &SprayModel,
    surface: &dyn Surface,
    threads: usize,
) -> HitList {
    deposit_batch_each(texels, batch, &|shot| (*shot, *spray), surface, threads)
}

/// The same of anything that is a shot with a spray of its own.
pub(super) fn deposit_batch_each<S: Sync>(
    texels: &TexelIndex,
    batch: &[S],
    shot: &(dyn Fn(&S) -> (Shot, SprayModel) + Sync),
    surface: &dyn Surface,
    threads: usize,
) -> HitList {
    let work = |shots: &[S]| {
        let mut scratch = Scratch::default();
        for (shot, spray) in shots.iter().map(shot) {
            deposit_shot(texels, &shot, &spray, surface, &mut scratch);
        }
        scratch.hits
    };
    in_chunks(batch, threads, &work)
}

/// The results of `work` on parts of the shots, one for each thread, joined in their order.
fn in_chunks<S: Sync, T: Send>(shots: &[S], threads: usize, work: &(dyn Fn(&[S]) -> Vec<T> + Sync)) -> Vec<T> {
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
pub(super) struct Scratch {
    stack: Vec<u32>,
    pub(super) shares: Vec<(u32, f64)>,
    remainders: Vec<(f64, usize)>,
    pub(super) hits: HitList,
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
pub(super) fn find_shares(
    texels: &TexelIndex,
    shot: &Shot,
    spray: &SprayModel,
    surface: &dyn Surface,
    stack: &mut Vec<u32>,
    shares: &mut Vec<(u32, f64)>,
) {
    let cone = Cone::new(spray, &shot.origin, &shot.axis);
    shares.clear();
    let (forms, texel_shares) = (cone.slope_forms(), vectorised());
    let mut claim = |lanes: &[u32], points: Points| {
        let Some(first) = lanes.first() else { return };
        let texels = std::array::from_fn(|k| &texels.texels[*lanes.get(k).unwrap_or(first) as usize]);
        let found = lanes.iter().zip(texel_shares(&cone, &forms, &texels, points));
        shares.extend(found.filter(|(_, share)| *share > 0.0).map(|(index, share)| (*index, share)));
    };
    let mut waiting = Waiting::default();
    texels.tree.for_each(&cone, stack, |index| {
        if let Some(points) = Points::of(&cone, &texels.texels[index as usize]) {
            waiting.push(index, points, &mut claim);
        }
    });
    waiting.finish(&mut claim);
    remove_shadowed(texels, shot, spray, surface, shares);
}

/// What is left of every claim where all of them together claim more than the cone keeps.
fn kept(shares: &[(u32, f64)], efficiency: f64) -> f64 {
    let claimed: f64 = shares.iter().map(|(_, share)| share).sum();
    if claimed > efficiency { efficiency / claimed } else { 1.0 }
}

/// Takes away the shares of texels which something stands before. Nothing is closer to the nozzle than the surface, so the rays start there.
fn remove_shadowed(
    texels: &TexelIndex,
    shot: &Shot,
    spray: &SprayModel,
    surface: &dyn Surface,
    shares: &mut Vec<(u32, f64)>,
) {
    let (clearance, rays) = shadow_rays(texels, shot, spray, surface, shares);
    let mut occluded = surface.occluded_beam(&shot.origin, clearance, &rays).into_iter();
    shares.retain(|_| occluded.next() != Some(true));
}

/// How far around the nozzle there is nothing, and for every claim the ray that must be free: its direction, and its length from there on.
pub(super) fn shadow_rays(
    texels: &TexelIndex,
    shot: &Shot,
    spray: &SprayModel,
    surface: &dyn Surface,
    shares: &[(u32, f64)],
) -> (f64, Vec<(Vector3<f64>, f64)>) {
    let clearance = surface.distance(&shot.origin, spray.range) * (1.0 - 1e-9);
    let to_texel = |(texel, _): &(u32, f64)| {
        let ray = texels.texels[*texel as usize].point - shot.origin;
        let distance = ray.norm();
        (ray / distance, distance - clearance - spray.shadow_bias)
    };
    (clearance, shares.iter().map(to_texel).collect())
}

/// Largest remainder rounding of `shares * emitted`: whole quanta whose sum is the rounded sum.
pub(super) fn round_shot(emitted: u64, efficiency: f64, scratch: &mut Scratch) {
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
