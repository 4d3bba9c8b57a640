//! What keyframes say of one point becomes equations of their poses: where the point lies and how bright it is are eliminated.

use nalgebra::{Matrix2, Matrix6x2, Vector2, Vector3, Vector6};

use crate::bundle_adjustment::posed_frame::{Observation, PosedFrame};
use crate::bundle_adjustment::residual_stats::{ResidualStats, Scales};
use crate::bundle_adjustment::surface_points::SurfacePoint;
use crate::pose_graph::normal_equations::NormalEquations;

/// Huber's constant: 95 % efficiency on normal residuals.
const HUBER: f64 = 1.345;

/// What a keyframe measured: `residual + jacobian · ξ + common · ν`.
struct Term {
    frame: usize,
    residual: f64,
    sigma: f64,
    jacobian: Vector6<f64>,
    /// Derivatives by ν: how far the point lies along its normal, and its intensity.
    common: Vector2<f64>,
}

/// Adds a point that two keyframes or more see. Returns how far along its normal it lies.
pub(crate) fn add_point(
    point: &SurfacePoint,
    seen: &[Observation],
    frames: &[Option<PosedFrame>],
    brightness: &[f64],
    equations: &mut NormalEquations,
    stats: &mut ResidualStats,
) -> f64 {
    let scales = stats.scales;
    let mut terms = distances(point, seen, frames, scales);
    let offset = centre(&mut terms);
    for (term, observation) in terms.iter().zip(seen) {
        stats.depth.add((term.residual / observation.sigma) as f32);
    }
    let mut bright = intensities(point, seen, frames, brightness, scales);
    if bright.len() > 1 {
        centre(&mut bright);
        for term in &bright {
            stats.add_intensity(term.frame, term.residual);
        }
        terms.append(&mut bright);
    }
    stats.terms += terms.len();
    offset + eliminate(&terms, equations)
}

fn distances(point: &SurfacePoint, seen: &[Observation], frames: &[Option<PosedFrame>], scales: Scales) -> Vec<Term> {
    let term = |o: &Observation| {
        let jacobian = frames[o.frame].as_ref()?.distance_jacobian(point);
        let sigma = o.sigma * scales.depth;
        Some(Term { frame: o.frame, residual: o.distance, sigma, jacobian, common: Vector2::new(-1.0, 0.0) })
    };
    seen.iter().filter_map(term).collect()
}

/// All with the mean slope of the intensity. With slopes of their own, which noise and resolution make differ, keyframes that move together with the surface would
/// seem to contradict each other, and what bends slowly would never be straightened.
fn intensities(
    point: &SurfacePoint,
    seen: &[Observation],
    frames: &[Option<PosedFrame>],
    brightness: &[f64],
    scales: Scales,
) -> Vec<Term> {
    let slopes = || seen.iter().filter_map(|o| Some(o.intensity?.slope));
    let slope = slopes().sum::<Vector3<f64>>() / slopes().count().max(1) as f64;
    let term = |o: &Observation| {
        let residual = o.intensity?.value - brightness[o.frame];
        let (jacobian, rise) = frames[o.frame].as_ref()?.intensity_jacobian(point, &slope);
        let common = Vector2::new(rise, -1.0);
        Some(Term { frame: o.frame, residual, sigma: scales.intensity, jacobian, common })
    };
    seen.iter().filter_map(term).collect()
}

/// Takes the median from all residuals: what is told from it is no outlier for being far from a first guess.
fn centre(terms: &mut [Term]) -> f64 {
    let mut sorted: Vec<f64> = terms.iter().map(|t| t.residual).collect();
    sorted.sort_by(f64::total_cmp);
    let middle = 0.5 * (sorted[(sorted.len() - 1) / 2] + sorted[sorted.len() / 2]);
    for term in terms {
        term.residual -= middle;
    }
    middle
}

