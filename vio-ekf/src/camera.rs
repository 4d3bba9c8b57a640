//! The pinhole with each lens that Kalibr knows, and the trait of any other.

mod distortion;
mod fisheye;
pub(crate) mod image_side;
pub(crate) mod intrinsics;
mod kalibr;
pub(crate) mod model;
mod sphere_models;

pub use model::CameraModel;

use nalgebra::{Isometry3, Matrix2x3, Unit, Vector2, Vector3};

use crate::error::Error;
use crate::error::invalid;
use crate::trajectory::is_finite;
use image_side::check_side;
use sphere_models::{double_sphere, eucm, omni};

/// How a lens departs from a pinhole.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "lowercase"))]
pub enum Distortion {
    /// Not at all.
    #[default]
    None,
    /// `k1, k2, p1, p2`: radial and tangential polynomial (Brown 1966; `radtan` of Kalibr).
    RadTan([f64; 4]),
    /// `k1 .. k4`: polynomial of the angle off the axis (Kannala and Brandt 2006; `equidistant` of Kalibr).
    Equidistant([f64; 4]),
    /// The unified omnidirectional model with a radial-tangential polynomial after it (Mei and Rives 2007; `omni` of Kalibr).
    Omni {
        /// Distance of the pinhole behind the sphere's centre, in its radius; not negative.
        xi: f64,
        /// `k1, k2, p1, p2`.
        radtan: [f64; 4],
    },
    /// `ξ, α` of the double sphere (Usenko, Demmel and Cremers 2018; `ds` of Kalibr); `ξ` above -1 up to 1, `α` from 0 to 1.
    #[cfg_attr(feature = "serde", serde(rename = "ds"))]
    DoubleSphere([f64; 2]),
    /// `α, β` of the enhanced unified model (Khomutenko, Garcia and Martinet 2016; `eucm` of Kalibr); `α` from 0 to 1, `β` positive.
    Eucm([f64; 2]),
}

impl Distortion {
    /// Refuses parameters that no lens has.
    fn check(&self) -> Result<(), Error> {
        let polynomial = match self {
            Self::RadTan(k) | Self::Equidistant(k) | Self::Omni { radtan: k, .. } => k,
            _ => &[0.0; 4],
        };
        if let Some(&bad) = polynomial.iter().find(|k| !k.is_finite()) {
            return Err(invalid("distortion", bad, "must be finite"));
        }
        match *self {
            Self::Omni { xi, .. } if !(0.0..1e3).contains(&xi) => {
                Err(invalid("xi", xi, "must be at least 0, and finite"))
            }
            Self::DoubleSphere([xi, _]) if !(xi > -1.0 && xi <= 1.0) => {
                Err(invalid("xi", xi, "must be above -1 and at most 1"))
            }
            Self::DoubleSphere([_, alpha]) | Self::Eucm([alpha, _]) if !(0.0..=1.0).contains(&alpha) => {
                Err(invalid("alpha", alpha, "must be from 0 to 1"))
            }
            Self::Eucm([_, beta]) if !(beta > 0.0 && beta.is_finite()) => {
                Err(invalid("beta", beta, "must be positive and finite"))
            }
            _ => Ok(()),
        }
    }
}

/// A camera: image size, lens, and where it sits on the body.
///
/// Camera axes: x right, y down, z forward. Pixel `(0, 0)` is the centre of the top left pixel.
///
/// ```
/// use vio_ekf::{Camera, nalgebra::Vector3};
/// let camera = Camera::euroc();
/// let pixel = camera.project(&Vector3::new(0.3, -0.2, 1.0)).expect("in front of the camera");
/// assert!((pixel.x - 499.9056).abs() < 1e-4 && (pixel.y - 160.1887).abs() < 1e-4);
/// let bearing = camera.bearing(&pixel).expect("inside the range of the lens model");
/// assert!((bearing.into_inner() * 1.13_f64.sqrt() - Vector3::new(0.3, -0.2, 1.0)).norm() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Camera {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Focal length, pixels per unit of the normalised x.
    pub fx: f64,
    /// Focal length, pixels per unit of the normalised y.
    pub fy: f64,
    /// Column of the principal point, pixels.
    pub cx: f64,
    /// Row of the principal point, pixels.
    pub cy: f64,
    /// The lens.
    pub distortion: Distortion,
    /// Pose of the camera on the body; the body is the inertial sensor.
    pub body_from_camera: Isometry3<f64>,
}

