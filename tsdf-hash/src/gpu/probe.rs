//! Whether a device computes as IEEE 754 says: asked before it is trusted with a map.

use wgpu::BufferUsages;

use crate::error::Error;
use crate::gpu::device::Device;
use crate::hashing::mix64;
use crate::rounding::ROUNDER;

const SOURCE: &str = concat!(include_str!("exact.wgsl"), include_str!("probe.wgsl"));
/// Values that one pair yields.
const RESULTS: usize = 8;
/// Pairs that a device is asked when it is opened.
const PAIRS: usize = 4096;

/// Refuses a device that would not produce the map's bytes.
pub(super) fn check(device: &Device) -> Result<(), Error> {
    let pairs: Vec<[f32; 2]> = (0..PAIRS as u64).map(pair).collect();
    for (pair, found) in pairs.iter().zip(ask(device, &pairs)?) {
        let expected = processor(*pair);
        if found != expected.map(f32::to_bits) {
            let found = found.map(f32::from_bits);
            let what =
                format!("{} computes {found:?} from {pair:?}, where IEEE 754 asks for {expected:?}", device.name);
            return Err(Error::Device { what });
        }
    }
    Ok(())
}

/// Positive floats: every fourth pair with mantissas near their ends, where roundings are hardest.
fn pair(n: u64) -> [f32; 2] {
    let word = mix64(n + 1);
    let float = |word: u64| {
        let mantissa = match word >> 32 & 3 {
            _ if !n.is_multiple_of(4) => word,
            0 => word & 7,
            1 => !(word & 7),
            2 => 1 << (word % 23),
            _ => !(1 << (word % 23)),
        };
        // Exponents within 2^±24 of one.
        f32::from_bits(((103 + (word >> 40 & 63) % 49) << 23 | mantissa & 0x7f_ffff) as u32)
    };
    [float(word), float(mix64(word))]
}

/// The same as the program of `probe.wgsl`.
fn processor([a, b]: [f32; 2]) -> [f32; RESULTS] {
    let scaled = a * 7.0;
    let integers = [a.to_bits().cast_signed(), b.to_bits().cast_signed().wrapping_neg()].map(|i| i as f32);
    let sum = (a * b + b) - b * b;
    [sum, scaled - ((scaled + ROUNDER) - ROUNDER), a / b, a.sqrt(), integers[0], integers[1], -1.0 / b, b.sqrt()]
}

/// The words that the device computes for each pair.
fn ask(device: &Device, pairs: &[[f32; 2]]) -> Result<Vec<[u32; RESULTS]>, Error> {
    let bytes = 4 * RESULTS * pairs.len();
    let uniform = device.buffer("probe settings", 16, BufferUsages::UNIFORM | BufferUsages::COPY_DST)?;
    let input = device.buffer("probe input", 8 * pairs.len(), BufferUsages::STORAGE | BufferUsages::COPY_DST)?;
    let output = device.buffer("probe output", bytes, BufferUsages::STORAGE | BufferUsages::COPY_SRC)?;
    let staging = device.buffer("probe staging", bytes, BufferUsages::MAP_READ | BufferUsages::COPY_DST)?;
    let program = device.program("probe", SOURCE, &[false, true])?;
    device.write(&uniform, 0, [pairs.len() as u32, 0, 0, 0].into_iter())?;
    let words: Vec<u32> = pairs.as_flattened().iter().map(|x| x.to_bits()).collect();
    device.write(&input, 0, words.into_iter())?;
    let mut commands = device.commands();
    let group = device.bind(&program, 16, &uniform, &[&input, &output]);
    program.dispatch(&mut commands, &group, 0, [pairs.len().div_ceil(64) as u32, 1]);
    commands.copy_buffer_to_buffer(&output, 0, &staging, 0, bytes as u64);
    device.run_and_read(commands, &staging, bytes, |words| {
        words.as_chunks().0.iter().map(|result| result.map(u32::from_ne_bytes)).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::{ask, pair, processor};
    use crate::gpu::device::Device;
    use crate::gpu::test_adapter::options;

    /// Four million pairs against the processor, and values known without either.
    #[test]
    fn arithmetic_is_that_of_the_processor() {
        let Some(options) = options() else { return };
        let device = Device::open(&options).unwrap();
        for batch in 0..32_u64 {
            let mut pairs: Vec<_> = (0..1 << 17).map(|n| pair(n + 1_000_000 * (batch + 1))).collect();
            pairs[0] = [4.0, 16.0];
            let found = ask(&device, &pairs).unwrap();
            assert_eq!([2, 3, 6, 7].map(|k| f32::from_bits(found[0][k])), [0.25, 2.0, -0.0625, 4.0]);
            for (pair, found) in pairs.iter().zip(found) {
                assert_eq!(found.map(f32::from_bits), processor(*pair), "{pair:?}");
            }
        }
    }
}
