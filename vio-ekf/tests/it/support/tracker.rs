//! A source of poses, such as a motion capture or a camera that is tracked.

use nalgebra::{Isometry3, Translation3, Vector3};
use vio_ekf::fusion::{AlignmentSettings, ExtrinsicsSettings, PoseMeasurement, PoseSource};
use vio_ekf::lie::so3;
use vio_ekf::{Stamp, nalgebra};

use super::flight::Flight;

/// A source of poses along a flight: its true frame, place, scale and delay.
#[derive(Clone, Copy)]
pub(crate) struct Tracker {
    pub(crate) source_from_world: Isometry3<f64>,
    pub(crate) body_from_sensor: Isometry3<f64>,
    pub(crate) scale: f64,
    /// Its stamps are this late, ns.
    pub(crate) late: i64,
    pub(crate) position_sigma: f64,
    pub(crate) attitude_sigma: f64,
}

impl Default for Tracker {
    fn default() -> Self {
        let body_from_sensor = Isometry3::new(Vector3::new(0.25, -0.1, 0.05), Vector3::new(0.3, -0.4, 0.5));
        Self {
            source_from_world: Isometry3::identity(),
            body_from_sensor,
            scale: 1.0,
            late: 0,
            position_sigma: 0.01,
            attitude_sigma: 0.005,
        }
    }
}

impl Tracker {
    /// What a filter that knows all about the source assumes.
    pub(crate) fn known(&self) -> PoseSource {
        PoseSource {
            alignment: AlignmentSettings { source_from_world: self.source_from_world, ..AlignmentSettings::default() },
            extrinsics: ExtrinsicsSettings { body_from_sensor: self.body_from_sensor, ..ExtrinsicsSettings::default() },
            scale: self.scale,
            time_offset_s: -self.late as f64 * 1e-9,
            ..PoseSource::default()
        }
    }

    /// The pose taken at a time, with noise.
    pub(crate) fn pose(&self, flight: &mut Flight, taken: Stamp) -> PoseMeasurement {
        let world_from_sensor = flight.truth(taken).world_from_body * self.body_from_sensor;
        let stretched = Isometry3::from_parts(
            (world_from_sensor.translation.vector * self.scale).into(),
            world_from_sensor.rotation,
        );
        let exact = self.source_from_world * stretched;
        let pose = Isometry3::from_parts(
            Translation3::from(exact.translation.vector + flight.rng.normals() * self.position_sigma),
            so3::exp(&(flight.rng.normals() * self.attitude_sigma)) * exact.rotation,
        );
        let stamp = Stamp::from_nanos(taken.nanos() + self.late);
        PoseMeasurement::isotropic(0, stamp, pose, self.position_sigma, self.attitude_sigma)
    }
}
