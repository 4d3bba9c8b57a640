//! The axes of the inertial samples beside the images of a recording, before the filter runs.

use crate::camera::Camera;
use crate::error::Error;
use crate::filter::frontend::point_tracker::PointTracker;
use crate::filter::point_observation::PointObservation;
use crate::filter::settings::PatchSettings;
use crate::imu_check::axes::check_imu_axes;
use crate::imu_check::static_view::{StaticView, static_view};
use crate::imu_check::validation::ImuWarning;
use crate::imu_check::window::busiest_window;
use crate::run::frames::{Picture, RecordedFrame};
use crate::samples::{ImageView, Imu};
use crate::stamp::Stamp;

/// Length of the part of the recording that is looked at, s: the one with the most rotation.
const WINDOW_S: f64 = 12.0;

/// What the images say about the axes of both inertial sensors; nothing where they say nothing against them. Points are tracked
/// through the part of the recording that turns most; the other frames are not looked at. Those that stay in their place while the
/// camera turns are no evidence, and are [named](ImuWarning::StaticView) if they are many; none lie where the `mask` is 0.
/// `time_offset_s` is added to the frames' stamps, gravity in m/s².
///
/// # Errors
/// [`Error`] if the camera's calibration cannot be, or the mask is not of its size.
pub fn check_axes_with_images<P: Picture>(
    samples: &[Imu],
    frames: impl IntoIterator<Item = RecordedFrame<P>>,
    (camera, mask): (&Camera, Option<&ImageView>),
    (gravity, time_offset_s): (f64, f64),
) -> Result<Vec<ImuWarning>, Error> {
    let Some((from, until)) = busiest_window(samples, WINDOW_S) else { return Ok(Vec::new()) };
    let mut tracker = PointTracker::new(*camera, &PatchSettings::default())?;
    mask.map_or(Ok(()), |mask| tracker.set_mask(mask))?;
    let mut images: Vec<(Stamp, Vec<PointObservation>)> = Vec::new();
    let frames = frames.into_iter().skip_while(|frame| frame.stamp < from);
    for RecordedFrame { stamp, picture, .. } in frames.take_while(|frame| frame.stamp <= until) {
        // What cannot be read is counted by the run.
        let Ok(picture) = picture else { continue };
        if let Ok(points) = tracker.image(&picture.view()) {
            images.push((stamp, points));
        }
    }
    let about = |sample: &&Imu| (from.plus_secs(-1.0)..=until.plus_secs(1.0)).contains(&sample.stamp);
    let samples: Vec<_> = samples.iter().filter(about).copied().collect();
    if samples.len() < 2 {
        return Ok(Vec::new());
    }
    let inside = samples[0].stamp..=samples[samples.len() - 1].stamp;
    images.retain(|(stamp, _)| inside.contains(&stamp.plus_secs(time_offset_s)));
    let mut warnings = Vec::new();
    if let Some(StaticView { ids, share, low, high }) = static_view(&samples, &images, camera, time_offset_s) {
        for (_, points) in &mut images {
            points.retain(|point| ids.binary_search(&point.id).is_err());
        }
        warnings.push(ImuWarning::StaticView { share, low, high });
    }
    let found = check_imu_axes(&samples, &images, camera, (gravity, time_offset_s))?;
    let readings = [("gyroscope", found.gyro), ("accelerometer", found.accel)];
    warnings.extend(
        readings.into_iter().filter_map(|(sensor, reading)| Some(ImuWarning::Images { sensor, reading: reading? })),
    );
    Ok(warnings)
}
