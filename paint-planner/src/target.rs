//! What is to be painted, and the gun that paints it.

use crate::error::Error;
use nalgebra::{Point3, UnitVector3};

/// One point of a stroke on the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Target {
    /// The point in the world, m.
    pub point: Point3<f64>,
    /// Outward surface normal at the point, world frame.
    pub normal: UnitVector3<f64>,
    /// Paint wanted per metre of stroke from here to the next target, m^3/m; 0 means valve shut.
    pub dose: f64,
    /// Time stamp of the person who drew the stroke, s; needed by
    /// [`TimingPolicy::GradientPreserving`](crate::timing::TimingPolicy::GradientPreserving) only.
    pub time: Option<f64>,
    /// Distance that the nozzle shall keep here, m: farther off, its spot is wider. [`NozzleSettings::stand_off`](crate::nozzle::NozzleSettings::stand_off)
    /// where there is none. The paper-exact mode starts there, and only bounds distances.
    pub stand_off: Option<f64>,
}

/// Where the nozzle is and where it sprays.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct NozzleState {
    /// Tip of the nozzle in the world, m.
    pub position: Point3<f64>,
    /// Spray axis in the world, from the nozzle to the surface.
    pub direction: UnitVector3<f64>,
}

impl Target {
    /// Distance of a nozzle from the normal line of the target, `|n x (p - t)|`, m (VR paper, section V).
    ///
    /// ```
    /// # use paint_planner::{Target, nalgebra::{Point3, Vector3}};
    /// let target = Target { point: Point3::origin(), normal: Vector3::z_axis(), dose: 0.0, time: None, stand_off: None };
    /// assert_eq!(target.normal_deviation(&Point3::new(0.03, 0.04, 0.1)), 0.05);
    /// ```
    pub fn normal_deviation(&self, nozzle_position: &Point3<f64>) -> f64 {
        self.normal.cross(&(nozzle_position - self.point)).norm()
    }

    /// The distance that is asked of the nozzle, m: its own, else the usual one.
    pub(crate) fn stand_off_or(&self, usual: f64) -> f64 {
        self.stand_off.unwrap_or(usual)
    }
}

/// Refuses paths that no planner can read.
pub(crate) fn check(targets: &[Target], distances: [f64; 2]) -> Result<(), Error> {
    if targets.len() < 2 {
        return Err(Error::TooFewTargets { count: targets.len() });
    }
    check_each(targets, distances)
}

/// Refuses targets that are no points of a surface, and distances that the nozzle may not keep.
pub(crate) fn check_each(targets: &[Target], distances: [f64; 2]) -> Result<(), Error> {
    let [least, most] = distances;
    for (index, target) in targets.iter().enumerate() {
        let refuse = |what| Err(Error::Target { index, what });
        if !target.point.iter().all(|c| c.is_finite() && c.abs() < 1e6) {
            return refuse("the point must be finite and within 1000 km of the origin");
        }
        let excess = (target.normal.norm() - 1.0).abs();
        if excess.is_nan() || excess > 1e-6 {
            return refuse("the normal must have unit length");
        }
        if !(target.dose >= 0.0 && target.dose.is_finite()) {
            return refuse("the dose must be finite and not negative");
        }
        if target.time.is_some_and(|time| !time.is_finite()) {
            return refuse("the time stamp must be finite");
        }
        if !target.stand_off.is_none_or(|distance| least < distance && distance < most) {
            return refuse("the stand-off must lie between nozzle.min and nozzle.max");
        }
    }
    Ok(())
}

/// Which neighbouring targets are close enough to be one stroke.
pub(crate) fn stroke_links(targets: &[Target], break_length: f64) -> Vec<bool> {
    targets.windows(2).map(|pair| (pair[1].point - pair[0].point).norm() <= break_length).collect()
}
