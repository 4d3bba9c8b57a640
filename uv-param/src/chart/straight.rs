//! Straight on over the surface, across seams too.

use super::locate::inside;
use super::{Chart, SurfacePoint};
use crate::triangle::orientation;
use crate::unfold::across;

/// Faces that a line may cross before it is given up: one that runs in circles about a vertex would never end.
const MAX_FACES: usize = 10_000;

impl Chart {
    /// The point that lies `offset` metres from `from` when the chart is continued across its seams: a straight line in the plane, which goes
    /// on beyond a seam in the plane of the other side. `None` where the line leaves the surface. The step that a spray's footprint, a stroke or a filter
    /// needs near a seam; inside a chart it is [`Self::locate`] of the sum.
    pub fn straight_on(&self, from: SurfacePoint, offset: [f64; 2]) -> Option<SurfacePoint> {
        let start = self.uv_of(from);
        self.follow(from.face as usize, None, [start, [start[0] + offset[0], start[1] + offset[1]]])
    }

    /// The same from a point on the far side of a seam: `line` is given in the plane of half-edge `h`, and goes on beyond it.
    pub(crate) fn straight_across(&self, h: usize, line: [[f64; 2]; 2]) -> Option<SurfacePoint> {
        let (entry, line) = self.over_seam(h, line)?;
        self.follow(entry / 3, Some(entry), line)
    }

    /// From face to face along a line, which came in by half-edge `entry`.
    fn follow(&self, mut face: usize, mut entry: Option<usize>, mut line: [[f64; 2]; 2]) -> Option<SurfacePoint> {
        for _ in 0..MAX_FACES {
            let corners = self.disk.faces[face].map(|v| self.uv[v as usize]);
            let [from, to] = line;
            if let Some(barycentric) = inside(corners, to) {
                return Some(SurfacePoint { face: face as u32, barycentric });
            }
            // The first edge on the way that has the end beyond it.
            let (mut exit, mut first) = (None, f64::INFINITY);
            for k in (0..3).filter(|&k| entry != Some(3 * face + k)) {
                let [a, b] = [corners[k], corners[(k + 1) % 3]];
                let (before, after) = (orientation([a, b, from]), orientation([a, b, to]));
                if after < 0.0 {
                    let share = (before / (before - after)).max(0.0);
                    if share < first {
                        (exit, first) = (Some(3 * face + k), share);
                    }
                }
            }
            let h = exit?;
            let next = if let Some(twin) = self.disk.twin(h) {
                twin
            } else {
                let (twin, moved) = self.over_seam(h, line)?;
                line = moved;
                twin
            };
            (face, entry) = (next / 3, Some(next));
        }
        None
    }

    /// The half-edge beyond a seam, and a line in the plane of that side; `None` at an open border.
    pub(crate) fn over_seam(&self, h: usize, line: [[f64; 2]; 2]) -> Option<(usize, [[f64; 2]; 2])> {
        let twin = self.disk.across_seam(h)?;
        let [to, from] = self.edge_uv(twin);
        Some((twin, line.map(|at| across(self.edge_uv(h), [from, to], at))))
    }

    /// The ends of a half-edge in the plane.
    pub(crate) fn edge_uv(&self, h: usize) -> [[f64; 2]; 2] {
        [h, h + 1].map(|k| self.uv[self.disk.faces[h / 3][k % 3] as usize])
    }
}
