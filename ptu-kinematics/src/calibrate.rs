//! Identification of the hardware constants from measured nozzle poses.

use nalgebra::{DMatrix, DVector, Point3, UnitVector3, Vector3};

use crate::angle::elevation_rotation;
use crate::error::{Error, finite};
use crate::hover::Nozzle;
use crate::joints::Joints;
use crate::pan_tilt::Ptu;
use crate::settings::PtuSettings;
use crate::trace::span;

/// One measured nozzle pose, in body axes, with the joint angles at that moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Joint angles read back from the servos.
    pub joints: Joints,
    /// Nozzle tip in body axes, metres.
    pub tip_in_body: Point3<f64>,
    /// Spray direction in body axes.
    pub direction_in_body: UnitVector3<f64>,
}

/// What [`calibrate`] found.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// The prior settings with offsets and gun pitch replaced.
    pub settings: PtuSettings,
    /// Root mean square distance between measured and modelled tips, metres.
    pub tip_rms: f64,
    /// Root mean square angle between measured and modelled directions, radians.
    pub direction_rms: f64,
}

/// Fits the offsets `a`, `b`, `c` and the gun pitch `μ` to observed nozzle poses.
///
/// Given the joint angles the tip is linear in the nine offsets, so the fit is one least-squares problem. Two directions
/// can never be told apart — `a_z` from `b_z` and `a_y` from `c_y`, whose axes stay parallel — and a joint that did not
/// move hides more; along all of these the answer stays at `prior` (minimum-norm correction). The gun pitch is the mean
/// elevation of the measured directions in the tilted frame.
pub fn calibrate(prior: &PtuSettings, observations: &[Observation]) -> Result<Calibration, Error> {
    span!("calibrate");
    if observations.len() < 3 {
        let got = format!("{} observations", observations.len());
        return Err(Error::Calibration { need: "at least 3 observations", got });
    }
    let model = Ptu::new(*prior)?;
    let n = observations.len();
    let mut design = DMatrix::zeros(3 * n, 9);
    let mut residual = DVector::zeros(3 * n);
    let mut pitch = Vector3::zeros();
    for (k, o) in observations.iter().enumerate() {
        finite("observation", [o.joints.pan, o.joints.tilt])?;
        finite("observed tip", o.tip_in_body.into())?;
        finite("observed direction", o.direction_in_body.into_inner().into())?;
        let pan = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), o.joints.pan);
        let tilted = pan * elevation_rotation(o.joints.tilt);
        design.fixed_view_mut::<3, 3>(3 * k, 0).copy_from(pan.matrix());
        design.fixed_view_mut::<3, 3>(3 * k, 3).fill_with_identity();
        design.fixed_view_mut::<3, 3>(3 * k, 6).copy_from(tilted.matrix());
        let modelled = model.forward(&nalgebra::Isometry3::identity(), o.joints).tip;
        residual.fixed_rows_mut::<3>(3 * k).copy_from(&(o.tip_in_body - modelled));
        pitch += tilted.inverse() * o.direction_in_body.into_inner();
    }
    if pitch.x.hypot(pitch.z) < 0.5 * n as f64 {
        let got = "directions that contradict each other".to_string();
        return Err(Error::Calibration { need: "directions near the x axis of the tilted frame", got });
    }
    let svd = design.svd(true, true);
    let cutoff = 1e-9 * svd.singular_values.max();
    let correction = svd
        .solve(&residual, cutoff)
        .map_err(|why| Error::Calibration { need: "a solvable least-squares problem", got: why.to_string() })?;
    let mut settings = *prior;
    settings.pan_from_tilt_axis += correction.fixed_rows::<3>(0);
    settings.body_from_pan_axis += correction.fixed_rows::<3>(3);
    settings.tilt_from_tip += correction.fixed_rows::<3>(6);
    settings.gun_pitch = pitch.z.atan2(pitch.x);

    let fitted = Ptu::new(settings)?;
    let (mut tip_squares, mut angle_squares) = (0.0, 0.0);
    for o in observations {
        let Nozzle { tip, direction } = fitted.forward(&nalgebra::Isometry3::identity(), o.joints);
        tip_squares += (o.tip_in_body - tip).norm_squared();
        angle_squares += direction.angle(&o.direction_in_body).powi(2);
    }
    Ok(Calibration {
        settings,
        tip_rms: (tip_squares / n as f64).sqrt(),
        direction_rms: (angle_squares / n as f64).sqrt(),
    })
}
