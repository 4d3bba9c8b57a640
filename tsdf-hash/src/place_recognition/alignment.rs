//! How one frame stands to another one by features that both have: three of them fix a pose, the others vote (RANSAC).

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

use crate::place_recognition::features::Feature;

/// Descriptors of one place differ in at most so many bits (ours).
const MOST_BITS: u32 = 64;
/// The nearest descriptor must be nearer than the second nearest by this factor (Lowe 2004).
const RATIO: f32 = 0.9;
/// Features that must agree about a pose.
const LEAST: usize = 12;
/// Draws of three.
const DRAWS: usize = 400;
const SEED: u64 = 7;
/// Two features are at one place within so many metres, and so many more per metre of depth: a corner is found to a pixel or two.
const TOLERANCE: [f64; 2] = [0.015, 0.015];

/// A frame beside a keyframe.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Alignment {
    pub(crate) keyframe_from_frame: Isometry3<f64>,
    /// Features that agree.
    pub(crate) agreeing: usize,
}

/// The points of a feature in the frame and in the keyframe.
type Pair = [Vector3<f64>; 2];

/// The pose of a frame beside a keyframe that most of their features agree about; `None` if few do.
pub(crate) fn align(frame: &[Feature], keyframe: &[Feature]) -> Option<Alignment> {
    let pairs = pairs(frame, keyframe);
    if pairs.len() < LEAST {
        return None;
    }
    let mut random = SplitMix64::seed_from_u64(SEED);
    let mut best: Vec<usize> = Vec::new();
    for _ in 0..DRAWS {
        let three: [usize; 3] = std::array::from_fn(|_| (random.next_u64() % pairs.len() as u64) as usize);
        if !is_rigid(&three.map(|k| pairs[k])) {
            continue;
        }
        let Some(pose) = rigid(three.iter().map(|k| &pairs[*k])) else { continue };
        let agreeing = agreeing(&pairs, &pose);
        if agreeing.len() > best.len() {
            best = agreeing;
        }
    }
    let mut pose = None;
    for _ in 0..3 {
        if best.len() < LEAST {
            return None;
        }
        let refined = rigid(best.iter().map(|k| &pairs[*k]))?;
        best = agreeing(&pairs, &refined);
        pose = Some(refined);
    }
    (best.len() >= LEAST).then_some(Alignment { keyframe_from_frame: pose?, agreeing: best.len() })
}

/// Features that are nearest to each other, each way.
fn pairs(frame: &[Feature], keyframe: &[Feature]) -> Vec<Pair> {
    let mut best_of_keyframe = vec![(u32::MAX, 0); keyframe.len()];
    let mut best_of_frame = Vec::with_capacity(frame.len());
    let mut off = vec![0; keyframe.len()];
    for (i, feature) in frame.iter().enumerate() {
        for ((off, best), other) in off.iter_mut().zip(&mut best_of_keyframe).zip(keyframe) {
            *off = feature.descriptor.distance(&other.descriptor);
            *best = (*best).min((*off, i));
        }
        let Some(nearest) = (0..keyframe.len()).min_by_key(|j| off[*j]) else { continue };
        let least = off[nearest];
        // The same corner in another of the smaller images is no rival.
        let is_rival = |j: usize| {
            least as f32 > RATIO * off[j] as f32
                && (vector(&keyframe[j]) - vector(&keyframe[nearest])).norm()
                    > 2.0 * tolerance(keyframe[j].point[2].into())
        };
        if least <= MOST_BITS && !(0..keyframe.len()).any(|j| j != nearest && is_rival(j)) {
            best_of_frame.push((i, nearest));
        }
    }
    best_of_frame.retain(|(i, j)| best_of_keyframe[*j].1 == *i);
    best_of_frame.into_iter().map(|(i, j)| [vector(&frame[i]), vector(&keyframe[j])]).collect()
}

fn vector(feature: &Feature) -> Vector3<f64> {
    Vector3::from(feature.point.map(f64::from))
}

/// How far two points of one place may be apart, at a depth.
fn tolerance(depth: f64) -> f64 {
    TOLERANCE[0] + TOLERANCE[1] * depth
}

fn tolerance_of(pair: &Pair) -> f64 {
    tolerance(pair[0].z.max(pair[1].z))
}

/// Whether three pairs are as far apart here as there, and far enough to fix a pose.
fn is_rigid(three: &[Pair; 3]) -> bool {
    [(0, 1), (1, 2), (2, 0)].into_iter().all(|(i, j)| {
        let [here, there] = [0, 1].map(|k| (three[i][k] - three[j][k]).norm());
        let most = tolerance_of(&three[i]) + tolerance_of(&three[j]);
        here > 4.0 * most && (here - there).abs() < most
    })
}

