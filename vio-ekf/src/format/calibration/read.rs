//! Reads calibrations of both formats.

use nalgebra::Isometry3;

use super::schema::{CameraChain, CameraSection, ImuChain, ImuSection, parse};
use super::section::Section;
use super::types::{CameraCalibration, ImuCalibration};
use crate::camera::{Camera, Distortion};
use crate::error::Error;
use crate::samples::ImuNoise;

const WHOLE_FILE: Section = Section { prefix: "", line: 1 };
/// Kalibr writes two chains, and the one of the cameras alone does not say where the inertial sensor is.
const NO_IMU: &str = "is missing: this chain is of cameras alone, give the one that Kalibr's calibration with the inertial sensor \
                      wrote (`camchain-imucam`)";
/// What is open to lenses of other models.
const KNOWN_MODELS: &str = "only `pinhole`, `omni`, `ds` and `eucm` are read from files: a lens of another model goes into the filter as \
                            a `CameraModel`";

/// Reads the `sensor.yaml` of an EuRoC/ASL camera.
pub fn read_asl_camera(text: &str) -> Result<CameraCalibration, Error> {
    let keys: CameraSection = parse(text)?;
    let at = WHOLE_FILE;
    let body_from_camera = at.asl_pose(keys.body_from_sensor.as_ref())?;
    let camera = camera(&at, &keys, "distortion_coefficients", body_from_camera)?;
    Ok(CameraCalibration {
        camera,
        rate_hz: at.optional("rate_hz", &keys.rate_hz)?,
        time_offset_s: 0.0,
        row_time_s: row_time(&at, &keys)?,
    })
}

/// Reads the `sensor.yaml` of an EuRoC/ASL inertial sensor.
pub fn read_asl_imu(text: &str) -> Result<ImuCalibration, Error> {
    let keys: ImuSection = parse(text)?;
    let at = WHOLE_FILE;
    let rate_hz = at.number("rate_hz", &keys.rate_hz)?;
    imu(&at, &keys, rate_hz, at.asl_pose(keys.body_from_sensor.as_ref())?)
}

/// Reads the cameras `cam0`, `cam1` ... of a Kalibr camera chain, in the order of the file.
pub fn read_kalibr_cameras(text: &str) -> Result<Vec<CameraCalibration>, Error> {
    let CameraChain { cameras: sections, others } = parse(text)?;
    if sections.is_empty() {
        let found = if others.is_empty() { "nothing".into() } else { format!("`{}`", others.join("`, `")) };
        let what = format!("no section `cam0:`, found {found}: give the camera chain that Kalibr wrote");
        return Err(WHOLE_FILE.refuse(WHOLE_FILE.line, "cam0", &what));
    }
    let read = |(name, section): &(String, serde_saphyr::Spanned<CameraSection>)| {
        let keys = &section.value;
        let at = Section { prefix: &format!("{name}."), line: section.referenced.line() };
        let body_from_camera = if keys.imu_from_camera.is_some() {
            at.pose("T_imu_cam", &keys.imu_from_camera)?
        } else if keys.camera_from_imu.is_some() {
            at.pose("T_cam_imu", &keys.camera_from_imu)?.inverse()
        } else {
            return Err(at.refuse(at.line, "T_cam_imu", NO_IMU));
        };
        let camera = camera(&at, keys, "distortion_coeffs", body_from_camera)?;
        let time_offset_s = at.optional("timeshift_cam_imu", &keys.timeshift_cam_imu)?.unwrap_or(0.0);
        Ok(CameraCalibration { camera, rate_hz: None, time_offset_s, row_time_s: row_time(&at, keys)? })
    };
    sections.iter().map(read).collect()
}

/// Reads the inertial sensor of a Kalibr file: `imu0`, or the bare keys of its input file.
pub fn read_kalibr_imu(text: &str) -> Result<ImuCalibration, Error> {
    let chain = parse::<ImuChain>(text)?;
    if let Some(camera) = &chain.cam0 {
        let what = "is a section of a camera chain: give Kalibr's file of the inertial sensor";
        return Err(WHOLE_FILE.refuse(camera.referenced.line(), "cam0", what));
    }
    let (at, keys) = match chain.imu0 {
        Some(section) => (Section { prefix: "imu0.", line: section.referenced.line() }, section.value),
        None => (WHOLE_FILE, parse(text)?),
    };
    let rate_hz = at.number("update_rate", &keys.update_rate)?;
    let body_from_imu = if keys.imu_from_body.is_some() {
        at.pose("T_i_b", &keys.imu_from_body)?.inverse()
    } else {
        Isometry3::identity()
    };
    imu(&at, &keys, rate_hz, body_from_imu)
}

