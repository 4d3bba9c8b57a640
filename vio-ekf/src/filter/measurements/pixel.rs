//! The pixel of a landmark that a tracker of the caller's own has found.

use nalgebra::{Matrix2, SMatrix, Vector2};

use super::measurement::{Measurement, Trial};
use super::patch::{ROW_TIME, WITH_LENS, WITHOUT_LENS};
use crate::camera::Camera;
use crate::camera::intrinsics::INTRINSICS;
use crate::camera::model::CameraModel;
use crate::filter::settings::{LandmarkSettings, UpdateSettings};
use crate::filter::state::error_state::bearing_and_camera;
use crate::filter::state::landmark::{Landmark, project};
use crate::filter::state::rolling_shutter::RollingShutter;
use crate::inertial::iterated_update::Linearization;

/// A pixel of the first camera.
#[derive(Debug)]
pub(crate) struct PixelMeasurement<'a, const C: usize> {
    /// First row of the landmark.
    pub(crate) row: usize,
    pub(crate) pixel: Vector2<f64>,
    /// The landmark in the state.
    pub(crate) landmark: Landmark,
    /// Velocity of its bearing, in tangent coordinates, rad/s.
    pub(crate) rate: Vector2<f64>,
    /// Change of the time offset since the state was propagated to the image, s.
    pub(crate) time_offset_error: f64,
    pub(crate) shutter: RollingShutter,
    pub(crate) camera: &'a dyn CameraModel,
    /// The camera where its intrinsics are estimated.
    pub(crate) lens: Option<Camera>,
    pub(crate) landmarks: &'a LandmarkSettings,
    pub(crate) update: &'a UpdateSettings,
}

impl<'a> PixelMeasurement<'a, WITHOUT_LENS> {
    /// The same that depends on the lens.
    pub(crate) fn with_lens(self) -> PixelMeasurement<'a, WITH_LENS> {
        let Self { row, pixel, landmark, rate, time_offset_error, shutter, camera, lens, landmarks, update } = self;
        PixelMeasurement { row, pixel, landmark, rate, time_offset_error, shutter, camera, lens, landmarks, update }
    }
}

impl<const C: usize> Measurement<2, C> for PixelMeasurement<'_, C> {
    fn rows(&self) -> [usize; C] {
        bearing_and_camera(self.row)
    }

    fn linearize(&self, trial: &Trial<'_, C>) -> Option<Linearization<2, C>> {
        let delta = trial.delta;
        let is_estimated = self.lens.is_some() && C > WITHOUT_LENS;
        let shutter = if is_estimated { self.shutter.slower(delta[ROW_TIME]) } else { self.shutter };
        let since = self.time_offset_error + shutter.delay(&self.pixel) + delta[2];
        let step = Vector2::new(delta[0], delta[1]) + self.rate * since;
        let bearing = self.landmark.bearing.boxplus(&step);
        let changed: Option<Camera> = self
            .lens
            .as_ref()
            .filter(|_| C > WITHOUT_LENS)
            .map(|lens| lens.with_intrinsics_changed(&std::array::from_fn(|k| delta[WITHOUT_LENS + k])));
        let camera = changed.as_ref().map_or(self.camera, |lens| lens);
        let (pixel, by_bearing) = project(camera, &bearing)?;
        let mut jacobian = SMatrix::<f64, 2, C>::zeros();
        jacobian.fixed_columns_mut::<2>(0).copy_from(&by_bearing);
        jacobian.set_column(2, &(by_bearing * self.rate));
        if let Some(lens) = &changed {
            let by_lens = lens.intrinsics_jacobian(&bearing.direction())?;
            jacobian.columns_mut(WITHOUT_LENS, INTRINSICS).copy_from(&by_lens);
            jacobian.set_column(ROW_TIME, &(by_bearing * self.rate * shutter.rows_after_stamp(&self.pixel)));
        }
        let noise = Matrix2::identity() * self.landmarks.pixel_sigma.powi(2);
        Some(Linearization { residual: self.pixel - pixel, jacobian, noise })
    }

    fn max_iterations(&self) -> usize {
        self.update.max_iterations
    }

    fn gate(&self) -> f64 {
        self.update.max_mahalanobis
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{SVector, Vector3};

    use super::*;
    use crate::filter::settings::Settings;
    use crate::filter::state::bearing::Bearing;
    use crate::filter::state::error_state;
    use crate::filter::state::inverse_distance::InverseDistance;
    use crate::filter::state::vio_state::VioState;

    /// The derivative against differences, at no step and at one that changes the lens: then with another focal length another pixel.
    #[test]
    fn the_pixel_moves_with_bearing_clock_and_lens() {
        let (camera, settings, state) = (Camera::euroc(), Settings::default(), VioState::empty());
        let pixel = Vector2::new(600.0, 100.0);
        let bearing = Bearing::new(&camera.bearing(&pixel).unwrap());
        let landmark = Landmark::new(bearing, InverseDistance::new(0.2), Matrix2::identity());
        let measurement = PixelMeasurement::<WITHOUT_LENS> {
            row: error_state::FIXED,
            pixel,
            landmark,
            rate: Vector2::new(0.3, -0.5),
            time_offset_error: 0.0,
            shutter: RollingShutter::new(&camera, 0.0),
            camera: &camera,
            lens: Some(camera),
            landmarks: &settings.landmarks,
            update: &settings.update,
        }
        .with_lens();
        let rows = measurement.rows();
        let linearize = |delta: &SVector<f64, WITH_LENS>| {
            let (state, rate_in_body) = (&state, &Vector3::zeros());
            measurement.linearize(&Trial { state, rate_in_body, rows: &rows, delta }).unwrap()
        };
        let still = SVector::<f64, WITH_LENS>::zeros();
        assert!(linearize(&still).residual.norm() < 1e-9);
        let mut stepped = still;
        (stepped[0], stepped[2], stepped[WITHOUT_LENS], stepped[WITHOUT_LENS + 2]) = (1e-3, 2e-4, 4.0, -3.0);
        // Where the principal point lies two pixels farther right, so does all that is seen.
        let mut farther = still;
        farther[WITHOUT_LENS + 2] = 2.0;
        assert!((linearize(&farther).residual - Vector2::new(-2.0, 0.0)).norm() < 1e-9);
        for at in [still, stepped] {
            let jacobian = linearize(&at).jacobian;
            for column in 0..WITH_LENS {
                let h = 1e-6;
                let [one, two] = [h, -h].map(|h| {
                    let mut delta = at;
                    delta[column] += h;
                    -linearize(&delta).residual
                });
                let slope = (one - two) / (2.0 * h);
                let off = (slope - jacobian.column(column)).norm();
                assert!(off < 1e-3 * slope.norm().max(1.0), "column {column} at {at}: {off}");
            }
        }
    }
}
