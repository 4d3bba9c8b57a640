//! One level of the pyramid of a frame: inverse depth and intensity at a lower resolution.

use crate::images::{ColourData, ColourView, DepthData, DepthView, Intrinsics};
use crate::integration::gap_filling::STEEPEST;

/// Inverse depths and intensities; row-major.
#[derive(Clone, Debug, Default)]
pub(crate) struct ImageLevel {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) focal: [f32; 2],
    pub(crate) centre: [f32; 2],
    /// Inverse depth, 1/m; 0 where there is none.
    pub(crate) omega: Vec<f32>,
    /// 0..=255; empty without colour.
    pub(crate) intensity: Vec<f32>,
    /// Its slopes per pixel; empty without colour.
    pub(crate) gradient: Vec<[f32; 2]>,
}

/// The camera of an image of which `factor` pixels along each side have become one.
pub(crate) fn reduced(k: &Intrinsics, factor: usize) -> Intrinsics {
    let f = factor as f64;
    // Pixel centres are at integers, so the image begins half a pixel before 0.
    Intrinsics { fx: k.fx / f, fy: k.fy / f, cx: (k.cx + 0.5) / f - 0.5, cy: (k.cy + 0.5) / f - 0.5 }
}

impl ImageLevel {
    /// The finest level: `factor` pixels of the frame along each side become one. Colour is looked up where the depth was
    /// measured.
    pub(crate) fn read(
        &mut self,
        depth: &DepthView,
        colour: Option<&ColourView>,
        factor: usize,
        [near, far]: [f64; 2],
    ) {
        self.resize(depth.width / factor, depth.height / factor, &reduced(&depth.intrinsics, factor));
        let steepest = STEEPEST * factor as f32 / depth.intrinsics.fx.abs().min(depth.intrinsics.fy.abs()) as f32;
        let (near, far) = (near as f32, far as f32);
        let invert = |z: f32| if z >= near && z <= far { 1.0 / z } else { 0.0 };
        let (w, width) = (depth.width, self.width);
        // Whole rows at a time, because the arithmetic then runs in vector registers.
        let mut rows = vec![0.0; w * factor];
        let (mut least, mut sum, mut count) = (vec![0.0; width], vec![0.0; width], vec![0.0; width]);
        for v in 0..self.height {
            let from = v * factor * w;
            match depth.data {
                DepthData::U16 { data, scale } => {
                    let metres = (1.0 / scale) as f32;
                    for (out, &d) in rows.iter_mut().zip(&data[from..]) {
                        *out = if d == u16::MAX { 0.0 } else { invert(f32::from(d) * metres) };
                    }
                }
                DepthData::F32 { data } => {
                    rows.iter_mut().zip(&data[from..]).for_each(|(out, &z)| *out = invert(z));
                }
            }
            least.fill(0.0);
            for row in rows.chunks_exact(w) {
                for (least, cell) in least.iter_mut().zip(row.chunks_exact(factor)) {
                    for &omega in cell {
                        *least = if omega > *least { omega } else { *least };
                    }
                }
            }
            for nearest in &mut least {
                *nearest = of_nearest(*nearest, steepest);
            }
            sum.fill(0.0);
            count.fill(0.0);
            for row in rows.chunks_exact(w) {
                let sums = sum.iter_mut().zip(&mut count).zip(&least);
                for (((sum, count), &least), cell) in sums.zip(row.chunks_exact(factor)) {
                    for &omega in cell {
                        let taken = if omega >= least { 1.0 } else { 0.0 };
                        *sum += taken * omega;
                        *count += taken;
                    }
                }
            }
            let out = &mut self.omega[v * width..][..width];
            for ((out, sum), count) in out.iter_mut().zip(&sum).zip(&count) {
                *out = if *count > 0.0 { sum / count } else { 0.0 };
            }
        }
        self.intensity.clear();
        if let Some(colour) = colour {
            match colour.data {
                ColourData::Rgb8(data) => self.read_intensity(depth, colour, factor, |at| f32::from(data[at])),
                ColourData::Rgb16(data) => {
                    self.read_intensity(depth, colour, factor, |at| f32::from(data[at]) * (255.0 / 65535.0));
                }
            }
        }
        self.differentiate();
    }

