//! The mesh with its texture: what droplets hit.

use glam::DVec3;
use nalgebra::{Point3, Vector3};
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, TraversalAction};

use super::cone::Cone;
use crate::error::{Error, check_positive};

/// Meshes with at most this many faces are searched one by one: a hierarchy would cost more than it saves.
const FEW_FACES: usize = 32;

/// Corners of one face and, where it is painted, their places in the texture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TexelFace {
    /// Corners in the world, m, counter-clockwise seen from the painted side.
    pub corners: [[f32; 3]; 3],
    /// Columns and rows of the corners in the texture, fractions allowed, row 0 at the top; `None` for what only stands in the way.
    pub texels: Option<[[f32; 2]; 3]>,
}

/// A face with what every cast needs of it.
#[derive(Debug, Clone)]
pub(super) struct Face {
    pub(super) corners: [Vector3<f64>; 3],
    pub(super) texels: Option<[[f32; 2]; 3]>,
    center: Point3<f64>,
    radius: f64,
}

/// A triangle soup with a texture of `width` by `height` texels: open, unequal and duplicate faces are fine; faces without an area are
/// left out and counted.
#[derive(Debug, Clone)]
pub struct TexelSurface {
    faces: Vec<Face>,
    tree: Bvh,
    width: usize,
    height: usize,
    areas: Vec<f64>,
    left_out: usize,
}

impl TexelSurface {
    /// From faces, the size of the texture (columns, rows) and the area of surface in each texel (m^2, row by row, zero beside the
    /// surface).
    ///
    /// # Errors
    /// No faces, numbers that are not finite, places outside the texture, as many areas as there are no texels, or no area at all.
    pub fn new(faces: &[TexelFace], [width, height]: [usize; 2], areas: &[f64]) -> Result<Self, Error> {
        if faces.is_empty() {
            return Err(Error::Empty { what: "faces" });
        }
        if areas.len() != width * height || areas.len() >= u32::MAX as usize {
            let value = areas.len() as f64;
            return Err(Error::OutOfRange {
                what: "number of texel areas",
                value,
                allowed: "columns times rows of the texture, below 2^32 - 1",
            });
        }
        if let Some(index) = areas.iter().position(|area| !(area.is_finite() && *area >= 0.0)) {
            return Err(Error::NotFinite { what: "area of texel", index });
        }
        check_positive("sum of the texel areas", areas.iter().sum())?;
        let mut surface = Self {
            faces: Vec::with_capacity(faces.len()),
            tree: Bvh::new(),
            width,
            height,
            areas: areas.to_vec(),
            left_out: 0,
        };
        for (index, face) in faces.iter().enumerate() {
            surface.push(index, face)?;
        }
        if surface.faces.is_empty() {
            return Err(Error::NoArea { faces: faces.len() });
        }
        let bounds = |face: &Face| {
            let [a, b, c] = &face.corners;
            let vector = |v: Vector3<f64>| DVec3::new(v.x, v.y, v.z);
            Aabb::new(vector(a.inf(b).inf(c)), vector(a.sup(b).sup(c)))
        };
        let boxes: Vec<Aabb> = surface.faces.iter().map(bounds).collect();
        surface.tree = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
        Ok(surface)
    }

    fn push(&mut self, index: usize, face: &TexelFace) -> Result<(), Error> {
        let numbers = face.corners.iter().flatten().chain(face.texels.iter().flatten().flatten());
        if numbers.into_iter().any(|v| !v.is_finite()) {
            return Err(Error::NotFinite { what: "face", index });
        }
        let [width, height] = [self.width as f32, self.height as f32];
        let inside = |[u, v]: &[f32; 2]| (-0.01..=width + 0.01).contains(u) && (-0.01..=height + 0.01).contains(v);
        if let Some(outside) = face.texels.iter().flatten().find(|place| !inside(place)) {
            return Err(Error::OutOfRange {
                what: "place of a corner in the texture",
                value: f64::from(if (0.0..=width).contains(&outside[0]) { outside[1] } else { outside[0] }),
                allowed: "between 0 and the number of columns or rows",
            });
        }
        let corners = face.corners.map(|p| Vector3::from(p.map(f64::from)));
        let [a, b, c] = &corners;
        if (b - a).cross(&(c - a)).norm_squared() == 0.0 {
            self.left_out += 1;
            return Ok(());
        }
        let center = (a + b + c) / 3.0;
        let radius = corners.iter().map(|p| (p - center).norm()).fold(0.0, f64::max);
        self.faces.push(Face { corners, texels: face.texels, center: center.into(), radius });
        Ok(())
    }

    /// Columns of the texture.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows of the texture.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Area of surface in each texel, m^2, row by row.
    pub fn areas(&self) -> &[f64] {
        &self.areas
    }

    /// Faces without an area: no droplet can hit them.
    pub fn faces_left_out(&self) -> usize {
        self.left_out
    }

    /// Calls `found` with every face that the cone may touch, in an order that depends on the mesh and the cone alone.
    pub(super) fn faces_in(&self, cone: &Cone, mut found: impl FnMut(&Face)) {
        let near = |face: &Face| cone.may_touch(&face.center, face.radius);
        if self.faces.len() <= FEW_FACES {
            self.faces.iter().filter(|face| near(face)).for_each(found);
            return;
        }
        self.tree.traverse(|node| {
            let (low, high) = (node.mins(), node.maxs());
            let center = (low + high) * 0.5;
            let radius = (high - low).length() * 0.5;
            if !cone.may_touch(&Point3::new(center.x, center.y, center.z), radius) {
                return TraversalAction::Prune;
            }
            if let Some(leaf) = node.leaf_data() {
                let face = &self.faces[leaf as usize];
                if near(face) {
                    found(face);
                }
            }
            TraversalAction::Continue
        });
    }
}