fn camera(
    at: &Section,
    keys: &CameraSection,
    coefficients: &str,
    body_from_camera: Isometry3<f64>,
) -> Result<Camera, Error> {
    let (model, line) = at.required("camera_model", &keys.camera_model)?;
    // What the model has of its own stands before the focal lengths.
    let (own, [fx, fy, cx, cy]) = match model.as_str() {
        "pinhole" => ([0.0; 2], at.numbers("intrinsics", &keys.intrinsics)?),
        "omni" => {
            let [xi, fx, fy, cx, cy] = at.numbers("intrinsics", &keys.intrinsics)?;
            ([xi, 0.0], [fx, fy, cx, cy])
        }
        "ds" | "eucm" => {
            let [a, b, fx, fy, cx, cy] = at.numbers("intrinsics", &keys.intrinsics)?;
            ([a, b], [fx, fy, cx, cy])
        }
        _ => return Err(at.refuse(line, "camera_model", &format!("is `{model}`, {KNOWN_MODELS}"))),
    };
    let [width, height] = at.numbers("resolution", &keys.resolution)?;
    let distortion = distortion((at, coefficients), keys, model, own)?;
    if !(1.0..=32768.0).contains(&width) || !(1.0..=32768.0).contains(&height) {
        let (_, line) = at.required("resolution", &keys.resolution)?;
        return Err(at.refuse(line, "resolution", "must be between 1 and 32768 pixels"));
    }
    let (width, height) = (width as usize, height as usize);
    let camera = Camera { width, height, fx, fy, cx, cy, distortion, body_from_camera };
    camera.check()?;
    Ok(camera)
}

/// Kalibr's calibration of rolling shutters calls it line delay.
fn row_time(at: &Section, keys: &CameraSection) -> Result<f64, Error> {
    Ok(at.optional("line_delay", &keys.line_delay)?.unwrap_or(0.0))
}

/// The lens: of the models that have their own form of it, or the polynomial of a pinhole.
fn distortion(
    (at, coefficients): (&Section, &str),
    keys: &CameraSection,
    projection: &str,
    own: [f64; 2],
) -> Result<Distortion, Error> {
    let four = || at.numbers(coefficients, &keys.distortion_coefficients);
    let (model, line) = at.required("distortion_model", &keys.distortion_model)?;
    let polynomial = matches!(model.as_str(), "radtan" | "radial-tangential" | "plumb_bob");
    match (projection, model.as_str()) {
        ("ds", "none") => Ok(Distortion::DoubleSphere(own)),
        ("eucm", "none") => Ok(Distortion::Eucm(own)),
        ("omni", "none") => Ok(Distortion::Omni { xi: own[0], radtan: [0.0; 4] }),
        ("omni", _) if polynomial => Ok(Distortion::Omni { xi: own[0], radtan: four()? }),
        ("pinhole", _) if polynomial => Ok(Distortion::RadTan(four()?)),
        ("pinhole", "equidistant") => Ok(Distortion::Equidistant(four()?)),
        ("pinhole", "none") => Ok(Distortion::None),
        (_, other) => {
            let known = match projection {
                "pinhole" => "only `radtan`, `radial-tangential`, `equidistant`, `none` are known",
                "omni" => "only `radtan`, `radial-tangential`, `none` go with `omni`",
                _ => "only `none` goes with `ds` and `eucm`",
            };
            Err(at.refuse(line, "distortion_model", &format!("is `{other}`, {known}")))
        }
    }
}

fn imu(at: &Section, keys: &ImuSection, rate_hz: f64, body_from_imu: Isometry3<f64>) -> Result<ImuCalibration, Error> {
    let noise = ImuNoise {
        gyro_density: at.number("gyroscope_noise_density", &keys.gyroscope_noise_density)?,
        gyro_walk: at.number("gyroscope_random_walk", &keys.gyroscope_random_walk)?,
        accel_density: at.number("accelerometer_noise_density", &keys.accelerometer_noise_density)?,
        accel_walk: at.number("accelerometer_random_walk", &keys.accelerometer_random_walk)?,
    };
    noise.check()?;
    if rate_hz <= 0.0 {
        return Err(crate::error::invalid("rate_hz", rate_hz, "must be positive"));
    }
    Ok(ImuCalibration { noise, rate_hz, body_from_imu })
}
