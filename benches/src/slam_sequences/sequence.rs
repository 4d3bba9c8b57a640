//! The five sequences.

use nalgebra::{Isometry3, Vector3};
use tsdf_hash::Intrinsics;

use super::camera::{DepthCamera, Shot};
use super::flight::{Flight, Range};
use super::solid::Solid;
use super::world::World;

/// Kinect-like, as most of the paper's: it is specified up to 4 m, where its noise is 26 mm.
const USUAL: DepthCamera = DepthCamera {
    size: [640, 480],
    intrinsics: Intrinsics { fx: 525.0, fy: 525.0, cx: 319.5, cy: 239.5 },
    noise: [1.2e-3, 1.9e-3],
    farthest: 4.0,
};
/// The simulator's: wide, without noise.
const WIDE: DepthCamera = DepthCamera {
    intrinsics: Intrinsics { fx: 380.0, fy: 380.0, cx: 319.5, cy: 239.5 },
    noise: [0.0; 2],
    farthest: 8.0,
    ..USUAL
};

/// What the paper printed of a sequence (Table 5.2): its own error, and those of `ElasticFusion` and `InfiniTAM`.
#[derive(Debug, Clone, Copy)]
pub struct Published {
    /// Of the positions, cm.
    pub tracking: [f64; 3],
    /// Mean of the mesh's distances from the truth, mm; not a number where it was distorted.
    pub mesh: [f64; 3],
}

/// A sequence as Table 5.1 describes it, and the room that it goes through.
#[derive(Debug, Clone, Copy)]
pub struct Sequence {
    /// As the paper calls it, in lower case.
    pub name: &'static str,
    /// Images.
    pub frames: usize,
    /// Images per second.
    pub rate: f64,
    /// Way, m.
    length: f64,
    /// Mean turning, degrees per second.
    turning: f64,
    /// Width, depth and height of the room, m.
    room: [f64; 3],
    /// The camera.
    pub camera: DepthCamera,
    range: Range,
    /// What the paper printed of its own, if it did.
    pub published: Option<Published>,
}

/// All of them. The paper's `long` and `uav` have no error in its Table 5.2.
pub const ALL: [Sequence; 5] = [
    Sequence {
        name: "loopy",
        frames: 2784,
        rate: 15.05,
        length: 42.379,
        turning: 14.209,
        room: [8.0, 6.0, 3.1],
        camera: USUAL,
        range: Range { middle: [0.0, 0.0, 1.5], half: [2.2, 1.4, 0.35], turns: [2.8, 0.3], at: None },
        published: Some(Published { tracking: [11.93, 12.16, 29.17], mesh: [24.06, 25.79, 41.16] }),
    },
    Sequence {
        name: "fast",
        frames: 427,
        rate: 14.57,
        length: 16.734,
        turning: 35.484,
        room: [5.6, 5.0, 2.8],
        camera: USUAL,
        range: Range { middle: [0.0, 0.0, 1.4], half: [1.3, 1.1, 0.35], turns: [3.0, 0.35], at: None },
        published: Some(Published { tracking: [12.14, 23.88, 84.41], mesh: [24.98, 50.42, f64::NAN] }),
    },
    Sequence {
        name: "long",
        frames: 1246,
        rate: 14.83,
        length: 50.4,
        turning: 20.895,
        room: [22.0, 8.3, 3.0],
        camera: USUAL,
        range: Range { middle: [0.0, 0.0, 1.5], half: [8.5, 2.3, 0.3], turns: [2.8, 0.25], at: None },
        published: None,
    },
    Sequence {
        name: "rotors",
        frames: 1762,
        rate: 29.97,
        length: 20.731,
        turning: 14.235,
        room: [15.6, 15.6, 5.0],
        camera: WIDE,
        range: Range { middle: [0.0, -3.0, 2.2], half: [3.0, 2.0, 0.7], turns: [2.2, 0.35], at: None },
        published: Some(Published { tracking: [3.08, 3.37, 3.21], mesh: [5.25, 6.41, 5.34] }),
    },
    Sequence {
        name: "uav",
        frames: 3308,
        rate: 59.7,
        length: 9.46,
        turning: 12.131,
        room: [5.0, 4.5, 2.5],
        camera: USUAL,
        range: Range {
            middle: [0.0, -1.0, 1.3],
            half: [1.2, 0.5, 0.35],
            turns: [0.7, 0.25],
            at: Some([0.0, 0.6, 0.9]),
        },
        published: None,
    },
];

/// A sequence that can be seen.
pub(super) struct Rendered {
    pub(super) world: World,
    pub(super) flight: Flight,
    sequence: Sequence,
    seed: u64,
}

impl Sequence {
    /// Seconds from the first to the last image.
    pub fn seconds(&self) -> f64 {
        (self.frames - 1) as f64 / self.rate
    }

    pub(super) fn rendered(&self, seed: u64) -> Rendered {
        let world = World::furnished(self.room, seed);
        // Something to look at, where it looks at something.
        let object = self.range.at.map(|[x, y, z]| {
            [
                Solid::Box([x - 0.3, y - 0.2, 0.0], [x + 0.3, y + 0.2, z - 0.2]),
                Solid::Ball([x - 0.1, y, z], 0.22),
                Solid::Pole([x + 0.2, y - 0.1], [z - 0.2, z + 0.3], 0.06),
            ]
        });
        let world = world.with(object.into_iter().flatten());
        let flight = Flight::new(self.range, self.seconds(), self.length, self.turning.to_radians(), seed);
        Rendered { world, flight, sequence: *self, seed }
    }
}

impl Rendered {
    pub(super) fn time(&self, frame: usize) -> f64 {
        frame as f64 / self.sequence.rate
    }

    pub(super) fn pose(&self, frame: usize) -> Isometry3<f64> {
        self.flight.at(self.time(frame))
    }

    pub(super) fn shot(&self, frame: usize, threads: usize) -> Shot {
        let seed = self.seed.wrapping_mul(1_000_003).wrapping_add(frame as u64);
        self.sequence.camera.shot(&self.world, &self.pose(frame), seed, threads)
    }

    /// Whether the camera is in the air all the way, with so much room around it.
    #[cfg(test)]
    fn clearance(&self) -> f64 {
        let at = |frame: usize| self.world.distance(&self.pose(frame).translation.vector.into());
        (0..self.sequence.frames).map(at).fold(f64::INFINITY, f64::min)
    }

    /// What a gyroscope beside the camera says, in the axes of the camera, rad/s.
    pub(super) fn rate(&self, time: f64) -> Vector3<f64> {
        self.flight.rate(time)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The camera is never in a piece of furniture, and the statistics are those of Table 5.1.
    #[test]
    fn the_sequences_are_those_of_the_paper() {
        for sequence in ALL {
            for seed in [1, 2] {
                let rendered = sequence.rendered(seed);
                let clearance = rendered.clearance();
                assert!(clearance > 0.1, "{} {seed}: {clearance}", sequence.name);
                let [length, turned] = rendered.flight.covered(sequence.seconds());
                assert!((length / sequence.length - 1.0).abs() < 0.01, "{} {length}", sequence.name);
                let turning = turned.to_degrees() / sequence.seconds();
                assert!((turning / sequence.turning - 1.0).abs() < 0.05, "{} {turning}", sequence.name);
            }
        }
    }
}