impl Camera {
    /// The left camera of the EuRoC vehicle with its published calibration (Burri et al. 2016).
    pub fn euroc() -> Self {
        Self {
            width: 752,
            height: 480,
            fx: 458.654,
            fy: 457.296,
            cx: 367.215,
            cy: 248.375,
            distortion: Distortion::RadTan([-0.28340811, 0.07395907, 0.00019359, 1.76187114e-5]),
            body_from_camera: nearest_pose(&[
                [0.0148655429818, -0.999880929698, 0.00414029679422, -0.0216401454975],
                [0.999557249008, 0.0149672133247, 0.025715529948, -0.064676986768],
                [-0.0257744366974, 0.00375618835797, 0.999660727178, 0.00981073058949],
            ]),
        }
    }

    /// The right camera of the EuRoC vehicle with its published calibration (Burri et al. 2016), 0.11 m beside the left one.
    pub fn euroc_right() -> Self {
        Self {
            width: 752,
            height: 480,
            fx: 457.587,
            fy: 456.134,
            cx: 379.999,
            cy: 255.238,
            distortion: Distortion::RadTan([-0.28368365, 0.07451284, -0.00010473, -3.55590700e-05]),
            body_from_camera: nearest_pose(&[
                [0.0125552670891, -0.999755099723, 0.0182237714554, -0.0198435579556],
                [0.999598781151, 0.0130119051815, 0.0251588363115, 0.0453689425024],
                [-0.0253898008918, 0.0179005838253, 0.999517347078, 0.00786212447038],
            ]),
        }
    }

