//! Furnished rooms, textured from a seed.

use nalgebra::{Point3, Vector3};

use super::solid::Solid;
use crate::Rng;

/// Large odd numbers that tell the axes apart.
const PRIMES: [u64; 3] = [0x9e37_79b9_7f4a_7c15, 0xc2b2_ae3d_27d4_eb4f, 0x1656_67b1_9e37_79f9];
/// Edge of the patches and of the grain of all surfaces, metres, and their share of the contrast.
const TEXTURE: [(f64, f64); 2] = [(0.25, 0.6), (0.06, 0.4)];

/// The inside of a box with solids in it.
#[derive(Debug, Clone)]
pub(super) struct World {
    pub(super) size: [f64; 3],
    solids: Vec<Solid>,
    seed: u64,
}

impl World {
    /// A room of a size, the floor's middle at the origin, with furniture along its walls.
    pub(super) fn furnished(size: [f64; 3], seed: u64) -> Self {
        let mut rng = Rng::new(seed);
        let mut solids = Vec::new();
        let [width, depth, height] = size;
        for (k, (length, across)) in
            [(width, depth), (depth, width), (width, depth), (depth, width)].into_iter().enumerate()
        {
            // Along the wall, then out from it: a piece of furniture, and a gap.
            let mut at = -length / 2.0 + 0.1;
            while at < length / 2.0 - 0.9 {
                let wide = rng.between(0.35, 0.8);
                let (deep, tall) = (rng.between(0.2, 0.55), rng.between(0.3, 0.75 * height));
                let place = |along: f64, out: f64| {
                    let wall = out - across / 2.0;
                    match k {
                        0 => [along, wall],
                        1 => [wall, along],
                        2 => [along, -wall],
                        _ => [-wall, along],
                    }
                };
                let [a, b] = [place(at, 0.0), place(at + wide, deep)];
                let middle = place(at + wide / 2.0, deep / 2.0 + 0.15);
                let low = [a[0].min(b[0]), a[1].min(b[1])];
                let high = [a[0].max(b[0]), a[1].max(b[1])];
                let radius = rng.between(0.08, 0.2);
                solids.push(match rng.unit() {
                    kind if kind < 0.6 => Solid::Box([low[0], low[1], 0.0], [high[0], high[1], tall]),
                    kind if kind < 0.75 => Solid::Pole(middle, [0.0, tall], radius),
                    kind if kind < 0.9 => Solid::Ball([middle[0], middle[1], tall], radius + 0.1),
                    _ => Solid::Box([low[0], low[1], 0.45 * height], [high[0], high[1], 0.45 * height + 0.06]),
                });
                at += wide + rng.between(0.1, 0.7);
            }
        }
        Self { size, solids, seed }
    }

    /// The same with more in it.
    pub(super) fn with(mut self, solids: impl IntoIterator<Item = Solid>) -> Self {
        self.solids.extend(solids);
        self
    }

    /// The world for rays from a point in the air.
    pub(super) fn seen_from(&self, origin: Point3<f64>) -> Seen<'_> {
        let cone = |solid: &Solid| {
            let (centre, radius) = solid.bounds();
            let (way, slack) = (centre - origin, 1.0 + 1e-9);
            // From within the ball it is in all directions.
            let cosine = (1.0 - (slack * radius / way.norm()).powi(2)).max(0.0).sqrt();
            let cosine = if way.norm() > slack * radius { cosine } else { -1.0 };
            (way.normalize(), cosine, *solid)
        };
        Seen { world: self, origin, cones: self.solids.iter().map(cone).collect() }
    }

    /// Distance of a point in the air from the nearest surface.
    pub(super) fn distance(&self, p: &Point3<f64>) -> f64 {
        let wall = |k: usize| {
            let [low, high] = self.bounds(k);
            (p[k] - low).min(high - p[k])
        };
        let walls = (0..3).map(wall).fold(f64::INFINITY, f64::min);
        self.solids.iter().map(|solid| solid.distance(p)).fold(walls, f64::min)
    }

    fn bounds(&self, k: usize) -> [f64; 2] {
        let size = self.size[k];
        if k == 2 { [0.0, size] } else { [-size / 2.0, size / 2.0] }
    }

    /// Colour of a surface at a point.
    pub(super) fn colour(&self, p: &Point3<f64>) -> [u8; 3] {
        let grain: f64 = TEXTURE.iter().map(|(cell, share)| share * smooth_noise(p, *cell, self.seed)).sum();
        [(40.0 + 180.0 * grain) as u8, (36.0 + 162.0 * grain) as u8, (32.0 + 144.0 * grain) as u8]
    }
}

/// A world as a point sees it.
pub(super) struct Seen<'a> {
    world: &'a World,
    origin: Point3<f64>,
    /// Axis and cosine of the angle of a cone around every solid.
    cones: Vec<(Vector3<f64>, f64, Solid)>,
}

impl Seen<'_> {
    /// The `t` at which the ray `t d` from the point first meets a surface.
    pub(super) fn hit(&self, d: &Vector3<f64>) -> f64 {
        let o = &self.origin;
        let wall = |k: usize| {
            let [low, high] = self.world.bounds(k);
            if d[k] == 0.0 { f64::INFINITY } else { (if d[k] > 0.0 { high } else { low } - o[k]) / d[k] }
        };
        let (walls, length) = ((0..3).map(wall).fold(f64::INFINITY, f64::min), d.norm());
        let ahead = self.cones.iter().filter(|(axis, cosine, _)| axis.dot(d) >= cosine * length);
        ahead.filter_map(|(_, _, solid)| solid.hit(o, d)).fold(walls, f64::min)
    }
}

/// Values from 0 to 1 at the corners of a grid, and what lies between.
fn smooth_noise(p: &Point3<f64>, cell: f64, seed: u64) -> f64 {
    let at = p.coords / cell;
    let (base, part) = (at.map(f64::floor), at.map(|v| v - v.floor()));
    let mut sum = 0.0;
    for corner in 0..8_u8 {
        let (mut key, mut weight) = (seed, 1.0);
        for (k, factor) in PRIMES.into_iter().enumerate() {
            let up = corner >> k & 1 == 1;
            weight *= if up { part[k] } else { 1.0 - part[k] };
            key = key.wrapping_add(((base[k] + f64::from(up)) as i64 as u64).wrapping_mul(factor));
        }
        sum += weight * (mixed(key) >> 11) as f64 / (1_u64 << 53) as f64;
    }
    sum
}

/// The finaliser of splitmix64.
fn mixed(key: u64) -> u64 {
    let key = (key ^ (key >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let key = (key ^ (key >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    key ^ (key >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where a ray ends there is a surface, and none before it.
    #[test]
    fn rays_end_where_the_distance_is_zero() {
        let world = World::furnished([6.0, 5.0, 2.8], 3).with([Solid::Ball([0.8, 0.3, 1.0], 0.3)]);
        let mut rng = Rng::new(9);
        for _ in 0..3000 {
            let o = Point3::new(rng.between(-0.3, 0.3), rng.between(-0.3, 0.3), rng.between(1.0, 1.8));
            let d = Vector3::from_fn(|_, _| rng.normal()).normalize();
            let end = world.seen_from(o).hit(&d);
            assert!(world.distance(&(o + d * end)).abs() < 1e-9, "{o} {d}");
            // Sphere tracing ends there, too; along surfaces its steps are short.
            let (mut t, mut step) = (0.0, f64::INFINITY);
            while step > 1e-6 && t < end {
                step = world.distance(&(o + d * t));
                t += step;
            }
            assert!(t <= end + 1e-9 && t > end - 1e-3, "{t} {end}");
        }
    }
}
