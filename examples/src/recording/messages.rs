//! What Foxglove's messages are made of.

use foxglove::messages::{Color, Quaternion, SceneEntity, SceneUpdate, Vector3 as FoxgloveVector3};
use nalgebra::Isometry3;

pub(crate) fn vector(pose: &Isometry3<f64>) -> FoxgloveVector3 {
    let t = pose.translation.vector;
    FoxgloveVector3 { x: t.x, y: t.y, z: t.z }
}

pub(crate) fn quaternion(pose: &Isometry3<f64>) -> Quaternion {
    let q = pose.rotation.quaternion();
    Quaternion { x: q.i, y: q.j, z: q.k, w: q.w }
}

pub(crate) fn rgb([r, g, b]: [u8; 3]) -> Color {
    Color { r: f64::from(r) / 255.0, g: f64::from(g) / 255.0, b: f64::from(b) / 255.0, a: 1.0 }
}

pub(crate) fn scene(entities: Vec<SceneEntity>) -> SceneUpdate {
    SceneUpdate { deletions: Vec::new(), entities }
}

/// A point as a message.
pub(crate) fn point(p: impl Into<[f64; 3]>) -> foxglove::messages::Point3 {
    let [x, y, z] = p.into();
    foxglove::messages::Point3 { x, y, z }
}
