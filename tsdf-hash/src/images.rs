//! What a camera saw, borrowed.

use nalgebra::Isometry3;

use crate::error::Error;

/// A pinhole camera: `u = fx x/z + cx`, `v = fy y/z + cy`, pixels, in a camera frame whose z looks forward.
///
/// The centre of pixel `(u, v)` is at `(u, v)`, so an image spans `-0.5..width-0.5`. Focal lengths may be negative
/// (ICL-NUIM publishes `fy = -480`).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Intrinsics {
    /// Focal length along a row, pixels; not zero.
    pub fx: f64,
    /// Focal length along a column, pixels; not zero.
    pub fy: f64,
    /// Principal point along a row, pixels.
    pub cx: f64,
    /// Principal point along a column, pixels.
    pub cy: f64,
}

/// Depth pixels, row-major: z along the optical axis, not the length of the ray.
#[derive(Clone, Copy, Debug)]
pub enum DepthData<'a> {
    /// Integers; 0 and 65535 mean "no depth".
    U16 {
        /// `width * height` values.
        data: &'a [u16],
        /// Units per metre: 1000 for millimetres, 5000 for the TUM and ICL-NUIM files.
        scale: f64,
    },
    /// Metres; everything that is not a finite positive number means "no depth".
    F32 {
        /// `width * height` values.
        data: &'a [f32],
    },
}

/// A depth image and its camera.
#[derive(Clone, Copy, Debug)]
pub struct DepthView<'a> {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The pixels.
    pub data: DepthData<'a>,
    /// The camera.
    pub intrinsics: Intrinsics,
}

impl DepthView<'_> {
    /// The middle one of all depths, m; `None` of an image without any.
    pub fn median(&self) -> Option<f64> {
        let mut depths: Vec<f64> = match self.data {
            DepthData::U16 { data, scale } => data
                .iter()
                .filter(|&&units| !matches!(units, 0 | u16::MAX))
                .map(|&units| f64::from(units) / scale)
                .collect(),
            DepthData::F32 { data } => {
                data.iter().filter(|depth| depth.is_finite() && **depth > 0.0).map(|&depth| f64::from(depth)).collect()
            }
        };
        let middle = depths.len() / 2;
        (!depths.is_empty()).then(|| *depths.select_nth_unstable_by(middle, f64::total_cmp).1)
    }
}

/// Colour pixels, row-major, R G B.
#[derive(Clone, Copy, Debug)]
pub enum ColourData<'a> {
    /// `3 * width * height` bytes.
    Rgb8(&'a [u8]),
    /// `3 * width * height` values over the whole range `0..=65535`.
    Rgb16(&'a [u16]),
}

/// A colour image taken from the optical centre of the depth image (registered); size and intrinsics may differ.
#[derive(Clone, Copy, Debug)]
pub struct ColourView<'a> {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The pixels.
    pub data: ColourData<'a>,
    /// The camera.
    pub intrinsics: Intrinsics,
}

impl Intrinsics {
    pub(crate) fn check(&self, image: &'static str) -> Result<(), Error> {
        for (name, value, is_focal) in
            [("fx", self.fx, true), ("fy", self.fy, true), ("cx", self.cx, false), ("cy", self.cy, false)]
        {
            if !value.is_finite() || value.abs() > 1e6 || (is_focal && value.abs() < 1e-3) {
                return Err(Error::InvalidIntrinsics { image, name, value });
            }
        }
        Ok(())
    }
}

impl DepthView<'_> {
    pub(crate) fn check(&self) -> Result<(), Error> {
        let found = match self.data {
            DepthData::U16 { data, scale } => {
                if !(scale.is_finite() && scale > 0.0) {
                    return Err(Error::InvalidScale { scale });
                }
                data.len()
            }
            DepthData::F32 { data } => data.len(),
        };
        check_size("depth", self.width, self.height, 1, found)?;
        self.intrinsics.check("depth")
    }
}

impl ColourView<'_> {
    pub(crate) fn check(&self) -> Result<(), Error> {
        let found = match self.data {
            ColourData::Rgb8(data) => data.len(),
            ColourData::Rgb16(data) => data.len(),
        };
        check_size("colour", self.width, self.height, 3, found)?;
        self.intrinsics.check("colour")
    }
}

pub(crate) fn check_sides(image: &'static str, width: usize, height: usize) -> Result<(), Error> {
    let sides = 1..=16384;
    if !sides.contains(&width) || !sides.contains(&height) {
        return Err(Error::InvalidSize { image, width, height });
    }
    Ok(())
}

fn check_size(image: &'static str, width: usize, height: usize, channels: usize, found: usize) -> Result<(), Error> {
    check_sides(image, width, height)?;
    let expected = width * height * channels;
    if found == expected { Ok(()) } else { Err(Error::WrongLength { image, expected, found }) }
}

pub(crate) fn check_pose(world_from_camera: &Isometry3<f64>) -> Result<(), Error> {
    let t = &world_from_camera.translation.vector;
    let q = world_from_camera.rotation.as_ref().coords;
    if !t.iter().chain(q.iter()).all(|x| x.is_finite()) {
        return Err(Error::InvalidPose { what: "an entry is not finite" });
    }
    if (q.norm() - 1.0).abs() > 1e-6 {
        return Err(Error::InvalidPose { what: "its quaternion is not of unit length" });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_of_what_has_a_depth() {
        let intrinsics = Intrinsics { fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0 };
        let median = |data: DepthData| DepthView { width: 5, height: 1, data, intrinsics }.median();
        assert_eq!(median(DepthData::U16 { data: &[0, 3000, 1000, 2000, u16::MAX], scale: 1000.0 }), Some(2.0));
        assert_eq!(median(DepthData::F32 { data: &[f32::NAN, 0.5, 4.0, -1.0, 0.25] }), Some(0.5));
        assert_eq!(median(DepthData::F32 { data: &[f32::NAN, 0.0, -1.0, f32::INFINITY, 0.0] }), None);
    }
}
