//! Where a picture is taken.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::error::{Error, check_positive, check_range};

/// A pinhole camera with `OpenCV` axes: x right, y down, z forward. The centre of pixel (0, 0) has the image
/// coordinates (0, 0), so that a camera in the middle has `cx = (width - 1) / 2`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Focal length in pixels along x.
    pub fx: f64,
    /// Focal length in pixels along y.
    pub fy: f64,
    /// Principal point, x, pixels.
    pub cx: f64,
    /// Principal point, y, pixels.
    pub cy: f64,
    /// Width of the image, pixels.
    pub width: u32,
    /// Height of the image, pixels.
    pub height: u32,
    /// Pose of the camera.
    pub world_from_camera: Isometry3<f64>,
}

impl Camera {
    /// A camera at `eye` that looks at `target`, with `up` upwards in the picture and the given horizontal opening angle.
    ///
    /// # Errors
    /// Numbers that are not finite, `target` at `eye`, a renderer along `up`, an angle outside 0..pi or an empty image.
    pub fn looking_at(
        eye: &Point3<f64>,
        target: &Point3<f64>,
        up: &Vector3<f64>,
        horizontal_angle: f64,
        (width, height): (u32, u32),
    ) -> Result<Self, Error> {
        check_range("horizontal angle of a camera", horizontal_angle, 1e-6, 3.1, "between 0 and 3.1 rad")?;
        let forward = target - eye;
        check_positive("distance from the eye to the target", forward.norm())?;
        check_positive("angle between the renderer and `up`", forward.cross(up).norm())?;
        // In OpenCV axes the picture's "up" is -y.
        let world_from_camera = Isometry3::face_towards(eye, target, &-up);
        let f = 0.5 * f64::from(width) / (0.5 * horizontal_angle).tan();
        let (cx, cy) = (0.5 * (f64::from(width) - 1.0), 0.5 * (f64::from(height) - 1.0));
        let camera = Self { fx: f, fy: f, cx, cy, width, height, world_from_camera };
        camera.check()?;
        Ok(camera)
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        check_positive("camera.width", f64::from(self.width))?;
        check_positive("camera.height", f64::from(self.height))?;
        for (what, f) in [("camera.fx", self.fx), ("camera.fy", self.fy)] {
            // Some published calibrations mirror an axis by a negative focal length.
            check_positive(what, f.abs())?;
        }
        let pose = self.world_from_camera.to_homogeneous();
        if pose.iter().chain([self.cx, self.cy].iter()).all(|v| v.is_finite()) {
            Ok(())
        } else {
            Err(Error::NotFinite { what: "camera", index: 0 })
        }
    }

    /// Unit direction of the ray through image point (u, v) in the world, and its component along the optical axis.
    pub(super) fn ray(&self, u: f64, v: f64) -> (Vector3<f64>, f64) {
        let direction = Vector3::new((u - self.cx) / self.fx, (v - self.cy) / self.fy, 1.0);
        let norm = direction.norm();
        (self.world_from_camera.rotation * (direction / norm), 1.0 / norm)
    }
}
