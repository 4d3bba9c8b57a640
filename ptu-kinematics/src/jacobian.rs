use nalgebra::{Matrix6, Vector3};

use crate::inverse::Hover;
use crate::settings::Ptu;

/// `∂(p, h) / ∂(r, ψ, θ₁, θ₂)`: rows are tip (3) and direction (3), columns position (3), heading, pan, tilt.
pub type Jacobian = Matrix6<f64>;

impl Ptu {
    /// The analytic Jacobian of the nozzle with respect to the hover state (ours). Each rotation column is
    /// `axis × (p - point on the axis)` for the tip and `axis × h` for the direction.
    pub fn jacobian(&self, hover: &Hover) -> Jacobian {
        let s = &self.settings;
        let world_from_body = hover.world_from_body();
        let nozzle = self.forward(&world_from_body, hover.joints);
        let azimuth = hover.heading + hover.joints.pan;
        let (sin, cos) = azimuth.sin_cos();
        let a = s.pan_from_tilt_axis;
        let pan_axis_point = world_from_body * nalgebra::Point3::from(s.body_from_pan_axis);
        let tilt_axis_point = pan_axis_point + Vector3::new(cos * a.x - sin * a.y, sin * a.x + cos * a.y, a.z);
        let up = Vector3::z();
        // Tilt is positive upwards: a right-handed rotation about minus the panned y axis.
        let tilt_axis = Vector3::new(sin, -cos, 0.0);
        let h = nozzle.direction.into_inner();

        let mut jacobian = Jacobian::zeros();
        jacobian.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        let axes = [(up, hover.position), (up, pan_axis_point), (tilt_axis, tilt_axis_point)];
        for (k, (axis, point)) in axes.into_iter().enumerate() {
            jacobian.fixed_view_mut::<3, 1>(0, 3 + k).copy_from(&axis.cross(&(nozzle.tip - point)));
            jacobian.fixed_view_mut::<3, 1>(3, 3 + k).copy_from(&axis.cross(&h));
        }
        jacobian
    }
}
