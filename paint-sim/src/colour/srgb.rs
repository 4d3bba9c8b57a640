//! The transfer curve of sRGB, and its bytes.

use std::sync::LazyLock;

/// The transfer curve of IEC 61966-2-1, from linear to encoded; neither is clipped.
pub fn encode_srgb(linear: f64) -> f64 {
    if linear <= 0.0031308 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// [`encode_srgb`] to 0..=255, and whether the component had to be clipped.
pub fn encode_srgb8(linear: f64) -> (u8, bool) {
    static STEPS: LazyLock<Srgb8Steps> = LazyLock::new(Srgb8Steps::new);
    let clipped = !(0.0..=1.0).contains(&linear);
    (STEPS.encode(linear.clamp(0.0, 1.0)), clipped)
}

/// The inverse of [`encode_srgb`].
pub fn decode_srgb(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// The inverse of [`encode_srgb8`]: a component 0..=255 to linear 0..=1.
pub fn decode_srgb8(encoded: u8) -> f64 {
    decode_srgb(f64::from(encoded) / 255.0)
}

/// [`encode_srgb8`] in single precision, without a branch on the data.
pub(crate) struct Srgb8Table {
    /// Least number with a code above so much; with one above the last there is none.
    next: [f32; 256],
    start: [u8; Srgb8Steps::PARTS + 1],
}

impl Srgb8Table {
    pub(crate) fn get() -> &'static Self {
        static TABLE: LazyLock<Srgb8Table> = LazyLock::new(|| {
            let steps = Srgb8Steps::new();
            // The least number of single precision that is not less.
            let narrow = |least: f64| {
                let rounded = least as f32;
                if f64::from(rounded) < least { rounded.next_up() } else { rounded }
            };
            let next =
                std::array::from_fn(|code| steps.least.get(code + 1).map_or(f32::INFINITY, |&least| narrow(least)));
            Srgb8Table { next, start: steps.start }
        });
        &TABLE
    }

    /// Least component with each code.
    #[cfg(feature = "gpu")]
    pub(crate) fn least(&self) -> impl Iterator<Item = f32> {
        std::iter::once(0.0).chain(self.next).take(256)
    }

    /// The byte of a linear component, clipped.
    pub(crate) fn encode(&self, linear: f32) -> u8 {
        let linear = linear.clamp(0.0, 1.0);
        let start = self.start[(linear * Srgb8Steps::PARTS as f32) as usize];
        start + u8::from(linear >= self.next[usize::from(start)])
    }
}

/// Where the rounded curve steps: a picture asks for it once per channel of each pixel, and a power costs more than a look.
struct Srgb8Steps {
    /// Least number from 0 to 1 with a code of at least so much.
    least: [f64; 256],
    /// Code at the low end of each of equal parts of 0 to 1.
    start: [u8; Self::PARTS + 1],
}

impl Srgb8Steps {
    /// More than the codes per unit where they are closest, 255 times 12.92: at most one steps within a part.
    const PARTS: usize = 4096;

    fn new() -> Self {
        let code = |linear: f64| (encode_srgb(linear) * 255.0).round() as u8;
        let least = std::array::from_fn(|wanted| {
            // Positive numbers are in the order of their bits.
            let (mut low, mut high) = (0_u64, 1.0_f64.to_bits());
            while low < high {
                let middle = low + (high - low) / 2;
                if usize::from(code(f64::from_bits(middle))) < wanted { low = middle + 1 } else { high = middle }
            }
            f64::from_bits(low)
        });
        Self { least, start: std::array::from_fn(|part| code(part as f64 / Self::PARTS as f64)) }
    }

    fn encode(&self, linear: f64) -> u8 {
        let start = self.start[(linear * Self::PARTS as f64) as usize];
        let next = self.least.get(usize::from(start) + 1);
        start + u8::from(next.is_some_and(|&next| linear >= next))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On both sides of every step, to the last bit.
    #[test]
    fn both_precisions_give_the_same_code() {
        let steps = Srgb8Steps::new();
        for least in steps.least {
            let step = least as f32;
            for linear in [step.next_down(), step, step.next_up()] {
                assert_eq!(Srgb8Table::get().encode(linear), encode_srgb8(f64::from(linear)).0, "{linear}");
            }
        }
        assert_eq!(Srgb8Table::get().encode(f32::NAN), 0);
    }
}
