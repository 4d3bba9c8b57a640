//! Points with normals, drawn into an image: each is a small surfel of its tangent plane.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

use crate::images::Intrinsics;

/// Half the width of a splat is a half at least, so that no point is too small for a pixel, and at most this, pixels: what is nearer than a few voxels is drawn with gaps.
const MOST_REACH: f64 = 16.0;
/// Planes seen more steeply than this cosine are not continued to the pixels beside: 84 degrees, as in fusion.
const GRAZING: f64 = 0.1;

/// The camera that points are drawn for.
pub(crate) struct Target {
    k: Intrinsics,
    size: (usize, usize),
    rotation: Matrix3<f64>,
    camera: Point3<f64>,
    pub(crate) depths: [f64; 2],
}

/// A point in the image.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Splat {
    /// Where it projects to, pixels.
    at: [f32; 2],
    /// Inverse depth of its plane there, 1/m, and the change of that per pixel: linear, since it is a plane.
    inverse: f32,
    slope: [f32; 2],
    /// The pixels that it covers, `[first, last]` along a row and along a column.
    pixels: [[u16; 2]; 2],
    score: f32,
    /// What the caller knows it by.
    source: u32,
}

/// The splat that a pixel shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Shown {
    pub(crate) inverse: f32,
    pub(crate) score: f32,
    /// Squared distance from the point to the centre of the pixel, pixels.
    apart: f32,
    splat: u32,
}

impl Shown {
    const NONE: Self = Self { inverse: 0.0, score: f32::NEG_INFINITY, apart: f32::INFINITY, splat: u32::MAX };

    fn is_none(&self) -> bool {
        self.splat == u32::MAX
    }

    /// Higher score, then nearer to the centre, then earlier: a total order, so that ties leave nothing to chance.
    fn beats(&self, other: &Self) -> bool {
        (self.score, -self.apart, other.splat) > (other.score, -other.apart, self.splat)
    }
}

impl Target {
    pub(crate) fn new(
        k: &Intrinsics,
        size: (usize, usize),
        world_from_camera: &Isometry3<f64>,
        depths: [f64; 2],
    ) -> Self {
        let rotation = world_from_camera.rotation.to_rotation_matrix().into_inner().transpose();
        Self { k: *k, size, rotation, camera: world_from_camera.translation.vector.into(), depths }
    }

    /// From the camera to a point, in its own axes.
    pub(crate) fn in_camera(&self, point_in_world: &Point3<f64>) -> Vector3<f64> {
        self.rotation * (point_in_world - self.camera)
    }

    /// A surfel of surface in the image; `None` if it is not in the image or its range of depths, or faces away.
    pub(crate) fn splat(&self, surfel: &Surfel, score: f32, source: u32) -> Option<Splat> {
        let p = self.in_camera(&surfel.point);
        let n = self.rotation * surfel.normal;
        let facing = -n.dot(&p);
        // Comparisons that a NaN fails.
        let seen = p.z >= self.depths[0] && p.z <= self.depths[1] && facing > 0.0;
        if !seen {
            return None;
        }
        let inverse = 1.0 / p.z;
        let at = [self.k.fx * p.x * inverse + self.k.cx, self.k.fy * p.y * inverse + self.k.cy];
        let cosine = facing / p.norm();
        // n · (r / w) = n · p along a ray r with r.z = 1: w = n · r / n · p.
        let slope =
            if cosine < GRAZING { [0.0; 2] } else { [-n.x / (facing * self.k.fx), -n.y / (facing * self.k.fy)] };
        let stretch = (cosine / surfel.cosine).clamp(1.0, surfel.stretch);
        let reach = (0.5 * focal(&self.k) * surfel.size * stretch * inverse).clamp(0.5, MOST_REACH);
        let pixels = [pixels(at[0], reach, self.size.0)?, pixels(at[1], reach, self.size.1)?];
        let [at, slope] = [at, slope].map(|pair| pair.map(|c| c as f32));
        Some(Splat { at, inverse: inverse as f32, slope, pixels, score, source })
    }
}

/// A small surfel of a surface.
pub(crate) struct Surfel {
    pub(crate) point: Point3<f64>,
    pub(crate) normal: Vector3<f64>,
    /// Its width, metres.
    pub(crate) size: f64,
    /// The cosine to its normal at which it was seen that wide; seen less steeply it is wider...
    pub(crate) cosine: f64,
    /// ...but not more than this many times.
    pub(crate) stretch: f64,
}