    /// `channel` looks up a value of the colour image, 0..=255.
    fn read_intensity(
        &mut self,
        depth: &DepthView,
        colour: &ColourView,
        factor: usize,
        channel: impl Fn(usize) -> f32,
    ) {
        // From pixels of the depth image to those of the colour image.
        let (d, c) = (&depth.intrinsics, &colour.intrinsics);
        let columns: Vec<Option<usize>> =
            (0..self.width * factor).map(|u| nearest((u as f64 - d.cx) / d.fx * c.fx + c.cx, colour.width)).collect();
        let share = 1.0 / (factor * factor) as f32;
        for v in 0..self.height {
            let start = self.intensity.len();
            self.intensity.resize(start + self.width, 0.0);
            let line = &mut self.intensity[start..];
            for y in v * factor..(v + 1) * factor {
                let row = nearest((y as f64 - d.cy) / d.fy * c.fy + c.cy, colour.height);
                for (out, columns) in line.iter_mut().zip(columns.chunks_exact(factor)) {
                    for &column in columns {
                        // Where the colour camera does not look there is no intensity: a NaN spreads.
                        *out += match (row, column) {
                            (Some(row), Some(column)) => {
                                let at = 3 * (row * colour.width + column);
                                share * grey([channel(at), channel(at + 1), channel(at + 2)])
                            }
                            _ => f32::NAN,
                        };
                    }
                }
            }
        }
    }

    /// Half as many pixels along each side.
    pub(crate) fn halve(&self, out: &mut Self) {
        let k = Intrinsics {
            fx: f64::from(self.focal[0]),
            fy: f64::from(self.focal[1]),
            cx: f64::from(self.centre[0]),
            cy: f64::from(self.centre[1]),
        };
        out.resize(self.width / 2, self.height / 2, &reduced(&k, 2));
        let steepest = STEEPEST * 2.0 / self.focal[0].abs().min(self.focal[1].abs());
        let coloured = !self.intensity.is_empty();
        out.intensity.resize(if coloured { out.width * out.height } else { 0 }, 0.0);
        for v in 0..out.height {
            for u in 0..out.width {
                let first = 2 * v * self.width + 2 * u;
                let cell = [first, first + 1, first + self.width, first + self.width + 1];
                out.omega[v * out.width + u] = nearest_surface(&cell.map(|k| self.omega[k]), steepest);
                if coloured {
                    out.intensity[v * out.width + u] = 0.25 * cell.map(|k| self.intensity[k]).iter().sum::<f32>();
                }
            }
        }
        out.differentiate();
    }

    fn resize(&mut self, width: usize, height: usize, k: &Intrinsics) {
        (self.width, self.height) = (width, height);
        self.focal = [k.fx as f32, k.fy as f32];
        self.centre = [k.cx as f32, k.cy as f32];
        self.omega.clear();
        self.omega.resize(width * height, 0.0);
        self.intensity.clear();
    }

    /// Central differences; NaN on the rim.
    pub(crate) fn differentiate(&mut self) {
        self.gradient.clear();
        self.gradient.resize(self.intensity.len(), [f32::NAN; 2]);
        let width = self.width;
        for v in 1..self.height.saturating_sub(1).max(1) {
            for u in 1..width.saturating_sub(1) {
                let at = v * width + u;
                if let (Some(right), Some(below)) = (self.intensity.get(at + 1), self.intensity.get(at + width)) {
                    self.gradient[at] =
                        [0.5 * (right - self.intensity[at - 1]), 0.5 * (below - self.intensity[at - width])];
                }
            }
        }
    }
}

/// The least inverse depth that can be of the nearest surface in a cell: a mean across an edge would be of no surface.
fn of_nearest(nearest: f32, steepest: f32) -> f32 {
    (nearest * (1.0 - steepest) - 1e-6).max(f32::MIN_POSITIVE)
}

/// The mean inverse depth of the nearest surface.
fn nearest_surface(cell: &[f32], steepest: f32) -> f32 {
    let least = of_nearest(cell.iter().fold(0.0_f32, |a, &b| a.max(b)), steepest);
    let (mut sum, mut count) = (0.0, 0.0);
    for &omega in cell.iter().filter(|omega| **omega >= least) {
        (sum, count) = (sum + omega, count + 1.0);
    }
    if count > 0.0 { sum / count } else { 0.0 }
}

fn nearest(at: f64, size: usize) -> Option<usize> {
    let at = at.round();
    (at >= 0.0 && at < size as f64).then_some(at as usize)
}

/// Rec. 601 luma.
pub(crate) fn grey([r, g, b]: [f32; 3]) -> f32 {
    0.299 * r + 0.587 * g + 0.114 * b
}
