//! Pictures whose every pixel is known in closed form.

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};
use paint_sim::colour::encode_srgb8;
use paint_sim::render::{Lights, Shading};
use paint_sim::surface::Hit;
use paint_sim::{Camera, Error, TriangleSurface, render};

fn camera(width: u32, height: u32) -> Camera {
    let (cx, cy) = (0.5 * (f64::from(width) - 1.0), 0.5 * (f64::from(height) - 1.0));
    Camera { fx: 60.0, fy: 50.0, cx, cy, width, height, world_from_camera: Isometry3::identity() }
}

fn lights() -> Lights {
    Lights {
        towards_sun: UnitVector3::new_normalize(-Vector3::z()),
        sun: [0.5, 0.25, 0.125],
        ambient: [0.25; 3],
        background: [0.0, 0.0, 1.0],
        ..Lights::default()
    }
}

fn white(hit: &Hit) -> Shading {
    Shading::matt([1.0; 3], hit.normal)
}

/// Two triangles through z = 2 + slope x, far larger than the picture.
fn slanted(slope: f32) -> TriangleSurface {
    let z = |x: f32| 2.0 + slope * x;
    let corners = [[-4.0, -9.0, z(-4.0)], [4.0, -9.0, z(4.0)], [4.0, 9.0, z(4.0)], [-4.0, 9.0, z(-4.0)]];
    TriangleSurface::new(&corners, &[[0, 1, 2], [0, 2, 3]]).unwrap()
}

#[test]
fn depth_of_a_plane_is_z_and_not_the_length_of_the_ray() {
    let frame = render(&slanted(0.25), &camera(64, 48), &white, &lights(), 1, 1).unwrap();
    for v in 0..48_u32 {
        for u in 0..64_u32 {
            // z = 2 + z (u - cx)/fx / 4.
            let expected = 2.0 / (1.0 - 0.25 * (f64::from(u) - 31.5) / 60.0);
            let depth = f64::from(frame.depth[(v * 64 + u) as usize]);
            assert!((depth - expected).abs() < 3e-7 * expected, "{u} {v}: {depth} instead of {expected}");
        }
    }
    let normal = frame.normals[0];
    let expected = Vector3::new(0.25, 0.0, -1.0).normalize();
    assert!((0..3).all(|i| (f64::from(normal[i]) - expected[i]).abs() < 1e-6), "{normal:?}");
    // Matt shading: sun times the cosine to its direction, plus ambient.
    let cosine = -expected.z;
    let code = |sun: f64| encode_srgb8(sun * cosine + 0.25).0;
    assert!(frame.colour.iter().all(|c| *c == [code(0.5), code(0.25), code(0.125)]));
}

/// In the default lights, exposed by 1: `albedo * (0.7 cos + 0.3)`, and the background beside it.
#[test]
fn the_usual_lights_are_a_sun_and_even_light() {
    let lights = Lights::default();
    let corners = [[-0.5, -0.5, -2.0], [0.5, -0.5, -2.0], [0.5, 0.5, -2.0], [-0.5, 0.5, -2.0]];
    let wall = TriangleSurface::new(&corners, &[[0, 1, 2], [0, 2, 3]]).unwrap();
    let seen = |normal: Vector3<f64>| {
        let shade = |_: &Hit| Shading::matt([1.0, 0.5, 0.25], normal);
        let from_above = Isometry3::rotation(Vector3::x() * std::f64::consts::PI);
        let camera = Camera { world_from_camera: from_above, ..camera(65, 49) };
        render(&wall, &camera, &shade, &lights, 1, 1).unwrap()
    };
    // Towards the eye, to which the sun is near; and away from the sun.
    for normal in [Vector3::z(), Vector3::new(-0.8, 0.5, 0.3).normalize()] {
        let frame = seen(normal);
        let lit = 0.7 * normal.dot(&Vector3::new(0.3, -0.4, 0.87).normalize()).max(0.0) + 0.3;
        assert_eq!(frame.colour[24 * 65 + 32], [lit, 0.5 * lit, 0.25 * lit].map(|v| encode_srgb8(v).0));
        assert_eq!(frame.colour[0], [0.85, 0.9, 1.0].map(|v| encode_srgb8(v).0));
        assert_eq!(frame.clipped, 0);
    }
}

#[test]
fn depth_of_a_sphere() {
    // A sphere of radius 1 around (0, 0, 3), fine enough that its facets lie within 5e-5 of it.
    let (rings, sectors) = (200_u32, 400_u32);
    let mut positions = Vec::new();
    for ring in 0..=rings {
        let polar = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
        for sector in 0..sectors {
            let azimuth = std::f64::consts::TAU * f64::from(sector) / f64::from(sectors);
            let point = [polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), 3.0 + polar.cos()];
            positions.push(point.map(|v| v as f32));
        }
    }
    let mut faces = Vec::new();
    for ring in 0..rings {
        for sector in 0..sectors {
            let at = |r: u32, s: u32| r * sectors + s % sectors;
            faces.push([at(ring, sector), at(ring + 1, sector), at(ring + 1, sector + 1)]);
            faces.push([at(ring, sector), at(ring + 1, sector + 1), at(ring, sector + 1)]);
        }
    }
    let surface = TriangleSurface::new(&positions, &faces).unwrap();
    let frame = render(&surface, &camera(64, 48), &white, &lights(), 1, 2).unwrap();
    let (mut inside, mut outside) = (0, 0);
    for (i, &depth) in frame.depth.iter().enumerate() {
        let ray = Vector3::new(((i % 64) as f64 - 31.5) / 60.0, ((i / 64) as f64 - 23.5) / 50.0, 1.0);
        // |t ray - c|^2 = 1 with c = (0, 0, 3).
        let (a, b) = (ray.norm_squared(), 3.0);
        let discriminant = b * b - a * 8.0;
        if discriminant > 0.05 {
            let expected = (b - discriminant.sqrt()) / a;
            assert!((f64::from(depth) - expected).abs() < 6e-4, "{depth} instead of {expected}");
            assert_ne!(frame.faces[i], u32::MAX);
            inside += 1;
        } else if discriminant < -0.05 {
            assert_eq!((depth, frame.faces[i], frame.colour[i]), (0.0, u32::MAX, [0, 0, 255]));
            outside += 1;
        }
    }
    assert!(inside > 500 && outside > 500);
}

