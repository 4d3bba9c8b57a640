//! READ: a grid of Gaussian filters laid over the picture (Gregor et al. 2015, section 3.2), and its adjoint.

use super::architecture::Architecture;
use crate::network::Real;

/// READ's grid of filters: `read x read` of them around a centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FilterGrid<T> {
    pub(crate) x: T,
    pub(crate) y: T,
    /// Between two filters, pixels.
    pub(crate) spacing: T,
    pub(crate) variance: T,
    pub(crate) gain: T,
    /// Whether variance and spacing lie inside their bounds: outside they do not follow the raw output.
    free: (bool, bool),
}

/// Bounds of the logarithms of variance and spacing: filters far wider than the picture, or narrower than a pixel, would
/// only lose digits (ours).
const LOG_VARIANCE: (f64, f64) = (-6.0, 6.0);
const LOG_SPACING: (f64, f64) = (-5.0, 3.0);
/// Least sum of a filter: one that lies beside the picture sees nothing instead of dividing by zero.
const LEAST: f64 = 1e-8;

impl<T: Real> FilterGrid<T> {
    /// From the five numbers that the decoder asks for: centre x and y, each from -1 to 1 over the picture, and the
    /// logarithms of variance, spacing and gain. The printed centre counts pixels from 1; here they count from 0.
    pub(crate) fn new(architecture: &Architecture, raw: &[T]) -> Self {
        let half = T::of(0.5 * (architecture.side + 1) as f64);
        let bound = |value: T, (low, high): (f64, f64)| {
            let bounded = value.at_least(T::of(low)).at_most(T::of(high));
            (bounded, bounded == value)
        };
        let (variance, free_variance) = bound(raw[2], LOG_VARIANCE);
        let (spacing, free_spacing) = bound(raw[3], LOG_SPACING);
        Self {
            x: half * (raw[0] + T::of(1.0)) - T::of(1.0),
            y: half * (raw[1] + T::of(1.0)) - T::of(1.0),
            variance: variance.exp(),
            spacing: T::of((architecture.side - 1) as f64 / (architecture.read - 1) as f64) * spacing.exp(),
            gain: raw[4].exp(),
            free: (free_variance, free_spacing),
        }
    }

    /// Distance of filter `n` from the centre, in spacings.
    fn offset(n: usize, read: usize) -> T {
        T::of(n as f64 - 0.5 * (read - 1) as f64)
    }
}

/// Filters of both axes over one picture, and room to work.
#[derive(Debug, Clone)]
pub(crate) struct ReadAttention<T> {
    architecture: Architecture,
    across: FilterBank<T>,
    down: FilterBank<T>,
    missing: Vec<T>,
    /// Filtered down only: for the picture and for what is missing, `read` rows.
    rows: [Vec<T>; 2],
    #[cfg(any(test, feature = "train"))]
    d_rows: Vec<T>,
    #[cfg(any(test, feature = "train"))]
    patch: Vec<T>,
}

impl<T: Real> ReadAttention<T> {
    pub(crate) fn new(architecture: &Architecture) -> Self {
        let strip = || vec![T::default(); architecture.read * architecture.side];
        Self {
            architecture: *architecture,
            across: FilterBank::new(architecture),
            down: FilterBank::new(architecture),
            missing: vec![T::default(); architecture.pixels()],
            rows: [strip(), strip()],
            #[cfg(any(test, feature = "train"))]
            d_rows: strip(),
            #[cfg(any(test, feature = "train"))]
            patch: vec![T::default(); architecture.read * architecture.read],
        }
    }

    fn filter(&mut self, window: &FilterGrid<T>, picture: &[T], ink: &[T]) {
        let side = self.architecture.side;
        self.across.fill(window.x, window);
        self.down.fill(window.y, window);
        for ((m, &x), &a) in self.missing.iter_mut().zip(picture).zip(ink) {
            *m = x - a;
        }
        for (rows, image) in self.rows.iter_mut().zip([picture, &self.missing]) {
            for (row, filter) in rows.chunks_exact_mut(side).zip(self.down.filters.chunks_exact(side)) {
                row.fill(T::default());
                for (line, &f) in image.chunks_exact(side).zip(filter) {
                    add_scaled(row, f, line);
                }
            }
        }
    }

