//! Casts the rays of one pose into a room, tile by tile.
//!
//! All surfaces are rectangles across the world's axes, so that a hit is a quotient and texture coordinates are linear in
//! it. Most tiles see one surface only, which the rays through their corners tell: a rectangle is convex. The others find
//! the nearest surface for each pixel.
//!
//! A frame has no age: the poses of its exposure come in pairs, as long before its middle as after, at opposite places of
//! the pixel and equally sharp. What moves is as blurred ahead as behind.

use nalgebra::{Isometry3, Matrix3, Vector2, Vector3};

use super::room::{Cuboid, Room, Surface};
use super::texture::Texture;
use crate::camera::Camera;

pub(super) const TILE_WIDTH: usize = 16;
pub(super) const TILE_HEIGHT: usize = 8;
pub(super) const TILE: usize = TILE_WIDTH * TILE_HEIGHT;
const CORNERS: [usize; 4] = [0, TILE_WIDTH - 1, TILE - 1, TILE - TILE_WIDTH];

/// Sharper than one texel per pixel by this part of a level: the poses of an exposure sample different places of a pixel.
const LEVEL_BIAS: f32 = -0.35;

/// World axes along which a face's texture runs, by the axis of its normal.
const TEXTURE_AXES: [[usize; 2]; 3] = [[1, 2], [0, 2], [0, 1]];

/// Directions of a tile's pixels in camera axes, unit length, and how they change from pixel to pixel.
pub(super) struct TileRays {
    directions: [[f32; TILE]; 3],
    per_column: Vector3<f32>,
    per_row: Vector3<f32>,
    /// Half the binary logarithm of the solid angle of a pixel.
    half_log_solid_angle: f32,
}

impl TileRays {
    /// For the tile whose top left pixel is given. Pixels outside the lens model look along the axis.
    pub(super) fn new(camera: &Camera, left: usize, top: usize) -> Self {
        let direction = |x: f64, y: f64| {
            camera.bearing(&Vector2::new(x, y)).map_or(Vector3::z(), nalgebra::Unit::into_inner).cast::<f32>()
        };
        let mut directions = [[0.0; TILE]; 3];
        let along = |pixel: usize| {
            let (x, y) = (left + pixel % TILE_WIDTH, top + pixel / TILE_WIDTH);
            direction(x.min(camera.width - 1) as f64, y.min(camera.height - 1) as f64)
        };
        for (pixel, d) in (0..TILE).map(|pixel| (pixel, along(pixel))) {
            (directions[0][pixel], directions[1][pixel], directions[2][pixel]) = (d.x, d.y, d.z);
        }
        let (x, y) = ((left + TILE_WIDTH / 2) as f64, (top + TILE_HEIGHT / 2) as f64);
        let per_column = (direction(x + 1.0, y) - direction(x - 1.0, y)) * 0.5;
        let per_row = (direction(x, y + 1.0) - direction(x, y - 1.0)) * 0.5;
        // A tile outside the lens model has no angle; any finite number does.
        let solid_angle = per_column.cross(&per_row).norm().max(1e-12);
        Self { directions, per_column, per_row, half_log_solid_angle: 0.5 * solid_angle.log2() }
    }
}

/// One rectangle as seen from a place.
#[derive(Clone, Copy)]
struct Face<'a> {
    texture: &'a Texture,
    axis: usize,
    /// Signed distance from the eye along the axis, m.
    distance: f32,
    /// Texture coordinates of the eye's foot point, in 256ths of a texel.
    origin: [f32; 2],
    /// 256ths of a texel per metre.
    scale: f32,
    /// Mip level at one metre of a pixel of unit solid angle, seen head-on.
    level_at_1m: f32,
    /// Brightness per unit of a texture sample.
    weight: f32,
}

struct Body<'a> {
    /// Corners relative to the eye, m.
    low: [f32; 3],
    high: [f32; 3],
    faces: [Face<'a>; 6],
}

/// A room seen from one pose.
pub(super) struct View<'a> {
    world_from_camera: Matrix3<f32>,
    /// By how much the camera turns from row to row, in its own axes; zero with a global shutter.
    turn_per_row: Vector3<f32>,
    /// The walls, then everything in them.
    bodies: Vec<Body<'a>>,
    /// Where in the pixel this pose samples, pixels from its centre.
    offset: Vector2<f32>,
}

