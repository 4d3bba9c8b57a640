//! Unit bearings with a tangent basis.

use nalgebra::{Matrix2x3, Matrix3x2, Unit, UnitQuaternion, Vector2, Vector3};

use crate::lie::so3;

/// A direction with a tangent basis: `μ = Q e_z`, `N` = the first two columns of `Q`.
///
/// The basis travels with the direction. Were it rebuilt from `μ` by cross products it would jump somewhere on the
/// sphere, and the covariance of the tangent coordinates with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bearing {
    rotation: UnitQuaternion<f64>,
}

impl Bearing {
    /// Along a direction, with the basis that the shortest turn from `e_z` gives.
    pub fn new(direction: &Unit<Vector3<f64>>) -> Self {
        Self { rotation: shortest(&Vector3::z(), direction) }
    }

    /// The direction `μ`, of length 1.
    pub fn direction(&self) -> Vector3<f64> {
        self.rotation * Vector3::z()
    }

    /// The tangent basis `N`: two columns, orthonormal, and orthogonal to the direction.
    pub fn basis(&self) -> Matrix3x2<f64> {
        self.rotation.to_rotation_matrix().matrix().fixed_columns::<2>(0).into_owned()
    }

    /// `∂μ/∂d = −hat(μ) N` for tangent coordinates `d`: its columns are `−e_y'` and `e_x'` of the turned axes.
    pub fn differential(&self) -> Matrix3x2<f64> {
        let basis = self.basis();
        Matrix3x2::from_columns(&[-basis.column(1), basis.column(0).into_owned()])
    }

    /// `Q ← Exp(N d) Q`: turned by the tangent coordinates `d`, radians.
    #[must_use]
    pub fn boxplus(&self, d: &Vector2<f64>) -> Self {
        // N d = Q (d, 0), hence Exp(N d) Q = Q Exp((d, 0)).
        Self { rotation: renormalised(self.rotation * so3::exp(&Vector3::new(d.x, d.y, 0.0))) }
    }

    /// Tangent coordinates at `other` of the shortest turn from `other` to `self`. For opposite directions, where the
    /// turn is not unique, a turn by π about the first basis vector.
    pub fn boxminus(&self, other: &Self) -> Vector2<f64> {
        let local = other.rotation.inverse() * self.direction();
        let sine = local.xy().norm();
        if sine == 0.0 {
            return if local.z < 0.0 { Vector2::new(std::f64::consts::PI, 0.0) } else { Vector2::zeros() };
        }
        Vector2::new(-local.y, local.x) * (sine.atan2(local.z) / sine)
    }

    /// The rotation by the shortest way from this direction to `e_z`.
    pub(crate) fn level(&self) -> UnitQuaternion<f64> {
        shortest(&self.direction(), &Vector3::z_axis())
    }

    /// Turned by a rotation, and from there along the shortest way to `direction`.
    #[must_use]
    pub(crate) fn transported(&self, rotation: &UnitQuaternion<f64>, direction: &Unit<Vector3<f64>>) -> Self {
        let turned = rotation * self.rotation;
        Self { rotation: renormalised(shortest(&(turned * Vector3::z()), direction) * turned) }
    }

    /// Tangent coordinates at `self`, per change of a vector at the tip of the direction: `Nᵀ hat(μ)`.
    pub(crate) fn coordinates(&self) -> Matrix2x3<f64> {
        let basis = self.basis();
        Matrix2x3::from_rows(&[-basis.column(1).transpose(), basis.column(0).transpose()])
    }
}

/// The shortest turn from one unit vector to another; about an axis of its own choice between opposite ones.
fn shortest(from: &Vector3<f64>, to: &Unit<Vector3<f64>>) -> UnitQuaternion<f64> {
    let (axis, cosine) = (from.cross(to), from.dot(to));
    let sine = axis.norm();
    if sine > 1e-12 {
        return so3::exp(&(axis * (sine.atan2(cosine) / sine)));
    }
    if cosine > 0.0 {
        return UnitQuaternion::identity();
    }
    let helper = if from.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    so3::exp(&(from.cross(&helper).normalize() * std::f64::consts::PI))
}

/// Products of unit quaternions leave the sphere by rounding only, but a feature's is multiplied for minutes.
fn renormalised(q: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(q.into_inner())
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix2;

    use super::*;
    use crate::sim::Rng;
    use crate::test_random::{signed, vector};

    #[test]
    fn bearing_coordinates() {
        let mut rng = Rng::new(4);
        // Reference value, computed by hand: Exp((0.1, −0.2, 0)) e_z.
        let tilted = Bearing::new(&Vector3::z_axis()).boxplus(&Vector2::new(0.1, -0.2));
        let expected = Vector3::new(-0.198337495, -0.099168748, 0.975103993);
        assert!((tilted.direction() - expected).amax() < 1e-9);
        for _ in 0..200 {
            let bearing = Bearing::new(&Unit::new_normalize(vector(&mut rng)));
            let d = Vector2::new(signed(&mut rng), signed(&mut rng));
            assert!((bearing.boxplus(&d).boxminus(&bearing) - d).norm() < 1e-12);
            let basis = bearing.basis();
            assert!((basis.transpose() * basis - Matrix2::identity()).amax() < 1e-14);
            assert!((basis.transpose() * bearing.direction()).amax() < 1e-14);
            let h = 1e-6;
            for k in 0..2 {
                let mut step = Vector2::zeros();
                step[k] = h;
                let slope = (bearing.boxplus(&step).direction() - bearing.boxplus(&-step).direction()) / (2.0 * h);
                assert!((slope - bearing.differential().column(k)).amax() < 1e-9);
                assert!((bearing.coordinates() * slope - step / h).amax() < 1e-9);
            }
        }
        let down = Bearing::new(&-Vector3::z_axis());
        assert!((down.boxminus(&Bearing::new(&Vector3::z_axis())).norm() - std::f64::consts::PI).abs() < 1e-12);
    }
}
