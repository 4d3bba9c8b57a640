//! The model: points of the map's surface, from a ray cast.

use nalgebra::Vector3;

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
pub(crate) fn model_points(view: &View, stride: usize, radius: usize, out: &mut Model) {
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
                    if z > 0.0 {
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