impl<'a> View<'a> {
    /// Pose `index` of `count` poses of one exposure.
    pub(super) fn new(
        room: &'a Room,
        moving: Option<&Cuboid>,
        (world_from_camera, turn_per_row): (&Isometry3<f64>, &Vector3<f64>),
        index: usize,
        count: usize,
    ) -> Self {
        let eye = world_from_camera.translation.vector;
        let share = 1.0 / count as f64;
        let cuboids = std::iter::once(&room.walls).chain(&room.furniture).chain(moving);
        let bodies = cuboids.map(|c| body(c, &eye, &room.textures, share as f32)).collect();
        // One pose in each column and in each row of a grid over the pixel, first and last opposite each other.
        let row =
            if count % 2 == 1 { (2 * index + count.div_ceil(2)) % count } else { 2 * (index + 1) % (count + 1) - 1 };
        let place = |cell: usize| ((cell as f64 + 0.5) * share - 0.5) as f32;
        Self {
            world_from_camera: world_from_camera.rotation.to_rotation_matrix().into_inner().cast(),
            turn_per_row: turn_per_row.cast(),
            bodies,
            offset: Vector2::new(place(index), place(row)),
        }
    }

    /// Adds the brightness that this pose contributes to a tile's pixels.
    pub(super) fn add_tile(&self, rays: &TileRays, sum: &mut [f32; TILE]) {
        let directions = self.in_world(rays);
        match self.one_face(&directions) {
            Some(face) => face.add_tile(&directions, rays.half_log_solid_angle, sum),
            None => self.add_mixed(&directions, rays.half_log_solid_angle, sum),
        }
    }

    fn in_world(&self, rays: &TileRays) -> [[f32; TILE]; 3] {
        let shift = rays.per_column * self.offset.x + rays.per_row * self.offset.y;
        let mut directions = rays.directions;
        if self.turn_per_row != Vector3::zeros() {
            let [xs, ys, zs] = &mut directions;
            for (i, ((x, y), z)) in xs.iter_mut().zip(ys).zip(zs).enumerate() {
                let rows = (i / TILE_WIDTH) as f32 - 0.5 * (TILE_HEIGHT as f32 - 1.0);
                let d = Vector3::new(*x, *y, *z);
                let turned = d + self.turn_per_row.cross(&d) * rows;
                (*x, *y, *z) = (turned.x, turned.y, turned.z);
            }
        }
        let [x, y, z] = &directions;
        std::array::from_fn(|axis| {
            let r = self.world_from_camera.row(axis);
            let (r0, r1, r2) = (r[0], r[1], r[2]);
            let base = r0 * shift.x + r1 * shift.y + r2 * shift.z;
            std::array::from_fn(|i| base + r0 * x[i] + r1 * y[i] + r2 * z[i])
        })
    }

    /// The face that fills the whole tile, if the corners prove it.
    fn one_face(&self, directions: &[[f32; TILE]; 3]) -> Option<Face<'a>> {
        let corners = CORNERS.map(|i| Vector3::new(directions[0][i], directions[1][i], directions[2][i]));
        let sides: [Vector3<f32>; 4] = std::array::from_fn(|i| corners[i].cross(&corners[(i + 1) % 4]));
        let centre = corners.iter().sum::<Vector3<f32>>();
        let mut inside = self.bodies[1..].iter().filter(|body| body.may_touch(&sides, &centre));
        let (Some(body), only) = (inside.next(), inside.next().is_none()) else {
            let face = self.bodies[0].exit(&corners[0]);
            return corners[1..].iter().all(|c| self.bodies[0].exit(c) == face).then(|| self.bodies[0].faces[face]);
        };
        let (_, face) = body.enter(&corners[0])?;
        let filled = only && corners[1..].iter().all(|c| body.enter(c).is_some_and(|(_, f)| f == face));
        filled.then(|| body.faces[face])
    }

    fn add_mixed(&self, directions: &[[f32; TILE]; 3], half_log_angle: f32, sum: &mut [f32; TILE]) {
        for i in 0..TILE {
            let d = Vector3::new(directions[0][i], directions[1][i], directions[2][i]);
            let mut face = &self.bodies[0].faces[self.bodies[0].exit(&d)];
            let mut nearest = f32::INFINITY;
            for body in &self.bodies[1..] {
                if let Some((depth, hit)) = body.enter(&d).filter(|&(depth, _)| depth < nearest) {
                    nearest = depth;
                    face = &body.faces[hit];
                }
            }
            let along = TEXTURE_AXES[face.axis].map(|axis| d[axis]);
            sum[i] += face.brightness(&face.place(d[face.axis], along, half_log_angle));
        }
    }
}

/// Where a ray meets a texture: coordinates in 256ths of a texel of a mip level, and the share of the next.
#[derive(Clone, Copy, Default)]
struct Place {
    u: i32,
    v: i32,
    level: i32,
    next: f32,
}

