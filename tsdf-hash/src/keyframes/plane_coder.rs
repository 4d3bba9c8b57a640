//! Images of 16 bits in few bytes: each pixel is predicted as on a plane, the differences are written in groups of as many bits as needed.

use crate::keyframes::bit_stream::{BitReader, BitWriter};

/// Differences that share their number of bits.
const GROUP: usize = 16;
/// Bits of that number.
const WIDTH_BITS: u32 = 5;

/// Values `0..=65535` of an image, row-major; 0 stands for "nothing measured".
pub(crate) fn encode(values: &[i32], width: usize) -> Vec<u8> {
    let mut out = BitWriter::default();
    let mut group = Vec::with_capacity(GROUP);
    for at in 0..values.len() {
        let difference = (values[at] - predicted(values, at, width)).wrapping_shl(15) >> 15;
        group.push(((difference << 1) ^ (difference >> 31)) as u32 & 0x1_ffff);
        if group.len() == GROUP || at + 1 == values.len() {
            let bits = group.iter().map(|v| u32::BITS - v.leading_zeros()).max().unwrap_or(0);
            out.put(bits, WIDTH_BITS);
            group.drain(..).for_each(|v| out.put(v, bits));
        }
    }
    out.finish()
}

/// The values again; `None` if the bytes are no image of `size` pixels.
pub(crate) fn decode(bytes: &[u8], width: usize, size: usize) -> Option<Vec<i32>> {
    let mut input = BitReader::new(bytes);
    let mut values = Vec::with_capacity(size);
    let mut bits = 0;
    for at in 0..size {
        if at.is_multiple_of(GROUP) {
            bits = input.take(WIDTH_BITS)?;
        }
        let coded = input.take(bits)? as i32;
        let difference = (coded >> 1) ^ -(coded & 1);
        let value = predicted(&values, at, width) + difference;
        // The difference is known modulo 2^17, the value lies in 16 bits.
        values.push(value.rem_euclid(1 << 17));
    }
    values.iter().all(|v| *v <= 0xffff).then_some(values)
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
