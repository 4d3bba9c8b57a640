//! From a point of the chart to a way-point of the nozzle (thesis Eq. (8.1)).

use nalgebra::{Point3, Unit, Vector3};

use crate::chart::{Chart, SurfacePoint};
use crate::error::Error;

/// Which normal the nozzle follows.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum NormalMode {
    /// The normal of the face (the thesis): jumps at every edge.
    Face,
    /// Vertex normals interpolated (ours): continuous.
    Smooth,
    /// The mean over a disc of the chart (ours): steady over rough surfaces.
    Footprint {
        /// Radius of the disc, metres.
        radius: f64,
    },
}

/// The spray cone that nozzle commands are made for.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct NozzleSettings {
    /// Standard deviation of the deposit on the surface, metres. Default 0.025: the thesis' 2 px of 1.25 cm.
    pub sigma: f64,
    /// HALF the cone angle of the spray, radians. Default 15 degrees (the thesis does not print it).
    pub half_angle: f64,
    /// Which normal to follow. Default [`NormalMode::Smooth`].
    pub normal: NormalMode,
}

impl Default for NozzleSettings {
    fn default() -> Self {
        Self { sigma: 0.025, half_angle: 15.0_f64.to_radians(), normal: NormalMode::Smooth }
    }
}

impl NozzleSettings {
    /// Distance of the nozzle from the surface, metres: `2 sigma / tan(theta)`, at which the cone is 2 sigma in radius.
    pub fn stand_off(&self) -> f64 {
        2.0 * self.sigma / self.half_angle.tan()
    }
}

/// Where the nozzle goes, in the frame of the mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NozzleCommand {
    /// Place of the nozzle tip, `w_pos = p + stand_off n`, metres.
    pub position: Point3<f64>,
    /// Direction of the spray, `w_dir = -n`.
    pub direction: Unit<Vector3<f64>>,
    /// The point of the surface that is painted.
    pub point: Point3<f64>,
    /// The normal that was followed.
    pub normal: Unit<Vector3<f64>>,
    /// The painted point as face and weights.
    pub at: SurfacePoint,
}

/// The way-point that paints the point `uv` (metres) of the chart (thesis Eq. (8.1), with the sum over the corners 0, 1, 2
/// and the normal of unit length).
///
/// # Errors
/// [`Error::OutsideChart`]; [`Error::Setting`] for a spray that is not a cone.
pub fn nozzle_command(chart: &Chart, uv: [f64; 2], settings: &NozzleSettings) -> Result<NozzleCommand, Error> {
    check(settings)?;
    let at = chart.locate(uv).ok_or(Error::OutsideChart { u: uv[0], v: uv[1] })?;
    let point = chart.point(at);
    let normal = match settings.normal {
        NormalMode::Face => chart.face_normal(at.face),
        NormalMode::Smooth => chart.smooth_normal(at),
        NormalMode::Footprint { radius } => chart.footprint_normal(at, radius),
    };
    let position = point + settings.stand_off() * normal.into_inner();
    Ok(NozzleCommand { position, direction: -normal, point, normal, at })
}

fn check(settings: &NozzleSettings) -> Result<(), Error> {
    let positive = |x: f64| x.is_finite() && x > 0.0;
    if !positive(settings.sigma) {
        return Err(Error::Setting { name: "sigma", value: settings.sigma, must_be: "positive, in metres" });
    }
    if !(positive(settings.half_angle) && settings.half_angle < std::f64::consts::FRAC_PI_2) {
        return Err(Error::Setting { name: "half_angle", value: settings.half_angle, must_be: "between 0 and pi / 2" });
    }
    match settings.normal {
        NormalMode::Footprint { radius } if !positive(radius) => {
            Err(Error::Setting { name: "radius", value: radius, must_be: "positive, in metres" })
        }
        _ => Ok(()),
    }
}