impl Face<'_> {
    /// Adds the brightness of a tile that this face fills.
    fn add_tile(&self, directions: &[[f32; TILE]; 3], half_log_angle: f32, sum: &mut [f32; TILE]) {
        let [du, dv] = TEXTURE_AXES[self.axis].map(|axis| &directions[axis]);
        let normal = &directions[self.axis];
        let mut places = [Place::default(); TILE];
        for (i, place) in places.iter_mut().enumerate() {
            *place = self.place(normal[i], [du[i], dv[i]], half_log_angle);
        }
        for (value, place) in sum.iter_mut().zip(&places) {
            *value += self.brightness(place);
        }
    }

    /// Of a ray with these components along the normal and along the texture's axes.
    #[inline(always)]
    fn place(&self, normal: f32, along: [f32; 2], half_log_angle: f32) -> Place {
        let depth = self.distance / normal;
        let most = self.texture.levels.len() as i32 - 1;
        let rank = (self.level_at_1m + half_log_angle + footprint(depth, normal)).clamp(0.0, most as f32);
        let level = (rank as i32).min(most - 1);
        let shrink = f32::from_bits(((127 - level) as u32) << 23);
        // From corners to centres of texels, half a texel, and rounded to the nearest.
        let at = |k: usize| ((self.origin[k] + depth * along[k] * self.scale) * shrink - 127.5) as i32;
        Place { u: at(0), v: at(1), level, next: rank - level as f32 }
    }

    /// Interpolated between the level and the next.
    #[inline(always)]
    fn brightness(&self, place: &Place) -> f32 {
        let (levels, level) = (&self.texture.levels, place.level as usize);
        let sharp = self.texture.sample(levels[level], place.u as u32, place.v as u32) as f32;
        let coarse = |c: i32| ((c - 128) >> 1) as u32;
        let soft = self.texture.sample(levels[level + 1], coarse(place.u), coarse(place.v)) as f32;
        (sharp + (soft - sharp) * place.next) * self.weight
    }
}

/// Half the binary logarithm of the area that a pixel of unit solid angle covers at a depth, `d² / |cos|`.
#[inline(always)]
fn footprint(depth: f32, cosine: f32) -> f32 {
    // The bits of a float are its logarithm, linear between powers of two: at most 0.09 off, and continuous.
    let area = depth * depth / cosine.abs();
    (area.to_bits() as i32 - 0x3f80_0000) as f32 * (0.5 / 8_388_608.0)
}

impl Body<'_> {
    /// Whether any of the box is inside the pyramid with these side planes.
    fn may_touch(&self, sides: &[Vector3<f32>; 4], centre: &Vector3<f32>) -> bool {
        sides.iter().all(|n| {
            // The planes' normals point inwards or outwards depending on the turn of the corners.
            let n = if n.dot(centre) < 0.0 { -n } else { *n };
            (0..3).map(|a| (n[a] * self.low[a]).max(n[a] * self.high[a])).sum::<f32>() >= 0.0
        })
    }

    /// The face through which a ray from inside leaves.
    fn exit(&self, d: &Vector3<f32>) -> usize {
        let far = |a: usize| if d[a] > 0.0 { self.high[a] / d[a] } else { self.low[a] / d[a] };
        let mut axis = 0;
        let mut nearest = far(0);
        for a in 1..3 {
            if far(a) < nearest {
                (axis, nearest) = (a, far(a));
            }
        }
        2 * axis + usize::from(d[axis] > 0.0)
    }

    /// Depth and face at which a ray from outside enters.
    fn enter(&self, d: &Vector3<f32>) -> Option<(f32, usize)> {
        let (mut near, mut far, mut axis) = (0.0_f32, f32::INFINITY, 3);
        for a in 0..3 {
            let inverse = 1.0 / d[a];
            let (one, two) = (self.low[a] * inverse, self.high[a] * inverse);
            let (first, second) = if one < two { (one, two) } else { (two, one) };
            if first > near {
                (near, axis) = (first, a);
            }
            far = far.min(second);
        }
        (near <= far && axis < 3).then(|| (near, 2 * axis + usize::from(d[axis] < 0.0)))
    }
}

fn body<'a>(cuboid: &Cuboid, eye: &Vector3<f64>, textures: &'a [Texture], share: f32) -> Body<'a> {
    let (low, high) = (cuboid.min - eye, cuboid.max - eye);
    let face = |index: usize| {
        let (axis, surface): (usize, &Surface) = (index / 2, &cuboid.faces[index]);
        let texture = &textures[surface.texture];
        let period = texture.size() as f64;
        // One period more, so that rounding at the edge cannot make a coordinate negative.
        let origin = |k: usize| {
            let world_axis = TEXTURE_AXES[axis][k];
            let coordinate = -low[world_axis] * surface.texels_per_m + surface.offset[k].rem_euclid(period) + period;
            (256.0 * coordinate) as f32
        };
        Face {
            texture,
            axis,
            distance: if index.is_multiple_of(2) { low[axis] } else { high[axis] } as f32,
            origin: [origin(0), origin(1)],
            scale: (256.0 * surface.texels_per_m) as f32,
            level_at_1m: surface.texels_per_m.log2() as f32 + LEVEL_BIAS,
            weight: surface.shade as f32 * share / 65536.0,
        }
    };
    let corner = |c: &Vector3<f64>| std::array::from_fn(|a| c[a] as f32);
    Body { low: corner(&low), high: corner(&high), faces: std::array::from_fn(face) }
}
