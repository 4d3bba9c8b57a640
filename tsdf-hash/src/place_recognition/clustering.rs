//! k-medians of binary descriptors in Hamming space, as a vocabulary tree is trained by.

use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::Rng;

use crate::place_recognition::descriptor::{BITS, Descriptor};

/// Clusters.
const BRANCHING: usize = 8;
/// Passes; most clusterings end sooner.
const PASSES: usize = 12;

/// At most eight clusters and their medians; those without members are left out. Too few members are not clustered.
pub(super) fn clustered(members: Vec<Descriptor>, random: &mut SplitMix64) -> Vec<(Descriptor, Vec<Descriptor>)> {
    if members.len() < 2 * BRANCHING {
        return Vec::new();
    }
    let mut centres = spread_out(&members, random);
    let mut nearest: Vec<usize> = Vec::new();
    for _ in 0..PASSES {
        let found: Vec<usize> = members.iter().map(|d| nearest_of(&centres, d)).collect();
        if found == nearest {
            break;
        }
        nearest = found;
        for (k, centre) in centres.iter_mut().enumerate() {
            let own = members.iter().zip(&nearest).filter(|(_, n)| **n == k).map(|(d, _)| d);
            *centre = median(own).unwrap_or(*centre);
        }
    }
    let mut clusters: Vec<(Descriptor, Vec<Descriptor>)> = centres.into_iter().map(|c| (c, Vec::new())).collect();
    for (descriptor, k) in members.into_iter().zip(nearest) {
        clusters[k].1.push(descriptor);
    }
    clusters.retain(|(_, members)| !members.is_empty());
    clusters
}

/// Members that are far from each other (k-means++, Arthur and Vassilvitskii 2007).
fn spread_out(members: &[Descriptor], random: &mut SplitMix64) -> Vec<Descriptor> {
    let mut draw = |below: u64| random.next_u64() % below.max(1);
    let mut centres = vec![members[draw(members.len() as u64) as usize]];
    let mut off: Vec<u64> = vec![u64::MAX; members.len()];
    while centres.len() < BRANCHING {
        let Some(last) = centres.last() else { break };
        for (off, member) in off.iter_mut().zip(members) {
            *off = (*off).min(u64::from(member.distance(last)).pow(2));
        }
        let total: u64 = off.iter().sum();
        if total == 0 {
            break;
        }
        let mut left = draw(total);
        let at = off.iter().position(|off| {
            let here = left < *off;
            left = left.saturating_sub(*off);
            here
        });
        centres.push(members[at.unwrap_or(0)]);
    }
    centres
}

fn nearest_of(centres: &[Descriptor], descriptor: &Descriptor) -> usize {
    (0..centres.len()).min_by_key(|k| centres[*k].distance(descriptor)).unwrap_or(0)
}

/// Every bit as most have it.
fn median<'a>(members: impl Iterator<Item = &'a Descriptor>) -> Option<Descriptor> {
    let mut counts = [0_u32; BITS as usize];
    let mut total = 0;
    for member in members {
        total += 1;
        for (k, count) in counts.iter_mut().enumerate() {
            *count += (member.0[k / 64] >> (k % 64) & 1) as u32;
        }
    }
    let mut out = Descriptor::default();
    for (k, count) in counts.iter().enumerate() {
        out.0[k / 64] |= u64::from(2 * count > total) << (k % 64);
    }
    (total > 0).then_some(out)
}
