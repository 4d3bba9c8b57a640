//! Distortion metrics of a chart.

use crate::disk::Disk;
use crate::triangle::{Frame, flips, orientation};

/// Figures of merit of a chart in its own scale: lengths in the chart are meant to be metres on the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Quality {
    /// Faces that are not strictly counter-clockwise in the chart (exact predicate on the f64 coordinates).
    pub flips: usize,
    /// The same after rounding the coordinates to f32, as files and GPUs do.
    pub flips_f32: usize,
    /// Area-weighted mean of `(s1^2 + s2^2 + s1^-2 + s2^-2) / 4`; 1 = isometry, infinite where a face is flipped.
    pub symmetric_dirichlet: f64,
    /// Area-weighted mean of `(s1 - 1)^2 + (s2 - 1)^2`; 0 = isometry.
    pub arap: f64,
    /// 99th percentile over faces of `max(s1, 1 / |s2|)`.
    pub stretch_p99: f64,
    /// Largest `max(s1, 1 / |s2|)`.
    pub stretch_max: f64,
    /// Area-weighted mean of `max(|s1 - 1|, ||s2| - 1|)`: the relative length error of a stroke.
    pub length_err_mean: f64,
    /// 99th percentile of the same, weighted by area.
    pub length_err_p99: f64,
    /// Area of the chart that lies on other parts of the chart, as a fraction of the whole: the common areas of all pairs
    /// of faces, exact up to rounding. What lies there twice cannot be told apart in a picture; 0 = none. Flipped faces do
    /// not count.
    pub overlap_share: f64,
    /// Pairs of faces that lie on each other (exact predicate).
    pub overlap_pairs: usize,
    /// Number of cuts the surface was opened by.
    pub cuts: usize,
    /// Length of the seams they left, on the surface, metres; both sides count once.
    pub seam_length_m: f64,
    /// Area of the surface, m^2.
    pub area_m2: f64,
    /// Iterations of the minimisers.
    pub iterations: usize,
}

impl Quality {
    pub(crate) fn measure(
        disk: &Disk,
        uv: &[[f64; 2]],
        (overlap_pairs, overlap): (usize, f64),
        iterations: usize,
    ) -> Self {
        let (mut area, mut flat_area, mut arap, mut dirichlet, mut error) = (0.0, 0.0, 0.0, 0.0, 0.0);
        let mut stretches = Vec::with_capacity(disk.faces.len());
        let mut errors = Vec::with_capacity(disk.faces.len());
        for (f, face) in disk.faces.iter().enumerate() {
            let frame = Frame::new(disk.corners(f));
            let jacobian = frame.jacobian(face.map(|v| uv[v as usize]));
            let [s1, s2] = jacobian.stretch();
            let length_error = (s1 - 1.0).abs().max((s2.abs() - 1.0).abs());
            area += frame.area;
            flat_area += frame.area * jacobian.det().max(0.0);
            arap += frame.area * jacobian.rigidity(jacobian.nearest_rotation().unwrap_or([1.0, 0.0]));
            dirichlet += frame.area * jacobian.symmetric_dirichlet() / 4.0;
            error += frame.area * length_error;
            stretches.push(s1.max(1.0 / s2.abs()));
            errors.push((length_error, frame.area));
        }
        stretches.sort_unstable_by(f64::total_cmp);
        errors.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let rounded: Vec<[f64; 2]> = uv.iter().map(|at| at.map(|x| f64::from(x as f32))).collect();
        let flips = flips(uv, &disk.faces);
        Self {
            flips,
            flips_f32: disk.faces.iter().filter(|f| orientation(f.map(|v| rounded[v as usize])) <= 0.0).count(),
            symmetric_dirichlet: if flips == 0 { dirichlet / area } else { f64::INFINITY },
            arap: arap / area,
            stretch_p99: stretches[(0.99 * (stretches.len() - 1) as f64).round() as usize],
            stretch_max: stretches[stretches.len() - 1],
            length_err_mean: error / area,
            length_err_p99: weighted_percentile(&errors, 0.99 * area),
            overlap_share: if flat_area > 0.0 { overlap / flat_area } else { 0.0 },
            overlap_pairs,
            cuts: disk.cuts(),
            seam_length_m: disk.seam_length(),
            area_m2: area,
            iterations,
        }
    }
}

/// The first value at which the running weight reaches `share`; `sorted` holds (value, weight).
fn weighted_percentile(sorted: &[(f64, f64)], share: f64) -> f64 {
    let mut sum = 0.0;
    for &(value, weight) in sorted {
        sum += weight;
        if sum >= share {
            return value;
        }
    }
    sorted.last().map_or(0.0, |last| last.0)
}

#[cfg(test)]
mod tests {
    use super::weighted_percentile;

    #[test]
    fn a_percentile_is_where_the_weights_reach_their_share() {
        let sorted = [(1.0, 2.0), (2.0, 1.0), (5.0, 1.0)];
        let found = [0.0, 2.0, 2.5, 3.5, 9.0].map(|share| weighted_percentile(&sorted, share));
        assert_eq!(found, [1.0, 1.0, 2.0, 5.0, 5.0]);
        assert_eq!(weighted_percentile(&[], 1.0), 0.0);
    }
}
