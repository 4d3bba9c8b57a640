//! FAST corners, ranked by Shi-Tomasi score and distance from other landmarks.

use nalgebra::Vector2;

use super::patch::Patch;
use super::pyramid::{Level, Pyramid};
use crate::filter::settings::PatchSettings;
use crate::samples::ImageView;

/// Corners are thinned to one per square of this many pixels of the level they are found on.
const CELL: usize = 6;
/// Pixels by which a corner is moved to see whether its patch gets better.
const REFINE_STEP: f64 = 3.0;
/// Radius of the circle of the corner test.
const RADIUS: usize = 3;
/// Offsets of that circle, clockwise from the top.
const CIRCLE: [(isize, isize); 16] = [
    (0, -3),
    (1, -3),
    (2, -2),
    (3, -1),
    (3, 0),
    (3, 1),
    (2, 2),
    (1, 3),
    (0, 3),
    (-1, 3),
    (-2, 2),
    (-3, 1),
    (-3, 0),
    (-3, -1),
    (-2, -2),
    (-1, -3),
];

/// Detects candidates for new landmarks.
#[derive(Debug, Clone)]
pub(crate) struct CornerDetector {
    /// Best corner per cell: strength and position.
    cells: Vec<(u16, u16, u16)>,
    candidates: Vec<Candidate>,
    offsets: [isize; 16],
    threshold: u8,
    /// Of the size of the image: where it is 0 nothing is detected. Empty without one.
    mask: Vec<u8>,
    width: usize,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Candidate {
    pixel: Vector2<f64>,
    quality: f64,
    /// Squared distance to the nearest landmark, pixels.
    distance: f64,
}

/// What a new landmark must satisfy: fields of [`PatchSettings`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DetectionCriteria {
    /// Least Shi-Tomasi score of a patch.
    pub(crate) min_score: f64,
    /// Least distance from other landmarks, pixels.
    pub(crate) min_distance: f64,
    /// Distance below which other landmarks lower the rank, pixels.
    pub(crate) penalty_distance: f64,
}

impl From<&PatchSettings> for DetectionCriteria {
    fn from(settings: &PatchSettings) -> Self {
        Self {
            min_score: settings.min_score,
            min_distance: settings.min_distance,
            penalty_distance: settings.penalty_distance,
        }
    }
}

impl CornerDetector {
    pub(crate) fn new(level: &Level, threshold: u8) -> Self {
        let cells = level.width.div_ceil(CELL) * level.height.div_ceil(CELL);
        let width = level.width as isize;
        let offsets = CIRCLE.map(|(x, y)| y * width + x);
        let candidates = Vec::with_capacity(cells);
        Self { cells: vec![(0, 0, 0); cells], candidates, offsets, threshold, mask: Vec::new(), width: 0 }
    }

    /// Nothing is detected from here on where the mask is 0.
    pub(crate) fn set_mask(&mut self, mask: &ImageView) {
        (self.mask, self.width) = (mask.data.to_vec(), mask.width);
    }

    /// Whether there is a mask.
    pub(crate) fn has_mask(&self) -> bool {
        !self.mask.is_empty()
    }

    /// Whether a pixel of the image is masked.
    pub(crate) fn is_masked(&self, pixel: &Vector2<f64>) -> bool {
        let [x, y] = [pixel.x, pixel.y].map(|v| v.round().max(0.0) as usize);
        x < self.width && self.mask.get(y * self.width + x) == Some(&0)
    }

    /// Finds corners and scores the patches around them; those near `present` pixels are left out.
    pub(crate) fn detect(
        &mut self,
        pyramid: &Pyramid,
        present: &(impl Iterator<Item = Vector2<f64>> + Clone),
        criteria: &DetectionCriteria,
    ) {
        let level = pyramid.corner_level();
        self.fast_corners(level);
        self.candidates.clear();
        for &(strength, x, y) in &self.cells {
            if strength == 0 {
                continue;
            }
            let pixel = level.pixel(&Vector2::new(f64::from(x), f64::from(y)));
            if self.is_masked(&pixel) {
                continue;
            }
            let distance = present.clone().map(|p| (p - pixel).norm_squared()).fold(f64::INFINITY, f64::min);
            if distance < criteria.min_distance * criteria.min_distance {
                continue;
            }
            // The finer level's patch around a coarse corner may miss the corner until it is refined.
            let score = Patch::extract(pyramid, &pixel).map(|patch| patch.shi_tomasi_score());
            let Some(score) = score.or_else(|| refine_corner(pyramid, &pixel).map(|best| best.0)) else { continue };
            self.candidates.push(Candidate { pixel, quality: score.max(0.0).sqrt().sqrt(), distance });
        }
    }

