//! The spray cone: how the paint of one shot spreads over directions.

pub mod air;
pub mod calibration;
#[cfg(feature = "gpu")]
mod cone_numbers;
mod ellipse;
mod slope_forms;
mod wear;

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};

use crate::error::{Error, check_positive, check_range};
#[cfg(feature = "gpu")]
pub(crate) use cone_numbers::{CONE_NUMBERS, cone_numbers};
pub(crate) use ellipse::SlopeEllipse;
use ellipse::{EllipticCone, left_of};
pub(crate) use slope_forms::SlopeForms;
#[cfg(feature = "gpu")]
pub(crate) use slope_forms::{EXP, LEAST_EXPONENT, ROUNDING};
pub use wear::TipWear;

/// One quantum of paint in the mass balance: one femtolitre, in cubic metres.
pub const QUANTUM: f64 = 1e-18;

/// A conical spray whose flux is Gaussian in slope space, `g(s) = exp(-|s|^2 / 2 t^2) / (2 pi t^2)` with `t = tan(sigma)`
/// and `s` the sideways offset per metre of depth along the axis.
///
/// The cone model is the VR paper's (Section IV); it prints neither angle nor flow, so the defaults are engineering values.
///
/// With an aspect `a` the Gaussian has the deviations `t sqrt(a)` and `t / sqrt(a)` along the two sides of an ellipse, so the density in its
/// middle does not depend on `a`; with yaw and pitch its middle lies at the slopes `tan(yaw)` to the left and `tan(pitch)` upwards. Left and up
/// are the nozzle's. Where only an axis is known (a [`Shot`], [`SprayModel::density`]), the nozzle does not roll: left is horizontal, the world's
/// z axis pointing up, and a vertical nozzle is one that was tilted there from the world's x axis. [`crate::droplets::Nozzle`] and
/// [`SprayModel::density_from`] say themselves where up is. The defaults are round and on the axis, and need neither.
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
    /// Ratio of the two deviations, 0.05 to 20; below 1 the ellipse's first side is the short one. Default 1: a round spray.
    pub aspect: f64,
    /// Angle of the ellipse's first side, about the axis from the nozzle's left towards up, rad. Default 0.
    pub turn: f64,
    /// Angle of the jet from the nozzle's axis to the left, rad. Default 0.
    pub yaw: f64,
    /// Angle of the jet from the nozzle's axis upwards, rad. Default 0.
    pub pitch: f64,
}

