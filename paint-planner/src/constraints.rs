//! Where the vehicle may not fly, and on which side its hose hangs.

mod keep_out;
mod tether;

use std::f64::consts::TAU;

use crate::error::Error;
use crate::world::Surface;
use nalgebra::{Point3, Vector3};

pub use keep_out::{KeepOutVolume, WithKeepOut};
pub use tether::Tether;

/// Size of the mark at a tether's anchor, metres.
const ANCHOR: f64 = 0.1;

/// What the vehicle keeps to beside the surface itself, world frame, metres, z up.
#[derive(Debug, Clone, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct FlightConstraints {
    /// Volumes that the vehicle must not enter.
    pub keep_out: Vec<KeepOutVolume>,
    /// The hose or tether; without one the vehicle turns as it likes.
    pub tether: Option<Tether>,
}

impl FlightConstraints {
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.keep_out.is_empty() && self.tether.is_none()
    }

    /// Refuses volumes and tethers that are none.
    ///
    /// # Errors
    /// [`Error::Setting`].
    pub fn check(&self) -> Result<(), Error> {
        self.keep_out.iter().try_for_each(KeepOutVolume::check)?;
        self.tether.as_ref().map_or(Ok(()), Tether::check)
    }

    /// The surface with the volumes about it.
    pub fn around<'a>(&'a self, surface: &'a dyn Surface) -> WithKeepOut<'a> {
        WithKeepOut { surface, volumes: &self.keep_out }
    }

    /// Edges of the volumes and a mark at the anchor as lines, m, for a picture of what lies between `low` and `high`.
    pub fn outlines(&self, low: &Vector3<f64>, high: &Vector3<f64>) -> Vec<Vec<Point3<f64>>> {
        let mut lines = Vec::new();
        for volume in &self.keep_out {
            match volume {
                KeepOutVolume::Box { min, max } => lines.extend(box_edges(min, max)),
                KeepOutVolume::Sphere { centre, radius } => lines.extend(great_circles(centre, *radius)),
                KeepOutVolume::HalfSpace { point, normal } => lines.push(part_of_plane(point, normal, low, high)),
            }
        }
        lines.extend(self.tether.iter().flat_map(|tether| great_circles(&tether.anchor, ANCHOR)));
        lines
    }
}

fn box_edges(min: &Point3<f64>, max: &Point3<f64>) -> Vec<Vec<Point3<f64>>> {
    let corner = |k: usize| {
        let pick = |axis: usize| if k >> axis & 1 == 1 { max[axis] } else { min[axis] };
        Point3::new(pick(0), pick(1), pick(2))
    };
    let edges = (0..8).flat_map(|k| (0..3).filter(move |axis| k >> axis & 1 == 0).map(move |axis| (k, k | 1 << axis)));
    edges.map(|(a, b)| vec![corner(a), corner(b)]).collect()
}

fn great_circles(centre: &Point3<f64>, radius: f64) -> Vec<Vec<Point3<f64>>> {
    let circle = |a: Vector3<f64>, b: Vector3<f64>| {
        let at = |k: i32| {
            let (sin, cos) = (TAU * f64::from(k) / 48.0).sin_cos();
            centre + (a * cos + b * sin) * radius
        };
        (0..=48).map(at).collect()
    };
    let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()];
    vec![circle(x, y), circle(y, z), circle(z, x)]
}

/// A square of a plane beside the middle of a box, as wide as the box is long.
fn part_of_plane(
    point: &Point3<f64>,
    normal: &Vector3<f64>,
    low: &Vector3<f64>,
    high: &Vector3<f64>,
) -> Vec<Point3<f64>> {
    let n = normal.normalize();
    let middle = Point3::from((low + high) / 2.0);
    let foot = middle - n * n.dot(&(middle - point));
    let aside = n.cross(&if n.z.abs() < 0.9 { Vector3::z() } else { Vector3::x() }).normalize();
    let (a, b) = (aside * (0.5 * (high - low).norm()), n.cross(&aside) * (0.5 * (high - low).norm()));
    vec![foot + a + b, foot - a + b, foot - a - b, foot + a - b, foot + a + b]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outlines_lie_on_the_volumes() {
        let keep_out = vec![
            KeepOutVolume::Box { min: Point3::new(0.0, 0.0, 0.0), max: Point3::new(1.0, 2.0, 3.0) },
            KeepOutVolume::Sphere { centre: Point3::new(5.0, 0.0, 1.0), radius: 0.5 },
            KeepOutVolume::HalfSpace { point: Point3::new(0.0, -4.0, 0.0), normal: Vector3::new(0.0, 2.0, 0.3) },
        ];
        let constraints = FlightConstraints { keep_out, tether: None };
        let lines = constraints.outlines(&Vector3::zeros(), &Vector3::new(1.0, 1.0, 1.0));
        assert_eq!(lines.len(), 12 + 3 + 1);
        let length: f64 = lines[..12].iter().map(|line| (line[1] - line[0]).norm()).sum();
        assert!((length - 24.0).abs() < 1e-12);
        for (k, line) in lines.iter().enumerate() {
            let volume = &constraints.keep_out[match k {
                0..12 => 0,
                12..15 => 1,
                _ => 2,
            }];
            // On the border: in the volume or a rounding beside it, and outside of it a little farther out.
            assert!(line.iter().all(|p| volume.distance(p) < 1e-12), "line {k}");
        }
    }
}