    /// The best candidate left, and its patch: a high score, far from all landmarks. Each is given once.
    pub(crate) fn take_best(
        &mut self,
        pyramid: &Pyramid,
        criteria: &DetectionCriteria,
    ) -> Option<(Vector2<f64>, Patch)> {
        let far = criteria.penalty_distance * criteria.penalty_distance;
        let near = criteria.min_distance * criteria.min_distance;
        let value = |c: &Candidate| c.quality * (c.distance / far).min(1.0);
        loop {
            // The first of equals, so that the order does not depend on how they are compared.
            let best = (0..self.candidates.len())
                .reduce(|best, k| if value(&self.candidates[k]) > value(&self.candidates[best]) { k } else { best })?;
            let pixel = self.candidates.swap_remove(best).pixel;
            let Some((score, pixel, patch)) = refine_corner(pyramid, &pixel) else { continue };
            if score < criteria.min_score || self.is_masked(&pixel) {
                continue;
            }
            self.candidates.retain_mut(|c| {
                c.distance = c.distance.min((c.pixel - pixel).norm_squared());
                c.distance >= near
            });
            return Some((pixel, patch));
        }
    }

    /// The corner test of Rosten and Drummond 2006: nine in a row of the circle all brighter, or all darker.
    fn fast_corners(&mut self, level: &Level) {
        self.cells.fill((0, 0, 0));
        let (width, threshold) = (level.width, i16::from(self.threshold));
        let columns = width.div_ceil(CELL);
        if width <= 2 * RADIUS || level.height <= 2 * RADIUS {
            return;
        }
        for y in RADIUS..level.height - RADIUS {
            for x in RADIUS..width - RADIUS {
                let at = y * width + x;
                let middle = i16::from(level.data[at]);
                let differs = |k: usize| {
                    let value = i16::from(level.data[at.wrapping_add_signed(self.offsets[k])]);
                    (value - middle).abs() > threshold
                };
                // Of two opposite pixels at least one belongs to any nine in a row.
                if !(differs(0) || differs(8)) || !(differs(4) || differs(12)) {
                    continue;
                }
                let (mut brighter, mut darker, mut strength) = (0_u32, 0_u32, 0_u16);
                for (k, offset) in self.offsets.iter().enumerate() {
                    let difference = i16::from(level.data[at.wrapping_add_signed(*offset)]) - middle;
                    if difference > threshold {
                        brighter |= 1 << k;
                    } else if difference < -threshold {
                        darker |= 1 << k;
                    }
                    strength += difference.unsigned_abs();
                }
                if nine_in_a_row(brighter) || nine_in_a_row(darker) {
                    let cell = &mut self.cells[y / CELL * columns + x / CELL];
                    if strength > cell.0 {
                        *cell = (strength, x as u16, y as u16);
                    }
                }
            }
        }
    }
}

/// The best patch about a corner, which is known to a pixel of a coarse level only, with its score.
fn refine_corner(pyramid: &Pyramid, corner: &Vector2<f64>) -> Option<(f64, Vector2<f64>, Patch)> {
    let offsets = (-1..=1).flat_map(|y| (-1..=1).map(move |x| Vector2::new(f64::from(x), f64::from(y)) * REFINE_STEP));
    let patches = offsets.filter_map(|offset| {
        let pixel = corner + offset;
        Patch::extract(pyramid, &pixel).map(|patch| (patch.shi_tomasi_score(), pixel, patch))
    });
    patches.reduce(|best, other| if other.0 > best.0 { other } else { best })
}

/// Whether nine neighbours on a ring of sixteen bits are set.
fn nine_in_a_row(ring: u32) -> bool {
    let twice = ring | ring << 16;
    let two = twice & twice >> 1;
    let four = two & two >> 2;
    let eight = four & four >> 4;
    eight & twice >> 8 != 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_corner_differs_by_more_than_the_threshold() {
        // A bright square from (10, 10) on: nine and more of the circle about its corner are darker, by so much.
        let strongest = |contrast: u8, sign: bool| {
            let bright = |x: usize, y: usize| (x >= 10 && y >= 10) == sign;
            let data = (0..20 * 20).map(|k| if bright(k % 20, k / 20) { 100 + contrast } else { 100 }).collect();
            let level = Level { width: 20, height: 20, data, scale: 1.0, offset: 0.0 };
            let mut detector = CornerDetector::new(&level, 20);
            detector.fast_corners(&level);
            let best = *detector.cells.iter().max().expect("cells");
            (best.0 > 0).then_some((best.1, best.2))
        };
        for sign in [true, false] {
            assert_eq!(strongest(20, sign), None);
            assert_eq!(strongest(21, sign), Some((10, 10)));
        }
    }
}
