//! Double precision on a GPU, which WGSL does not have: computed in integers, so that its bits are the processor's on every adapter.

/// What a program in double precision begins with.
pub(crate) const DOUBLE: &str = include_str!("double.wgsl");

/// Numbers as the programs take them.
pub(crate) fn doubles(values: &[f64]) -> Vec<u8> {
    values
        .iter()
        .flat_map(|value| [value.to_bits() as u32, (value.to_bits() >> 32) as u32])
        .flat_map(u32::to_ne_bytes)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::{Input, Program, test_adapter, words};
    use rand_xoshiro::SplitMix64;
    use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};

    /// Sum, difference, product and quotient of a pair, how its numbers compare, and the first one's narrow neighbour widened.
    const PROBE: &str = "
        @group(0) @binding(0) var<uniform> settings: vec4<u32>;
        @group(0) @binding(1) var<storage, read> pairs: array<vec4<u32>>;
        @group(0) @binding(2) var<storage, read_write> results: array<vec2<u32>>;

        @compute @workgroup_size(64)
        fn probe(@builtin(global_invocation_id) id: vec3<u32>) {
            if id.x >= settings.x {
                return;
            }
            let a = pairs[id.x].xy;
            let b = pairs[id.x].zw;
            results[6u * id.x] = plus(a, b);
            results[6u * id.x + 1u] = minus(a, b);
            results[6u * id.x + 2u] = times(a, b);
            results[6u * id.x + 3u] = over(a, b);
            results[6u * id.x + 4u] = vec2(u32(is_less(a, b)), u32(is_at_most(a, b)));
            results[6u * id.x + 5u] = widened(bitcast<f32>(0x3f800000u | (a.x & 0x807fffffu)));
        }";

    /// Numbers of all kinds: any bits, near one another, small integers, at the ends of every range.
    fn number(rng: &mut SplitMix64) -> f64 {
        let word = rng.next_u64();
        let ends = [
            0,
            1,
            2,
            0x000f_ffff_ffff_ffff,
            0x0010_0000_0000_0000,
            0x7fef_ffff_ffff_ffff,
            0x7ff0_0000_0000_0000,
            u64::MAX >> 1,
        ];
        let sign = word << 63;
        match word >> 56 & 7 {
            0 => f64::from_bits(rng.next_u64()),
            1 => f64::from_bits(ends[(word >> 8 & 7) as usize] | sign),
            2 => f64::from((word >> 8) as i8),
            // Hardly normal, or not at all.
            3 => f64::from_bits(rng.next_u64() >> (9 + (word >> 8 & 3)) | sign),
            // Significands near their ends, where roundings are hardest.
            4 => f64::from_bits((1000 + (word >> 8 & 63)) << 52 | (word >> 16 & 7) | sign),
            5 => f64::from_bits((1000 + (word >> 8 & 63)) << 52 | ((1 << 52) - 1 - (word >> 16 & 7)) | sign),
            _ => f64::from_bits((1000 + (word >> 8 & 63)) << 52 | rng.next_u64() >> 12 | sign),
        }
    }

    #[test]
    fn arithmetic_is_that_of_the_processor() {
        let Some(options) = test_adapter::options() else { return };
        let program = Program::new(&options, &format!("{DOUBLE}{PROBE}"), "probe").unwrap();
        let mut rng = SplitMix64::seed_from_u64(1);
        let mut pairs: Vec<[f64; 2]> = (0..1 << 20).map(|_| [number(&mut rng), number(&mut rng)]).collect();
        // Sums that nearly vanish.
        for pair in pairs.iter_mut().step_by(5) {
            pair[1] = -f64::from_bits(pair[0].to_bits() ^ (1 << (rng.next_u64() % 53)));
        }
        // Known without either.
        pairs[0] = [1.5, -0.25];
        let uniform = words(&[pairs.len() as u32, 0, 0, 0]);
        let groups = pairs.len().div_ceil(64);
        let found =
            program.run(&uniform, &[Input::Sent(&doubles(pairs.as_flattened()))], groups, 12 * pairs.len()).unwrap();
        let found: Vec<u64> =
            found.as_chunks().0.iter().map(|[low, high]| u64::from(*low) | u64::from(*high) << 32).collect();
        assert_eq!([0, 1, 2, 3].map(|k| f64::from_bits(found[k])), [1.25, 1.75, -0.375, -6.0]);
        let same = |a: u64, b: f64| a == b.to_bits() || (f64::from_bits(a).is_nan() && b.is_nan());
        for ([a, b], found) in pairs.iter().zip(found.as_chunks::<6>().0) {
            let expected = [a + b, a - b, a * b, a / b];
            assert!(
                (0..4).all(|k| same(found[k], expected[k])),
                "{a:e} {b:e}: {:?}, not {expected:?}",
                found.map(f64::from_bits)
            );
            assert_eq!(found[4], u64::from(a < b) | u64::from(a <= b) << 32, "{a:e} {b:e}");
            let narrow = f32::from_bits(0x3f80_0000 | (a.to_bits() as u32 & 0x807f_ffff));
            assert_eq!(f64::from_bits(found[5]), f64::from(narrow));
        }
    }
}
