//! The frame of an estimate moved onto that of the reference.

use nalgebra::{
    Isometry3, Matrix3, Matrix4, Quaternion, Similarity3, SymmetricEigen, Translation3, UnitQuaternion, Vector3,
};

use crate::error::Error;
use crate::trajectory::{check_poses, same_length};

/// Eigenvalue gaps and horizontal moments below this share of the spread are rounding.
const DEGENERATE: f64 = 1e-13;

/// Which difference of frames is removed before absolute errors are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "lowercase"))]
pub enum Alignment {
    /// None: both are given in the same frame.
    None,
    /// Position and heading, four degrees of freedom: right for an estimator that knows gravity and scale.
    PosYaw,
    /// Rigid motion, six degrees of freedom: `evo --align`. Forgives a wrong vertical.
    #[default]
    Se3,
    /// Rigid motion and scale: `evo --align --correct_scale`, for monocular vision without an IMU.
    Sim3,
}

/// The shift and the turn about the vertical that take one pose to the place and heading of another.
pub fn heading_onto(target: &Isometry3<f64>, from: &Isometry3<f64>) -> Isometry3<f64> {
    // The turn about z that is nearest to the rotation between both.
    let q = (target.rotation * from.rotation.inverse()).into_inner();
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 2.0 * q.k.atan2(q.w));
    Isometry3::from_parts(Translation3::from(target.translation.vector - turn * from.translation.vector), turn)
}

/// The transform `reference_from_estimate` that brings the estimated positions nearest to the reference ones, in the
/// sense of least squares over all poses. Needs at least one pose (none for [`Alignment::None`]), equally many in both.
///
/// Rigid and similarity: the problem of Umeyama (1991), solved through the quaternion of Horn (1987), whose largest
/// eigenvalue is also the numerator of the scale. Position and yaw: closed form for the rotation about `z`.
pub fn align(
    reference: &[Isometry3<f64>],
    estimate: &[Isometry3<f64>],
    mode: Alignment,
) -> Result<Similarity3<f64>, Error> {
    same_length("reference", reference.len(), "estimate", estimate.len())?;
    if mode == Alignment::None {
        return Ok(Similarity3::identity());
    }
    check_poses("reference pose", reference)?;
    check_poses("estimated pose", estimate)?;
    if reference.is_empty() {
        return Err(Error::TooFew { what: "pose pairs to align", got: 0, need: 1 });
    }
    let moments = Moments::new(reference, estimate);
    let (rotation, scale) = match mode {
        Alignment::None => (UnitQuaternion::identity(), 1.0),
        Alignment::PosYaw => (moments.yaw()?, 1.0),
        Alignment::Se3 => (moments.rotation("se3")?.0, 1.0),
        Alignment::Sim3 => {
            let (rotation, numerator) = moments.rotation("sim3")?;
            (rotation, numerator / moments.estimate_variance)
        }
    };
    let translation = moments.reference_mean - rotation * moments.estimate_mean * scale;
    Ok(Similarity3::from_parts(Translation3::from(translation), rotation, scale))
}

/// Moves poses by an alignment: positions are scaled, turned and shifted, orientations turned.
pub fn apply(reference_from_estimate: &Similarity3<f64>, poses: &[Isometry3<f64>]) -> Vec<Isometry3<f64>> {
    let (scale, rigid) = (reference_from_estimate.scaling(), reference_from_estimate.isometry);
    let scaled = |pose: &Isometry3<f64>| Isometry3::from_parts((pose.translation.vector * scale).into(), pose.rotation);
    poses.iter().map(|pose| rigid * scaled(pose)).collect()
}

/// First and second moments of the two point sets, divided by their number.
struct Moments {
    reference_mean: Vector3<f64>,
    estimate_mean: Vector3<f64>,
    reference_variance: f64,
    estimate_variance: f64,
    /// `Σ (g − ḡ)(e − ē)ᵀ / n`.
    covariance: Matrix3<f64>,
    /// Largest variance that rounding of the coordinates can fake, for reference and estimate.
    rounding: (f64, f64),
}

