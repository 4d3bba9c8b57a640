//! Grey textures without an end, filtered for the distance at which they are seen.

use super::rng::Rng;
use crate::error::Error;
use crate::error::invalid;

/// A square grey texture that repeats in both directions, with its mip levels.
///
/// Each stored word packs the four neighbours that bilinear interpolation needs, so that a lookup is one load.
#[derive(Debug, Clone)]
pub struct Texture {
    texels: Vec<u32>,
    pub(super) levels: Vec<Level>,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Level {
    base: u32,
    shift: u32,
    mask: u32,
}

impl Texture {
    /// From `size · size` grey values, row by row; `size` is a power of two from 2 to 4096.
    pub fn new(size: usize, grey: &[u8]) -> Result<Self, Error> {
        if !size.is_power_of_two() || !(2..=4096).contains(&size) {
            return Err(invalid("size", size as f64, "must be a power of two from 2 to 4096"));
        }
        crate::trajectory::same_length("texture", grey.len(), "size times size", size * size)?;
        let mut texels = Vec::with_capacity(size * size * 4 / 3 + 1);
        let mut levels = Vec::new();
        let mut image: Vec<f32> = grey.iter().map(|&g| f32::from(g)).collect();
        let mut side = size;
        loop {
            levels.push(Level { base: texels.len() as u32, shift: side.trailing_zeros(), mask: side as u32 - 1 });
            let at = |x: usize, y: usize| image[(y & (side - 1)) * side + (x & (side - 1))].round() as u32;
            for y in 0..side {
                for x in 0..side {
                    texels.push(at(x, y) | at(x + 1, y) << 8 | at(x, y + 1) << 16 | at(x + 1, y + 1) << 24);
                }
            }
            if side == 1 {
                return Ok(Self { texels, levels });
            }
            image = halved(&image, side);
            side /= 2;
        }
    }

    /// Texels along the side.
    pub(super) fn size(&self) -> usize {
        1 << self.levels[0].shift
    }

    /// Bilinear value times 65536 at fixed-point coordinates of a level, 8 bits below the point.
    #[inline(always)]
    pub(super) fn sample(&self, level: Level, x: u32, y: u32) -> u32 {
        let row = ((y >> 8) & level.mask) << level.shift;
        let packed = self.texels[(level.base + row + ((x >> 8) & level.mask)) as usize];
        let (fx, fy) = (x & 255, y & 255);
        // Both rows at once, in the two halves of the word.
        let rows = (packed & 0x00ff_00ff) * (256 - fx) + ((packed >> 8) & 0x00ff_00ff) * fx;
        (rows & 0xffff) * (256 - fy) + (rows >> 16) * fy
    }

    /// A painted wall: stains, posters, and rotated rectangles and triangles from 3 cm to half a metre (at 3 mm a texel).
    pub(super) fn painted(size: usize, seed: u64) -> Result<Self, Error> {
        let mut rng = Rng::new(seed);
        let mut image = fractal(size, &mut rng, 26.0, 0.62);
        let scale = size as f64 / 2048.0;
        for (count, low, high) in [(90, 60.0, 180.0), (700, 16.0, 60.0), (2600, 5.0, 18.0)] {
            for _ in 0..count {
                let corners = if rng.uniform() < 0.7 { 4 } else { 3 };
                polygon(&mut image, size, &mut rng, corners, (low * scale, high * scale));
            }
        }
        speckle(&mut image, &mut rng, 5.0);
        Self::new(size, &quantised(&image))
    }

    /// Masonry: courses of stones of different brightness with dark joints, and stains.
    pub(super) fn masonry(size: usize, seed: u64) -> Result<Self, Error> {
        let mut rng = Rng::new(seed);
        let mut image = fractal(size, &mut rng, 22.0, 0.7);
        let rows = 24;
        let mut stones = Vec::with_capacity(rows);
        for _ in 0..rows {
            // Joints at uneven distances; the first repeats a period later.
            let mut joints = vec![rng.below(size / 16)];
            while let Some(&last) = joints.last() {
                let next = last + size / 32 + rng.below(size / 12);
                if next + size / 32 > size + joints[0] {
                    break;
                }
                joints.push(next);
            }
            let tints: Vec<f32> = joints.iter().map(|_| rng.between(-50.0, 50.0) as f32).collect();
            stones.push((joints, tints));
        }
        let joint = (size / 340).max(1);
        for y in 0..size {
            let row = y * rows / size;
            let in_joint = (y * rows) % size < joint * rows;
            let (joints, tints) = &stones[row];
            for x in 0..size {
                let wrapped = if x < joints[0] { x + size } else { x };
                let stone = joints.partition_point(|&j| j <= wrapped) - 1;
                let value = &mut image[y * size + x];
                if in_joint || wrapped - joints[stone] < joint {
                    *value = *value * 0.4 + 10.0;
                } else {
                    *value += tints[stone];
                }
            }
        }
        for _ in 0..900 {
            let scale = size as f64 / 2048.0;
            polygon(&mut image, size, &mut rng, 3, (4.0 * scale, 14.0 * scale));
        }
        speckle(&mut image, &mut rng, 6.0);
        Self::new(size, &quantised(&image))
    }

    /// A bare wall: one grey with stains of about one grey level, nothing to hold on to.
    pub(super) fn blank(size: usize, seed: u64) -> Result<Self, Error> {
        let mut rng = Rng::new(seed);
        Self::new(size, &quantised(&fractal(size, &mut rng, 1.0, 0.3)))
    }

