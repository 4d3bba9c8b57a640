//! The spray cone: how the paint of one shot spreads over directions.

use nalgebra::{Point3, UnitVector3, Vector3};

use crate::error::{Error, check_positive, check_range};

/// One quantum of paint in the mass balance: one femtolitre, in cubic metres.
pub const QUANTUM: f64 = 1e-18;

/// A conical spray whose flux is Gaussian in slope space, `g(s) = exp(-|s|^2 / 2 t^2) / (2 pi t^2)` with `t = tan(sigma)`
/// and `s` the sideways offset per metre of depth along the axis.
///
/// The cone model is the VR paper's (Section IV); it prints neither angle nor flow, so the defaults are engineering values.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct SprayModel {
    /// Standard deviation of the spread as an angle from the axis, rad; the slope's deviation is its tangent.
    /// Default 8 degrees: a spot of 14 mm sigma from 10 cm.
    pub sigma: f64,
    /// Half opening of the cone in multiples of sigma, measured in slope; the Gaussian is renormalised inside. Default 3.
    pub cut: f64,
    /// Share of the paint inside the cone that sticks where it lands, 0..=1; the rest is overspray. Default 1.
    pub efficiency: f64,
    /// Depth along the axis beyond which paint counts as overspray, m. Default 1.
    pub range: f64,
    /// How far before a texel its shadow ray ends, m: larger than the roughness by which texels lie below the mesh.
    /// Default 1 mm.
    pub shadow_bias: f64,
}

impl Default for SprayModel {
    fn default() -> Self {
        Self { sigma: 8.0_f64.to_radians(), cut: 3.0, efficiency: 1.0, range: 1.0, shadow_bias: 1e-3 }
    }
}

impl SprayModel {
    /// Paint per area that a unit volume leaves at `point`, 1/m^2, transfer efficiency included, shadows not:
    /// `eta g(s) r cos(i) / z^3` (ours), zero behind the nozzle, on the back of the surface and outside the cone.
    ///
    /// `normal` is the unit normal of the painted side. The integral over any surface that closes the cone is `eta`.
    pub fn density(
        &self,
        origin: &Point3<f64>,
        axis: &UnitVector3<f64>,
        point: &Point3<f64>,
        normal: &UnitVector3<f64>,
    ) -> f64 {
        Cone::new(self, origin, axis).density(point, normal)
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        check_range("spray.sigma", self.sigma, 1e-4, 1.4, "an angle between 0.0001 and 1.4 rad")?;
        check_range("spray.cut", self.cut, 0.1, 100.0, "between 0.1 and 100 sigmas")?;
        check_range("spray.efficiency", self.efficiency, 0.0, 1.0, "between 0 and 1")?;
        check_positive("spray.range", self.range)?;
        check_range("spray.shadow_bias", self.shadow_bias, 0.0, f64::MAX, "finite and not negative")
    }
}

/// One burst of the nozzle: what leaves it while it stands at one pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shot {
    /// Tip of the nozzle in the world frame, m.
    pub origin: Point3<f64>,
    /// Spray direction in the world frame.
    pub axis: UnitVector3<f64>,
    /// Emitted paint, m^3 (pigment-carrying film volume: what KM thickness is made of).
    pub volume: f64,
}

/// The spray of one shot in the world, with everything that does not depend on the point worked out.
pub(crate) struct Cone<'a> {
    pub(crate) origin: &'a Point3<f64>,
    pub(crate) axis: &'a Vector3<f64>,
    /// Tangent of the half opening.
    pub(crate) slope: f64,
    /// Cosine of the half opening.
    pub(crate) cosine: f64,
    pub(crate) range: f64,
    /// Slope deviation `t`.
    pub(crate) deviation: f64,
    exponent: f64,
    scale: f64,
}

impl<'a> Cone<'a> {
    pub(crate) fn new(spray: &SprayModel, origin: &'a Point3<f64>, axis: &'a UnitVector3<f64>) -> Self {
        let deviation = spray.sigma.tan();
        let slope = spray.cut * deviation;
        let kept = -(-0.5 * spray.cut * spray.cut).exp_m1();
        Self {
            origin,
            axis: axis.as_ref(),
            slope,
            cosine: 1.0 / (1.0 + slope * slope).sqrt(),
            range: spray.range,
            deviation,
            exponent: -0.5 / (deviation * deviation),
            scale: spray.efficiency / (std::f64::consts::TAU * deviation * deviation * kept),
        }
    }

    /// Paint per area and unit volume at `point`, 1/m^2.
    pub(crate) fn density(&self, point: &Point3<f64>, normal: &Vector3<f64>) -> f64 {
        let ray = point - self.origin;
        let depth = ray.dot(self.axis);
        let facing = -ray.dot(normal);
        if !(depth > 0.0 && depth <= self.range && facing > 0.0) {
            return 0.0;
        }
        let slope_squared = (ray / depth - self.axis).norm_squared();
        if slope_squared > self.slope * self.slope {
            return 0.0;
        }
        self.scale * (self.exponent * slope_squared).exp() * facing / (depth * depth * depth)
    }

    /// Whether a ball may touch the cone; never false when it does.
    pub(crate) fn may_intersect(&self, center: &Point3<f64>, radius: f64) -> bool {
        let ray = center - self.origin;
        let depth = ray.dot(self.axis);
        if depth < -radius || depth > self.range + radius {
            return false;
        }
        let sideways = (ray - self.axis * depth).norm();
        (sideways - self.slope * depth) * self.cosine <= radius
    }
}
