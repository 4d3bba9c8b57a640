//! How a part lies in its chart: as it lay before, or turned into its smallest box.

use crate::min_area_rectangle::min_area_rectangle;

/// A turn (cosine and sine), then a shift, metres.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pose {
    turn: [f64; 2],
    corner: [f64; 2],
    /// Box around the part, metres.
    pub(super) size: [f64; 2],
}

impl Pose {
    /// Brings the box of some points to the origin: the smallest box in any turn, or, where they must not be turned, that along the axes.
    pub(super) fn of(points: &[[f64; 2]], turned: bool) -> Self {
        let angle = if turned { min_area_rectangle(points).map_or(0.0, |rectangle| rectangle.angle) } else { 0.0 };
        let mut pose = Self { turn: [angle.cos(), -angle.sin()], corner: [0.0; 2], size: [0.0; 2] };
        let extreme = |k: usize, pick: fn(f64, f64) -> f64| {
            points.iter().map(|&at| pose.apply(at)[k]).reduce(pick).unwrap_or(0.0)
        };
        let [corner, far] = [f64::min, f64::max].map(|pick| [extreme(0, pick), extreme(1, pick)]);
        (pose.corner, pose.size) = (corner, [far[0] - corner[0], far[1] - corner[1]]);
        pose
    }

    pub(super) fn apply(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [c, s] = self.turn;
        [c * x - s * y - self.corner[0], s * x + c * y - self.corner[1]]
    }
}