/// The pixels `first..=last` with centres within `reach` of a point, of `size` along an axis; `None` if there is none.
fn pixels(at: f64, reach: f64, size: usize) -> Option<[u16; 2]> {
    let (low, high) = (at - reach, at + reach);
    if high < 0.0 || low > (size - 1) as f64 {
        return None;
    }
    // Up and down by conversions: `ceil` is a call where the processor is not known to have it.
    let low = low.max(0.0);
    let first = low as u16 + u16::from(low > f64::from(low as u16));
    let last = high.min((size - 1) as f64) as u16;
    (first <= last).then_some([first, last])
}

/// The larger focal length, pixels.
pub(crate) fn focal(k: &Intrinsics) -> f64 {
    k.fx.abs().max(k.fy.abs())
}

impl Splat {
    /// Whether the point itself lies in an image.
    pub(crate) fn inside(&self, (width, height): (usize, usize)) -> bool {
        [width, height].iter().zip(self.at).all(|(&size, at)| at >= -0.5 && at <= size as f32 - 0.5)
    }

    /// Inverse depth of the plane at a pixel.
    #[inline(always)]
    fn inverse_at(&self, x: usize, y: usize) -> f32 {
        self.inverse + self.slope[0] * (x as f32 - self.at[0]) + self.slope[1] * (y as f32 - self.at[1])
    }

    /// As a candidate for a pixel: its whole score in its own one, a share of it elsewhere.
    #[inline(always)]
    fn shown(&self, index: usize, x: usize, y: usize, share: f32) -> Shown {
        let apart = [x as f32 - self.at[0], y as f32 - self.at[1]];
        let own = apart.iter().all(|d| d.abs() <= 0.5);
        Shown {
            inverse: self.inverse_at(x, y),
            score: if own { self.score } else { self.score * share },
            apart: apart[0] * apart[0] + apart[1] * apart[1],
            splat: index as u32,
        }
    }
}

/// An image in the making, and its memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Raster {
    splats: Vec<Splat>,
    /// Inverse depths: of the nearest splat, then of the farthest that competes with it.
    limits: Vec<f32>,
    shown: Vec<Shown>,
    fills: Vec<(usize, Shown)>,
}

impl Raster {
    pub(crate) fn clear(&mut self) {
        self.splats.clear();
    }

    pub(crate) fn push(&mut self, splat: Splat) {
        self.splats.push(splat);
    }

    /// Decides what each pixel shows: of the splats that cover it, those no farther behind the nearest than `behind`
    /// (which takes and gives an inverse depth) allows compete, and the highest score wins. `share` is what remains of a
    /// score in other pixels than the point's own.
    pub(crate) fn draw(&mut self, size: (usize, usize), share: f32, behind: impl Fn(f32) -> f32) {
        let (width, height) = size;
        self.limits.clear();
        self.limits.resize(width * height, 0.0);
        self.shown.clear();
        self.shown.resize(width * height, Shown::NONE);
        for splat in &self.splats {
            each_pixel(splat, |x, y| {
                let nearest = &mut self.limits[y * width + x];
                *nearest = nearest.max(splat.inverse_at(x, y));
            });
        }
        for limit in &mut self.limits {
            *limit = behind(*limit);
        }
        for (index, splat) in self.splats.iter().enumerate() {
            each_pixel(splat, |x, y| {
                let at = y * width + x;
                let candidate = splat.shown(index, x, y, share);
                if candidate.inverse > 0.0 && candidate.inverse >= self.limits[at] && candidate.beats(&self.shown[at]) {
                    self.shown[at] = candidate;
                }
            });
        }
        self.fill(size, share, behind);
    }

    /// Closes gaps of one pixel: where the pixels on both sides, or above and below, show something, their planes go on.
    /// What has only one neighbour stays empty, so that a view drawn again and again does not grow.
    fn fill(&mut self, (width, height): (usize, usize), share: f32, behind: impl Fn(f32) -> f32) {
        self.fills.clear();
        for y in 0..height {
            for x in 0..width {
                let at = y * width + x;
                if !self.shown[at].is_none() {
                    continue;
                }
                let pair = |inside: bool, step: usize| {
                    let pair = inside.then(|| [self.shown[at - step], self.shown[at + step]]);
                    pair.filter(|pair| pair.iter().all(|shown| !shown.is_none()))
                };
                let row = pair(x > 0 && x + 1 < width, 1);
                let column = pair(y > 0 && y + 1 < height, width);
                let candidates = || {
                    row.iter().chain(&column).flatten().map(|beside| {
                        let index = beside.splat as usize;
                        let shown = self.splats[index].shown(index, x, y, share);
                        Shown { score: beside.score * share, ..shown }
                    })
                };
                let limit = behind(candidates().fold(0.0, |most, shown| shown.inverse.max(most)));
                let best = candidates()
                    .filter(|shown| shown.inverse > 0.0 && shown.inverse >= limit)
                    .fold(Shown::NONE, |best, shown| if shown.beats(&best) { shown } else { best });
                if !best.is_none() {
                    self.fills.push((at, best));
                }
            }
        }
        for &(at, shown) in &self.fills {
            self.shown[at] = shown;
        }
    }

