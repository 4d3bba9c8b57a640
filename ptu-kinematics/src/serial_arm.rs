//! A serial arm with any number of revolute joints; its inverse is numeric.

use nalgebra::{Isometry3, Matrix3, Matrix3xX, Matrix6xX, Point3, UnitQuaternion, UnitVector3, Vector3};

use crate::angle::elevation_rotation;
use crate::chain::KinematicChain;
use crate::error::{Error, finite};
use crate::hover::{Hover, Nozzle};
use crate::joints::Range;
#[cfg(feature = "urdf")]
use crate::trace::span;

/// Steps of the inverse; from the rest posture about ten are needed.
const MAX_STEPS: usize = 200;
/// Longest turn of the spray axis asked of one step, radians: the linearisation holds that far.
const LONGEST_STEP: f64 = 0.3;
/// Damping per radian of remaining error: falls with it, so that the last steps are Newton's.
const DAMPING: f64 = 0.1;
/// Remaining angle at which a direction counts as reached, radians.
const REACHED: f64 = 1e-9;

/// One revolute joint.
#[derive(Debug, Clone, PartialEq)]
pub struct SerialJoint {
    /// Name, for errors.
    pub name: String,
    /// Pose of the joint's frame in the frame before it (the body for the first) at joint angle zero.
    pub parent_from_joint: Isometry3<f64>,
    /// Axis in the joint's frame.
    pub axis: UnitVector3<f64>,
    /// Limits, radians.
    pub limits: Range,
}

/// Revolute joints in a row; the nozzle sprays along the x axis of the last frame.
///
/// More than two joints leave the direction of the spray redundant, and so does the body, which can stand anywhere: the
/// inverse takes the joints near the rest posture, and lets the body position follow from them.
#[derive(Debug, Clone, PartialEq)]
pub struct SerialArm {
    joints: Vec<SerialJoint>,
    last_from_nozzle: Isometry3<f64>,
    rest: Vec<f64>,
}

/// A joint in the frame that the arm is looked at from.
struct Axis {
    direction: Vector3<f64>,
    origin: Point3<f64>,
}

impl SerialArm {
    /// An arm whose rest posture is the middle of all limits.
    ///
    /// # Errors
    /// No joints, numbers that are not finite, or limits in the wrong order.
    pub fn new(joints: Vec<SerialJoint>, last_from_nozzle: Isometry3<f64>) -> Result<Self, Error> {
        if joints.is_empty() {
            return Err(Error::InvalidSetting { name: "joints", value: 0.0, rule: "an arm needs at least one" });
        }
        for joint in &joints {
            joint.limits.check("limits of a serial joint")?;
            finite("axis of a serial joint", joint.axis.into_inner().into())?;
            finite("frame of a serial joint", joint.parent_from_joint.translation.vector.into())?;
        }
        finite("frame of the nozzle", last_from_nozzle.translation.vector.into())?;
        let rest = joints.iter().map(|joint| 0.5 * (joint.limits.min + joint.limits.max)).collect();
        Ok(Self { joints, last_from_nozzle, rest })
    }

    /// The same arm with another rest posture, moved into the limits.
    ///
    /// # Errors
    /// Not one finite angle per joint.
    pub fn with_rest(mut self, rest: &[f64]) -> Result<Self, Error> {
        if rest.len() != self.joints.len() {
            let rule = "one angle per joint is needed";
            return Err(Error::InvalidSetting { name: "rest", value: rest.len() as f64, rule });
        }
        for ((own, &angle), joint) in self.rest.iter_mut().zip(rest).zip(&self.joints) {
            finite("rest posture", [angle])?;
            *own = joint.limits.clamp(angle);
        }
        Ok(self)
    }

    /// Builds the chain that ends at link `nozzle_link`, whose x axis is the spray axis; the root link is the body. A
    /// continuous joint gets limits of ±π.
    ///
    /// # Errors
    /// [`Error::Urdf`] for a file that cannot be read as such a chain.
    #[cfg(feature = "urdf")]
    pub fn from_urdf(text: &str, nozzle_link: &str) -> Result<Self, Error> {
        span!("from_urdf");
        let mut joints: Vec<SerialJoint> = Vec::new();
        let mut fixed = Isometry3::identity();
        for joint in crate::urdf::read_chain(text, nozzle_link)? {
            fixed *= joint.parent_from_child;
            let Some(axis) = joint.axis else { continue };
            let limits = joint.limits(1.0).unwrap_or(Range::symmetric(std::f64::consts::PI));
            let axis = UnitVector3::new_unchecked(axis);
            joints.push(SerialJoint { name: joint.name, parent_from_joint: fixed, axis, limits });
            fixed = Isometry3::identity();
        }
        Self::new(joints, fixed)
    }

    /// The joints, from the body to the nozzle.
    pub fn joints(&self) -> &[SerialJoint] {
        &self.joints
    }

    /// Every joint axis, and the nozzle.
    fn frames(&self, world_from_body: &Isometry3<f64>, angles: &[f64]) -> (Vec<Axis>, Isometry3<f64>) {
        let mut pose = *world_from_body;
        let mut axes = Vec::with_capacity(self.joints.len());
        for (joint, &angle) in self.joints.iter().zip(angles) {
            pose *= joint.parent_from_joint;
            axes.push(Axis {
                direction: pose.rotation * joint.axis.into_inner(),
                origin: pose.translation.vector.into(),
            });
            pose.rotation *= UnitQuaternion::from_axis_angle(&joint.axis, angle);
        }
        (axes, pose * self.last_from_nozzle)
    }