/// `½ Σ w (r + J ξ + a ν)²` without ν: the Schur complement. Returns the first of ν.
fn eliminate(terms: &[Term], equations: &mut NormalEquations) -> f64 {
    let (mut own, mut pull) = (Matrix2::zeros(), Vector2::zeros());
    let mut across: Vec<(usize, Matrix6x2<f64>)> = Vec::new();
    for term in terms {
        let size = (term.residual / term.sigma).abs();
        let weight = (HUBER / size).min(1.0) / (term.sigma * term.sigma);
        own += weight * term.common * term.common.transpose();
        pull += weight * term.residual * term.common;
        let Some(block) = equations.blocks[term.frame] else { continue };
        let place = equations.h.place(block, block);
        equations.h.add(place, |row, column| weight * term.jacobian[row] * term.jacobian[column]);
        let mut part = equations.b.fixed_rows_mut::<6>(6 * block);
        part += term.jacobian * (weight * term.residual);
        let shared = weight * term.jacobian * term.common.transpose();
        match across.iter_mut().find(|(b, _)| *b == block) {
            Some((_, sum)) => *sum += shared,
            None => across.push((block, shared)),
        }
    }
    if own[(1, 1)] == 0.0 {
        // Without intensities there is nothing to eliminate.
        own[(1, 1)] = 1.0;
    }
    let Some(inverse) = own.try_inverse() else { return 0.0 };
    for (k, (a, shared)) in across.iter().enumerate() {
        let carried = shared * inverse;
        let mut part = equations.b.fixed_rows_mut::<6>(6 * a);
        part -= carried * pull;
        for (b, other) in &across[k..] {
            let place = equations.h.place(*a, *b);
            // The row of the block is the later pose; observations come in the order of their keyframes.
            let block = other * carried.transpose();
            equations.h.add(place, |row, column| -block[(row, column)]);
        }
    }
    -(inverse * pull)[0]
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::bundle_adjustment::posed_frame::Intensity;
    use crate::tracking::image_level::ImageLevel;

    /// How much brighter keyframes are found than they were taken to be, and the pull on their poses, where they see `seen` of one point.
    fn found(seen: [f64; 3], brightness: [f64; 3]) -> (Vec<f64>, f64) {
        let level = ImageLevel::default();
        let pose = |k: usize| Isometry3::translation(0.2 * k as f64, 0.0, -1.0);
        let frames = [0, 1, 2].map(|k| Some(PosedFrame::new(&level, &pose(k))));
        let point = SurfacePoint { position: Vector3::zeros(), normal: -Vector3::z() };
        let slope = Vector3::new(30.0, -20.0, 0.0);
        let see = |k: usize| {
            let intensity = Some(Intensity { value: seen[k], slope });
            Observation { frame: k, distance: 0.0, sigma: 1e-3, intensity }
        };
        let mut equations = NormalEquations::new(&[true, false, false], &[], &[[0, 1], [0, 2], [1, 2]]).unwrap();
        let mut stats = ResidualStats::new(3, Scales { depth: 1.0, intensity: 2.0 });
        add_point(&point, &[0, 1, 2].map(see), &frames, &brightness, &mut equations, &mut stats);
        (stats.brighter().collect(), equations.b.amax())
    }

    /// Keyframes that see a point as much brighter as they are say the same of it; where nothing is known of their brightness it is found,
    /// beside that of the middle one.
    #[test]
    fn the_brightness_of_keyframes_is_no_error() {
        let (brighter, pull) = found([100.0, 112.0, 95.0], [0.0, 12.0, -5.0]);
        assert!(brighter.iter().all(|b| b.abs() < 1e-9) && pull < 1e-9, "{brighter:?} {pull}");
        let (brighter, pull) = found([100.0, 112.0, 95.0], [0.0; 3]);
        assert_eq!(brighter, [0.0, 12.0, -5.0]);
        assert!(pull > 1.0, "{pull}");
    }
}