    /// Refuses a calibration that no camera has: empty image, focal length not positive, anything not finite.
    pub fn check(&self) -> Result<(), Error> {
        for (name, side) in [("width", self.width), ("height", self.height)] {
            check_side(name, side)?;
        }
        for (name, value) in [("fx", self.fx), ("fy", self.fy)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(invalid(name, value, "must be positive and finite, in pixels"));
            }
        }
        for (name, value) in [("cx", self.cx), ("cy", self.cy)] {
            if !value.is_finite() {
                return Err(invalid(name, value, "must be finite, in pixels"));
            }
        }
        self.distortion.check()?;
        if is_finite(&self.body_from_camera) {
            Ok(())
        } else {
            Err(Error::NonFinite { what: "body_from_camera", index: 0 })
        }
    }

    /// Pixel of a point in camera axes, which may lie outside the image; `None` behind the camera (for a wide lens: beyond its field
    /// of view) and outside the range in which the lens model is one to one.
    pub fn project(&self, point_in_camera: &Vector3<f64>) -> Option<Vector2<f64>> {
        let distorted = match &self.distortion {
            Distortion::Equidistant(k) => fisheye::project(k, point_in_camera)?,
            Distortion::RadTan(k) => distortion::distort(k, &normalised(point_in_camera)?)?,
            Distortion::None => normalised(point_in_camera)?,
            Distortion::Omni { xi, radtan } => distortion::distort(radtan, &omni::project(*xi, point_in_camera)?.0)?,
            Distortion::DoubleSphere(k) => double_sphere::project(*k, point_in_camera)?.0,
            Distortion::Eucm(k) => eucm::project(*k, point_in_camera)?.0,
        };
        Some(self.pixel(&distorted))
    }

    /// As [`project`](Self::project), with the derivative of the pixel by the point, pixels per metre.
    pub fn project_with_jacobian(&self, point_in_camera: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        let (distorted, mut jacobian) = match &self.distortion {
            Distortion::Equidistant(k) => fisheye::project_with_jacobian(k, point_in_camera)?,
            Distortion::RadTan(k) => {
                let m = normalised(point_in_camera)?;
                let distorted = distortion::distort(k, &m)?;
                (distorted, distortion::jacobian(k, &m) * perspective_jacobian(&m, point_in_camera.z))
            }
            Distortion::None => {
                let m = normalised(point_in_camera)?;
                (m, perspective_jacobian(&m, point_in_camera.z))
            }
            Distortion::Omni { xi, radtan } => {
                let (m, by_point) = omni::project(*xi, point_in_camera)?;
                (distortion::distort(radtan, &m)?, distortion::jacobian(radtan, &m) * by_point)
            }
            Distortion::DoubleSphere(k) => double_sphere::project(*k, point_in_camera)?,
            Distortion::Eucm(k) => eucm::project(*k, point_in_camera)?,
        };
        for column in 0..3 {
            jacobian[(0, column)] *= self.fx;
            jacobian[(1, column)] *= self.fy;
        }
        Some((self.pixel(&distorted), jacobian))
    }

    /// Direction in camera axes that a pixel looks along; `None` where the lens model has no inverse.
    pub fn bearing(&self, pixel: &Vector2<f64>) -> Option<Unit<Vector3<f64>>> {
        let distorted = Vector2::new((pixel.x - self.cx) / self.fx, (pixel.y - self.cy) / self.fy);
        if !(distorted.x.is_finite() && distorted.y.is_finite()) {
            return None;
        }
        let direction = match &self.distortion {
            Distortion::Equidistant(k) => fisheye::direction(k, &distorted)?,
            Distortion::RadTan(k) => distortion::undistort(k, &distorted)?.push(1.0),
            Distortion::None => distorted.push(1.0),
            Distortion::Omni { xi, radtan } => omni::direction(*xi, &distortion::undistort(radtan, &distorted)?)?,
            Distortion::DoubleSphere(k) => double_sphere::direction(*k, &distorted)?,
            Distortion::Eucm(k) => eucm::direction(*k, &distorted)?,
        };
        Some(Unit::new_normalize(direction))
    }

    /// Whether a pixel lies inside the image, at least `border` pixels from the centres of its outermost pixels.
    pub fn contains(&self, pixel: &Vector2<f64>, border: f64) -> bool {
        let inside = |x: f64, side: usize| x >= border && x <= side as f64 - 1.0 - border;
        inside(pixel.x, self.width) && inside(pixel.y, self.height)
    }

    fn pixel(&self, distorted: &Vector2<f64>) -> Vector2<f64> {
        Vector2::new(self.fx * distorted.x + self.cx, self.fy * distorted.y + self.cy)
    }
}

/// Intersection with the plane at unit depth.
fn normalised(point: &Vector3<f64>) -> Option<Vector2<f64>> {
    // A point in the camera's own plane would give an infinite or a meaningless pixel.
    let usable = point.z > 1e-9 * point.norm() && point.z.is_finite();
    usable.then(|| Vector2::new(point.x / point.z, point.y / point.z))
}

fn perspective_jacobian(m: &Vector2<f64>, depth: f64) -> Matrix2x3<f64> {
    Matrix2x3::new(1.0, 0.0, -m.x, 0.0, 1.0, -m.y) / depth
}

/// The pose nearest to a printed 3x4 matrix, whose rotation holds only as many digits as were printed.
pub(crate) fn nearest_pose(rows: &[[f64; 4]; 3]) -> Isometry3<f64> {
    let matrix = nalgebra::Matrix3::from_fn(|r, c| rows[r][c]);
    let translation = Vector3::new(rows[0][3], rows[1][3], rows[2][3]);
    // U Vᵀ of the singular value decomposition; where there is none the matrix stays, and the checks refuse it.
    let svd = matrix.svd(true, true);
    let nearest = svd.u.zip(svd.v_t).map_or(matrix, |(u, v_t)| u * v_t);
    let rotation = nalgebra::Rotation3::from_matrix_unchecked(nearest);
    Isometry3::from_parts(translation.into(), nalgebra::UnitQuaternion::from_rotation_matrix(&rotation))
}
