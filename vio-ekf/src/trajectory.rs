//! Poses over time: discrete, and as a smooth curve with exact rates and accelerations.

pub(crate) mod spline;

pub use spline::{Motion, Spline};

use nalgebra::{Isometry3, Translation3, UnitQuaternion};

use crate::error::Error;
use crate::lie::so3;
use crate::stamp::Stamp;

/// Poses `world_from_body` over time; stamps strictly increase and every number is finite.
///
/// ```
/// use vio_ekf::nalgebra::Isometry3;
/// use vio_ekf::{Stamp, Trajectory};
///
/// let mut trajectory = Trajectory::default();
/// trajectory.push(Stamp::from_nanos(0), Isometry3::identity())?;
/// trajectory.push(Stamp::from_nanos(100), Isometry3::translation(1.0, 0.0, 0.0))?;
/// assert_eq!(trajectory.pose_at(Stamp::from_nanos(25))?.translation.x, 0.25);
/// # Ok::<(), vio_ekf::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(try_from = "Columns"))]
pub struct Trajectory {
    stamps: Vec<Stamp>,
    poses: Vec<Isometry3<f64>>,
}

/// A trajectory as it is read, before it has been checked.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Columns {
    stamps: Vec<Stamp>,
    poses: Vec<Isometry3<f64>>,
}

#[cfg(feature = "serde")]
impl TryFrom<Columns> for Trajectory {
    type Error = Error;

    fn try_from(columns: Columns) -> Result<Self, Error> {
        Self::new(columns.stamps, columns.poses)
    }
}

impl Trajectory {
    /// From as many stamps as poses.
    pub fn new(stamps: Vec<Stamp>, poses: Vec<Isometry3<f64>>) -> Result<Self, Error> {
        same_length("stamps", stamps.len(), "poses", poses.len())?;
        let mut trajectory = Self { stamps: Vec::with_capacity(stamps.len()), poses: Vec::with_capacity(poses.len()) };
        for (stamp, pose) in stamps.into_iter().zip(poses) {
            trajectory.push(stamp, pose)?;
        }
        Ok(trajectory)
    }

    /// Appends a pose. Its stamp must be after all present ones.
    pub fn push(&mut self, stamp: Stamp, world_from_body: Isometry3<f64>) -> Result<(), Error> {
        let index = self.len();
        if let Some(&previous) = self.stamps.last()
            && stamp <= previous
        {
            return Err(Error::NotIncreasing { index, previous, stamp });
        }
        if !is_finite(&world_from_body) {
            return Err(Error::NonFinite { what: "pose", index });
        }
        self.stamps.push(stamp);
        self.poses.push(world_from_body);
        Ok(())
    }

    /// Number of poses.
    pub fn len(&self) -> usize {
        self.poses.len()
    }

    /// Whether there is no pose.
    pub fn is_empty(&self) -> bool {
        self.poses.is_empty()
    }

    /// Stamps, strictly increasing.
    pub fn stamps(&self) -> &[Stamp] {
        &self.stamps
    }

    /// Poses `world_from_body`, one per stamp.
    pub fn poses(&self) -> &[Isometry3<f64>] {
        &self.poses
    }

    /// Stamp and pose, in order.
    pub fn iter(&self) -> impl Iterator<Item = (Stamp, &Isometry3<f64>)> {
        self.stamps.iter().copied().zip(&self.poses)
    }

    /// First and last stamp, if there is any.
    pub fn span(&self) -> Option<(Stamp, Stamp)> {
        Some((*self.stamps.first()?, *self.stamps.last()?))
    }

    /// Seconds from the first to the last pose; 0 for fewer than two.
    pub fn duration_s(&self) -> f64 {
        self.span().map_or(0.0, |(first, last)| last.secs_since(first))
    }

    /// Length of the polyline through the positions, in metres.
    pub fn path_length(&self) -> f64 {
        path_lengths(&self.poses).last().copied().unwrap_or(0.0)
    }

    /// Pose at a time between the first and the last stamp: position linear, rotation at constant rate about one axis
    /// (slerp, the short way round).
    pub fn pose_at(&self, stamp: Stamp) -> Result<Isometry3<f64>, Error> {
        let (first, last) = self.span().ok_or(Error::TooFew { what: "poses to interpolate", got: 0, need: 1 })?;
        if stamp < first || stamp > last {
            return Err(Error::OutOfRange { stamp, first, last });
        }
        let next = self.stamps.partition_point(|&s| s < stamp);
        if self.stamps[next] == stamp {
            return Ok(self.poses[next]);
        }
        let (t0, t1) = (self.stamps[next - 1], self.stamps[next]);
        Ok(interpolate(&self.poses[next - 1], &self.poses[next], stamp.secs_since(t0) / t1.secs_since(t0)))
    }

    /// The trajectory interpolated at other times, all inside its span.
    pub fn resample(&self, stamps: &[Stamp]) -> Result<Self, Error> {
        let poses = stamps.iter().map(|&stamp| self.pose_at(stamp)).collect::<Result<_, _>>()?;
        Self::new(stamps.to_vec(), poses)
    }
}

/// Between two poses, `fraction` in `[0, 1]`: position linear, rotation by slerp, `R₀ Exp(f Log(R₀ᵀ R₁))`.
pub fn interpolate(from: &Isometry3<f64>, to: &Isometry3<f64>, fraction: f64) -> Isometry3<f64> {
    let position = from.translation.vector + (to.translation.vector - from.translation.vector) * fraction;
    let turn = so3::log(&(from.rotation.inverse() * to.rotation)) * fraction;
    // Products of unit quaternions drift off the sphere by rounding only; one normalisation here keeps chains of them on.
    let rotation = UnitQuaternion::new_normalize((from.rotation * so3::exp(&turn)).into_inner());
    Isometry3::from_parts(Translation3::from(position), rotation)
}

/// Distance travelled along the polyline up to each pose, in metres; starts with 0.
pub fn path_lengths(poses: &[Isometry3<f64>]) -> Vec<f64> {
    let mut length = 0.0;
    let mut lengths = Vec::with_capacity(poses.len());
    for (index, pose) in poses.iter().enumerate() {
        if index > 0 {
            length += (pose.translation.vector - poses[index - 1].translation.vector).norm();
        }
        lengths.push(length);
    }
    lengths
}

/// Finite, and small enough that squared distances cannot overflow. Quaternions must be of unit length: a zero
/// quaternion in a `UnitQuaternion` would turn into NaN later on.
pub(crate) fn is_finite(pose: &Isometry3<f64>) -> bool {
    pose.translation.vector.iter().all(|v| v.abs() < 1e100) && (pose.rotation.coords.norm_squared() - 1.0).abs() < 1e-6
}

/// Refuses a pose list with numbers the evaluation cannot digest.
pub(crate) fn check_poses(what: &'static str, poses: &[Isometry3<f64>]) -> Result<(), Error> {
    poses.iter().position(|pose| !is_finite(pose)).map_or(Ok(()), |index| Err(Error::NonFinite { what, index }))
}

/// Refuses two lists that should match item by item and do not.
pub(crate) fn same_length(
    left: &'static str,
    left_len: usize,
    right: &'static str,
    right_len: usize,
) -> Result<(), Error> {
    if left_len == right_len { Ok(()) } else { Err(Error::LengthMismatch { left, left_len, right, right_len }) }
}