    /// Joints that turn the spray axis along `wanted` (body axes), from the rest posture by damped least squares
    /// (Wampler 1986, Nakamura and Hanafusa 1986), and the angle that is left. A joint that a step would push beyond its
    /// limit stands still in that step.
    fn solve(&self, wanted: &Vector3<f64>) -> (Vec<f64>, f64) {
        let mut angles = self.rest.clone();
        let mut best = (angles.clone(), f64::INFINITY);
        for _ in 0..MAX_STEPS {
            let (axes, nozzle) = self.frames(&Isometry3::identity(), &angles);
            let spray = nozzle.rotation * Vector3::x();
            let cross = spray.cross(wanted);
            let left = cross.norm().atan2(spray.dot(wanted));
            if left < best.1 {
                best = (angles.clone(), left);
            }
            if left <= 1e-3 * REACHED {
                break;
            }
            // Exactly opposite every turn is as good: the one about the nozzle's own y axis is taken.
            let about = cross.try_normalize(1e-12).unwrap_or_else(|| nozzle.rotation * Vector3::y());
            self.step(&mut angles, &axes, &spray, &(about * left.min(LONGEST_STEP)), DAMPING * left);
        }
        best
    }

    /// One damped step towards the rotation vector `turn` of the spray axis.
    fn step(&self, angles: &mut [f64], axes: &[Axis], spray: &Vector3<f64>, turn: &Vector3<f64>, damping: f64) {
        let mut free = vec![true; axes.len()];
        loop {
            // A turn about the spray itself changes nothing: it is taken out of the columns.
            let columns: Vec<Vector3<f64>> = axes
                .iter()
                .zip(&free)
                .map(
                    |(axis, &free)| {
                        if free { axis.direction - spray * spray.dot(&axis.direction) } else { Vector3::zeros() }
                    },
                )
                .collect();
            let jacobian = Matrix3xX::from_columns(&columns);
            // The outer product fills the direction that the columns leave out.
            let gram = &jacobian * jacobian.transpose()
                + spray * spray.transpose()
                + Matrix3::identity() * (damping * damping + f64::EPSILON);
            let Some(inverse) = gram.try_inverse() else { return };
            let change = jacobian.tr_mul(&(inverse * turn));
            let blocked =
                (0..angles.len()).find(|&k| free[k] && !self.joints[k].limits.contains(angles[k] + change[k]));
            let Some(k) = blocked else {
                angles.iter_mut().zip(change.iter()).for_each(|(angle, change)| *angle += change);
                return;
            };
            angles[k] = self.joints[k].limits.clamp(angles[k] + change[k]);
            free[k] = false;
        }
    }
}

impl KinematicChain for SerialArm {
    type Joints = Vec<f64>;

    fn limits(&self) -> Vec<Range> {
        self.joints.iter().map(|joint| joint.limits).collect()
    }

    fn forward(&self, world_from_body: &Isometry3<f64>, joints: &Vec<f64>) -> Nozzle {
        let (_, nozzle) = self.frames(world_from_body, joints);
        let direction = UnitVector3::new_normalize(nozzle.rotation * Vector3::x());
        Nozzle { tip: nozzle.translation.vector.into(), direction }
    }

    fn point(&self, azimuth: f64, elevation: f64) -> Vec<f64> {
        let level = elevation_rotation(elevation) * Vector3::x();
        self.solve(&(UnitQuaternion::from_axis_angle(&Vector3::z_axis(), azimuth) * level)).0
    }

    fn inverse(&self, tip: &Point3<f64>, direction: &UnitVector3<f64>, heading: f64) -> Result<Hover<Vec<f64>>, Error> {
        finite("tip", (*tip).into())?;
        finite("direction", direction.into_inner().into())?;
        finite("heading", [heading])?;
        let world_from_body = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading);
        let (joints, left) = self.solve(&world_from_body.inverse_transform_vector(direction));
        if left > REACHED {
            return Err(Error::Unreachable { left });
        }
        let in_body = self.forward(&Isometry3::identity(), &joints).tip;
        Ok(Hover { position: tip - world_from_body * in_body.coords, heading, joints })
    }

    fn jacobian(&self, hover: &Hover<Vec<f64>>) -> Matrix6xX<f64> {
        let (axes, nozzle) = self.frames(&hover.world_from_body(), &hover.joints);
        let tip = Point3::from(nozzle.translation.vector);
        let spray = nozzle.rotation * Vector3::x();
        let mut jacobian = Matrix6xX::zeros(4 + axes.len());
        jacobian.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        let heading = Axis { direction: Vector3::z(), origin: hover.position };
        for (k, axis) in std::iter::once(&heading).chain(&axes).enumerate() {
            jacobian.fixed_view_mut::<3, 1>(0, 3 + k).copy_from(&axis.direction.cross(&(tip - axis.origin)));
            jacobian.fixed_view_mut::<3, 1>(3, 3 + k).copy_from(&axis.direction.cross(&spray));
        }
        jacobian
    }

    fn members(&self, world_from_body: &Isometry3<f64>, joints: &Vec<f64>) -> Vec<Point3<f64>> {
        let (axes, nozzle) = self.frames(world_from_body, joints);
        axes.iter().map(|axis| axis.origin).chain([nozzle.translation.vector.into()]).collect()
    }
}
