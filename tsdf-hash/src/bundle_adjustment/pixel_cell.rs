//! Four pixels around a place in an image.

use nalgebra::Vector3;

use crate::tracking::image_level::ImageLevel;

/// Four inverse depths that differ by more than this share of them are of two surfaces, or of one seen too much from the side (ours).
const MOST_CHANGE: f32 = 0.06;

/// Four pixels and the share of each.
pub(crate) struct PixelCell {
    corners: [usize; 4],
    shares: [f32; 4],
}

impl PixelCell {
    /// Around where a point in front of the camera is seen; `None` outside the image.
    pub(crate) fn of(level: &ImageLevel, arm: &Vector3<f64>) -> Option<Self> {
        let [u, v] = [(arm.x, 0), (arm.y, 1)]
            .map(|(x, k)| (f64::from(level.focal[k]) * x / arm.z + f64::from(level.centre[k])) as f32);
        if !(u >= 0.0 && v >= 0.0) {
            return None;
        }
        let (i, j) = (u as usize, v as usize);
        if i + 1 >= level.width || j + 1 >= level.height {
            return None;
        }
        let (du, dv) = (u - i as f32, v - j as f32);
        let at = j * level.width + i;
        let shares = [(1.0 - dv) * (1.0 - du), (1.0 - dv) * du, dv * (1.0 - du), dv * du];
        Some(Self { corners: [at, at + 1, at + level.width, at + level.width + 1], shares })
    }

    fn mix(&self, of: impl Fn(usize) -> f32) -> f32 {
        self.corners.iter().zip(&self.shares).map(|(k, share)| share * of(*k)).sum()
    }

    /// Inverse depth, which is linear on a plane; `None` across edges and holes.
    pub(crate) fn inverse_depth(&self, level: &ImageLevel) -> Option<f32> {
        let corners = self.corners.map(|k| level.omega[k]);
        let (least, most) = corners.iter().fold((f32::MAX, 0.0_f32), |(a, b), o| (a.min(*o), b.max(*o)));
        (least > 0.0 && most - least <= MOST_CHANGE * most).then(|| self.mix(|k| level.omega[k]))
    }

    /// Intensity and its slopes times the focal lengths; `None` without colour and on the rim.
    pub(crate) fn intensity(&self, level: &ImageLevel) -> Option<(f64, [f64; 2])> {
        if level.intensity.is_empty() {
            return None;
        }
        let value = f64::from(self.mix(|k| level.intensity[k]));
        let slopes = [0, 1].map(|n| f64::from(self.mix(|k| level.gradient[k][n]) * level.focal[n]));
        (value + slopes[0] + slopes[1]).is_finite().then_some((value, slopes))
    }
}
