//! The shares of shots that texels catch, computed on a GPU.

use std::ops::Range;
use std::sync::Arc;

use super::ball_tree::LEAF;
use super::texel_index::TexelIndex;
use super::texel_share::{
    MAX_PIECES_PER_SIDE, Points, REACH, SINGLE_SAMPLE_SIZE, THREE, THREE_POINT_SIZE, TWO, TWO_POINT_SIZE,
};
use super::waiting::Waiting;
use crate::error::Error;
use crate::gpu::{DOUBLE, GpuOptions, Input, Program, doubles, words};
use crate::spray::{CONE_NUMBERS, Cone, EXP, LEAST_EXPONENT, ROUNDING, Shot, SprayModel, cone_numbers};

/// Bytes of a texel: point, normal, area and side.
const TEXEL: usize = 64;
/// Leaves of one work group.
const LEAVES: usize = 4;
/// Words of the result of a texel.
const WORDS: usize = 3;
/// Leaves after which no other shot is taken in: bounds the memory of what is found.
const ENOUGH_LEAVES: usize = 1 << 16;

/// A leaf of the tree of texels that a shot may reach.
struct Reached {
    page: usize,
    shot: u32,
    /// Where its texels stand in the tree's order.
    texels: Range<usize>,
}

/// A GPU that knows the texels.
pub(super) struct GpuShares {
    pub(super) index: Arc<TexelIndex>,
    program: Program,
    /// The texels in the order of the tree, cut between leaves into what a buffer takes: the first texel of each, and the buffer.
    pages: Vec<(usize, wgpu::Buffer)>,
}

impl GpuShares {
    pub(super) fn new(index: &Arc<TexelIndex>, options: &GpuOptions) -> Result<Self, Error> {
        let program = Program::new(options, &format!("{DOUBLE}{}", include_str!("share.wgsl")), "shares")?;
        let most = program.most_words() * 4 / TEXEL;
        let mut pages = Vec::new();
        let (mut first, mut end) = (0, 0);
        let mut page = |range: Range<usize>| -> Result<(), Error> {
            let texel = |&texel: &u32| {
                let texel = &index.texels[texel as usize];
                let [p, n] = [&texel.point.coords, &*texel.normal];
                [p.x, p.y, p.z, n.x, n.y, n.z, texel.area, texel.area.sqrt()]
            };
            let numbers: Vec<f64> = index.tree.order()[range.clone()].iter().flat_map(texel).collect();
            pages.push((range.start, program.keep(&doubles(&numbers))?));
            Ok(())
        };
        for leaf in index.tree.leaves() {
            if leaf.end - first > most.max(LEAF) {
                page(first..end)?;
                first = end;
            }
            end = leaf.end;
        }
        page(first..end)?;
        Ok(Self { index: Arc::clone(index), program, pages })
    }

    /// Name, backend and driver of the adapter.
    pub(super) fn adapter(&self) -> &str {
        self.program.adapter()
    }

    /// For the first of these shots, at least one of them, the texels that catch some of each if nothing stands before them, with their shares of
    /// it: what the processor finds, in the same order.
    pub(super) fn of_first(&self, shots: &[Shot], spray: &SprayModel) -> Result<Vec<Vec<(u32, f64)>>, Error> {
        let mut cones = Vec::with_capacity(shots.len() * CONE_NUMBERS);
        // Where the leaves of every shot end.
        let (mut leaves, mut ends, mut stack) = (Vec::new(), Vec::with_capacity(shots.len()), Vec::new());
        for shot in shots {
            let cone = Cone::new(spray, &shot.origin, &shot.axis);
            cones.extend(cone_numbers(&cone));
            let shot = ends.len() as u32;
            self.index.tree.for_each_leaf(&cone, &mut stack, |texels| {
                let page = self.pages.partition_point(|page| page.0 <= texels.start) - 1;
                leaves.push(Reached { page, shot, texels });
            });
            ends.push(leaves.len());
            if leaves.len() >= ENOUGH_LEAVES {
                break;
            }
        }
        let mut found = vec![[0; WORDS * LEAF]; leaves.len()];
        let cones = doubles(&cones);
        for (page, (first, texels)) in self.pages.iter().enumerate() {
            let here: Vec<usize> = (0..leaves.len()).filter(|&leaf| leaves[leaf].page == page).collect();
            for here in here.chunks(LEAVES * self.program.most_groups(LEAVES * LEAF * WORDS)) {
                let reference = |&leaf: &usize| {
                    let Reached { shot, texels, .. } = &leaves[leaf];
                    [*shot, (texels.start - first) as u32, texels.len() as u32, 0]
                };
                let references = words(&here.iter().flat_map(reference).collect::<Vec<u32>>());
                let inputs = [Input::Sent(&cones), Input::Kept(texels), Input::Sent(&references)];
                let count = here.len();
                let groups = count.div_ceil(LEAVES);
                let results = self.program.run(&settings(count), &inputs, groups, groups * LEAVES * LEAF * WORDS)?;
                for (&leaf, result) in here.iter().zip(results.as_chunks().0) {
                    found[leaf] = *result;
                }
            }
        }
        let mut first = 0;
        let shares = ends.into_iter().map(|end| {
            let shares = self.in_order(&leaves[first..end], &found[first..end]);
            first = end;
            shares
        });
        Ok(shares.collect())
    }

