//! The model: points of the map's surface, from a ray cast.

use nalgebra::Vector3;

use crate::images::Intrinsics;
use crate::ray_cast::pixel::UNSEEN;
use crate::ray_cast::view::View;
use crate::tracking::image_level::grey;

/// A point of the surface; position relative to the camera of the view, along the axes of the world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ModelPoint {
    pub(crate) position: [f32; 3],
    pub(crate) normal: [f32; 3],
    /// 0..=255; NaN where no colour was seen.
    pub(crate) intensity: f32,
}

/// Points along each side of a tile.
const TILE: usize = 8;
/// What lies so many times farther behind a point than beside it is another surface (ours): more than a plane seen at 76 degrees.
const RIM_DEPTH: f64 = 4.0;

/// The points of a view, tile by tile: what is wrong with the map is alike within a tile.
#[derive(Clone, Debug, Default)]
pub(crate) struct Model {
    pub(crate) points: Vec<ModelPoint>,
    /// Where each tile ends.
    ends: Vec<usize>,
}

impl Model {
    pub(crate) fn tiles(&self) -> impl Iterator<Item = &[ModelPoint]> {
        let starts = std::iter::once(&0).chain(&self.ends);
        starts.zip(&self.ends).map(|(from, to)| &self.points[*from..*to])
    }
}

/// The points of every `stride`-th pixel of a view along each side; intensities are means over `2 radius + 1` pixels along each
/// side.
///
/// Points nearer than `rim_width` to a rim are left out, metres; 0: none. Where a surface ends is known to a voxel, and differently from each
/// side: what is seen again from elsewhere would be held where its rims were rounded off, along directions that nothing else fixes.
pub(crate) fn model_points(view: &View, rim_width: f64, stride: usize, radius: usize, out: &mut Model) {
    out.points.clear();
    out.ends.clear();
    let Some(k) = view.intrinsics else { return };
    let rotation = view.world_from_camera.rotation.to_rotation_matrix().into_inner();
    let side = TILE * stride;
    for row in (0..view.height).step_by(side) {
        for column in (0..view.width).step_by(side) {
            for v in (row + stride / 2..view.height.min(row + side)).step_by(stride) {
                for u in (column + stride / 2..view.width.min(column + side)).step_by(stride) {
                    let at = v * view.width + u;
                    let z = f64::from(view.depth[at]);
                    if z > 0.0 && !is_at_rim(view, [u, v], &k, rim_width) {
                        let ray = Vector3::new((u as f64 - k.cx) / k.fx, (v as f64 - k.cy) / k.fy, 1.0);
                        let position = (rotation * ray * z).cast::<f32>().into();
                        let intensity = intensity(view, u, v, radius);
                        out.points.push(ModelPoint { position, normal: view.normals[at], intensity });
                    }
                }
            }
            if out.ends.last().copied().unwrap_or(0) < out.points.len() {
                out.ends.push(out.points.len());
            }
        }
    }
}

/// Whether so many metres beside a point there is a surface far behind it.
fn is_at_rim(view: &View, [u, v]: [usize; 2], k: &Intrinsics, width: f64) -> bool {
    let at = v * view.width + u;
    let z = f64::from(view.depth[at]);
    let behind = (z + RIM_DEPTH * width) as f32;
    let [across, down] = [k.fx, k.fy].map(|f| (width * f.abs() / z).ceil() as usize);
    let is_behind = |is_there: bool, at: usize| is_there && view.depth[at] > behind;
    is_behind(u >= across, at.wrapping_sub(across))
        || is_behind(u + across < view.width, at + across)
        || is_behind(v >= down, at.wrapping_sub(down * view.width))
        || is_behind(v + down < view.height, at + down * view.width)
}

/// Mean grey around a pixel; NaN if one of them is unseen.
fn intensity(view: &View, u: usize, v: usize, radius: usize) -> f32 {
    if u < radius || v < radius || u + radius >= view.width || v + radius >= view.height {
        return f32::NAN;
    }
    let mut sum = 0.0;
    for y in v - radius..=v + radius {
        for at in y * view.width + u - radius..=y * view.width + u + radius {
            if view.depth[at] == 0.0 || view.colours[at] == UNSEEN {
                return f32::NAN;
            }
            sum += grey(view.colours[at].map(f32::from));
        }
    }
    let side = (2 * radius + 1) as f32;
    sum / (side * side)
}
