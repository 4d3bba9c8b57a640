//! The light that the texels of a surface send out, from pictures that a camera takes on its way.

use nalgebra::{Matrix3, Point3, SVD, Vector3};

use crate::error::{Error, check_range};
use crate::film::Texel;
use crate::render::Camera;
use crate::surface::Surface;

/// A texel that is seen at a flatter angle than this cosine is left out.
const FLATTEST: f64 = 0.35;
/// Light between these is neither black nor clipped.
const EXPOSED: std::ops::RangeInclusive<f64> = 2e-3..=0.98;
/// The eye has to be free from this far off the surface, m.
const OFF_SURFACE: f64 = 2e-3;
/// Singular values below this share of the largest are none: the pictures do not tell these terms of the fall-off apart.
const LEAST_SINGULAR_VALUE: f64 = 1e-9;

/// A picture of one channel.
#[derive(Debug, Clone, Copy)]
pub struct Picture<'a> {
    /// Camera and pose.
    pub camera: Camera,
    /// Linear light, 0 to 1, row by row from the top left.
    pub light: &'a [f32],
}

/// What a texel sends out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TexelLight {
    /// Natural logarithm of the linear light as the middle of the picture would show it.
    pub log: f64,
    /// Its standard deviation by the noise of the pictures; 0 where no texel of the mosaic was seen more than a few times.
    pub sigma: f64,
}

/// Pictures of the same surface in the same light. Each is used when it comes and not kept.
#[derive(Debug, Clone)]
pub struct Mosaic {
    texels: Vec<Texel>,
    sums: Vec<Sums>,
}

/// Sums over what was seen of a texel: `x` are the terms of the fall-off at the place in the picture, `y` is the logarithm of the light.
#[derive(Debug, Clone, Default)]
struct Sums {
    count: f64,
    x: Vector3<f64>,
    y: f64,
    xx: Matrix3<f64>,
    xy: Vector3<f64>,
    yy: f64,
}

impl Mosaic {
    /// Of texels that nothing has been seen of.
    pub fn new(texels: Vec<Texel>) -> Self {
        Self { sums: vec![Sums::default(); texels.len()], texels }
    }

    /// The texels.
    pub fn texels(&self) -> &[Texel] {
        &self.texels
    }

    /// Adds what a picture shows of the texels; `surface` is what may hide them. Returns how many it shows.
    ///
    /// # Errors
    /// A camera or light that is not finite, light of another size than the camera's, `threads` outside 1..=1024.
    pub fn add(&mut self, picture: &Picture, surface: &dyn Surface, threads: usize) -> Result<usize, Error> {
        let Picture { camera, light } = picture;
        camera.check()?;
        check_range("threads", threads as f64, 1.0, 1024.0, "between 1 and 1024")?;
        let pixels = camera.width as usize * camera.height as usize;
        if light.len() != pixels {
            return Err(Error::WrongLength { what: "pixels of a picture", expected: pixels, found: light.len() });
        }
        if let Some(index) = light.iter().position(|light| !light.is_finite()) {
            return Err(Error::NotFinite { what: "light of pixel", index });
        }
        let share = self.texels.len().div_ceil(threads).max(1);
        let chunks = self.texels.chunks(share).zip(self.sums.chunks_mut(share));
        let look = |texels: &[Texel], sums: &mut [Sums]| {
            let mut seen = 0;
            for (texel, sums) in texels.iter().zip(sums) {
                if let Some((x, light)) = picture.see(texel, surface) {
                    sums.add(x, light.ln());
                    seen += 1;
                }
            }
            seen
        };
        Ok(std::thread::scope(|scope| {
            let workers: Vec<_> = chunks.map(|(texels, sums)| scope.spawn(move || look(texels, sums))).collect();
            let join = |worker: std::thread::ScopedJoinHandle<'_, usize>| match worker.join() {
                Ok(seen) => seen,
                Err(panic) => std::panic::resume_unwind(panic),
            };
            workers.into_iter().map(join).sum()
        }))
    }

    /// The light of every texel; `None` of those that were not seen.
    ///
    /// A texel that is seen at several places of the picture tells of the lens: its logarithms differ by the fall-off alone. The fall-off,
    /// `b1 r² + b2 r⁴ + b3 r⁶` in the logarithm, is the regression within texels (fixed effects), so no texel has to be known.
    pub fn light(&self) -> Vec<Option<TexelLight>> {
        let (mut xx, mut xy, mut yy, mut freedom) = (Matrix3::zeros(), Vector3::zeros(), 0.0, -3.0);
        for sums in self.sums.iter().filter(|sums| sums.count >= 2.0) {
            xx += sums.xx - sums.x * sums.x.transpose() / sums.count;
            xy += sums.xy - sums.x * (sums.y / sums.count);
            yy += sums.yy - sums.y * sums.y / sums.count;
            freedom += sums.count - 1.0;
        }
        let svd = SVD::new(xx, true, true);
        let least = LEAST_SINGULAR_VALUE * svd.singular_values.max();
        let fall_off: Vector3<f64> = svd.solve(&xy, least).unwrap_or_default();
        let sigma = if freedom > 0.0 { ((yy - fall_off.dot(&xy)).max(0.0) / freedom).sqrt() } else { 0.0 };
        let light = |sums: &Sums| {
            let log = (sums.y - fall_off.dot(&sums.x)) / sums.count;
            (sums.count > 0.0).then(|| TexelLight { log, sigma: sigma / sums.count.sqrt() })
        };
        self.sums.iter().map(light).collect()
    }
}

