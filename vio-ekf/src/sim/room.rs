//! A textured room around a path, with boxes that stand and swing.

use nalgebra::Vector3;

use super::rng::{Rng, derive};
use super::texture::Texture;
use crate::error::Error;
use crate::error::invalid;
use crate::stamp::Stamp;
use crate::trajectory::spline::Spline;

/// Motion is looked at this often when the room is laid out.
const PATH_STEP_NS: i64 = 100_000_000;

/// Bodies in a room; the renderer tells surfaces apart by a byte.
const MAX_CUBOIDS: usize = 40;

/// How a room is built around a path.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct RoomSettings {
    /// Distance from the path to the walls, m, drawn for each wall between these; 1.5 to 3.
    pub wall_distance_m: (f64, f64),
    /// Boxes that stand or hang in the room; 8.
    pub furniture: usize,
    /// No box comes nearer to the path than this, m; 0.6.
    pub clearance_m: f64,
    /// Side of a texel, m; 3 mm, so that a texture repeats after 6 m.
    pub texel_m: f64,
    /// Texels along the side of a texture, a power of two; 2048.
    pub texture_size: usize,
    /// Walls without texture, in the order -x, +x, -y, +y, floor, ceiling; none.
    pub blank: [bool; 6],
    /// A box that moves through the room; none.
    pub occluder: Option<Occluder>,
}

impl Default for RoomSettings {
    fn default() -> Self {
        Self {
            wall_distance_m: (1.5, 3.0),
            furniture: 8,
            clearance_m: 0.6,
            texel_m: 0.003,
            texture_size: 2048,
            blank: [false; 6],
            occluder: None,
        }
    }
}

/// A textured box that swings about a point: everything a camera may take for the resting world and should not.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub struct Occluder {
    /// Middle of the motion in the world, m.
    pub centre_in_world: Vector3<f64>,
    /// Edge lengths, m.
    pub size: Vector3<f64>,
    /// Amplitude of the swing along each axis, m.
    pub amplitude: Vector3<f64>,
    /// Time of a full swing, s.
    pub period_s: f64,
}

/// How one rectangle is painted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Index of the texture.
    pub texture: usize,
    /// Texels per metre.
    pub texels_per_m: f64,
    /// Texture coordinates, in texels, of the corner where all coordinates are least.
    pub offset: [f64; 2],
    /// Brightness factor: the light on this face.
    pub shade: f64,
}

/// An axis-aligned box. Its faces are numbered -x, +x, -y, +y, -z, +z. On each the texture's two axes are the two
/// remaining world axes in the order x, y, z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cuboid {
    /// Corner with the least coordinates, m.
    pub min: Vector3<f64>,
    /// Corner with the largest.
    pub max: Vector3<f64>,
    /// How the faces are painted.
    pub faces: [Surface; 6],
}

/// A room seen from inside, with boxes in it.
#[derive(Debug, Clone)]
pub struct Room {
    /// Walls, floor and ceiling.
    pub walls: Cuboid,
    /// Boxes inside.
    pub furniture: Vec<Cuboid>,
    /// The textures the surfaces name.
    pub textures: Vec<Texture>,
    /// A moving box, with the paint of its faces.
    pub occluder: Option<(Occluder, [Surface; 6])>,
}

impl Room {
    /// A room that encloses a path, laid out and painted from a seed. The path's world has z up.
    pub fn around(spline: &Spline, settings: &RoomSettings, seed: u64) -> Result<Self, Error> {
        settings.check()?;
        let path = positions(spline)?;
        let mut rng = Rng::new(derive(seed, 10));
        let (mut min, mut max) = (path[0], path[0]);
        for p in &path {
            min = min.inf(p);
            max = max.sup(p);
        }
        let mut margin = || rng.between(settings.wall_distance_m.0, settings.wall_distance_m.1);
        min -= Vector3::from_fn(|_, _| margin());
        max += Vector3::from_fn(|_, _| margin());
        let textures = vec![
            Texture::painted(settings.texture_size, derive(seed, 11))?,
            Texture::masonry(settings.texture_size, derive(seed, 12))?,
            Texture::blank(settings.texture_size.min(256), derive(seed, 13))?,
        ];
        let mut paint = |texture: usize, shade: f64| Surface {
            texture,
            texels_per_m: 1.0 / settings.texel_m,
            offset: std::array::from_fn(|_| rng.between(0.0, settings.texture_size as f64)),
            shade,
        };
        // Light from above: the floor is bright, the ceiling is not; two walls are of stone.
        let wall = [(0, 0.95), (1, 1.0), (1, 0.8), (0, 0.85), (0, 0.9), (1, 0.7)];
        let faces = std::array::from_fn(|face| {
            let (texture, shade) = wall[face];
            paint(if settings.blank[face] { 2 } else { texture }, shade)
        });
        let box_faces = || [(0, 0.8), (0, 0.9), (1, 0.7), (0, 1.05), (0, 0.6), (0, 1.1)];
        let occluder =
            settings.occluder.map(|occluder| (occluder, box_faces().map(|(texture, shade)| paint(texture, shade))));
        let mut furniture: Vec<Cuboid> = Vec::new();
        let mut place = Rng::new(derive(seed, 14));
        // Where the path leaves no room for a box of the size drawn, another one is drawn; a tight room gets fewer.
        for _ in 0..200 * settings.furniture {
            if furniture.len() == settings.furniture {
                break;
            }
            let extent = max - min;
            let size = Vector3::from_fn(|axis, _| extent[axis] * place.between(0.08, 0.3));
            let mut low = Vector3::from_fn(|axis, _| min[axis] + place.uniform() * (extent[axis] - size[axis]));
            // Most stand on the floor, some hang from the ceiling.
            low.z = if place.uniform() < 0.7 { min.z } else { max.z - size.z };
            let high = low + size;
            let free = path.iter().all(|p| (p - p.sup(&low).inf(&high)).norm() > settings.clearance_m);
            let apart = furniture.iter().all(|b| (0..3).any(|a| high[a] < b.min[a] || low[a] > b.max[a]));
            if free && apart {
                let faces = box_faces().map(|(texture, shade)| paint(texture, shade));
                furniture.push(Cuboid { min: low, max: high, faces });
            }
        }
        Ok(Self { walls: Cuboid { min, max, faces }, furniture, textures, occluder })
    }