    /// For each pixel what it shows, and the source of that.
    pub(crate) fn pixels(&self) -> impl Iterator<Item = Option<(Shown, usize)>> + '_ {
        self.shown.iter().map(|shown| {
            let splat = self.splats.get(shown.splat as usize)?;
            Some((*shown, splat.source as usize))
        })
    }
}

#[inline(always)]
fn each_pixel(splat: &Splat, mut work: impl FnMut(usize, usize)) {
    let [[left, right], [top, bottom]] = splat.pixels;
    for y in top..=bottom {
        for x in left..=right {
            work(usize::from(x), usize::from(y));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hashing::mix64;

    /// The rule, pixel by pixel, over all splats in any order.
    fn brute(splats: &[(Splat, f32)], x: usize, y: usize, share: f32, band: f32) -> Option<usize> {
        let all: Vec<(usize, f32, f32, f32)> = splats
            .iter()
            .enumerate()
            .filter_map(|(k, (s, reach))| {
                let (dx, dy) = (x as f32 - s.at[0], y as f32 - s.at[1]);
                let inverse = s.inverse + s.slope[0] * dx + s.slope[1] * dy;
                let own = dx.abs() <= 0.5 && dy.abs() <= 0.5;
                let score = if own { s.score } else { s.score * share };
                (dx.abs() <= *reach && dy.abs() <= *reach).then_some((k, 1.0 / inverse, score, dx * dx + dy * dy))
            })
            .collect();
        let nearest = all.iter().map(|c| c.1).fold(f32::INFINITY, f32::min);
        all.into_iter()
            .filter(|c| c.1 <= nearest + band)
            .min_by(|a, b| b.2.total_cmp(&a.2).then(a.3.total_cmp(&b.3)).then(a.0.cmp(&b.0)))
            .map(|c| c.0)
    }

    #[test]
    fn every_pixel_follows_the_rule() {
        let (size, band, share) = ((24, 18), 0.08, 0.9);
        let mut word = 0;
        let mut uniform = || {
            word += 1;
            (mix64(word) >> 40) as f32 / (1 << 24) as f32
        };
        let mut raster = Raster::default();
        let mut all = Vec::new();
        for _ in 0..150 {
            // Two layers with depths inside and outside of the band, few scores: ties occur.
            let depth = if uniform() < 0.5 { 1.0 } else { 1.5 } + 0.16 * uniform();
            let (at, reach) = ([uniform() * 30.0 - 3.0, uniform() * 24.0 - 3.0], 0.5 + 2.0 * uniform());
            let range = |axis: usize, size| pixels(at[axis].into(), reach.into(), size);
            let Some(pixels) = range(0, size.0).zip(range(1, size.1)) else { continue };
            let splat = Splat {
                at,
                inverse: 1.0 / depth,
                slope: [uniform() * 0.01, -uniform() * 0.01],
                pixels: [pixels.0, pixels.1],
                score: (uniform() * 3.0).floor() * 0.3 + 0.1,
                source: all.len() as u32,
            };
            all.push((splat, reach));
            raster.push(splat);
        }
        raster.draw(size, share, |nearest| nearest / (1.0 + band * nearest));
        let (mut covered, mut filled) = (0, 0);
        for (at, shown) in raster.pixels().enumerate() {
            let expected = brute(&all, at % size.0, at / size.0, share, band);
            match expected {
                Some(source) => assert_eq!(shown.map(|(_, source)| source), Some(source), "pixel {at}"),
                None => filled += usize::from(shown.is_some()),
            }
            covered += usize::from(expected.is_some());
        }
        assert!(covered > 200 && filled > 0 && covered + filled < 24 * 18, "{covered} {filled}");
    }

    #[test]
    fn gaps_close_and_borders_stay() {
        // A wall at 2 m, every other column missing, up to column 8 of 12.
        let mut raster = Raster::default();
        for (source, k) in (0_u32..).zip(0..5 * 6) {
            let at = [2 * (k % 5), k / 5];
            let pixels = at.map(|c| [c, c]);
            raster.push(Splat { at: at.map(f32::from), inverse: 0.5, slope: [0.0; 2], pixels, score: 0.8, source });
        }
        raster.draw((12, 6), 0.9, |nearest| nearest / (1.0 + 0.1 * nearest));
        for (at, shown) in raster.pixels().enumerate() {
            let expected = match at % 12 {
                9.. => None,
                x if x % 2 == 0 => Some(0.8),
                _ => Some(0.8 * 0.9_f32),
            };
            assert_eq!(shown.map(|(shown, _)| shown.score), expected, "pixel {at}");
        }
    }
}
