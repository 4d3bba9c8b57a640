//! Times and poses in messages.

use foxglove::messages::{self, Timestamp};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use vio_ekf::Stamp;

pub(crate) fn stamp(time: Timestamp) -> Stamp {
    Stamp::from_nanos(i64::from(time.sec()) * 1_000_000_000 + i64::from(time.nsec()))
}

pub(crate) fn isometry(t: Option<messages::Vector3>, q: Option<messages::Quaternion>) -> Option<Isometry3<f64>> {
    let (t, q) = (t?, q?);
    isometry_of([t.x, t.y, t.z], [q.x, q.y, q.z, q.w])
}

/// Of a translation and a quaternion x y z w.
pub(crate) fn isometry_of([x, y, z]: [f64; 3], [i, j, k, w]: [f64; 4]) -> Option<Isometry3<f64>> {
    let rotation = UnitQuaternion::try_new(Quaternion::new(w, i, j, k), 0.5)?;
    Some(Isometry3::from_parts(Translation3::new(x, y, z), rotation))
}
