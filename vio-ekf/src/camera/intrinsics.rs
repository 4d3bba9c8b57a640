//! The intrinsics of a lens as numbers that can be estimated.

use nalgebra::{SMatrix, Vector3};

use super::{Camera, Distortion};

/// Focal lengths and principal point in pixels, and the first two terms of the distortion.
pub(crate) const INTRINSICS: usize = 6;

/// Step of the derivative by a term of the distortion.
const STEP: f64 = 1e-5;

impl Camera {
    /// The same lens in a form that has all intrinsics: without distortion it becomes a polynomial of zeros.
    pub(crate) fn estimable(self) -> Self {
        match self.distortion {
            Distortion::None => Self { distortion: Distortion::RadTan([0.0; 4]), ..self },
            _ => self,
        }
    }

    /// With intrinsics that are larger by so much; what no lens has is cut to the range of its model.
    pub(crate) fn with_intrinsics_changed(&self, delta: &[f64; INTRINSICS]) -> Self {
        let [fx, fy, cx, cy, first, second] = *delta;
        let distortion = match self.distortion {
            Distortion::None => Distortion::None,
            Distortion::RadTan([k1, k2, p1, p2]) => Distortion::RadTan([k1 + first, k2 + second, p1, p2]),
            Distortion::Equidistant([k1, k2, k3, k4]) => Distortion::Equidistant([k1 + first, k2 + second, k3, k4]),
            Distortion::Omni { xi, radtan: [k1, k2, p1, p2] } => {
                Distortion::Omni { xi, radtan: [k1 + first, k2 + second, p1, p2] }
            }
            Distortion::DoubleSphere([xi, alpha]) => {
                Distortion::DoubleSphere([(xi + first).clamp(-0.99, 1.0), (alpha + second).clamp(0.0, 1.0)])
            }
            Distortion::Eucm([alpha, beta]) => {
                Distortion::Eucm([(alpha + first).clamp(0.0, 1.0), (beta + second).max(1e-3)])
            }
        };
        let [fx, fy] = [self.fx + fx, self.fy + fy].map(|f| f.max(1.0));
        Self { fx, fy, cx: self.cx + cx, cy: self.cy + cy, distortion, ..*self }
    }

    /// What has to be added to another lens of the same model to get this one.
    pub(crate) fn intrinsics_less(&self, other: &Self) -> [f64; INTRINSICS] {
        let terms = |camera: &Self| match camera.distortion {
            Distortion::None => [0.0; 2],
            Distortion::RadTan([a, b, ..])
            | Distortion::Equidistant([a, b, ..])
            | Distortion::Omni { radtan: [a, b, ..], .. } => [a, b],
            Distortion::DoubleSphere(terms) | Distortion::Eucm(terms) => terms,
        };
        let numbers = |camera: &Self| {
            let [first, second] = terms(camera);
            [camera.fx, camera.fy, camera.cx, camera.cy, first, second]
        };
        let (own, others) = (numbers(self), numbers(other));
        std::array::from_fn(|k| own[k] - others[k])
    }

    /// Derivative of the pixel of a point by the intrinsics.
    pub(crate) fn intrinsics_jacobian(&self, point_in_camera: &Vector3<f64>) -> Option<SMatrix<f64, 2, INTRINSICS>> {
        let pixel = self.project(point_in_camera)?;
        let mut jacobian = SMatrix::<f64, 2, INTRINSICS>::zeros();
        jacobian[(0, 0)] = (pixel.x - self.cx) / self.fx;
        jacobian[(1, 1)] = (pixel.y - self.cy) / self.fy;
        jacobian[(0, 2)] = 1.0;
        jacobian[(1, 3)] = 1.0;
        for term in 4..INTRINSICS {
            let moved = |step: f64| {
                let mut delta = [0.0; INTRINSICS];
                delta[term] = step;
                self.with_intrinsics_changed(&delta).project(point_in_camera)
            };
            // At the rim one side may have no pixel.
            let (low, high) = (moved(-STEP), moved(STEP));
            let steps = f64::from(u8::from(low.is_some()) + u8::from(high.is_some()));
            let change = high.unwrap_or(pixel) - low.unwrap_or(pixel);
            jacobian.set_column(term, &(change / (steps * STEP)));
        }
        jacobian.iter().all(|v| v.is_finite()).then_some(jacobian)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_derivative_is_that_of_the_projection() {
        let euroc = Camera::euroc();
        for distortion in [
            euroc.distortion,
            Distortion::RadTan([0.0; 4]),
            Distortion::Equidistant([0.01, -0.02, 0.003, 0.0]),
            Distortion::Omni { xi: 0.9, radtan: [-0.1, 0.05, 0.0, 0.0] },
            Distortion::DoubleSphere([-0.2, 0.55]),
            Distortion::Eucm([0.6, 1.1]),
        ] {
            let camera = Camera { distortion, ..euroc };
            for point in [Vector3::new(0.3, -0.2, 1.0), Vector3::new(-1.1, 0.6, 2.0), Vector3::new(0.0, 0.0, 1.0)] {
                let jacobian = camera.intrinsics_jacobian(&point).unwrap();
                let steps = [1e-3, 1e-3, 1e-3, 1e-3, 1e-4, 1e-4];
                for term in 0..INTRINSICS {
                    let at = |sign: f64| {
                        let mut delta = [0.0; INTRINSICS];
                        delta[term] = sign * steps[term];
                        camera.with_intrinsics_changed(&delta).project(&point).unwrap()
                    };
                    let expected = (at(1.0) - at(-1.0)) / (2.0 * steps[term]);
                    assert!((jacobian.column(term) - expected).amax() < 1e-4 * (1.0 + expected.amax()), "{term}");
                }
            }
        }
    }
}
