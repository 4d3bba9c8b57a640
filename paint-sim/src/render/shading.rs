//! What is asked of a point of the surface.

use nalgebra::Vector3;

use super::coat::Coat;

/// How a point of the surface is shaded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shading {
    /// Albedo, linear RGB.
    pub albedo: [f32; 3],
    /// Unit normal for the light, either side: the hit's own for facets, an interpolated one for smooth shading. Shadows and
    /// [`Frame::normals`](super::Frame::normals) follow the geometry.
    pub normal: Vector3<f64>,
    /// What makes it glossy; `None` is matt.
    pub coat: Option<Coat>,
}

impl Shading {
    /// A matt point.
    pub fn matt(albedo: [f32; 3], normal: Vector3<f64>) -> Self {
        Self { albedo, normal, coat: None }
    }
}