impl Sums {
    fn add(&mut self, x: Vector3<f64>, y: f64) {
        self.count += 1.0;
        self.x += x;
        self.y += y;
        self.xx += x * x.transpose();
        self.xy += x * y;
        self.yy += y * y;
    }
}

impl Picture<'_> {
    /// The terms of the fall-off where a texel is seen, and its mean light; `None` where it is not seen, or not whole.
    fn see(&self, texel: &Texel, surface: &dyn Surface) -> Option<(Vector3<f64>, f64)> {
        let eye = Point3::from(self.camera.world_from_camera.translation.vector);
        let (way, normal) = (eye - texel.point, texel.normal.as_ref());
        let distance = way.norm();
        if distance.is_nan() || way.dot(normal) < FLATTEST * distance {
            return None;
        }
        let middle = self.project(&texel.point)?;
        // A grid of nine inside the square of the texel's area: the mean is what it sends out, not its middle.
        let third = texel.area.sqrt() / 3.0;
        let aside = normal.cross(&if normal.z.abs() < 0.9 { Vector3::z() } else { Vector3::x() }).normalize() * third;
        let along = normal.cross(&aside);
        let mut sum = 0.0;
        for (i, j) in (-1..=1).flat_map(|i| (-1..=1).map(move |j| (f64::from(i), f64::from(j)))) {
            let light = self.at(self.project(&(texel.point + aside * i + along * j))?)?;
            if !EXPOSED.contains(&light) {
                return None;
            }
            sum += light;
        }
        let start = texel.point + normal * OFF_SURFACE;
        let direction = (eye - start).normalize();
        if surface.occluded(&start, &direction, distance - 2.0 * OFF_SURFACE) {
            return None;
        }
        let Camera { cx, cy, width, height, .. } = self.camera;
        let [x, y] = [middle[0] - cx, middle[1] - cy];
        let r2 = 4.0 * (x * x + y * y) / (f64::from(width).powi(2) + f64::from(height).powi(2));
        Some((Vector3::new(r2, r2 * r2, r2 * r2 * r2), sum / 9.0))
    }

    fn project(&self, point: &Point3<f64>) -> Option<[f64; 2]> {
        let Camera { fx, fy, cx, cy, world_from_camera, .. } = &self.camera;
        let p = world_from_camera.inverse_transform_point(point);
        (p.z > 0.0).then(|| [fx * p.x / p.z + cx, fy * p.y / p.z + cy])
    }

    /// Bilinear; `None` outside.
    fn at(&self, [x, y]: [f64; 2]) -> Option<f64> {
        let (width, height) = (self.camera.width as usize, self.camera.height as usize);
        if !(x >= 0.0 && y >= 0.0) {
            return None;
        }
        let (left, top) = (x as usize, y as usize);
        if left + 1 >= width || top + 1 >= height {
            return None;
        }
        let (right, low) = (x - left as f64, y - top as f64);
        let row = |y: usize| {
            let [a, b] = [0, 1].map(|k| f64::from(self.light[y * width + left + k]));
            a * (1.0 - right) + b * right
        };
        Some(row(top) * (1.0 - low) + row(top + 1) * low)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::surface::Hit;

    /// No surface.
    struct Nothing;

    impl Surface for Nothing {
        fn cast(&self, _: &Point3<f64>, _: &Vector3<f64>, _: f64) -> Option<Hit> {
            None
        }

        fn distance(&self, _: &Point3<f64>, max: f64) -> f64 {
            max
        }
    }

    /// Radii count from the principal point, wherever it is, and reach 1 half a diagonal away.
    #[test]
    fn the_fall_off_is_that_of_the_radius_around_the_principal_point() {
        let (width, height) = (60, 80);
        let world_from_camera = Isometry3::identity();
        let camera = Camera { fx: 100.0, fy: 200.0, cx: 25.0, cy: 33.0, width, height, world_from_camera };
        let light = vec![0.5; 60 * 80];
        let picture = Picture { camera, light: &light };
        // 15 pixels to the right and 20 down: 25 of the 50 pixels of half a diagonal.
        let texel = Texel { point: Point3::new(0.3, 0.2, 2.0), normal: -Vector3::z_axis(), area: 1e-4 };
        let (terms, seen) = picture.see(&texel, &Nothing).unwrap();
        assert!((terms - Vector3::new(0.25, 0.0625, 0.015625)).norm() < 1e-12, "{terms}");
        assert!((seen - 0.5).abs() < 1e-7);
    }

    #[test]
    fn light_is_as_uncertain_as_the_pictures_disagree() {
        // Two texels in the middle of four pictures each. Of eight readings two means and three terms of the fall-off are taken off.
        let seen = |logs: [f64; 4]| Sums {
            count: 4.0,
            y: logs.iter().sum(),
            yy: logs.iter().map(|log| log * log).sum(),
            ..Sums::default()
        };
        let sums = vec![seen([-1.1, -0.9, -1.1, -0.9]), seen([-2.2, -1.8, -2.2, -1.8]), Sums::default()];
        let light = Mosaic { texels: Vec::new(), sums }.light();
        let expected = ((4.0 * 0.01 + 4.0 * 0.04) / (8.0 - 2.0 - 3.0_f64)).sqrt() / 2.0;
        for (light, log) in light.iter().zip([-1.0, -2.0]) {
            let light = light.expect("seen");
            assert!((light.log - log).abs() < 1e-12 && (light.sigma - expected).abs() < 1e-12, "{light:?}");
        }
        assert_eq!(light[2], None);
    }
}