    /// `γ [F_y x F_xᵀ ; F_y (x - a) F_xᵀ]`, Paper IV, algorithm 3: `read(x_t, x̂_t, h_dec)`.
    pub(crate) fn read(&mut self, raw: &[T], picture: &[T], ink: &[T], out: &mut [T]) {
        let window = FilterGrid::new(&self.architecture, raw);
        self.filter(&window, picture, ink);
        let (read, side) = (self.architecture.read, self.architecture.side);
        for (rows, out) in self.rows.iter().zip(out.chunks_exact_mut(read * read)) {
            for (row, out) in rows.chunks_exact(side).zip(out.chunks_exact_mut(read)) {
                for (filter, out) in self.across.filters.chunks_exact(side).zip(out) {
                    *out = window.gain * dot(row, filter);
                }
            }
        }
    }

    #[cfg(any(test, feature = "train"))]
    /// The backward pass: `d_raw` is written, the derivative by the depth of paint that the ink comes from is added to.
    pub(crate) fn backward(
        &mut self,
        (raw, picture, ink): (&[T], &[T], &[T]),
        (out, d_out): (&[T], &[T]),
        d_raw: &mut [T],
        d_depth: &mut [T],
    ) {
        let window = FilterGrid::new(&self.architecture, raw);
        self.filter(&window, picture, ink);
        let (read, side) = (self.architecture.read, self.architecture.side);
        self.across.slopes.fill(T::default());
        self.down.slopes.fill(T::default());
        for (k, d_out) in d_out.chunks_exact(read * read).enumerate() {
            for (p, &d) in self.patch.iter_mut().zip(d_out) {
                *p = window.gain * d;
            }
            let image = if k == 0 { picture } else { &self.missing };
            for n in 0..read {
                let d_row = &mut self.d_rows[n * side..(n + 1) * side];
                let row = &self.rows[k][n * side..(n + 1) * side];
                d_row.fill(T::default());
                for m in 0..read {
                    let d = self.patch[n * read + m];
                    add_scaled(d_row, d, &self.across.filters[m * side..(m + 1) * side]);
                    add_scaled(&mut self.across.slopes[m * side..(m + 1) * side], d, row);
                }
                let slopes = &mut self.down.slopes[n * side..(n + 1) * side];
                for (slope, line) in slopes.iter_mut().zip(image.chunks_exact(side)) {
                    *slope += dot(d_row, line);
                }
            }
        }
        // What is missing is the picture less the ink, and the ink is tanh of the depth.
        for (i, (d_depth, ink)) in d_depth.chunks_exact_mut(side).zip(ink.chunks_exact(side)).enumerate() {
            for (n, d_row) in self.d_rows.chunks_exact(side).enumerate() {
                let f = self.down.filters[n * side + i];
                for ((d, &a), &r) in d_depth.iter_mut().zip(ink).zip(d_row) {
                    *d += -(f * r) * (T::of(1.0) - a * a);
                }
            }
        }
        let (x, across) = self.across.backward(window.x, &window);
        let (y, down) = self.down.backward(window.y, &window);
        let half = T::of(0.5 * (side + 1) as f64);
        d_raw[0] = half * x;
        d_raw[1] = half * y;
        d_raw[2] = if window.free.0 { across.0 + down.0 } else { T::default() };
        d_raw[3] = if window.free.1 { across.1 + down.1 } else { T::default() };
        d_raw[4] = dot(out, d_out);
    }
}

/// The filters of one axis: `F[n, i] = exp(-(i - μ_n)² / 2σ²) / Z_n`, a row per filter.
#[derive(Debug, Clone)]
struct FilterBank<T> {
    side: usize,
    filters: Vec<T>,
    #[cfg(any(test, feature = "train"))]
    /// Derivatives by the filters.
    slopes: Vec<T>,
    /// Whether a filter's sum is large enough to be divided by.
    seen: Vec<bool>,
}

