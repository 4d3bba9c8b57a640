//! A cloud laid onto a surface from nearby (Chen and Medioni 1992): distances from the tangent planes of the nearest points.

use nalgebra::{Isometry3, Matrix6, SymmetricEigen, Vector3, Vector6};

use super::nearest_points::NearestPoints;
use super::oriented_point::OrientedPoint;
use crate::tracking::pose::moved;

/// Partners are as far apart as this at most, spacings, one round of steps after the other.
const REACHES: [f64; 3] = [3.0, 1.5, 0.75];
const STEPS: usize = 8;
/// A step that moves by less, radians and metres, ends a round.
const SETTLED: f64 = 1e-5;
/// Normals of partners are within 60 degrees.
const LEAST_COSINE: f64 = 0.5;

/// A cloud beside a surface.
pub(super) struct Alignment<'a> {
    pub(super) surface: &'a NearestPoints,
    pub(super) cloud: &'a [OrientedPoint],
    pub(super) spacing: f64,
}

/// How well a cloud lies on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fit {
    /// Mean of the squared distances, cut at the largest, over the square of that.
    pub(super) cost: f64,
    /// Share of the cloud that has a partner.
    pub(super) share: f64,
    /// Distance of partners, root mean square, metres.
    pub(super) rms: f64,
    /// Slope, root mean square, along the direction that is seen least.
    pub(super) slope: f64,
}

impl Alignment<'_> {
    /// The pose nearby at which the cloud lies best.
    pub(super) fn settle(&self, start: &Isometry3<f64>) -> Isometry3<f64> {
        let mut pose = *start;
        for reach in REACHES {
            for _ in 0..STEPS {
                let (normal, right) = self.normal_equations(&pose, reach * self.spacing);
                // A hair of damping holds what nothing fixes.
                let damped = normal + Matrix6::identity() * (1e-6 * normal.trace() + f64::MIN_POSITIVE);
                let Some(step) = damped.cholesky().map(|factor| factor.solve(&right)) else { return pose };
                pose = moved(&pose, &step);
                if step.amax() < SETTLED {
                    break;
                }
            }
        }
        pose
    }

    /// How well it lies there.
    pub(super) fn fit(&self, pose: &Isometry3<f64>) -> Fit {
        let reach = 0.5 * self.spacing;
        let (mut cost, mut count, mut squares) = (0.0, 0.0, 0.0);
        for point in self.cloud {
            let off = self.off(pose, point, reach).map(|(off, ..)| off * off);
            cost += off.unwrap_or(reach * reach);
            if let Some(off) = off {
                count += 1.0;
                squares += off;
            }
        }
        let all = self.cloud.len().max(1) as f64;
        let (normal, _) = self.normal_equations(pose, reach);
        // Turns count by how far they move the cloud.
        let radius = (self.cloud.iter().map(|p| p.point.coords.norm_squared()).sum::<f64>() / all).sqrt();
        let scale = Matrix6::from_diagonal(&Vector6::from_fn(|k, _| if k < 3 { 1.0 / radius.max(1e-6) } else { 1.0 }));
        let scaled = scale * normal * scale / f64::max(count, 1.0);
        let least = SymmetricEigen::new(scaled).eigenvalues.min().max(0.0);
        Fit {
            cost: cost / (all * reach * reach),
            share: count / all,
            rms: (squares / f64::max(count, 1.0)).sqrt(),
            slope: least.sqrt(),
        }
    }

    /// Distance of a point from its partner's tangent plane, the arm that turns it, and that plane's normal.
    fn off(
        &self,
        pose: &Isometry3<f64>,
        point: &OrientedPoint,
        reach: f64,
    ) -> Option<(f64, Vector3<f64>, Vector3<f64>)> {
        let arm = pose.rotation * point.point.coords;
        let there = pose.translation.vector + arm;
        let partner = self.surface.near(&there.into())?;
        let off = partner.normal.dot(&(there - partner.point.coords));
        let alike = partner.normal.dot(&(pose.rotation * point.normal)) >= LEAST_COSINE;
        (alike && off.abs() <= reach).then_some((off, arm, partner.normal))
    }

    fn normal_equations(&self, pose: &Isometry3<f64>, reach: f64) -> (Matrix6<f64>, Vector6<f64>) {
        let (mut normal, mut right) = (Matrix6::zeros(), Vector6::zeros());
        for (off, arm, plane) in self.cloud.iter().filter_map(|point| self.off(pose, point, reach)) {
            let turn = arm.cross(&plane);
            let row = Vector6::new(turn.x, turn.y, turn.z, plane.x, plane.y, plane.z);
            normal += row * row.transpose();
            right -= row * off;
        }
        (normal, right)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    /// Three faces of a box that meet at a corner, so many metres a point, somewhere off the origin.
    fn corner(spacing: f64) -> Vec<OrientedPoint> {
        let face = |axis: usize| {
            (0..20 * 20).map(move |k| {
                let [along, across] = [f64::from(k % 20) + 0.5, f64::from(k / 20) + 0.5];
                let mut place = Vector3::new(4.0, -6.0, 2.0);
                place[(axis + 1) % 3] += along;
                place[(axis + 2) % 3] += across;
                OrientedPoint { point: Point3::from(place * spacing), normal: Vector3::ith(axis, 1.0) }
            })
        };
        (0..3).flat_map(face).collect()
    }

    /// How firmly a cloud lies is no matter of the unit that it is measured in.
    #[test]
    fn the_slope_of_a_fit_is_that_of_its_shape() {
        let fit = |spacing: f64| {
            let cloud = corner(spacing);
            let surface = NearestPoints::new(cloud.clone(), spacing);
            Alignment { surface: &surface, cloud: &cloud, spacing }.fit(&Isometry3::identity())
        };
        let [small, large] = [0.01, 1.0].map(fit);
        assert!(small.share > 0.9 && (small.share - large.share).abs() < 0.01, "{small:?} {large:?}");
        assert!(small.slope > 0.02 && (small.slope / large.slope - 1.0).abs() < 0.01, "{small:?} {large:?}");
    }
}