    /// The shares of a shot in the order in which the processor comes to them.
    fn in_order(&self, leaves: &[Reached], found: &[[u32; WORDS * LEAF]]) -> Vec<(u32, f64)> {
        let mut shares = Vec::new();
        let mut claim = |lanes: &[u32], _: Points| {
            let share = |&place: &u32| {
                let (leaf, lane) = (place as usize / LEAF, place as usize % LEAF);
                let [low, high] = [0, 1].map(|word| u64::from(found[leaf][WORDS * lane + word]));
                (self.index.tree.order()[leaves[leaf].texels.start + lane], f64::from_bits(high << 32 | low))
            };
            shares.extend(lanes.iter().map(share).filter(|(_, share)| *share > 0.0));
        };
        let mut waiting = Waiting::default();
        for (leaf, result) in found.iter().enumerate() {
            for (lane, [_, _, class]) in result.as_chunks().0.iter().enumerate() {
                // Zero is none.
                if let Some(points) = Points::ALL.get((*class as usize).wrapping_sub(1)) {
                    waiting.push((leaf * LEAF + lane) as u32, *points, &mut claim);
                }
            }
        }
        waiting.finish(&mut claim);
        shares
    }
}

/// The uniform: what `share.wgsl` calls its settings, with the numbers of the processor's program.
fn settings(leaves: usize) -> Vec<u8> {
    let sizes = [SINGLE_SAMPLE_SIZE, TWO_POINT_SIZE, THREE_POINT_SIZE, REACH];
    let exponential = [LEAST_EXPONENT, ROUNDING, std::f64::consts::LOG2_E, std::f64::consts::LN_2];
    let rules = TWO.into_iter().chain(THREE).flat_map(|(node, weight)| [node, weight]);
    let numbers: Vec<f64> = sizes.into_iter().chain(exponential).chain(EXP).chain([1.0]).chain(rules).collect();
    let mut bytes = words(&[leaves as u32, MAX_PIECES_PER_SIDE as u32, 0, 0]);
    bytes.extend(doubles(&numbers));
    bytes
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, UnitVector3, Vector3};

    use super::*;
    use crate::film::deposit::find_shares;
    use crate::film::{Film, Texel};
    use crate::gpu::test_adapter;
    use crate::rng::Rng;
    use crate::surface::TriangleSurface;

    /// To the last bit, and in the same order: round and elliptic sprays, texels far smaller than the spot and far larger, before the nozzle,
    /// beside it and behind it, with normals of all directions.
    #[test]
    fn shares_are_those_of_the_processor() {
        let mut rng = Rng::new(5, 0);
        let mut part = || rng.uniform() - 0.5;
        let mut unit = |least: f64| UnitVector3::new_normalize(Vector3::new(part(), part(), part() - least));
        let normals: Vec<_> = (0..3000).map(|k| if k == 0 { -Vector3::z_axis() } else { unit(0.3) }).collect();
        let texel = |(k, normal): (usize, UnitVector3<f64>)| Texel {
            point: Point3::new(0.4 * part(), 0.4 * part(), 0.1 * part()),
            normal,
            area: 10.0_f64.powf(-3.0 - 6.0 * (k % 100) as f64 / 100.0),
        };
        let film = Film::new(normals.into_iter().enumerate().map(texel).collect()).unwrap();
        let far = TriangleSurface::new(&[[0.0, 0.0, 9e3], [1.0, 0.0, 9e3], [0.0, 1.0, 9e3]], &[[0, 1, 2]]).unwrap();
        let Some(options) = test_adapter::options() else { return };
        let gpu = GpuShares::new(&film.index, &options).unwrap();
        let usual = SprayModel::default();
        let sprays = [
            SprayModel { sigma: 0.3, ..usual },
            SprayModel { sigma: 0.9, cut: 60.0, range: 0.3, efficiency: 0.3, ..usual },
            SprayModel { aspect: 0.4, turn: 1.0, yaw: -0.2, pitch: 0.3, sigma: 0.3, ..usual },
        ];
        let (mut stack, mut expected, mut count) = (Vec::new(), Vec::new(), 0);
        for spray in sprays {
            let shot = |k: i32| Shot {
                origin: Point3::new(0.2 * part(), 0.2 * part(), if k == 0 { 0.0 } else { -0.2 * part() - 0.15 }),
                axis: if k == 1 {
                    Vector3::z_axis()
                } else {
                    UnitVector3::new_normalize(Vector3::new(part(), part(), 1.0))
                },
                volume: 1.0,
            };
            let shots: Vec<Shot> = (0..20).map(shot).collect();
            for (shot, found) in shots.iter().zip(gpu.of_first(&shots, &spray).unwrap()) {
                find_shares(&film.index, shot, &spray, &far, &mut stack, &mut expected);
                let bits = |shares: &[(u32, f64)]| {
                    shares.iter().map(|(texel, share)| (*texel, share.to_bits())).collect::<Vec<_>>()
                };
                assert_eq!(bits(&found), bits(&expected), "{shot:?} {spray:?}");
                count += found.len();
            }
        }
        assert!(count > 10_000, "{count}");
    }
}
