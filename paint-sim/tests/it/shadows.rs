//! Rays that share their search against one search for each.

use nalgebra::{Point3, UnitVector3, Vector3};
use paint_sim::render::{Coat, Lamp, Lights, Shading};
use paint_sim::surface::Hit;
use paint_sim::{Camera, Film, Shot, SprayModel, Surface, Texel, TriangleSurface, render};

/// Asks for every ray alone: what the trait does where nobody overrides it.
struct OneByOne<'a>(&'a TriangleSurface);

impl Surface for OneByOne<'_> {
    fn cast(&self, origin: &Point3<f64>, direction: &Vector3<f64>, max: f64) -> Option<Hit> {
        self.0.cast(origin, direction, max)
    }

    fn occluded(&self, origin: &Point3<f64>, direction: &Vector3<f64>, max: f64) -> bool {
        self.0.occluded(origin, direction, max)
    }

    fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
        self.0.distance(point, max)
    }
}

struct Random(u64);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn vector(&mut self, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.between(-size, size))
    }
}

/// An uneven wall around z = 0 over a square of 40 cm, its vertices `step` apart, and `boards` triangles of any size before, in and behind it;
/// texels on the wall, one on each of its triangles. All of it `away` from the world's origin.
fn scene(random: &mut Random, step: f64, boards: usize, away: &Vector3<f64>) -> (TriangleSurface, Vec<Texel>) {
    let count = (0.4 / step) as u32;
    let at = |i: u32| f64::from(i) * step - 0.2;
    let (tilt, height) = (random.vector(0.3), random.between(0.0, 0.03));
    let mut positions = Vec::new();
    for (i, j) in (0..=count).flat_map(|i| (0..=count).map(move |j| (i, j))) {
        let (x, y) = (at(i), at(j));
        let z =
            tilt.x * x + tilt.y * y + height * (40.0 * x).sin() * (31.0 * y).cos() + random.between(-0.1, 0.1) * step;
        positions.push(Vector3::new(x, y, z));
    }
    let mut faces = Vec::new();
    for (i, j) in (0..count).flat_map(|i| (0..count).map(move |j| (i, j))) {
        let corner = |i: u32, j: u32| i * (count + 1) + j;
        faces.extend([
            [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1)],
            [corner(i, j), corner(i + 1, j + 1), corner(i, j + 1)],
        ]);
    }
    let wall = faces.len();
    for _ in 0..boards {
        let size = 10_f64.powf(random.between(-3.0, 0.5));
        let middle = Vector3::new(random.between(-0.2, 0.2), random.between(-0.2, 0.2), random.between(-0.05, 0.2));
        faces.push([0, 1, 2].map(|k| positions.len() as u32 + k));
        positions.extend([0, 1, 2].map(|_| middle + random.vector(size)));
    }
    let positions: Vec<[f32; 3]> = positions.iter().map(|p| (p + away).map(|v| v as f32).into()).collect();
    let texel = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|v| Vector3::from(positions[v as usize].map(f64::from)));
        let normal = (b - a).cross(&(c - a));
        Texel {
            point: ((a + b + c) / 3.0).into(),
            normal: UnitVector3::new_normalize(normal),
            area: 0.5 * normal.norm(),
        }
    };
    let texels = faces[..wall].iter().map(texel).collect();
    (TriangleSurface::new(&positions, &faces).unwrap(), texels)
}

fn nozzle(random: &mut Random, away: &Vector3<f64>) -> (Point3<f64>, UnitVector3<f64>) {
    let origin = Vector3::new(random.between(-0.15, 0.15), random.between(-0.15, 0.15), random.between(0.02, 0.3));
    let axis = random.vector(0.5) - Vector3::z();
    ((origin + away).into(), UnitVector3::new_normalize(axis))
}

const PLACES: [[f64; 3]; 3] = [[0.0; 3], [3.0, -5.0, 2.0], [4000.0, -2000.0, 90.0]];

