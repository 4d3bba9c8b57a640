//! What is measured: the motion between two poses, or a pose.

use nalgebra::{Isometry3, Matrix6, Vector6};

use crate::error::Error;
use crate::images::check_pose;
use crate::pose_graph::robust_kernel::RobustKernel;
use crate::pose_graph::se3::{adjoint, log, right_jacobian_inverse};

/// The motion between two poses was measured; its residual is `Log(Z⁻¹ T_first⁻¹ T_second)`.
#[derive(Clone, Debug, PartialEq)]
pub struct BetweenFactor {
    /// Index of a pose.
    pub first: usize,
    /// Index of another one.
    pub second: usize,
    /// The measurement `Z`: takes points of the second frame into the first.
    pub first_from_second: Isometry3<f64>,
    /// Inverse covariance of `(ω, v)`, radians and metres, along the axes of the second frame.
    pub information: Matrix6<f64>,
    /// What contradicts the rest.
    pub kernel: RobustKernel,
}

/// A pose was measured; its residual is `Log(Z⁻¹ T)`.
#[derive(Clone, Debug, PartialEq)]
pub struct PriorFactor {
    /// Index of the pose.
    pub pose: usize,
    /// The measurement `Z`.
    pub world_from_body: Isometry3<f64>,
    /// Inverse covariance of `(ω, v)`, radians and metres, along the axes of the body.
    pub information: Matrix6<f64>,
}

/// Residual and Jacobians: with respect to `ξ` in `T exp(ξ)` of the second pose, and what takes one of the first to it.
pub(crate) struct Linearised {
    pub(crate) residual: Vector6<f64>,
    pub(crate) second: Matrix6<f64>,
    /// `J_first = −J_second · transport`.
    pub(crate) transport: Matrix6<f64>,
}

impl BetweenFactor {
    pub(crate) fn residual(&self, first: &Isometry3<f64>, second: &Isometry3<f64>) -> Vector6<f64> {
        log(&(self.first_from_second.inverse() * (first.inverse() * second)))
    }

    pub(crate) fn linearise(&self, first: &Isometry3<f64>, second: &Isometry3<f64>) -> Linearised {
        let first_from_second = first.inverse() * second;
        let residual = log(&(self.first_from_second.inverse() * first_from_second));
        let second = right_jacobian_inverse(&residual);
        Linearised { residual, second, transport: adjoint(&first_from_second.inverse()) }
    }

    pub(crate) fn check(&self, index: usize, poses: usize) -> Result<(), Error> {
        let refuse = |what| Err(Error::InvalidFactor { factor: "between", index, what });
        if self.first.max(self.second) >= poses || self.first == self.second {
            return refuse("it must join two different poses of the graph");
        }
        if !self.kernel.is_valid() {
            return refuse("the constant of its robust kernel must be finite and above 0");
        }
        check_measurement(&self.first_from_second, &self.information).or_else(refuse)
    }
}

impl PriorFactor {
    pub(crate) fn residual(&self, pose: &Isometry3<f64>) -> Vector6<f64> {
        log(&(self.world_from_body.inverse() * pose))
    }

    pub(crate) fn check(&self, index: usize, poses: usize) -> Result<(), Error> {
        let refuse = |what| Err(Error::InvalidFactor { factor: "prior", index, what });
        if self.pose >= poses {
            return refuse("its pose is not in the graph");
        }
        check_measurement(&self.world_from_body, &self.information).or_else(refuse)
    }
}

fn check_measurement(pose: &Isometry3<f64>, information: &Matrix6<f64>) -> Result<(), &'static str> {
    if check_pose(pose).is_err() {
        return Err("its measurement is not a rigid motion");
    }
    let scale = information.amax();
    if !scale.is_finite() || (information - information.transpose()).amax() > 1e-9 * scale {
        return Err("its information must be finite and symmetric");
    }
    if information.symmetric_eigenvalues().min() < -1e-9 * scale {
        return Err("its information must have no negative eigenvalue");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::pose_graph::se3::exp;

    #[test]
    fn jacobians_are_those_of_central_differences() {
        let first = Isometry3::new(Vector3::new(1.0, 2.0, -0.5), Vector3::new(0.4, -0.9, 0.3));
        let second = Isometry3::new(Vector3::new(-0.3, 1.0, 0.7), Vector3::new(-0.2, 0.5, 1.1));
        let first_from_second = Isometry3::new(Vector3::new(-1.0, 0.2, 1.3), Vector3::new(-0.9, 0.8, 0.1));
        let factor = BetweenFactor {
            first: 0,
            second: 1,
            first_from_second,
            information: Matrix6::identity(),
            kernel: RobustKernel::Squared,
        };
        let found = factor.linearise(&first, &second);
        let (j_first, h) = (-found.second * found.transport, 1e-5);
        for k in 0..6 {
            let step = Vector6::from_fn(|row, _| if row == k { h } else { 0.0 });
            let by = |at: &dyn Fn(&Vector6<f64>) -> Vector6<f64>| (at(&step) - at(&-step)) / (2.0 * h);
            let of_first = by(&|s| factor.residual(&(first * exp(s)), &second));
            let of_second = by(&|s| factor.residual(&first, &(second * exp(s))));
            assert!((of_first - j_first.column(k)).amax() < 1e-8, "{k}");
            assert!((of_second - found.second.column(k)).amax() < 1e-8, "{k}");
        }
    }
}