impl<T: Real> FilterBank<T> {
    fn new(architecture: &Architecture) -> Self {
        let strip = vec![T::default(); architecture.read * architecture.side];
        Self {
            side: architecture.side,
            filters: strip.clone(),
            #[cfg(any(test, feature = "train"))]
            slopes: strip,
            seen: vec![true; architecture.read],
        }
    }

    fn fill(&mut self, centre: T, window: &FilterGrid<T>) {
        let steepness = T::of(-0.5) / window.variance;
        let read = self.seen.len();
        for (n, filter) in self.filters.chunks_exact_mut(self.side).enumerate() {
            let middle = centre + FilterGrid::<T>::offset(n, read) * window.spacing;
            let mut sum = T::default();
            for (i, f) in filter.iter_mut().enumerate() {
                let d = T::of(i as f64) - middle;
                *f = (steepness * d * d).exp();
                sum += *f;
            }
            self.seen[n] = sum.to_f64() > LEAST;
            let share = T::of(1.0) / sum.at_least(T::of(LEAST));
            for f in filter {
                *f = *f * share;
            }
        }
    }

    #[cfg(any(test, feature = "train"))]
    /// Derivatives by the centre, and by the logarithms of variance and spacing.
    fn backward(&self, centre: T, window: &FilterGrid<T>) -> (T, (T, T)) {
        let steepness = T::of(1.0) / window.variance;
        let read = self.seen.len();
        let (mut by_centre, mut by_variance, mut by_spacing) = (T::default(), T::default(), T::default());
        let rows = self.filters.chunks_exact(self.side).zip(self.slopes.chunks_exact(self.side));
        for (n, (filter, slope)) in rows.enumerate() {
            let offset = FilterGrid::<T>::offset(n, read) * window.spacing;
            let middle = centre + offset;
            // The sum of a filter is always one, so what all its slopes have in common does nothing.
            let common = if self.seen[n] { dot(filter, slope) } else { T::default() };
            for (i, (&f, &s)) in filter.iter().zip(slope).enumerate() {
                let d = T::of(i as f64) - middle;
                let pull = f * (s - common) * d * steepness;
                by_centre += pull;
                by_variance += T::of(0.5) * pull * d;
                by_spacing += pull * offset;
            }
        }
        (by_centre, (by_variance, by_spacing))
    }
}

fn add_scaled<T: Real>(out: &mut [T], factor: T, row: &[T]) {
    for (o, &r) in out.iter_mut().zip(row) {
        *o += factor * r;
    }
}

/// In eight sums, so that they can be computed at once.
fn dot<T: Real>(a: &[T], b: &[T]) -> T {
    let mut sums = [T::default(); 8];
    let (a, b) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    for (a, b) in a.0.iter().zip(b.0) {
        for k in 0..8 {
            sums[k] += a[k] * b[k];
        }
    }
    let mut sum = T::default();
    for s in sums {
        sum += s;
    }
    for (&a, &b) in a.1.iter().zip(b.1) {
        sum += a * b;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_filters_are_those_of_the_reference() {
        // Computed outside, in double precision: three filters on eight pixels, centre 3.5, spacing 2, variance 1.
        let architecture = Architecture { side: 8, read: 3, ..Architecture::MNIST };
        let raw = [0.0, 0.0, 0.0, (2.0_f64 / 3.5).ln(), 0.0];
        let picture: Vec<f64> = (0..64).map(|k| f64::from(k) / 64.0).collect();
        let mut reader = ReadAttention::new(&architecture);
        let mut out = [0.0; 18];
        reader.read(&raw, &picture, &[0.0; 64], &mut out);
        let filter = [0.1319476868, 0.3586709994, 0.3586709994, 0.1319476868, 0.01785717757, 0.0008890565206];
        for (f, expected) in reader.across.filters.iter().zip(filter) {
            assert!((f - expected).abs() < 1e-10);
        }
        let patch = [
            0.2176633858,
            0.2481660652,
            0.2786687445,
            0.4616848206,
            0.4921875,
            0.5226901794,
            0.7057062555,
            0.7362089348,
            0.7667116142,
        ];
        for (o, expected) in out.iter().zip(patch.iter().chain(&patch)) {
            assert!((o - expected).abs() < 1e-10);
        }
    }
}