#[test]
fn shadows_are_those_of_each_ray_alone() {
    let mut random = Random(3);
    let (mut dark, mut all) = (0, 0);
    for k in 0..180 {
        let away = Vector3::from(PLACES[k % 3]);
        let step = [0.02, 0.01, 0.1][k / 3 % 3];
        let (surface, texels) = scene(&mut random, step, [0, 3, 40, 400][k % 4], &away);
        for shot in 0..8 {
            let (mut origin, axis) = nozzle(&mut random, &away);
            if shot == 0 {
                // The plane of a triangle passes through the nozzle, or nearly.
                let texel = &texels[k * 31 % texels.len()];
                let along = texel.normal.cross(&axis).normalize();
                origin = texel.point + along * 0.15;
            }
            let from = surface.distance(&origin, 1.0) * (1.0 - 1e-9);
            let rays: Vec<(Vector3<f64>, f64)> = texels
                .iter()
                .map(|texel| texel.point - origin)
                .filter(|ray| ray.dot(&axis) > 0.5 * ray.norm())
                .map(|ray| (ray.normalize(), ray.norm() - from - 1e-3))
                .collect();
            let alone = OneByOne(&surface).occluded_beam(&origin, from, &rays);
            dark += alone.iter().filter(|&&dark| dark).count();
            all += rays.len();
            assert_eq!(surface.occluded_beam(&origin, from, &rays), alone, "scene {k}, shot {shot}");
        }
    }
    assert!(dark > all / 20 && dark < all / 2, "{dark} of {all}");
}

#[test]
fn no_femtolitre_depends_on_how_shadows_are_sought() {
    let mut random = Random(4);
    let mut lost = 0;
    for k in 0..36 {
        let away = Vector3::from(PLACES[k % 3]);
        let (surface, texels) = scene(&mut random, [0.02, 0.01][k / 3 % 2], [0, 3, 40][k % 3], &away);
        let shots: Vec<Shot> = (0..12)
            .map(|_| {
                let (origin, axis) = nozzle(&mut random, &away);
                Shot { origin, axis, volume: random.between(0.0, 1e-9) }
            })
            .collect();
        let round = SprayModel { sigma: random.between(0.05, 0.4), ..SprayModel::default() };
        let spray = if k % 2 == 0 { round } else { SprayModel { aspect: 2.0, yaw: 0.1, ..round } };
        let mut expected = Film::new(texels).unwrap();
        let balance = expected.deposit(&shots, &spray, &OneByOne(&surface), 1, &mut |_, _| ()).unwrap();
        lost += balance.overspray;
        for threads in [1, 3] {
            let mut film = expected.layer();
            film.deposit(&shots, &spray, &surface, threads, &mut |_, _| ()).unwrap();
            assert_eq!(film.volumes(), expected.volumes(), "scene {k}, {threads} threads");
        }
    }
    assert!(lost > 0);
}

#[test]
fn sun_shadows_are_those_of_each_ray_alone() {
    let mut random = Random(6);
    let (mut dark, mut all) = (0, 0);
    for k in 0..180 {
        let away = Vector3::from(PLACES[k % 3]);
        let step = [0.02, 0.01, 0.1][k / 3 % 3];
        let (surface, texels) = scene(&mut random, step, [0, 3, 40, 400][k % 4], &away);
        for patch in 0..8 {
            let towards = match patch {
                // In the plane of a triangle, where only rounding decides.
                0 => texels[k * 31 % texels.len()].normal.cross(&random.vector(1.0)).normalize(),
                _ => (random.vector(0.7) + Vector3::z()).normalize(),
            };
            let (first, lift) =
                (random.between(0.0, 0.9) * texels.len() as f64, 10_f64.powf(random.between(-7.0, -2.0)));
            let points: Vec<Point3<f64>> = texels[first as usize..]
                .iter()
                .step_by([1, 3][patch % 2])
                .take([5, 64, 400][patch % 3])
                .map(|texel| texel.point + texel.normal.into_inner() * lift)
                .collect();
            let max = [1e4, 0.1][patch % 2];
            let alone = OneByOne(&surface).occluded_parallel(&points, &towards, max);
            dark += alone.iter().filter(|&&dark| dark).count();
            all += points.len();
            assert_eq!(surface.occluded_parallel(&points, &towards, max), alone, "scene {k}, patch {patch}");
        }
    }
    assert!(dark > all / 20 && dark < all / 2, "{dark} of {all}");
}

