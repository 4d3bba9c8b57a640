//! Which axes, signs and unit inertial samples have, as the images of a camera tell.

use nalgebra::Matrix3;

use crate::camera::model::CameraModel;
use crate::error::Error;
use crate::filter::point_observation::PointObservation;
use crate::imu_check::accelerometer::check_accelerometer;
use crate::imu_check::bias_at_rest::bias_at_rest;
use crate::imu_check::gyroscope::check_gyroscope;
use crate::imu_check::reading::AxesReading;
use crate::imu_check::seen_image::SeenImage;
use crate::samples::Imu;
use crate::stamp::Stamp;
use crate::trajectory::same_length;

/// What the images say about the axes of inertial samples. `None` where nothing is wrong, or nothing can be told.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AxesCheck {
    /// How the gyroscope has to be read.
    pub gyro: Option<AxesReading>,
    /// How the accelerometer has to be read, once the gyroscope is.
    pub accel: Option<AxesReading>,
    /// Pairs of images that told of the gyroscope, and windows that told of the accelerometer.
    pub evidence: [usize; 2],
}

/// Compares inertial samples with the points that a tracker has followed through the images, each by its id, without any help of the
/// samples.
///
/// The gyroscope's reading is the one with which points of two images, turned into common axes, have the normals of their epipolar
/// planes in one plane (Kneip and Lynen 2013). The accelerometer's is the one with which the points stay where they are while the
/// camera moves under gravity of its known length: linear equations in velocity, gravity, bias and distances (Martinelli 2014), in
/// which the reading is linear too, so that all 48 signed permutations cost one set of equations a window. `time_offset_s` is added to
/// the images' stamps.
///
/// An axis that the motion does not excite looks the same with either sign, and is not named.
pub fn check_imu_axes(
    samples: &[Imu],
    images: &[(Stamp, Vec<PointObservation>)],
    camera: &dyn CameraModel,
    (gravity, time_offset_s): (f64, f64),
) -> Result<AxesCheck, Error> {
    same_length("samples", samples.len().min(2), "samples that are needed", 2)?;
    let body_from_camera = camera.body_from_camera();
    let images: Vec<SeenImage> = images
        .iter()
        .map(|(stamp, points)| SeenImage {
            stamp: stamp.plus_secs(time_offset_s),
            points: points
                .iter()
                .filter_map(|p| Some((p.id, body_from_camera.rotation * camera.bearing(&p.pixel)?.into_inner())))
                .collect(),
        })
        .filter(|image| image.stamp >= samples[0].stamp && image.stamp <= samples[samples.len() - 1].stamp)
        .collect();
    let bias = bias_at_rest(samples);
    let (gyro, pairs) = check_gyroscope(samples, &images, &bias);
    let read = gyro.unwrap_or_else(|| AxesReading::new(Matrix3::identity(), false));
    let turned = |sample: &Imu| Imu { gyro: read.axes * (sample.gyro - bias) * read.factor(), ..*sample };
    let samples: Vec<Imu> = samples.iter().map(turned).collect();
    let lever = body_from_camera.translation.vector;
    let (accel, windows) = check_accelerometer(&samples, &images, &lever, gravity);
    Ok(AxesCheck { gyro, accel, evidence: [pairs, windows] })
}
