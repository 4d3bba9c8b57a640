//! Rays on a GPU: what each hits is what the processor says, also where single precision could not know it.

use nalgebra::{Point3, Rotation3, Vector3};
use paint_sim::surface::GpuOptions;
use paint_sim::surface::{GpuSurface, ShadowRay, Surface};
use paint_sim::{Error, TriangleSurface};

use super::{available, options, random};

/// A triangle by its corners.
type Corners = [[f32; 3]; 3];

/// Triangles that single precision has trouble with: small ones in a field, slivers, one twice, one that cuts others, and a wall of two.
fn corners(away: [f32; 3]) -> Vec<Corners> {
    let mut all: Vec<Corners> = Vec::new();
    for k in 0..900_u64 {
        let part = |place: u64| random(20 * k + place) as f32 - 0.5;
        let middle = [part(0), part(1), 0.2 * part(2)];
        let size = [0.1, 0.02, 0.002][k as usize % 3];
        let sliver = if k % 7 == 0 { 1e-4 } else { 1.0 };
        let corner = |c: u64| {
            [0, 1, 2].map(|i| middle[i as usize] + size * part(3 + 3 * c + i) * if i == 0 { sliver } else { 1.0 })
        };
        all.push([0, 1, 2].map(corner));
        if k % 50 == 0 {
            all.push(all[all.len() - 1]);
        }
    }
    let (a, b, c, d) = ([-60.0, -60.0, -0.3], [70.0, -60.0, -0.31], [70.0, 60.0, -0.32], [-60.0, 60.0, -0.3]);
    all.extend([[a, b, c], [a, c, d]]);
    all.into_iter().map(|corners| corners.map(|p| [0, 1, 2].map(|k| p[k] + away[k]))).collect()
}