    /// Refuses a room that cannot be rendered: empty boxes, surfaces of textures that are not there.
    pub fn check(&self) -> Result<(), Error> {
        if self.furniture.len() > MAX_CUBOIDS {
            return Err(invalid("furniture", self.furniture.len() as f64, "must be at most 40 boxes"));
        }
        for (index, cuboid) in std::iter::once(&self.walls).chain(&self.furniture).enumerate() {
            if !(0..3).all(|a| cuboid.min[a] < cuboid.max[a] && (cuboid.max[a] - cuboid.min[a]).is_finite()) {
                return Err(Error::NonFinite { what: "extent (max - min, which must be positive) of box", index });
            }
        }
        let occluder_faces = self.occluder.iter().flat_map(|(_, faces)| faces);
        let boxes = std::iter::once(&self.walls).chain(&self.furniture);
        for surface in boxes.flat_map(|b| &b.faces).chain(occluder_faces) {
            if surface.texture >= self.textures.len() {
                return Err(invalid("texture", surface.texture as f64, "must be an index into the room's textures"));
            }
            let numbers = [surface.texels_per_m, surface.offset[0], surface.offset[1], surface.shade];
            if surface.texels_per_m <= 0.0 || surface.shade < 0.0 || !numbers.iter().all(|v| v.is_finite()) {
                return Err(invalid(
                    "texels_per_m",
                    surface.texels_per_m,
                    "must be positive, offsets and shade finite",
                ));
            }
        }
        Ok(())
    }

    /// The moving box at a time after the start, if there is one.
    pub(super) fn occluder_at(&self, since_s: f64) -> Option<Cuboid> {
        let (occluder, faces) = self.occluder?;
        let swing = (std::f64::consts::TAU * since_s / occluder.period_s).sin();
        let centre = occluder.centre_in_world + occluder.amplitude * swing;
        Some(Cuboid { min: centre - occluder.size / 2.0, max: centre + occluder.size / 2.0, faces })
    }
}

impl RoomSettings {
    fn check(&self) -> Result<(), Error> {
        let (low, high) = self.wall_distance_m;
        if !(low > 0.0 && low <= high && high.is_finite()) {
            return Err(invalid("wall_distance_m", low, "must be positive, finite, and not above its second number"));
        }
        if !(self.texel_m > 0.0 && self.texel_m.is_finite()) {
            return Err(invalid("texel_m", self.texel_m, "must be positive and finite, in metres"));
        }
        if self.furniture > MAX_CUBOIDS {
            return Err(invalid("furniture", self.furniture as f64, "must be at most 40 boxes"));
        }
        if !self.texture_size.is_power_of_two() || !(64..=4096).contains(&self.texture_size) {
            let rule = "must be a power of two from 64 to 4096";
            return Err(invalid("texture_size", self.texture_size as f64, rule));
        }
        if let Some(occluder) = &self.occluder {
            let numbers = occluder.centre_in_world.iter().chain(&occluder.amplitude);
            if !(occluder.size.iter().all(|&s| s > 0.0 && s.is_finite()) && numbers.into_iter().all(|v| v.is_finite()))
            {
                return Err(invalid(
                    "occluder",
                    f64::NAN,
                    "must have a positive size and a finite place and amplitude",
                ));
            }
            if !(occluder.period_s > 0.0 && occluder.period_s.is_finite()) {
                return Err(invalid("period_s", occluder.period_s, "must be positive and finite"));
            }
        }
        crate::error::all_not_negative(&[("clearance_m", self.clearance_m)])
    }
}

/// Positions along the whole motion.
fn positions(spline: &Spline) -> Result<Vec<Vector3<f64>>, Error> {
    let (first, last) = spline.span();
    let count = (last.nanos() - first.nanos()) / PATH_STEP_NS;
    let stamps = (0..=count).map(|i| Stamp::from_nanos(first.nanos() + i * PATH_STEP_NS)).chain([last]);
    stamps.map(|stamp| Ok(spline.sample(stamp)?.world_from_body.translation.vector)).collect()
}
