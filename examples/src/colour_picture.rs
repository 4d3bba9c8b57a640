//! A picture in colour, in linear light, sampled without aliasing.

use image::DynamicImage;
use paint_sim::colour::decode_srgb;

use crate::design::DesignError;
use crate::mesh_io::MeshMaterials;

/// Red, green, blue and opacity, linear sRGB, the colours multiplied by the opacity.
pub(crate) type Rgba = [f32; 4];

/// A picture and its halves, quarters and so on, down to one pixel across.
#[derive(Debug, Clone)]
pub struct ColourPicture {
    levels: Vec<Level>,
}

#[derive(Debug, Clone)]
struct Level {
    width: usize,
    height: usize,
    pixels: Vec<Rgba>,
}

impl ColourPicture {
    /// From a picture in sRGB.
    pub fn new(picture: &DynamicImage) -> Result<Self, DesignError> {
        if picture.width() < 2 || picture.height() < 2 {
            let why = format!("is only {} x {} pixels", picture.width(), picture.height());
            return Err(DesignError::Unusable { name: "picture".into(), why });
        }
        let stored = picture.to_rgba32f();
        let linear = |[r, g, b, a]: [f32; 4]| {
            let [r, g, b] = [r, g, b].map(|c| a * decode_srgb(f64::from(c)) as f32);
            [r, g, b, a]
        };
        let (width, height) = (stored.width() as usize, stored.height() as usize);
        let mut levels = vec![Level { width, height, pixels: stored.pixels().map(|p| linear(p.0)).collect() }];
        while let Some(half) = levels.last().and_then(Level::half) {
            levels.push(half);
        }
        Ok(Self { levels })
    }

    /// One for every material of a mesh.
    pub fn of_materials(materials: &MeshMaterials) -> Result<Vec<Self>, DesignError> {
        materials.materials.iter().map(|material| Self::new(&material.picture()?.into())).collect()
    }

    /// Width over height.
    pub fn aspect(&self) -> f64 {
        self.levels[0].width as f64 / self.levels[0].height as f64
    }

    /// Pixels across.
    pub fn width(&self) -> usize {
        self.levels[0].width
    }

    /// The colour at `(u, v)` in `[0, 1]`, v down, of about as many `pixels` across; clamped to the border.
    pub fn sample(&self, [u, v]: [f64; 2], pixels: f64) -> Rgba {
        let level = pixels.max(1.0).log2().round() as usize;
        self.levels[level.min(self.levels.len() - 1)].bilinear(u, v)
    }

    /// The same in full resolution where the picture repeats and v runs up: its top row is v = 1.
    pub(crate) fn repeated(&self, [u, v]: [f64; 2]) -> Rgba {
        self.levels[0].bilinear(u.rem_euclid(1.0), 1.0 - v.rem_euclid(1.0))
    }
}

impl Level {
    /// Half as wide and high, each pixel the mean of those that it stands for; `None` of one that is two pixels across already.
    fn half(&self) -> Option<Self> {
        if self.width < 4 || self.height < 4 {
            return None;
        }
        let (width, height) = (self.width / 2, self.height / 2);
        let span = |k: usize, parts: usize, all: usize| k * all / parts..(k + 1) * all / parts;
        let mean = |x: usize, y: usize| {
            let (mut sum, mut count) = ([0.0; 4], 0.0);
            for row in span(y, height, self.height) {
                for column in span(x, width, self.width) {
                    let pixel = self.pixels[row * self.width + column];
                    sum.iter_mut().zip(pixel).for_each(|(sum, c)| *sum += c);
                    count += 1.0;
                }
            }
            sum.map(|c| c / count)
        };
        let pixels = (0..width * height).map(|k| mean(k % width, k / width)).collect();
        Some(Self { width, height, pixels })
    }

    fn bilinear(&self, u: f64, v: f64) -> Rgba {
        let x = (u * self.width as f64 - 0.5).clamp(0.0, (self.width - 1) as f64);
        let y = (v * self.height as f64 - 0.5).clamp(0.0, (self.height - 1) as f64);
        let (x0, y0) = ((x as usize).min(self.width - 2), (y as usize).min(self.height - 2));
        let (fx, fy) = ((x - x0 as f64) as f32, (y - y0 as f64) as f32);
        let at = |dx: usize, dy: usize| self.pixels[(y0 + dy) * self.width + x0 + dx];
        let blend = |a: Rgba, b: Rgba, t: f32| -> Rgba { std::array::from_fn(|c| a[c] + t * (b[c] - a[c])) };
        blend(blend(at(0, 0), at(1, 0), fx), blend(at(0, 1), at(1, 1), fx), fy)
    }
}
