//! Points followed by their looks alone, the turn between images taken from the gyroscope.

use nalgebra::{Matrix2, UnitQuaternion, Vector2, Vector3};

use super::detect::{Demands, Detector};
use super::patch::Patch;
use super::pyramid::Pyramid;
use crate::Camera;

/// Points that are followed.
const POINTS: usize = 40;
/// New ones are sought when there are fewer.
const REFILL: usize = 30;
/// Places to either side, and their spacing in pixels, at which a point is looked for.
const SEARCH: (i32, f64) = (4, 2.0);
/// Iterations of the alignment.
const ITERATIONS: usize = 10;
/// Largest share of a patch's contrast that may be left unexplained.
const UNEXPLAINED: f64 = 0.3;

/// The points that are followed.
#[derive(Debug, Clone, Default)]
pub(crate) struct Follower {
    followed: Vec<Followed>,
    next_id: u64,
}

#[derive(Debug, Clone)]
struct Followed {
    id: u64,
    patch: Patch,
    pixel: Vector2<f64>,
    direction: Vector3<f64>,
    /// Motion between the last two images that the turn does not explain, pixels.
    flow: Vector2<f64>,
    /// How the turns since the point was first seen have deformed the patch.
    warp: Matrix2<f64>,
}

impl Follower {
    /// Follows all points into the next image; `turn` is the body's in the meantime.
    pub(crate) fn image(
        &mut self,
        turn: Option<UnitQuaternion<f64>>,
        pyramid: &Pyramid,
        (detector, demands): (&mut Detector, &Demands),
        camera: &Camera,
    ) {
        match turn {
            Some(turn) => {
                let attitude = camera.body_from_camera.rotation;
                let turn = attitude.inverse() * turn.inverse() * attitude;
                self.followed.retain_mut(|followed| followed.follow(&turn, pyramid, camera).is_some());
            }
            None => self.followed.clear(),
        }
        if self.followed.len() >= REFILL {
            return;
        }
        detector.detect(pyramid, &self.followed.iter().map(|followed| followed.pixel), demands);
        while self.followed.len() < POINTS {
            let Some((pixel, patch)) = detector.pick(pyramid, demands) else { break };
            let Some(direction) = camera.bearing(&pixel) else { continue };
            let (id, flow, warp) = (self.next_id, Vector2::zeros(), Matrix2::identity());
            self.followed.push(Followed { id, patch, pixel, direction: direction.into_inner(), flow, warp });
            self.next_id += 1;
        }
    }

    /// Names and directions.
    pub(crate) fn seen(&self) -> impl Iterator<Item = (u64, Vector3<f64>)> {
        self.followed.iter().map(|followed| (followed.id, followed.direction))
    }

    /// Where a point is now.
    pub(crate) fn pixel(&self, id: u64) -> Option<Vector2<f64>> {
        self.followed.iter().find(|followed| followed.id == id).map(|followed| followed.pixel)
    }
}

impl Followed {
    /// Finds the point in the next image, or gives it up.
    fn follow(&mut self, turn: &UnitQuaternion<f64>, pyramid: &Pyramid, camera: &Camera) -> Option<()> {
        let turned = camera.project(&(turn * self.direction))?;
        let middle = turned + self.flow;
        let moved = |x: f64, y: f64| {
            let bearing = camera.bearing(&(self.pixel + Vector2::new(x, y)))?;
            camera.project(&(turn * bearing.into_inner()))
        };
        self.warp = Matrix2::from_columns(&[moved(1.0, 0.0)? - turned, moved(0.0, 1.0)? - turned]) * self.warp;
        let warp = self.warp;
        let (reach, spacing) = SEARCH;
        let places =
            (-reach..=reach).flat_map(|y| (-reach..=reach).map(move |x| Vector2::new(f64::from(x), f64::from(y))));
        let tried = places.filter_map(|offset| {
            let pixel = middle + offset * spacing;
            Some((self.patch.compare_coarse(pyramid, &pixel, &warp)?.mismatch, pixel))
        });
        let (_, mut pixel) = tried.reduce(|best, other| if other.0 < best.0 { other } else { best })?;
        for _ in 0..ITERATIONS {
            let comparison = self.patch.compare(pyramid, &pixel, &warp)?;
            let step = warp * comparison.information.try_inverse()? * comparison.moment;
            pixel += step;
            if step.norm() < 0.01 {
                if comparison.unexplained > UNEXPLAINED * comparison.energy || (pixel - middle).amax() > 12.0 {
                    return None;
                }
                self.flow = pixel - turned;
                self.pixel = pixel;
                self.direction = camera.bearing(&pixel)?.into_inner();
                return Some(());
            }
        }
        None
    }
}
