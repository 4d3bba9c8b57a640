//! Small blurry images of depth beside intensity, as PTAM keeps them (Klein and Murray 2008), and how alike two of them are.

use crate::tracking::image_level::ImageLevel;

/// Images are compared shifted by so many steps of two pixels, across and down.
const SHIFTS: [i32; 2] = [6, 3];
const STEP: i32 = 2;

/// Inverse depth and intensity, each of zero mean; intensity is empty without colour.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SmallImage {
    pub(crate) width: usize,
    /// Focal lengths, pixels.
    pub(crate) focal: [f32; 2],
    pub(crate) channels: [Vec<f32>; 2],
}

/// How alike two images are, and where.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Likeness {
    /// Mean of the correlations of the channels that both have, `-1..=1`.
    pub(crate) correlation: f32,
    /// What one sees at a pixel the other sees so many pixels farther right and down.
    pub(crate) shift: [f32; 2],
}

impl SmallImage {
    pub(crate) fn new(level: &ImageLevel) -> Self {
        Self {
            width: level.width,
            focal: level.focal,
            channels: [centred(&level.omega, |omega| omega > 0.0), centred(&level.intensity, f32::is_finite)],
        }
    }

    /// The best of all shifts.
    pub(crate) fn likeness(&self, other: &Self) -> Likeness {
        let mut best = Likeness { correlation: -1.0, shift: [0.0; 2] };
        for down in -SHIFTS[1]..=SHIFTS[1] {
            for across in -SHIFTS[0]..=SHIFTS[0] {
                let shift = [STEP * across, STEP * down];
                let correlation = self.correlation(other, shift);
                if correlation > best.correlation {
                    best = Likeness { correlation, shift: shift.map(|s| s as f32) };
                }
            }
        }
        best
    }

    /// Over what both see when the other is shifted.
    fn correlation(&self, other: &Self, shift: [i32; 2]) -> f32 {
        let found =
            [0, 1].map(|k| correlation(&self.channels[k], &other.channels[k], [self.width, other.width], shift));
        let known: Vec<f32> = found.into_iter().flatten().collect();
        if known.is_empty() { -1.0 } else { known.iter().sum::<f32>() / known.len() as f32 }
    }
}

fn correlation(a: &[f32], b: &[f32], [width, other]: [usize; 2], [dx, dy]: [i32; 2]) -> Option<f32> {
    if a.is_empty() || a.len() != b.len() || width != other {
        return None;
    }
    let (w, h) = (width as i32, (a.len() / width) as i32);
    let (from, to) = ((-dx).max(0), (w - dx).min(w));
    let [mut ab, mut aa, mut bb] = [0.0_f32; 3];
    for y in (-dy).max(0)..(h - dy).min(h) {
        let one = &a[(y * w + from) as usize..(y * w + to) as usize];
        let two = &b[((y + dy) * w + from + dx) as usize..((y + dy) * w + to + dx) as usize];
        for (a, b) in one.iter().zip(two) {
            ab += a * b;
            aa += a * a;
            bb += b * b;
        }
    }
    Some(ab / (aa * bb).sqrt().max(1e-12))
}

/// Zero mean over the values that are known; 0 elsewhere.
fn centred(values: &[f32], known: impl Fn(f32) -> bool) -> Vec<f32> {
    let count = values.iter().filter(|v| known(**v)).count().max(1) as f32;
    let mean = values.iter().filter(|v| known(**v)).sum::<f32>() / count;
    values.iter().map(|&v| if known(v) { v - mean } else { 0.0 }).collect()
}
