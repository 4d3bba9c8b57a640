//! How well the camera's calibration is known.

use crate::error::Error;
use crate::error::{all_not_negative, invalid};

/// Uncertainty of the calibration. A zero means known exactly: the quantity is then not estimated.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct CalibrationSettings {
    /// Standard deviation of the camera's position on the body, m per axis; ours: 0.
    pub camera_position_sigma_m: f64,
    /// Standard deviation of the camera's attitude on the body, rad per axis; ours: 0.
    pub camera_attitude_sigma: f64,
    /// Seconds to add to the camera's stamps to get the inertial sensor's time (`timeshift_cam_imu` of Kalibr); 0.
    pub time_offset_s: f64,
    /// Its standard deviation, s; ours, where none is given: 1 ms of a clock that a calibration file describes
    /// ([`Vio::from_calibration`](crate::Vio::from_calibration)), and 0, known exactly, of a camera that is given itself.
    pub time_offset_sigma_s: Option<f64>,
    /// Standard deviation of the focal length, relative; ours: 0. With this or one of the next two the intrinsics are estimated, of
    /// Kalibr's models alone. Both axes err together, and a tenth of it each by itself.
    pub focal_sigma: f64,
    /// Standard deviation of the principal point, pixels per axis; ours: 0.
    pub principal_point_sigma_px: f64,
    /// Standard deviation of the first term of the distortion (`k1`; `xi` of `ds`, `alpha` of `eucm`); a third of it is that of the
    /// second; ours: 0.
    pub distortion_sigma: f64,
    /// Where intrinsics are estimated: standard deviation of the angles of the second camera against the first, rad; ours: 0.
    pub stereo_attitude_sigma: f64,
    /// The same of its place, m per axis; ours: 0.
    pub stereo_position_sigma_m: f64,
    /// Standard deviation of the stamp of each image, s; ours: 0. With it every image has an offset of its own, found with the
    /// landmarks that it sees, and the mean offset is taken as known.
    pub stamp_jitter_s: f64,
    /// Time from the exposure of a row until that of the row below, s: rolling shutter. 0, a global shutter. The stamp of an image is
    /// then that of its middle row. One camera only.
    pub row_time_s: f64,
    /// Its standard deviation, s; ours: 0. It is estimated with the intrinsics, and with one camera only.
    pub row_time_sigma_s: f64,
}

impl CalibrationSettings {
    /// Of what is left of a ruler, a guess, or another camera's file, all of it estimated: lenses to 3 %, 10 pixels and 0.15 of the
    /// first term of the distortion; the camera on the body to 3 cm and 3 degrees, its clock to 15 ms; the read-out of 480 rows to 24 ms,
    /// of one camera alone; two cameras to 2 mm and half a degree.
    #[must_use]
    pub fn roughly(self) -> Self {
        Self {
            camera_position_sigma_m: 0.03,
            camera_attitude_sigma: 0.05,
            time_offset_sigma_s: Some(0.015),
            focal_sigma: 0.03,
            principal_point_sigma_px: 10.0,
            distortion_sigma: 0.15,
            stereo_attitude_sigma: 0.01,
            stereo_position_sigma_m: 0.002,
            row_time_sigma_s: 5e-5,
            ..self
        }
    }

    /// The lenses alone, the first term of the distortion to 0.3.
    pub(crate) fn of_lenses_only(self) -> Self {
        Self {
            camera_position_sigma_m: 0.0,
            camera_attitude_sigma: 0.0,
            time_offset_sigma_s: Some(0.0),
            distortion_sigma: 2.0 * self.distortion_sigma,
            ..self
        }
    }

    /// Place and clock of the camera alone.
    pub(crate) fn of_place_only(self) -> Self {
        Self {
            focal_sigma: 0.0,
            principal_point_sigma_px: 0.0,
            distortion_sigma: 0.0,
            stereo_attitude_sigma: 0.0,
            stereo_position_sigma_m: 0.0,
            row_time_sigma_s: 0.0,
            ..self
        }
    }

    /// Of what a first estimate leaves, all of it estimated: a tenth of [`roughly`](Self::roughly).
    #[must_use]
    pub fn nearly(self) -> Self {
        let rough = self.roughly();
        Self {
            camera_position_sigma_m: 0.1 * rough.camera_position_sigma_m,
            camera_attitude_sigma: 0.1 * rough.camera_attitude_sigma,
            time_offset_sigma_s: rough.time_offset_sigma_s.map(|sigma| 0.1 * sigma),
            focal_sigma: 0.1 * rough.focal_sigma,
            principal_point_sigma_px: 0.1 * rough.principal_point_sigma_px,
            distortion_sigma: 0.1 * rough.distortion_sigma,
            stereo_attitude_sigma: 0.1 * rough.stereo_attitude_sigma,
            stereo_position_sigma_m: 0.1 * rough.stereo_position_sigma_m,
            row_time_sigma_s: 0.1 * rough.row_time_sigma_s,
            ..self
        }
    }

    /// Whether the intrinsics are estimated.
    pub(crate) fn estimates_intrinsics(&self) -> bool {
        [self.focal_sigma, self.principal_point_sigma_px, self.distortion_sigma, self.row_time_sigma_s]
            .iter()
            .any(|sigma| *sigma > 0.0)
    }

    pub(super) fn check(&self) -> Result<(), Error> {
        if self.time_offset_s.is_nan() || self.time_offset_s.abs() > 10.0 {
            return Err(invalid("time_offset_s", self.time_offset_s, "must be below 10 s"));
        }
        // From the bottom to the top is possible; a whole read-out longer than a second is not.
        if self.row_time_s.is_nan() || self.row_time_s.abs() > 1e-3 {
            return Err(invalid(
                "row_time_s",
                self.row_time_s,
                "must be below 0.001 s: a read-out of 30 ms over 480 rows is 6.25e-5",
            ));
        }
        all_not_negative(&[
            ("camera_position_sigma_m", self.camera_position_sigma_m),
            ("camera_attitude_sigma", self.camera_attitude_sigma),
            ("time_offset_sigma_s", self.time_offset_sigma_s.unwrap_or(0.0)),
            ("stamp_jitter_s", self.stamp_jitter_s),
            ("focal_sigma", self.focal_sigma),
            ("principal_point_sigma_px", self.principal_point_sigma_px),
            ("distortion_sigma", self.distortion_sigma),
            ("stereo_attitude_sigma", self.stereo_attitude_sigma),
            ("stereo_position_sigma_m", self.stereo_position_sigma_m),
            ("row_time_sigma_s", self.row_time_sigma_s),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lenses_alone_are_tried_with_twice_the_distortion_of_a_rough_guess() {
        let lenses = CalibrationSettings::default().roughly().of_lenses_only();
        assert_eq!((lenses.distortion_sigma, lenses.focal_sigma, lenses.principal_point_sigma_px), (0.3, 0.03, 10.0));
        let place = [lenses.camera_position_sigma_m, lenses.camera_attitude_sigma];
        assert_eq!((place, lenses.time_offset_sigma_s), ([0.0; 2], Some(0.0)));
    }
}
