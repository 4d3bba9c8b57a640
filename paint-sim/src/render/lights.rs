//! The light on a surface.

use nalgebra::{UnitVector3, Vector3};

/// The light in the scene, linear RGB. A white surface that faces the sun appears as `sun + ambient`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lights {
    /// Unit vector towards the sun, world frame.
    pub towards_sun: UnitVector3<f64>,
    /// Light of the sun, linear RGB.
    pub sun: [f32; 3],
    /// Light from everywhere, linear RGB.
    pub ambient: [f32; 3],
    /// What is seen where there is no surface, linear RGB.
    pub background: [f32; 3],
}

impl Default for Lights {
    /// A high sun from the front right.
    fn default() -> Self {
        let towards_sun = UnitVector3::new_normalize(Vector3::new(0.3, -0.4, 0.87));
        Self { towards_sun, sun: [0.7; 3], ambient: [0.3; 3], background: [0.85, 0.9, 1.0] }
    }
}

/// How a point of the surface is shaded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shading {
    /// Albedo, linear RGB.
    pub albedo: [f32; 3],
    /// Unit normal for the light, either side: the hit's own for facets, an interpolated one for smooth shading. Shadows and
    /// [`Frame::normals`](super::Frame::normals) follow the geometry.
    pub normal: Vector3<f64>,
}
