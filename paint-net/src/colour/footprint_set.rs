//! What many sprays leave, in little memory.

use crate::error::Error;
use crate::painters::SurfaceFootprint;

/// Steps between nothing and the deepest place of a footprint.
const STEPS: f32 = 65_535.0;
/// A gap of as many pixels takes less room than the beginning of another run.
const GAP: usize = 4;

/// [Footprints](SurfaceFootprint) of many sprays as runs of neighbouring pixels, depths in 65,535 steps of a footprint's deepest place: two bytes a
/// pixel instead of eight, and sums over them run along the pixels. Ours.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FootprintSet {
    sprays: Vec<SprayRuns>,
    runs: Vec<Run>,
    depths: Vec<u16>,
    pixels: usize,
}

/// Where the runs and depths of a spray begin, and the depth of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
struct SprayRuns {
    run: usize,
    depth: usize,
    step: f32,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Run {
    pixel: u32,
    length: u32,
}

impl FootprintSet {
    /// Adds what a spray leaves, in any order of its pixels; depths on the same pixel add up.
    ///
    /// # Errors
    /// [`Error::Pixel`] for a depth that is negative or not finite.
    pub fn push(&mut self, mut footprint: SurfaceFootprint) -> Result<(), Error> {
        if let Some(&(x, depth)) = footprint.iter().find(|(_, depth)| !(*depth >= 0.0 && depth.is_finite())) {
            let value = f64::from(depth);
            return Err(Error::Pixel { what: "footprint", x: x as usize, y: 0, value, range: "a depth of 0 or more" });
        }
        footprint.sort_by_key(|(pixel, _)| *pixel);
        footprint.dedup_by(|next, one| {
            let same = next.0 == one.0;
            one.1 += if same { next.1 } else { 0.0 };
            same
        });
        footprint.retain(|(_, depth)| *depth > 0.0);
        let deepest = footprint.iter().fold(0.0, |most: f32, (_, depth)| most.max(*depth));
        if deepest.is_infinite() {
            let (value, range) = (f64::from(deepest), "depths of a pixel with a finite sum");
            return Err(Error::Pixel { what: "footprint", x: 0, y: 0, value, range });
        }
        self.sprays.push(SprayRuns { run: self.runs.len(), depth: self.depths.len(), step: deepest / STEPS });
        let first = self.runs.len();
        for (pixel, depth) in footprint {
            match self.runs[first..].last_mut() {
                Some(run) if ((pixel - run.pixel - run.length) as usize) < GAP => {
                    self.depths.resize(self.depths.len() + (pixel - run.pixel - run.length) as usize, 0);
                    run.length = pixel - run.pixel + 1;
                }
                _ => self.runs.push(Run { pixel, length: 1 }),
            }
            self.depths.push((depth / deepest * STEPS).round() as u16);
            self.pixels = self.pixels.max(pixel as usize + 1);
        }
        Ok(())
    }

    /// The footprints of a list.
    ///
    /// # Errors
    /// As [`push`](Self::push).
    pub fn of(footprints: impl IntoIterator<Item = SurfaceFootprint>) -> Result<Self, Error> {
        let mut set = Self::default();
        footprints.into_iter().try_for_each(|footprint| set.push(footprint))?;
        set.depths.shrink_to_fit();
        set.runs.shrink_to_fit();
        Ok(set)
    }

    /// How many sprays there are.
    pub fn len(&self) -> usize {
        self.sprays.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.sprays.is_empty()
    }

    /// Pixels that a picture must have for all of them to lie on it.
    pub fn pixels(&self) -> usize {
        self.pixels
    }

    /// Pixels and depths of a spray per unit of its volume.
    pub fn iter(&self, spray: usize) -> impl Iterator<Item = (usize, f32)> + '_ {
        let step = self.sprays[spray].step;
        self.spans(spray).flat_map(move |(pixel, depths)| {
            depths.iter().enumerate().map(move |(k, depth)| (pixel + k, step * f32::from(*depth)))
        })
    }

    /// Whether a spray leaves nothing.
    pub(super) fn leaves_nothing(&self, spray: usize) -> bool {
        self.sprays[spray].step == 0.0
    }

    /// `plane += S v` for one spray.
    pub(super) fn deposit(&self, spray: usize, volume: f64, plane: &mut [f32]) {
        let scale = volume as f32 * self.sprays[spray].step;
        for (pixel, depths) in self.spans(spray) {
            for (sum, depth) in plane[pixel..pixel + depths.len()].iter_mut().zip(depths) {
                *sum += scale * f32::from(*depth);
            }
        }
    }