#[test]
fn what_stands_before_the_sun_throws_a_shadow() {
    // A small plate at z = 1 above x > 0.5 and a sun from behind the camera: its shadow lies right behind it.
    let positions = [
        [-9.0, -9.0, 2.0],
        [9.0, -9.0, 2.0],
        [9.0, 9.0, 2.0],
        [-9.0, 9.0, 2.0],
        [0.6, -9.0, 1.0],
        [9.0, -9.0, 1.0],
        [9.0, 9.0, 1.0],
        [0.6, 9.0, 1.0],
    ];
    let surface = TriangleSurface::new(&positions, &[[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]).unwrap();
    // The sun shines towards +x and +z, so that the shadow begins at x = 0.6 - 0.45 on the wall.
    let sun = Lights { towards_sun: UnitVector3::new_normalize(Vector3::new(0.45, 0.0, -1.0)), ..lights() };
    let frame = render(&surface, &camera(64, 48), &white, &sun, 1, 1).unwrap();
    let ambient = [encode_srgb8(0.25).0; 3];
    for (i, colour) in frame.colour.iter().enumerate() {
        let slope = ((i % 64) as f64 - 31.5) / 60.0;
        let in_shadow = slope * 2.0 > 0.15 && slope < 0.6;
        assert_eq!(*colour == ambient, in_shadow, "{slope}");
    }
}

#[test]
fn edges_are_mixed_and_threads_do_not_matter() {
    // The wall covers x > 0, whose edge runs through the middle of column 32.
    let corners = [[0.0, -9.0, 2.0], [9.0, -9.0, 2.0], [9.0, 9.0, 2.0], [0.0, 9.0, 2.0]];
    let surface = TriangleSurface::new(&corners, &[[0, 1, 2], [0, 2, 3]]).unwrap();
    let black_night = Lights { sun: [0.0; 3], ambient: [1.0; 3], background: [0.0; 3], ..lights() };
    let frame = render(&surface, &camera(65, 9), &white, &black_night, 4, 1).unwrap();
    for row in frame.colour.chunks(65) {
        assert_eq!(row[31], [0; 3]);
        assert_eq!(row[32], [encode_srgb8(0.5).0; 3]);
        assert_eq!(row[33], [255; 3]);
    }
    for threads in 2..5 {
        assert_eq!(render(&surface, &camera(65, 9), &white, &black_night, 4, threads).unwrap(), frame);
    }
}

#[test]
fn a_camera_looks_at_its_target() {
    let eye = Point3::new(3.0, -1.0, 2.0);
    let target = Point3::new(-1.0, 0.5, 0.0);
    let camera = Camera::looking_at(&eye, &target, &Vector3::z(), 1.0, (101, 51)).unwrap();
    let in_camera = |p: &Point3<f64>| camera.world_from_camera.inverse_transform_point(p);
    let ahead = in_camera(&target);
    assert!(ahead.x.abs() < 1e-12 && ahead.y.abs() < 1e-12 && ahead.z > 0.0);
    // OpenCV axes: what is higher has a smaller y, what is to the right a larger x.
    assert!(in_camera(&(target + Vector3::z())).y < 0.0);
    let right = (target - eye).cross(&Vector3::z());
    assert!(in_camera(&(target + right)).x > 0.0);
    // The image is one radian wide between the outer borders of the outer pixels.
    assert!((2.0 * (50.5 / camera.fx).atan() - 1.0).abs() < 1e-12);

    assert!(Camera::looking_at(&eye, &eye, &Vector3::z(), 1.0, (10, 10)).is_err());
    assert!(Camera::looking_at(&eye, &(eye + Vector3::z()), &Vector3::z(), 1.0, (10, 10)).is_err());
    let surface = slanted(0.0);
    let broken = Camera { fx: f64::NAN, ..camera };
    assert!(matches!(render(&surface, &broken, &white, &lights(), 1, 1), Err(Error::OutOfRange { .. })));
    assert!(render(&surface, &camera, &white, &lights(), 0, 1).is_err());
    assert!(render(&surface, &camera, &white, &lights(), 1, 0).is_err());
}

#[test]
fn light_follows_the_normal_of_the_look() {
    // A plane that faces the camera, told to lean 60 degrees away from the sun behind the camera: half the light.
    let sun = Lights { towards_sun: -Vector3::z_axis(), sun: [0.5; 3], ambient: [0.0; 3], ..Lights::default() };
    let leaning = |hit: &Hit| Shading { normal: Vector3::new(0.75_f64.sqrt(), 0.0, -0.5), ..white(hit) };
    let level = |shade: &(dyn Fn(&Hit) -> Shading + Sync)| {
        let frame = render(&slanted(0.0), &camera(9, 9), shade, &sun, 1, 1).unwrap();
        frame.colour[40][0]
    };
    assert_eq!(level(&white), paint_sim::colour::encode_srgb8(0.5).0);
    assert_eq!(level(&leaning), paint_sim::colour::encode_srgb8(0.25).0);
}
