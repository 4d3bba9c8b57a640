//! The depth of a keyframe in few bytes: inverse depth of 16 bits, predicted as on a plane, on which it is linear.

use crate::images::Intrinsics;
use crate::keyframes::bit_stream::{BitReader, BitWriter};
use crate::tracking::image_level::ImageLevel;

/// Differences that share their number of bits.
const GROUP: usize = 16;
/// Bits of that number.
const WIDTH_BITS: u32 = 5;

/// A depth image, at most about 320 pixels wide.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CompressedDepth {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) intrinsics: Intrinsics,
    /// Inverse depth of the largest value, 1/m.
    pub(crate) most: f32,
    pub(crate) bytes: Vec<u8>,
}

impl CompressedDepth {
    pub(crate) fn new(level: &ImageLevel) -> Self {
        let most = level.omega.iter().fold(1e-6_f32, |most, omega| most.max(*omega));
        let scale = f32::from(u16::MAX) / most;
        // 0 is "no depth": what was measured is 1 at least.
        let values: Vec<i32> =
            level.omega.iter().map(|o| if *o > 0.0 { ((o * scale).round() as i32).max(1) } else { 0 }).collect();
        let mut out = BitWriter::default();
        let mut group = Vec::with_capacity(GROUP);
        for at in 0..values.len() {
            let difference = (values[at] - predicted(&values, at, level.width)).wrapping_shl(15) >> 15;
            group.push(((difference << 1) ^ (difference >> 31)) as u32 & 0x1_ffff);
            if group.len() == GROUP || at + 1 == values.len() {
                let bits = group.iter().map(|v| u32::BITS - v.leading_zeros()).max().unwrap_or(0);
                out.put(bits, WIDTH_BITS);
                group.drain(..).for_each(|v| out.put(v, bits));
            }
        }
        let [fx, fy] = level.focal.map(f64::from);
        let [cx, cy] = level.centre.map(f64::from);
        let intrinsics = Intrinsics { fx, fy, cx, cy };
        Self { width: level.width, height: level.height, intrinsics, most, bytes: out.finish() }
    }

    /// Metres, 0 where there is none; `None` if the bytes are no image of this size.
    pub(crate) fn metres(&self) -> Option<Vec<f32>> {
        let scale = self.most / f32::from(u16::MAX);
        let (size, mut input) = (self.width * self.height, BitReader::new(&self.bytes));
        let mut values = Vec::with_capacity(size);
        let mut bits = 0;
        for at in 0..size {
            if at.is_multiple_of(GROUP) {
                bits = input.take(WIDTH_BITS)?;
            }
            let coded = input.take(bits)? as i32;
            let difference = (coded >> 1) ^ -(coded & 1);
            let value = predicted(&values, at, self.width) + difference;
            // The difference is known modulo 2^17, the value lies in 16 bits.
            values.push(value.rem_euclid(1 << 17));
        }
        values.into_iter().map(|v| (v <= 0xffff).then(|| if v > 0 { 1.0 / (v as f32 * scale) } else { 0.0 })).collect()
    }
}

/// The value on the plane through the neighbours left, above, and between them.
fn predicted(values: &[i32], at: usize, width: usize) -> i32 {
    let (column, row) = (at % width, at / width);
    match (column > 0, row > 0) {
        (true, true) => {
            let (left, above, between) = (values[at - 1], values[at - width], values[at - width - 1]);
            // Beside a hole or an edge the plane leads nowhere.
            if left == 0 || above == 0 || between == 0 { left } else { (left + above - between).clamp(0, 0xffff) }
        }
        (true, false) => values[at - 1],
        (false, true) => values[at - width],
        (false, false) => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level(width: usize, omega: Vec<f32>) -> ImageLevel {
        ImageLevel {
            width,
            height: omega.len() / width,
            focal: [300.0, -300.0],
            centre: [3.0, 2.0],
            omega,
            ..ImageLevel::default()
        }
    }

    #[test]
    fn depth_comes_back_to_the_step_and_planes_cost_little() {
        // A slope, an edge, holes, and the largest and smallest values beside each other.
        let omega: Vec<f32> = (0..64 * 48)
            .map(|k| match (k % 64, k / 64) {
                (20..30, 10..20) => 0.0,
                (x, _) if x < 16 => 2.0,
                (x, 30) => {
                    if x % 2 == 0 {
                        4.0
                    } else {
                        1e-4
                    }
                }
                (x, y) => 0.3 + 0.004 * x as f32 + 0.002 * y as f32,
            })
            .collect();
        let packed = CompressedDepth::new(&level(64, omega.clone()));
        assert!(packed.bytes.len() < omega.len(), "{} bytes", packed.bytes.len());
        let metres = packed.metres().unwrap();
        for (z, omega) in metres.iter().zip(&omega) {
            assert_eq!(*z > 0.0, *omega > 0.0);
            if *z > 0.0 {
                assert!((1.0 / z - omega).abs() <= 4.0 / 65535.0, "{z} {omega}");
            }
        }
        let mut cut = packed.clone();
        cut.bytes.pop();
        assert_eq!(cut.metres(), None);
    }
}
