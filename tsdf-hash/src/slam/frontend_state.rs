//! What a run needs, besides its map and keyframes, to track on as if it had not been interrupted; as text, one line for each thing known.

use std::fmt::Write as _;

use nalgebra::{Isometry3, Matrix6, Quaternion, UnitQuaternion, Vector3};

use crate::slam::motion_model::StampedPose;
use crate::tracking::outcome::PosePrior;

/// Stored rotations are of unit length but for rounding.
const TOLERANCE: f64 = 1e-9;

/// What is known of the last pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Last {
    #[default]
    Tracked,
    /// Along some directions the motion before goes on.
    Guessed,
    Lost,
}

impl Last {
    const NAMES: [(&'static str, Self); 3] =
        [("tracked", Self::Tracked), ("guessed", Self::Guessed), ("lost", Self::Lost)];
}

/// Where a tracked camera was, how it moved, and what its frames were like.
#[derive(Debug, Clone, Default)]
pub struct FrontendState {
    pub(crate) last: Last,
    pub(crate) pose: Option<PosePrior>,
    /// The frame that was taken there.
    pub(crate) frame: Option<StampedPose>,
    /// The pose before.
    pub(crate) before: Option<Isometry3<f64>>,
    /// The usual agreement and likeness.
    pub(crate) usual: Option<[f64; 2]>,
    /// Bias of the gyroscope, rad/s, and the motions that it was learned from.
    pub(crate) bias: Vector3<f64>,
    pub(crate) learned: usize,
}

impl FrontendState {
    pub(crate) fn to_text(&self) -> String {
        let last = Last::NAMES.iter().find(|(_, last)| *last == self.last).map(|(name, _)| (*name, Vec::new()));
        let bias = [self.bias.x, self.bias.y, self.bias.z, self.learned as f64];
        let lines = [
            last,
            self.pose.map(|pose| ("pose", numbers(&pose.world_from_camera))),
            self.pose.and_then(|pose| pose.covariance).map(|covariance| ("covariance", covariance.as_slice().to_vec())),
            self.frame.map(|frame| ("stamp", vec![frame.stamp])),
            self.frame.and_then(|frame| frame.world_from_camera).map(|pose| ("recorded", numbers(&pose))),
            self.before.map(|pose| ("before", numbers(&pose))),
            self.usual.map(|usual| ("usual", usual.to_vec())),
            Some(("bias", bias.to_vec())),
        ];
        let mut text = String::new();
        for (name, numbers) in lines.into_iter().flatten() {
            text.push_str(name);
            for number in numbers {
                // Writing to a String cannot fail.
                let _ = write!(text, " {number}");
            }
            text.push('\n');
        }
        text
    }

    /// # Errors
    /// The line, and what is wrong with it.
    pub(crate) fn from_text(text: &str) -> Result<Self, String> {
        let mut state = Self::default();
        for (k, line) in text.lines().enumerate() {
            state.read_line(line).ok_or_else(|| format!("line {}: \"{line}\" is not understood", k + 1))?;
        }
        Ok(state)
    }

    fn read_line(&mut self, line: &str) -> Option<()> {
        let mut words = line.split(' ');
        let name = words.next()?;
        let values: Vec<f64> =
            words.map(|word| word.parse().ok().filter(|v: &f64| v.is_finite())).collect::<Option<_>>()?;
        match (name, values.as_slice()) {
            ("pose", values) => self.pose = Some(PosePrior { world_from_camera: pose(values)?, covariance: None }),
            ("covariance", values) if values.len() == 36 => {
                self.pose.as_mut()?.covariance = Some(Matrix6::from_column_slice(values));
            }
            ("stamp", &[stamp]) => self.frame = Some(StampedPose { stamp, world_from_camera: None }),
            ("recorded", values) => self.frame.as_mut()?.world_from_camera = Some(pose(values)?),
            ("before", values) => self.before = Some(pose(values)?),
            ("usual", &[agreement, likeness]) => self.usual = Some([agreement, likeness]),
            ("bias", &[x, y, z, learned]) => (self.bias, self.learned) = (Vector3::new(x, y, z), learned as usize),
            (name, []) => self.last = Last::NAMES.iter().find(|(known, _)| *known == name)?.1,
            _ => return None,
        }
        Some(())
    }
}

fn numbers(pose: &Isometry3<f64>) -> Vec<f64> {
    let (p, q) = (pose.translation.vector, pose.rotation.coords);
    vec![p.x, p.y, p.z, q.x, q.y, q.z, q.w]
}

fn pose(numbers: &[f64]) -> Option<Isometry3<f64>> {
    let &[x, y, z, qx, qy, qz, qw] = numbers else { return None };
    let rotation = Quaternion::new(qw, qx, qy, qz);
    // To the bit: to normalise would change what was stored.
    let is_unit = (rotation.norm() - 1.0).abs() < TOLERANCE;
    is_unit.then(|| Isometry3::from_parts(Vector3::new(x, y, z).into(), UnitQuaternion::new_unchecked(rotation)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_written_reads_back_to_the_bit() {
        let pose = |k: f64| Isometry3::new(Vector3::new(0.1 * k, -k, k / 3.0), Vector3::new(0.3, 0.1 * k, -0.2));
        let full = FrontendState {
            last: Last::Guessed,
            pose: Some(PosePrior {
                world_from_camera: pose(1.0),
                covariance: Some(Matrix6::from_fn(|row, column| (row as f64 + 0.1).sqrt() / (column as f64 + 7.0))),
            }),
            frame: Some(StampedPose { stamp: 1_305_031_102.175_304, world_from_camera: Some(pose(2.0)) }),
            before: Some(pose(3.0)),
            usual: Some([0.97, 1.0 / 7.0]),
            bias: Vector3::new(1e-3, -2e-17, 0.1),
            learned: 41,
        };
        let lost = FrontendState { last: Last::Lost, ..FrontendState::default() };
        for state in [full.clone(), lost, FrontendState::default()] {
            let again = FrontendState::from_text(&state.to_text()).unwrap();
            assert_eq!(format!("{again:?}"), format!("{state:?}"));
        }
        let text = full.to_text();
        for (from, to, line) in
            [("guessed", "confused", 1), ("covariance", "covariance NaN", 3), ("before", "before 1", 6)]
        {
            let why = FrontendState::from_text(&text.replace(from, to)).unwrap_err();
            assert!(why.starts_with(&format!("line {line}: ")), "{why}");
        }
        assert!(FrontendState::from_text("recorded 0 0 0 0 0 0 1").is_err(), "of no frame");
    }
}