    /// A chequerboard of `fields` by `fields` fields, an even number, dark 40 and light 200.
    pub fn chequered(size: usize, fields: usize) -> Result<Self, Error> {
        if fields < 2 || fields % 2 == 1 || !size.is_multiple_of(fields) {
            return Err(invalid("fields", fields as f64, "must be even and divide the size"));
        }
        let width = size / fields;
        let grey = |i: usize| if (i % size / width + i / size / width).is_multiple_of(2) { 40 } else { 200 };
        Self::new(size, &(0..size * size).map(grey).collect::<Vec<u8>>())
    }
}

fn halved(image: &[f32], side: usize) -> Vec<f32> {
    let half = side / 2;
    let mut out = Vec::with_capacity(half * half);
    for y in 0..half {
        let (top, bottom) = (&image[2 * y * side..], &image[(2 * y + 1) * side..]);
        out.extend((0..half).map(|x| 0.25 * (top[2 * x] + top[2 * x + 1] + bottom[2 * x] + bottom[2 * x + 1])));
    }
    out
}

fn quantised(image: &[f32]) -> Vec<u8> {
    image.iter().map(|v| v.round().clamp(0.0, 255.0) as u8).collect()
}

/// Periodic noise of all scales around mid grey: each octave doubles the resolution and has `gain` times the amplitude.
fn fractal(size: usize, rng: &mut Rng, amplitude: f32, gain: f32) -> Vec<f32> {
    let mut side = 4_usize.min(size);
    let mut amplitude = amplitude;
    let mut image: Vec<f32> = vec![125.0; side * side];
    loop {
        for value in &mut image {
            *value += amplitude * (2.0 * rng.uniform() as f32 - 1.0);
        }
        if side == size {
            return image;
        }
        image = doubled(&image, side);
        side *= 2;
        amplitude *= gain;
    }
}

/// Bilinear enlargement with wrap-around.
fn doubled(image: &[f32], side: usize) -> Vec<f32> {
    let mask = side - 1;
    let mut out = Vec::with_capacity(4 * side * side);
    for y in 0..2 * side {
        // Centres of the fine texels lie a quarter off those of the coarse.
        let (near, far) = (y / 2, (y / 2).wrapping_add(y % 2 * 2).wrapping_sub(1) & mask);
        for x in 0..2 * side {
            let (left, right) = (x / 2, (x / 2).wrapping_add(x % 2 * 2).wrapping_sub(1) & mask);
            let row = |r: usize| 0.75 * image[r * side + left] + 0.25 * image[r * side + right];
            out.push(0.75 * row(near) + 0.25 * row(far));
        }
    }
    out
}

fn speckle(image: &mut [f32], rng: &mut Rng, amplitude: f32) {
    for value in image {
        *value += amplitude * (2.0 * rng.uniform() as f32 - 1.0);
    }
}

/// Fills a regular or stretched polygon at a random place, angle and grey. `radius` is the range of its radius in texels.
fn polygon(image: &mut [f32], size: usize, rng: &mut Rng, corners: usize, radius: (f64, f64)) {
    let (cx, cy) = (rng.between(0.0, size as f64), rng.between(0.0, size as f64));
    let radius = rng.between(radius.0, radius.1).max(1.0);
    let (stretch, angle) = (rng.between(0.35, 1.0), rng.between(0.0, std::f64::consts::TAU));
    let grey = rng.between(15.0, 240.0) as f32;
    let (sine, cosine) = angle.sin_cos();
    // Inside a regular polygon: the projection on every edge normal is below the inradius.
    let inradius = (std::f64::consts::PI / corners as f64).cos();
    let normals: Vec<(f64, f64)> =
        (0..corners).map(|k| (std::f64::consts::TAU * k as f64 / corners as f64).sin_cos()).collect();
    let reach = radius.ceil() as i64;
    for dy in -reach..=reach {
        for dx in -reach..=reach {
            let (x, y) = (dx as f64 / radius, dy as f64 / radius);
            let (a, b) = (cosine * x + sine * y, (cosine * y - sine * x) / stretch);
            if normals.iter().all(|(s, c)| a * c + b * s <= inradius) {
                let wrap = |c: f64, d: i64| (c as i64 + d).rem_euclid(size as i64) as usize;
                let value = &mut image[wrap(cy, dy) * size + wrap(cx, dx)];
                // A little of what is below shows through, so that no area is flat.
                *value = 0.8 * grey + 0.2 * *value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masonry_has_dark_joints_between_its_courses() {
        // 24 courses of 21 or 22 rows, the first row of each a joint of two fifths of the brightness.
        let (size, courses) = (512, 24);
        let texture = Texture::masonry(size, 4).expect("a texture");
        let row = |y: usize| {
            let values = (0..size as u32).map(|x| texture.sample(texture.levels[0], x << 8, (y as u32) << 8));
            values.map(|value| f64::from(value) / 65536.0).sum::<f64>() / size as f64
        };
        let (mut below, mut beside) = (0, 0.0);
        for course in 0..courses {
            let joint = (course * size).div_ceil(courses);
            let stones = (joint + 4..joint + 18).map(row).sum::<f64>() / 14.0;
            below += usize::from(row(joint) < stones - 20.0);
            beside += stones / courses as f64;
        }
        // What is drawn over the wall may hide a joint.
        assert!(below >= 22 && beside > 70.0, "{below} dark joints; stones of {beside}");
    }
}