/// Of the pairs, those whose points a pose brings together.
fn agreeing(pairs: &[Pair], pose: &Isometry3<f64>) -> Vec<usize> {
    let off = |pair: &Pair| (pose.rotation * pair[0] + pose.translation.vector - pair[1]).norm();
    (0..pairs.len()).filter(|k| off(&pairs[*k]) < tolerance_of(&pairs[*k])).collect()
}

/// The least-squares motion (Kabsch 1976); `None` if the points lie on a line.
fn rigid<'a>(pairs: impl Iterator<Item = &'a Pair> + Clone) -> Option<Isometry3<f64>> {
    let count = pairs.clone().count() as f64;
    let mean = pairs.clone().fold([Vector3::zeros(); 2], |m, p| [m[0] + p[0] / count, m[1] + p[1] / count]);
    let spread = pairs.fold(Matrix3::zeros(), |s, p| s + (p[1] - mean[1]) * (p[0] - mean[0]).transpose());
    let svd = spread.try_svd(true, true, 1e-14, 100)?;
    if svd.singular_values[1] < 1e-3 * svd.singular_values[0] {
        return None;
    }
    let (u, v) = (svd.u?, svd.v_t?);
    // Never a mirror image.
    let sign = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * v).determinant().signum()));
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(u * sign * v));
    let shift = mean[1] - rotation * mean[0];
    Some(Isometry3::from_parts(Translation3::from(shift), rotation))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::place_recognition::descriptor::Descriptor;

    /// Features at random places, with random descriptors.
    fn scattered(count: usize, seed: u64) -> Vec<Feature> {
        let mut random = SplitMix64::seed_from_u64(seed);
        let mut unit = || (random.next_u64() >> 40) as f32 / (1 << 24) as f32;
        let points: Vec<[f32; 3]> =
            (0..count).map(|_| [2.0 * unit() - 1.0, 1.5 * unit() - 0.75, 1.0 + 2.0 * unit()]).collect();
        let mut bits = SplitMix64::seed_from_u64(seed + 1);
        let features = points.into_iter().map(|point| {
            let descriptor = Descriptor(std::array::from_fn(|_| bits.next_u64()));
            Feature { point, descriptor }
        });
        features.collect()
    }

    /// The same features seen from elsewhere, a few bits and millimetres off.
    fn seen_from(features: &[Feature], pose: &Isometry3<f64>) -> Vec<Feature> {
        let mut random = SplitMix64::seed_from_u64(99);
        let seen = features.iter().map(|f| {
            let at = pose.inverse_transform_vector(&Vector3::zeros());
            let p = pose.inverse() * nalgebra::Point3::from(f.point.map(f64::from));
            let off = (random.next_u64() % 9) as f32 * 1e-3 - 4e-3;
            let mut descriptor = f.descriptor;
            descriptor.0[(random.next_u64() % 4) as usize] ^= random.next_u64() & random.next_u64() & random.next_u64();
            Feature { point: [p.x as f32 + off, p.y as f32, (p.z + at.z) as f32 - off], descriptor }
        });
        seen.collect()
    }

    #[test]
    fn the_pose_is_found_among_strangers() {
        let keyframe = scattered(60, 1);
        let pose = Isometry3::new(Vector3::new(0.3, -0.1, 0.4), Vector3::new(0.1, 0.5, -0.2));
        let mut frame = seen_from(&keyframe, &pose);
        frame.extend(scattered(100, 5));
        // Half of the keyframe's own features have moved.
        for (k, feature) in frame.iter_mut().take(60).enumerate().filter(|(k, _)| k % 2 == 0) {
            feature.point[k % 3] += 0.5;
        }
        let found = align(&frame, &keyframe).unwrap();
        let off = pose.inverse() * found.keyframe_from_frame;
        assert!(off.translation.vector.norm() < 5e-3 && off.rotation.angle() < 5e-3, "{off}");
        assert!((28..=34).contains(&found.agreeing), "{}", found.agreeing);
    }

    #[test]
    fn strangers_and_few_features_do_not_align() {
        assert!(align(&scattered(200, 1), &scattered(200, 2)).is_none());
        let few = scattered(LEAST - 1, 3);
        assert!(align(&few, &few).is_none());
        let line: Vec<Feature> =
            scattered(40, 3).iter().map(|f| Feature { point: [f.point[0], 0.0, 2.0], ..*f }).collect();
        assert!(align(&line, &line).is_none(), "a line does not fix a turn about itself");
        assert!(align(&[], &line).is_none());
    }
}