fn surface(corners: &[Corners]) -> TriangleSurface {
    let faces: Vec<[u32; 3]> = (0..corners.len() as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    TriangleSurface::new(corners.as_flattened(), &faces).unwrap()
}

/// A place on a triangle: on a corner, on an edge or hardly beside it, or anywhere.
fn place(triangle: &Corners, k: u64) -> Point3<f64> {
    let [a, b, c] = triangle.map(|p| Point3::from(p.map(f64::from)));
    let part = |place: u64| random(20 * k + place + 1_000_000_000);
    let hardly = (part(0) - 0.5) * 10.0_f64.powi(-(3 + (k % 12) as i32));
    match k / 12 % 4 {
        0 => a,
        1 => a + (b - a) * part(1) + (c - a) * hardly,
        2 => a + (b - a) * part(1) + (c - b) * (1.0 - part(1)) * part(2),
        _ => b + (c - b) * part(1),
    }
}

/// Rays to places of triangles: most from one eye, the others from places of their own.
fn rays(corners: &[Corners], eye: &Point3<f64>, count: u64) -> Vec<(Point3<f64>, Vector3<f64>, f64)> {
    let ray = |k: u64| {
        let target = place(&corners[(random(k + 77) * corners.len() as f64) as usize], k);
        let way = target - eye;
        (target, way.normalize(), way.norm())
    };
    (0..count).map(ray).collect()
}

#[test]
fn rays_hit_what_they_hit_on_the_processor() {
    for away in [[0.0; 3], [5000.0, 0.0, -700.0]] {
        let corners = corners(away);
        let surface = surface(&corners);
        let Some(gpu) = available(GpuSurface::new(&surface, &options())) else { return };
        let offset = Vector3::from(away.map(f64::from));
        let mut hits = 0;
        for eye in [Point3::new(0.1, -0.2, 0.9), Point3::new(2.0, 3.0, 20.0)] {
            let eye = eye + offset;
            let directions: Vec<_> = rays(&corners, &eye, 20_000).into_iter().map(|ray| ray.1).collect();
            let found = gpu.cast_beam(&eye, &directions, 1e4);
            for (k, (direction, found)) in directions.iter().zip(&found).enumerate() {
                let expected = surface.cast(&eye, direction, 1e4);
                assert_eq!(*found, expected, "{away:?} ray {k}");
                hits += usize::from(expected.is_some());
            }
            // Along the axes, and where nothing is.
            let axes = [
                Vector3::x(),
                -Vector3::z(),
                Vector3::z(),
                Vector3::zeros(),
                Vector3::new(f64::NAN, 0.0, 1.0),
                -2.0 * Vector3::z(),
            ];
            let expected: Vec<_> = axes.iter().map(|axis| surface.cast(&eye, axis, 30.0)).collect();
            assert_eq!(gpu.cast_beam(&eye, &axes, 30.0), expected);
        }
        assert!(hits > 20_000, "{hits}");
        let rays = gpu.rays();
        println!("{away:?}: {rays:?} of rays most of which aim at edges");
        assert!(gpu.fault().is_none() && rays.left < rays.asked);
    }
}

#[test]
fn shadows_are_those_of_the_processor() {
    for away in [[0.0; 3], [5000.0, 0.0, -700.0]] {
        let corners = corners(away);
        let surface = surface(&corners);
        let Some(gpu) = available(GpuSurface::new(&surface, &options())) else { return };
        let eye = Point3::new(0.3, 0.1, 0.7) + Vector3::from(away.map(f64::from));
        let sun = Vector3::new(0.3, -0.4, 0.87).normalize();
        let shadow = |(k, (target, direction, length)): (usize, &(Point3<f64>, Vector3<f64>, f64))| {
            // Up to the place, hardly further, or hardly less far; and from hardly off it to the sun.
            let off = (random(k as u64 + 9000) - 0.5) * 10.0_f64.powi(-(4 + (k % 9) as i32));
            match k % 4 {
                0 => ShadowRay { origin: eye, direction: *direction, from: 0.0, length: *length + off },
                1 => ShadowRay { origin: eye, direction: *direction, from: 0.2, length: *length - 0.2 + off },
                2 => ShadowRay { origin: target + Vector3::z() * off, direction: sun, from: 0.0, length: 1e4 },
                _ => ShadowRay {
                    origin: target + sun * off,
                    direction: Rotation3::from_scaled_axis(sun * 0.1) * sun,
                    from: 0.0,
                    length: off * 1e3,
                },
            }
        };
        let shadows: Vec<_> = rays(&corners, &eye, 40_000).iter().enumerate().map(shadow).collect();
        let found = gpu.occluded_each(&shadows);
        let mut dark = 0;
        for (k, (ray, found)) in shadows.iter().zip(&found).enumerate() {
            let expected = ray.length > 0.0 && surface.occluded(&ray.start(), &ray.direction, ray.length);
            assert_eq!(*found, expected, "{away:?} ray {k} {ray:?}");
            dark += usize::from(expected);
        }
        assert!(dark > 5000 && dark < 38_000, "{dark}");
        println!("{away:?}: {:?}, {dark} dark", gpu.rays());
        let origins: Vec<_> = shadows.iter().map(ShadowRay::start).collect();
        assert_eq!(gpu.occluded_parallel(&origins, &sun, 9.0), surface.occluded_parallel(&origins, &sun, 9.0));
        let beam: Vec<_> = shadows.iter().map(|ray| (ray.direction, ray.length)).collect();
        assert_eq!(gpu.occluded_beam(&eye, 0.1, &beam), surface.occluded_beam(&eye, 0.1, &beam));
    }
}

#[test]
fn what_has_no_place_in_single_precision_is_refused_or_left_to_the_processor() {
    let Some(gpu_options) = available(GpuSurface::new(&surface(&corners([0.0; 3])), &options())).map(|_| options())
    else {
        return;
    };
    let scaled = |by: f32| surface(&[[[by, 0.0, 0.0], [0.0, by, 0.0], [0.0, 0.0, by]]]);
    for by in [1e-9, 1e20] {
        assert!(matches!(GpuSurface::new(&scaled(by), &gpu_options).err(), Some(Error::OutOfRange { .. })), "{by}");
    }
    let nowhere = GpuOptions { adapter: "no such adapter".into(), ..options() };
    assert!(matches!(GpuSurface::new(&scaled(1.0), &nowhere).err(), Some(Error::Gpu { .. })));
    let one = scaled(1.0);
    let gpu = GpuSurface::new(&one, &gpu_options).unwrap();
    let far = Point3::new(1e15, 1e15, 1e15);
    let towards = [(Point3::origin() - far).normalize()];
    assert_eq!(gpu.cast_beam(&far, &towards, 1e16), vec![one.cast(&far, &towards[0], 1e16)]);
    assert_eq!(gpu.cast_beam(&far, &[], 1.0), vec![]);
    assert_eq!(gpu.rays().left, 1);
    assert_eq!(gpu.distance(&Point3::origin(), 9.0), one.distance(&Point3::origin(), 9.0));
    assert!(gpu.occluded(&Point3::origin(), &Vector3::x(), 2.0) && !gpu.name().is_empty());
}
