//! One ray, through the fields of its tile.
//!
//! Only additions, subtractions, multiplications, divisions, square roots, comparisons and integers, in the order in which
//! they are written: the result is the same on every processor that rounds as IEEE 754 asks.

use super::camera::Camera;
use super::cell::Cell;
use super::fields::{Field, Fields};
use super::tiles::{self, Tiles};
use super::{Band, Pixel, UNSEEN};

/// A ray parallel to a plane of voxels still has a finite inverse, voxels per metre.
pub(crate) const LEAST_SLOPE: f32 = 1e-6;
/// A field that starts this little below zero is met at its border: rounding, in truncation distances.
pub(crate) const GRAZE: f32 = 1e-3;
/// Steps near the surface and in unobserved cells, voxels.
pub(crate) const LEAST_STEP: f32 = 0.5;

/// Fills the rows of a band.
pub(super) fn fill(band: &mut Band, camera: &Camera, fields: &Fields, tiles: &Tiles, colour: bool) {
    let width = camera.width;
    let rows = band.depth.len() / width;
    let scene = Scene { camera, fields, colour };
    for top in (0..rows).step_by(tiles::SIDE) {
        for left in (0..width).step_by(tiles::SIDE) {
            let list = tiles.list(left / tiles::SIDE, (band.first + top) / tiles::SIDE);
            for row in top..(top + tiles::SIDE).min(rows) {
                let (start, step) = camera.row(band.first + row);
                for u in left..(left + tiles::SIDE).min(width) {
                    let direction = [0, 1, 2].map(|k| start[k] + step[k] * u as f32);
                    band.set(row * width + u, &scene.cast(direction, list));
                }
            }
        }
    }
}

/// What a ray did in one field.
enum Outcome {
    /// Left it without meeting the surface.
    Through,
    /// Met the solid from a side where no distance was observed.
    Blocked,
    Hit(Pixel),
}

struct Scene<'a> {
    camera: &'a Camera,
    fields: &'a Fields,
    colour: bool,
}

impl Scene<'_> {
    fn cast(&self, direction: [f32; 3], list: &[u32]) -> Pixel {
        let inverse = direction.map(|d| 1.0 / if d.abs() < LEAST_SLOPE { LEAST_SLOPE } else { d });
        let [dx, dy, dz] = direction;
        let per_voxel = 1.0 / (dx * dx + dy * dy + dz * dz).sqrt();
        for &k in list {
            let place = &self.fields.places[k as usize];
            let [x, y, z] = [0, 1, 2].map(|k| sorted(place.low[k] * inverse[k], place.high[k] * inverse[k]));
            let enter = max(max(x.0, y.0), max(z.0, self.camera.min_depth));
            let leave = min(min(x.1, y.1), min(z.1, self.camera.max_depth));
            if enter <= leave {
                let field = &self.fields.fields[place.field];
                let reach = self.camera.truncation;
                let ray = Ray { origin: place.origin, direction, per_voxel, reach, field, colour: self.colour };
                match ray.through(enter, leave) {
                    Outcome::Through => {}
                    Outcome::Blocked => return Pixel::NONE,
                    Outcome::Hit(pixel) => return pixel,
                }
            }
        }
        Pixel::NONE
    }
}

pub(super) fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

pub(super) fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

fn sorted(a: f32, b: f32) -> (f32, f32) {
    if a < b { (a, b) } else { (b, a) }
}

/// A ray `origin + t direction` in the nodes of a field; `t` is the depth in metres.
struct Ray<'a> {
    field: &'a Field,
    origin: [f32; 3],
    direction: [f32; 3],
    /// Metres of depth per voxel along the ray.
    per_voxel: f32,
    /// Truncation distance in voxels.
    reach: f32,
    colour: bool,
}

impl Ray<'_> {
    fn through(&self, enter: f32, leave: f32) -> Outcome {
        let mut outside: Option<(f32, f32)> = None;
        let mut t = enter;
        loop {
            let value = self.cell(t).value(&self.field.distance);
            let step = if value >= 0.0 {
                outside = Some((t, value));
                max(value * self.reach, LEAST_STEP)
            } else if value < 0.0 {
                return match outside {
                    Some(before) => self.refine(before, (t, value)),
                    None if value > -GRAZE => self.refine((t, 0.0), (t, value)),
                    None => Outcome::Blocked,
                };
            } else {
                outside = None;
                LEAST_STEP
            };
            if t >= leave {
                return Outcome::Through;
            }
            t = min(t + step * self.per_voxel, leave);
        }
    }

    fn cell(&self, t: f32) -> Cell {
        Cell::at([0, 1, 2].map(|k| self.origin[k] + self.direction[k] * t))
    }

    /// From two depths on either side of the surface: one step of the secant, one of Newton.
    fn refine(&self, (near, above): (f32, f32), (far, below): (f32, f32)) -> Outcome {
        let t = near + (far - near) * (above / (above - below));
        let cell = self.cell(t);
        let (value, [gx, gy, gz]) = cell.value_and_gradient(&self.field.distance);
        let slope = gx * self.direction[0] + gy * self.direction[1] + gz * self.direction[2];
        if slope < 0.0 {
            let reach = LEAST_STEP * self.per_voxel;
            let depth = t + min(max(-value / slope, -reach), reach);
            let scale = 1.0 / (gx * gx + gy * gy + gz * gz).sqrt();
            let colour = if self.colour { cell.colour(&self.field.colour) } else { UNSEEN };
            let weight = self.field.weight[cell.nearest()];
            Outcome::Hit(Pixel { depth, normal: [gx * scale, gy * scale, gz * scale], colour, weight })
        } else {
            // A back face, or a NaN: the voxel at the hit is not observed.
            Outcome::Blocked
        }
    }
}