impl Default for SprayModel {
    fn default() -> Self {
        Self {
            sigma: 8.0_f64.to_radians(),
            cut: 3.0,
            efficiency: 1.0,
            range: 1.0,
            shadow_bias: 1e-3,
            aspect: 1.0,
            turn: 0.0,
            yaw: 0.0,
            pitch: 0.0,
        }
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

    /// The same of a nozzle whose frame is known (x along its axis, y left, z up), so that it may roll.
    pub fn density_from(
        &self,
        world_from_nozzle: &Isometry3<f64>,
        point: &Point3<f64>,
        normal: &UnitVector3<f64>,
    ) -> f64 {
        let origin = Point3::from(world_from_nozzle.translation.vector);
        let axis = world_from_nozzle.rotation * Vector3::x_axis();
        let left = world_from_nozzle.rotation * Vector3::y();
        Cone::with_left(self, &origin, &axis, || left).density(point, normal)
    }

    /// The cross-section of the jet.
    pub(crate) fn ellipse(&self) -> SlopeEllipse {
        SlopeEllipse::new(self.sigma.tan(), self.aspect, self.turn, [self.yaw, self.pitch])
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        check_range("spray.sigma", self.sigma, 1e-4, 1.4, "an angle between 0.0001 and 1.4 rad")?;
        check_range("spray.cut", self.cut, 0.1, 100.0, "between 0.1 and 100 sigmas")?;
        check_range("spray.efficiency", self.efficiency, 0.0, 1.0, "between 0 and 1")?;
        check_positive("spray.range", self.range)?;
        check_range("spray.shadow_bias", self.shadow_bias, 0.0, f64::MAX, "finite and not negative")?;
        check_range("spray.aspect", self.aspect, 0.05, 20.0, "between 0.05 and 20")?;
        check_range("spray.turn", self.turn, -1e3, 1e3, "an angle in radians")?;
        check_range("spray.yaw", self.yaw, -1.4, 1.4, "an angle between -1.4 and 1.4 rad")?;
        check_range("spray.pitch", self.pitch, -1.4, 1.4, "an angle between -1.4 and 1.4 rad")
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
    /// One over its cosine.
    secant: f64,
    pub(crate) range: f64,
    /// Slope deviation, the smaller one of an ellipse.
    pub(crate) deviation: f64,
    exponent: f64,
    scale: f64,
    /// What takes the place of the round cone where it is not round or not on the axis.
    elliptic: Option<EllipticCone>,
}

impl<'a> Cone<'a> {
    pub(crate) fn new(spray: &SprayModel, origin: &'a Point3<f64>, axis: &'a UnitVector3<f64>) -> Self {
        Self::with_left(spray, origin, axis, || left_of(axis))
    }

    fn with_left(
        spray: &SprayModel,
        origin: &'a Point3<f64>,
        axis: &'a UnitVector3<f64>,
        left: impl FnOnce() -> Vector3<f64>,
    ) -> Self {
        let deviation = spray.sigma.tan();
        let slope = spray.cut * deviation;
        let kept = -(-0.5 * spray.cut * spray.cut).exp_m1();
        let ellipse = spray.ellipse();
        let around = || {
            let left = left();
            ellipse.around(&left, &axis.cross(&left), spray.cut)
        };
        Self {
            origin,
            axis: axis.as_ref(),
            slope,
            secant: slope.hypot(1.0),
            range: spray.range,
            deviation: ellipse.deviations[0].min(ellipse.deviations[1]),
            exponent: -0.5 / (deviation * deviation),
            scale: spray.efficiency / (std::f64::consts::TAU * deviation * deviation * kept),
            elliptic: (!ellipse.is_plain()).then(around),
        }
    }

    /// What gives the density of many points at once.
    pub(crate) fn slope_forms(&self) -> SlopeForms {
        let (sides, center, cut) = if let Some(cone) = &self.elliptic {
            (cone.directions_in_deviations(), cone.center_in_deviations(), cone.cut)
        } else {
            let left = left_of(self.axis) / self.deviation;
            ([left, self.axis.cross(&left)], [0.0; 2], self.slope / self.deviation)
        };
        let forms = [*self.axis, sides[0], sides[1]];
        SlopeForms { forms, center, most: cut * cut, range: self.range, scale: self.scale }
    }

    /// Paint per area and unit volume at `point`, 1/m^2.
    pub(crate) fn density(&self, point: &Point3<f64>, normal: &Vector3<f64>) -> f64 {
        let ray = point - self.origin;
        let (depth, facing) = (ray.dot(self.axis), -ray.dot(normal));
        if !(depth > 0.0 && depth <= self.range && facing > 0.0) {
            return 0.0;
        }
        let slope = ray / depth;
        let (square, most, factor) = match &self.elliptic {
            Some(cone) => (cone.squared(&slope), cone.cut * cone.cut, -0.5),
            None => ((slope - self.axis).norm_squared(), self.slope * self.slope, self.exponent),
        };
        if square > most {
            return 0.0;
        }
        self.scale * (factor * square).exp() * facing / (depth * depth * depth)
    }

    /// Whether a ball may touch the cone; never false when it does.
    pub(crate) fn may_intersect(&self, center: &Point3<f64>, radius: f64) -> bool {
        let ray = center - self.origin;
        let depth = ray.dot(self.axis);
        if depth < -radius || depth > self.range + radius {
            return false;
        }
        if let Some(cone) = &self.elliptic {
            return cone.may_intersect(&ray, depth, radius);
        }
        let sideways = (ray - self.axis * depth).norm_squared();
        let reach = self.slope * depth + radius * self.secant;
        reach >= 0.0 && sideways <= reach * reach
    }
}