    /// `Sᵀ field` for one spray.
    pub(super) fn gather(&self, spray: usize, field: &[f32]) -> f64 {
        let mut sum = 0.0;
        for (pixel, depths) in self.spans(spray) {
            sum += product(&field[pixel..pixel + depths.len()], depths);
        }
        f64::from(self.sprays[spray].step * sum)
    }

    /// The same footprints on a coarser picture: the mean over the pixels in each of its `groups`, `group` of each pixel. None lies beside those.
    ///
    /// # Errors
    /// As [`push`](Self::push).
    pub(super) fn coarse(&self, group: &[u32], groups: usize) -> Result<Self, Error> {
        let mut sizes = vec![0.0_f32; groups];
        for &g in group {
            sizes[g as usize] += 1.0;
        }
        let mean = |(pixel, depth): (usize, f32)| (group[pixel], depth / sizes[group[pixel] as usize]);
        Self::of((0..self.len()).map(|spray| self.iter(spray).map(mean).collect()))
    }

    fn spans(&self, spray: usize) -> impl Iterator<Item = (usize, &[u16])> {
        let SprayRuns { run, mut depth, .. } = self.sprays[spray];
        let end = self.sprays.get(spray + 1).map_or(self.runs.len(), |next| next.run);
        self.runs[run..end].iter().map(move |run| {
            let from = depth;
            depth += run.length as usize;
            (run.pixel as usize, &self.depths[from..depth])
        })
    }
}

/// Sums that run side by side: one alone would wait for itself at every step.
const LANES: usize = 8;

#[inline(always)]
fn product(values: &[f32], depths: &[u16]) -> f32 {
    let mut sums = [0.0_f32; LANES];
    let (values, depths) = (values.chunks_exact(LANES), depths.chunks_exact(LANES));
    let rest = values.remainder().iter().zip(depths.remainder());
    let rest: f32 = rest.map(|(value, depth)| value * f32::from(*depth)).sum();
    for (values, depths) in values.zip(depths) {
        for lane in 0..LANES {
            sums[lane] += values[lane] * f32::from(depths[lane]);
        }
    }
    sums.iter().sum::<f32>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    fn footprints() -> Vec<SurfaceFootprint> {
        vec![
            // Two shots on the same pixels, in any order, with a short and a long gap.
            vec![(9, 0.5), (3, 1.0), (4, 0.25), (3, 0.5), (30, 0.125), (6, 1e-9)],
            Vec::new(),
            vec![(2, 0.0)],
            vec![(0, 3.0)],
        ]
    }

    #[test]
    fn footprints_are_those_of_the_lists() {
        let set = FootprintSet::of(footprints()).unwrap();
        assert_eq!((set.len(), set.pixels()), (4, 31));
        assert_eq!([0, 1, 2, 3].map(|spray| set.leaves_nothing(spray)), [false, true, true, false]);
        let field: Vec<f32> = (0..31).map(|k| (1.0 + k as f32).sqrt()).collect();
        for (spray, footprint) in footprints().iter().enumerate() {
            let mut expected = [0.0_f32; 31];
            for &(pixel, depth) in footprint {
                expected[pixel as usize] += depth;
            }
            let mut plane = [0.0_f32; 31];
            set.deposit(spray, 2.0, &mut plane);
            let deepest = expected.iter().fold(0.0_f32, |a, b| a.max(*b));
            let near = |(a, b): (&f32, &f32)| (a - 2.0 * b).abs() <= 2.0 * deepest / STEPS;
            assert!(plane.iter().zip(&expected).all(near), "{plane:?} {expected:?}");
            let gathered: f32 = expected.iter().zip(&field).map(|(a, b)| a * b).sum();
            assert!((set.gather(spray, &field) - f64::from(gathered)).abs() < 1e-4);
        }
    }

    #[test]
    fn a_coarse_footprint_holds_the_mean_of_its_pixels() {
        let set = FootprintSet::of([vec![(0, 1.0), (1, 2.0), (2, 4.0), (4, 6.0)]]).unwrap();
        let coarse = set.coarse(&[0, 0, 1, 1, 1], 2).unwrap();
        let found: Vec<(usize, f32)> = coarse.iter(0).collect();
        assert!((found[0].1 - 1.5).abs() < 1e-3 && (found[1].1 - 10.0 / 3.0).abs() < 1e-3, "{found:?}");
    }

    #[test]
    fn depths_that_make_no_sense_are_refused() {
        for depth in [-1.0, f32::NAN, f32::INFINITY] {
            assert!(matches!(FootprintSet::of([vec![(3, depth)]]), Err(Error::Pixel { x: 3, .. })));
        }
        assert!(FootprintSet::of([vec![(3, f32::MAX), (3, f32::MAX)]]).is_err());
    }
}
