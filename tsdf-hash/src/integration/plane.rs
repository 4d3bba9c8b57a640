//! The plane seen at a pixel.

/// The plane seen at a pixel: a voxel at depth `z`, `(du, dv)` pixels beside the pixel's centre, is
/// `offset - z (scaled_omega + scaled_slope · (du, dv))` steps of the stored distance in front of it.
#[derive(Clone, Copy)]
pub(crate) struct Plane {
    /// Distance of the camera from the plane, in steps of the stored distance (`μ / 32767`).
    pub(crate) offset: f32,
    /// Inverse depth at the pixel's centre times the offset; 0 if the pixel is not fused.
    pub(crate) scaled_omega: f32,
    /// Slopes of the inverse depth per pixel, times the offset. The weight of the observation, an integer in `1..=15`,
    /// sits in the last four bits of the second one, where it is a relative error below `2e-6`.
    pub(crate) scaled_slope: [f32; 2],
}

impl Plane {
    /// Of a pixel that is not fused.
    pub(crate) const NONE: Self = Self { offset: 1.0, scaled_omega: 0.0, scaled_slope: [0.0; 2] };

    /// Inverse depth at the pixel's centre, 1/m; `None` if it is not fused.
    pub(crate) fn omega(&self) -> Option<f32> {
        (self.scaled_omega > 0.0).then(|| self.scaled_omega / self.offset)
    }
}