#[test]
fn pictures_are_those_of_each_ray_alone() {
    let mut random = Random(7);
    let (mut seen, mut all) = (0, 0);
    for k in 0..48 {
        let away = Vector3::from(PLACES[k % 2]);
        let (surface, _) = scene(&mut random, [0.02, 0.004][k / 2 % 2], [0, 3, 40, 400][k % 4], &away);
        let eye = random.vector(0.3) + Vector3::z() * random.between(0.05, 1.0);
        let target = random.vector(0.1);
        let size = [(40, 30), (67, 35)][k % 2];
        let angle = random.between(0.02, 1.8);
        let camera = Camera::looking_at(&(eye + away).into(), &(target + away).into(), &Vector3::y(), angle, size);
        let lamp = Lamp { position: (random.vector(0.3) + Vector3::z() + away).into(), light: [0.3, 0.2, 0.1] };
        let lights = Lights {
            towards_sun: UnitVector3::new_normalize(random.vector(0.8) + Vector3::z()),
            lamps: if k % 3 == 0 { vec![lamp] } else { Vec::new() },
            ..Lights::default()
        };
        let coat = (k % 5 == 0).then(|| Coat::new(0.3).unwrap());
        let shade = |hit: &Hit| Shading { coat, ..Shading::matt([0.2, 0.5, hit.barycentric[0] as f32], hit.normal) };
        let (camera, supersampling) = (camera.unwrap(), 1 + k as u32 % 3);
        let expected = render(&OneByOne(&surface), &camera, &shade, &lights, supersampling, 1).unwrap();
        seen += expected.faces.iter().filter(|face| **face != u32::MAX).count();
        all += expected.faces.len();
        for threads in [1, 3] {
            let picture = render(&surface, &camera, &shade, &lights, supersampling, threads).unwrap();
            assert!(picture == expected, "scene {k}, {threads} threads");
        }
    }
    assert!(seen > all / 4 && seen < all, "{seen} of {all}");
}

/// A board beside the nozzle that reaches far behind it: in the plane x = 0.1, wider than all rays up to a depth of one metre.
#[test]
fn a_board_that_begins_behind_the_nozzle_casts_its_shadow() {
    let positions = [[0.1, -30.0, -3.0], [0.1, 30.0, -3.0], [0.1, 0.0, 3.0]];
    let surface = TriangleSurface::new(&positions, &[[0, 1, 2]]).unwrap();
    let slope = |k: u32| 0.8 * (f64::from(k) / 9.5 - 1.0);
    let towards = |k: u32| (Vector3::new(slope(k % 20), slope(k / 20), 1.0).normalize(), 0.95);
    let rays: Vec<(Vector3<f64>, f64)> = (0..400).map(towards).collect();
    let expected: Vec<bool> = rays.iter().map(|(direction, _)| direction.x > 0.1).collect();
    assert_eq!(surface.occluded_beam(&Point3::origin(), 0.05, &rays), expected);
}

/// Empty, too short and not finite rays.
#[test]
fn rays_without_a_length_hit_nothing() {
    let mut random = Random(5);
    let (surface, _) = scene(&mut random, 0.02, 0, &Vector3::zeros());
    let origin = Point3::new(0.0, 0.0, 0.2);
    assert!(surface.occluded_beam(&origin, 0.1, &[]).is_empty());
    let mut rays = vec![(-Vector3::z(), 0.3); 20];
    rays[3].1 = 0.0;
    rays[4].1 = -0.3;
    rays[5].1 = f64::NAN;
    rays[6].0 = Vector3::repeat(f64::NAN);
    let expected: Vec<bool> = (0..20).map(|k| !(3..=6).contains(&k)).collect();
    assert_eq!(surface.occluded_beam(&origin, 0.1, &rays), expected);
    assert_eq!(OneByOne(&surface).occluded_beam(&origin, 0.1, &rays), expected);
    // Side by side: in one place, and among them one that is nowhere.
    let mut starts = vec![origin; 20];
    assert_eq!(surface.occluded_parallel(&starts, &-Vector3::z(), 1.0), [true; 20]);
    starts[7].x = f64::NAN;
    let expected: Vec<bool> = (0..20).map(|k| k != 7).collect();
    assert_eq!(surface.occluded_parallel(&starts, &-Vector3::z(), 1.0), expected);
    for nowhere in [Vector3::zeros(), Vector3::repeat(f64::NAN)] {
        assert_eq!(surface.occluded_parallel(&starts, &nowhere, 1.0), [false; 20]);
    }
    assert!(surface.occluded_parallel(&[], &Vector3::z(), 1.0).is_empty());
}
