//! Where a person would stand to paint a target: before each of its sides, strip by strip.

use nalgebra::{Isometry3, Point3, Translation3, UnitVector3, Vector3};
use paint_sim::gantry_robot::Pass;

use super::object::{PaintObject, SurfaceSample};
use super::scenario::facing;
use super::settings::HandheldSettings;

/// Largest angle between a normal and the side it belongs to.
const SIDE_ANGLE: f64 = 40.0 / 180.0 * std::f64::consts::PI;
/// Share of the slide that a strip takes: the rest is for the hand's sway.
const STRIP: f64 = 0.6;
/// Beyond the target on either side of a sweep, m.
const MARGIN: f64 = 0.01;
/// Share of the time in which the valve is expected to be open.
const DUTY: f64 = 0.2;
/// Time on a strip beside that, s.
const AT_LEAST: f64 = 10.0;

/// A side of the target: texels whose normals point about the same way.
struct Side {
    normal: UnitVector3<f64>,
    samples: Vec<(SurfaceSample, f64)>,
}

/// Passes before all sides of the target, the largest first. `seconds` is the time for each; `None` lets the paint decide.
pub fn passes(object: &PaintObject, settings: &HandheldSettings, seconds: Option<f64>) -> Vec<Pass> {
    let thickness = object.thickness.iter().copied().fold(0.0, f64::max);
    let mut passes = Vec::new();
    for side in sides(object) {
        let rotation = facing(&SurfaceSample { point: Point3::origin(), normal: side.normal });
        let local = |sample: &SurfaceSample| rotation.inverse() * sample.point.coords;
        let extent = |k: usize, samples: &[&(SurfaceSample, f64)]| {
            samples
                .iter()
                .map(|(sample, _)| local(sample)[k])
                .fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)))
        };
        let all: Vec<&(SurfaceSample, f64)> = side.samples.iter().collect();
        let (low, high) = extent(2, &all);
        let strip = STRIP * settings.geometry.travel;
        let strips = ((high - low) / strip).ceil().max(1.0) as usize;
        let height = (high - low) / strips as f64;
        for k in 0..strips {
            let bottom = low + k as f64 * height;
            let inside = |sample: &SurfaceSample| {
                let z = local(sample).z;
                z >= bottom && (z < bottom + height || k + 1 == strips)
            };
            let samples: Vec<_> = all.iter().copied().filter(|(sample, _)| inside(sample)).collect();
            if samples.is_empty() {
                continue;
            }
            let (left, right) = extent(1, &samples);
            let nearest = extent(0, &samples).0;
            let area: f64 = samples.iter().map(|(_, area)| area).sum();
            let middle = Vector3::new(nearest - settings.stand_off, 0.5 * (left + right), bottom + 0.5 * height);
            let spraying = area * thickness / settings.deposit.flow;
            passes.push(Pass {
                middle: Isometry3::from_parts(Translation3::from(rotation * middle), rotation),
                half_width: 0.5 * (right - left) + MARGIN,
                duration: seconds.unwrap_or(spraying / DUTY + AT_LEAST),
            });
        }
    }
    passes
}

fn sides(object: &PaintObject) -> Vec<Side> {
    let mut rest: Vec<(SurfaceSample, f64)> = object.wanted_points().collect();
    let mut sides = Vec::new();
    while let Some(first) = rest.first() {
        // From any normal to the mean of those near it, twice: the middle of a side.
        let mut normal = first.0.normal;
        for _ in 0..2 {
            let near = rest.iter().filter(|(sample, _)| sample.normal.dot(&normal) > SIDE_ANGLE.cos());
            let sum: Vector3<f64> = near.map(|(sample, area)| sample.normal.into_inner() * *area).sum();
            normal = UnitVector3::try_new(sum, 1e-12).unwrap_or(normal);
        }
        // The seed goes with its side in any case, so that the rest shrinks.
        let seed = rest.swap_remove(0);
        let (mut samples, others): (Vec<_>, Vec<_>) =
            rest.into_iter().partition(|(sample, _)| sample.normal.dot(&normal) > SIDE_ANGLE.cos());
        samples.push(seed);
        rest = others;
        sides.push(Side { normal, samples });
    }
    let area = |side: &Side| side.samples.iter().map(|(_, area)| area).sum::<f64>();
    sides.sort_by(|a, b| area(b).total_cmp(&area(a)));
    // Slivers between sides are seen from one of them.
    let least = 0.02 * sides.iter().map(area).sum::<f64>();
    let kept = sides.iter().filter(|side| area(side) >= least).count().max(1);
    sides.truncate(kept);
    sides
}
