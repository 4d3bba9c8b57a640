//! The VR state message (VR paper, Section III-A).

use nalgebra::{Isometry3, Point3, UnitVector3};

use crate::error::Error;

/// States per second (VR paper, Section III-A).
pub const RATE: f64 = 90.0;
/// Version of [`VrState`]; it changes with the meaning of a field.
pub const VERSION: u32 = 1;

/// Coordinates beyond this are no place of a session, m.
const FARTHEST: f64 = 1e4;
/// Flows beyond this are no spray gun, m^3/s.
const MAX_FLOW: f64 = 1e-3;

/// What the person is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "lowercase"))]
pub enum VrMode {
    /// Neither painting nor viewing; the default.
    #[default]
    Idle,
    /// The paint button is pressed.
    Painting,
    /// The view button is pressed: the vehicle is to look.
    Viewing,
}

/// The virtual cradle, four degrees of freedom.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct CradlePose {
    /// Where the person's head is in the world, m.
    pub position: Point3<f64>,
    /// Heading about world z, rad; 0 looks along x.
    pub heading: f64,
}

/// Where the virtual spray gun paints.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct PaintHit {
    /// Point of the surface in the world, m.
    pub point: Point3<f64>,
    /// Outward unit normal of the surface there.
    pub normal: UnitVector3<f64>,
}

/// One state of a session. Colour, flow, sequence number and version are ours.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct VrState {
    /// [`VERSION`] of the sender.
    pub version: u32,
    /// Number of the state in its session, without gaps.
    pub sequence: u64,
    /// Time on the sender's clock, s.
    pub time: f64,
    /// What the person is doing.
    pub mode: VrMode,
    /// Pose of the spray gun's nozzle in the world, m; x along the spray. Its rotation is a unit quaternion x y z w.
    pub nozzle: Isometry3<f64>,
    /// Pose of the cradle.
    pub cradle: CradlePose,
    /// Where the gun paints; only in [`VrMode::Painting`], `None` where the ray meets nothing.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub hit: Option<PaintHit>,
    /// Number of the paint on the palette.
    pub colour: u8,
    /// Flow of paint while painting, m^3/s.
    pub flow: f64,
}

impl VrState {
    /// Refuses what no headset sends: another version, numbers that are not finite or absurd, rotations and normals that are not of
    /// unit length.
    ///
    /// # Errors
    /// [`Error::VrState`] names the state and the field.
    pub fn check(&self) -> Result<(), Error> {
        let refuse = |what| Err(Error::VrState { sequence: self.sequence, what });
        let place = |p: &Point3<f64>| p.iter().all(|c| c.is_finite() && c.abs() <= FARTHEST);
        let unit = |length: f64| (length - 1.0).abs() < 1e-3;
        if self.version != VERSION {
            return refuse("`version` is not the one that is read here: reload the page");
        }
        if !(self.time.is_finite() && self.time.abs() < 1e12) {
            return refuse("`time` must be finite seconds");
        }
        if !place(&self.nozzle.translation.vector.into()) {
            return refuse("`nozzle` must lie within 10 km of the origin");
        }
        if !unit(self.nozzle.rotation.norm()) {
            return refuse("the rotation of `nozzle` must be a unit quaternion");
        }
        if !(place(&self.cradle.position) && self.cradle.heading.is_finite()) {
            return refuse("`cradle` must be finite and within 10 km of the origin");
        }
        if self.hit.is_some_and(|hit| !place(&hit.point) || !unit(hit.normal.norm())) {
            return refuse("`hit` needs a point within 10 km of the origin and a unit normal");
        }
        if !(0.0..=MAX_FLOW).contains(&self.flow) {
            return refuse("`flow` must lie between 0 and 1 l/s");
        }
        Ok(())
    }

    /// Tip of the nozzle, m.
    pub fn nozzle_position(&self) -> Point3<f64> {
        self.nozzle.translation.vector.into()
    }
}