impl Moments {
    fn new(reference: &[Isometry3<f64>], estimate: &[Isometry3<f64>]) -> Self {
        let n = reference.len() as f64;
        let mean = |poses: &[Isometry3<f64>]| poses.iter().map(|p| p.translation.vector).sum::<Vector3<f64>>() / n;
        let rounding = |poses: &[Isometry3<f64>]| {
            let largest = poses.iter().map(|p| p.translation.vector.amax()).fold(0.0, f64::max);
            (16.0 * f64::EPSILON * largest).powi(2)
        };
        let (reference_mean, estimate_mean) = (mean(reference), mean(estimate));
        let (mut reference_variance, mut estimate_variance, mut covariance) = (0.0, 0.0, Matrix3::zeros());
        for (g, e) in reference.iter().zip(estimate) {
            let (g, e) = (g.translation.vector - reference_mean, e.translation.vector - estimate_mean);
            reference_variance += g.norm_squared() / n;
            estimate_variance += e.norm_squared() / n;
            covariance += g * e.transpose() / n;
        }
        Self {
            reference_mean,
            estimate_mean,
            reference_variance,
            estimate_variance,
            covariance,
            rounding: (rounding(reference), rounding(estimate)),
        }
    }

    /// `√(var g · var e)`, the largest a moment can be; refused if all points of a set coincide.
    fn spread(&self, mode: &'static str) -> Result<f64, Error> {
        if self.reference_variance <= self.rounding.0 || self.estimate_variance <= self.rounding.1 {
            return Err(Error::Degenerate { mode, why: "all poses are at one place" });
        }
        Ok(self.reference_variance.sqrt() * self.estimate_variance.sqrt())
    }

    /// Rotation about z that maximises `tr(Rᵀ C)`.
    fn yaw(&self) -> Result<UnitQuaternion<f64>, Error> {
        let spread = self.spread("posyaw")?;
        let c = &self.covariance;
        let (sine, cosine) = (c[(1, 0)] - c[(0, 1)], c[(0, 0)] + c[(1, 1)]);
        if sine.hypot(cosine) <= DEGENERATE * spread {
            return Err(Error::Degenerate { mode: "posyaw", why: "they do not spread sideways" });
        }
        Ok(UnitQuaternion::from_axis_angle(&Vector3::z_axis(), sine.atan2(cosine)))
    }

    /// Rotation that maximises `tr(Rᵀ C)`, and this maximum.
    fn rotation(&self, mode: &'static str) -> Result<(UnitQuaternion<f64>, f64), Error> {
        let spread = self.spread(mode)?;
        // Normalised, so that the eigenvalue solver works near one whatever the units; columns of S are Horn's S_ab
        // with a the estimate and b the reference.
        let s = self.covariance.transpose() / spread;
        let d = Vector3::new(s[(1, 2)] - s[(2, 1)], s[(2, 0)] - s[(0, 2)], s[(0, 1)] - s[(1, 0)]);
        let lower = s + s.transpose() - Matrix3::identity() * s.trace();
        let mut n = Matrix4::zeros();
        n[(0, 0)] = s.trace();
        n.fixed_view_mut::<3, 1>(1, 0).copy_from(&d);
        n.fixed_view_mut::<1, 3>(0, 1).copy_from(&d.transpose());
        n.fixed_view_mut::<3, 3>(1, 1).copy_from(&lower);
        let undetermined = Error::Degenerate { mode, why: "they lie on one line" };
        let Some(eigen) = SymmetricEigen::try_new(n, f64::EPSILON, 1000) else { return Err(undetermined) };
        let best = eigen.eigenvalues.imax();
        let largest = eigen.eigenvalues[best];
        let second = (0..4).filter(|&i| i != best).map(|i| eigen.eigenvalues[i]).fold(f64::NEG_INFINITY, f64::max);
        if largest - second <= DEGENERATE {
            return Err(undetermined);
        }
        let q = eigen.eigenvectors.column(best);
        let rotation = UnitQuaternion::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3]));
        Ok((rotation, largest * spread))
    }
}
