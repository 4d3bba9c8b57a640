//! Rays and distances against geometry that is known in closed form.

use nalgebra::{Point3, Vector3};
use paint_sim::{Error, Surface, TriangleSurface};

/// A closed unit sphere of latitude and longitude rings, the poles included.
fn sphere(rings: u32, sectors: u32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let mut positions = vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    for ring in 1..rings {
        let polar = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
        for sector in 0..sectors {
            let azimuth = std::f64::consts::TAU * f64::from(sector) / f64::from(sectors);
            let point = [polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos()];
            positions.push(point.map(|v| v as f32));
        }
    }
    let at = |ring: u32, sector: u32| 2 + (ring - 1) * sectors + sector % sectors;
    let mut faces = Vec::new();
    for sector in 0..sectors {
        faces.push([0, at(1, sector), at(1, sector + 1)]);
        faces.push([1, at(rings - 1, sector + 1), at(rings - 1, sector)]);
        for ring in 1..rings - 1 {
            faces.push([at(ring, sector), at(ring + 1, sector), at(ring + 1, sector + 1)]);
            faces.push([at(ring, sector), at(ring + 1, sector + 1), at(ring, sector + 1)]);
        }
    }
    (positions, faces)
}

/// Numbers between two others, evenly.
fn uniform(seed: u64) -> impl FnMut(f64, f64) -> f64 {
    let mut state = seed;
    move |low, high| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[test]
fn no_ray_leaves_a_closed_sphere() {
    let (positions, faces) = sphere(30, 60);
    let surface = TriangleSurface::new(&positions, &faces).unwrap();
    let center = Point3::new(0.01, -0.02, 0.03);
    let corner = |v: u32| Vector3::from(positions[v as usize].map(f64::from));
    // Straight at every vertex and at every middle of an edge, where rays slip through if they can.
    for face in &faces {
        let [a, b, c] = face.map(corner);
        for target in [a, (a + b) * 0.5, (b + c) * 0.5, (a + c) * 0.5] {
            let direction = (Point3::from(target) - center).normalize();
            let hit = surface.cast(&center, &direction, 10.0).unwrap();
            let point = center + direction * hit.distance;
            assert!(point.coords.norm() > 0.99 && point.coords.norm() < 1.0 + 1e-6);
            assert!(surface.occluded(&center, &direction, hit.distance + 1e-9));
            assert!(!surface.occluded(&center, &direction, hit.distance - 1e-9));
        }
    }
}

#[test]
fn hits_say_where_on_the_triangle() {
    let positions = [[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [0.0, 4.0, 1.0]];
    let surface = TriangleSurface::new(&positions, &[[0, 1, 2]]).unwrap();
    let hit = surface.cast(&Point3::new(0.5, 1.0, -1.0), &Vector3::z(), 10.0).unwrap();
    assert!((hit.distance - 2.0).abs() < 1e-15 && hit.face == 0);
    assert!((hit.barycentric[0] - 0.25).abs() < 1e-15 && (hit.barycentric[1] - 0.25).abs() < 1e-15);
    assert_eq!(hit.normal, Vector3::z());
    assert!(surface.cast(&Point3::new(0.5, 1.0, -1.0), &Vector3::z(), 1.9).is_none());
    assert!(surface.cast(&Point3::new(0.5, 1.0, 3.0), &Vector3::z(), 10.0).is_none());
    assert!(surface.cast(&Point3::new(1.5, 3.0, -1.0), &Vector3::z(), 10.0).is_none());
}

#[test]
fn the_closest_hit_and_the_distance_are_those_of_brute_force() {
    let (positions, faces) = sphere(12, 17);
    let surface = TriangleSurface::new(&positions, &faces).unwrap();
    let mut state = 3_u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    for _ in 0..500 {
        let origin = Point3::new(4.0 * uniform(), 4.0 * uniform(), 4.0 * uniform());
        let direction = Vector3::new(uniform(), uniform(), uniform()).normalize();
        let mut closest = f64::INFINITY;
        for face in &faces {
            let [a, b, c] = face.map(|v| Vector3::from(positions[v as usize].map(f64::from)));
            // Cramer's rule for origin + t direction = a + u (b-a) + v (c-a).
            let matrix = nalgebra::Matrix3::from_columns(&[b - a, c - a, -direction]);
            if let Some(solution) = matrix.lu().solve(&(origin.coords - a))
                && solution.x >= 0.0
                && solution.y >= 0.0
                && solution.x + solution.y <= 1.0
                && solution.z >= 0.0
            {
                closest = closest.min(solution.z);
            }
        }
        let hit = surface.cast(&origin, &direction, 100.0).map_or(f64::INFINITY, |hit| hit.distance);
        assert!(hit == closest || (hit - closest).abs() < 1e-12, "{hit} instead of {closest}");
        // The mesh lies between the unit sphere and the ball inside its flattest face.
        let gap = (origin.coords.norm() - 1.0).abs();
        let distance = surface.distance(&origin, 10.0);
        assert!((distance - gap).abs() < 0.06, "{distance} instead of {gap}");
        assert_eq!(surface.distance(&origin, 0.5 * distance), 0.5 * distance);
        // A point of a triangle, off its edges, is next to that triangle.
        let [a, b, c] = faces[((uniform() + 0.5) * faces.len() as f64) as usize]
            .map(|v| Point3::from(positions[v as usize].map(f64::from)));
        if (b - a).cross(&(c - a)).norm() > 1e-6 {
            let inside = Point3::from(0.2 * a.coords + 0.3 * b.coords + 0.5 * c.coords);
            assert_eq!(surface.nearest_triangle(&inside, 1e-6), Some([a, b, c]));
            assert_eq!(surface.nearest_triangle(&(inside + inside.coords), 0.5), None);
        }
    }
}

#[test]
fn soups_are_welcome_and_nonsense_is_not() {
    let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    // A triangle twice, and one without area.
    let surface = TriangleSurface::new(&positions, &[[0, 1, 1], [0, 1, 2], [0, 1, 2]]).unwrap();
    let hit = surface.cast(&Point3::new(0.2, 0.2, 1.0), &-Vector3::z(), 2.0).unwrap();
    assert_eq!(hit.face, 1);
    let beam = [-Vector3::z(), Vector3::new(0.01, 0.0, -1.0).normalize()];
    for hit in surface.cast_beam(&Point3::new(0.2, 0.2, 1.0), &beam, 2.0) {
        assert_eq!(hit.unwrap().face, 1);
    }
    assert!(surface.cast(&Point3::new(f64::NAN, 0.2, 1.0), &-Vector3::z(), 2.0).is_none());
    assert!(surface.cast(&Point3::new(0.2, 0.2, 1.0), &Vector3::zeros(), 2.0).is_none());

    assert!(matches!(TriangleSurface::new(&[], &[[0, 1, 2]]), Err(Error::Empty { what: "positions" })));
    assert!(matches!(TriangleSurface::new(&positions, &[]), Err(Error::Empty { what: "faces" })));
    let error = TriangleSurface::new(&positions, &[[0, 1, 2], [0, 1, 3]]).unwrap_err();
    assert_eq!(error, Error::VertexIndex { face: 1, vertex: 3, vertices: 3 });
    assert!(matches!(TriangleSurface::new(&positions, &[[0, 1, 1]]), Err(Error::NoArea { faces: 1 })));
    let broken = [[0.0, 0.0, f32::NAN], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    assert!(matches!(TriangleSurface::new(&broken, &[[0, 1, 2]]), Err(Error::NotFinite { index: 0, .. })));
}

/// Beams of every width before meshes coarse and fine, from outside, inside and from a corner: each ray hits what it hits alone.
#[test]
fn rays_of_a_beam_hit_what_each_hits_alone() {
    let mut random = uniform(9);
    let mut hits = 0;
    for (rings, sectors) in [(4, 6), (24, 48), (160, 320)] {
        let (mut positions, faces) = sphere(rings, sectors);
        // Dents, so that a ray may meet several sheets.
        for p in &mut positions {
            *p = p.map(|v| v * (1.0 + 0.2 * (9.0 * p[0] * p[1] + 5.0 * p[2]).sin()));
        }
        let surface = TriangleSurface::new(&positions, &faces).unwrap();
        for k in 0..300 {
            let corner = positions[k * 7 % positions.len()].map(f64::from);
            let origin = match k % 4 {
                0 => Point3::origin(),
                1 => Point3::from(corner),
                _ => Point3::new(random(-3.0, 3.0), random(-3.0, 3.0), random(-3.0, 3.0)),
            };
            let towards =
                Vector3::from_fn(|_, _| random(-1.0, 1.0)) - if k % 4 > 1 { origin.coords } else { Vector3::zeros() };
            let side = towards.cross(&Vector3::new(0.3, -0.5, 0.8)).normalize();
            let up = towards.normalize().cross(&side);
            let step = 10_f64.powf(random(-4.0, -0.5));
            let directions: Vec<Vector3<f64>> = (0..64)
                .map(|i| {
                    let (x, y) = (f64::from(i % 8) * step, f64::from(i / 8) * step);
                    (towards.normalize() + side * x + up * y).normalize()
                })
                .collect();
            let together = surface.cast_beam(&origin, &directions, 9.0);
            assert_eq!(together.len(), directions.len());
            for (direction, hit) in directions.iter().zip(together) {
                let alone = surface.cast(&origin, direction, 9.0);
                hits += usize::from(alone.is_some());
                assert_eq!(hit, alone, "{rings} rings, from {origin} to {direction}");
            }
        }
    }
    assert!(hits > 20_000, "{hits}");
}

/// Many rays in any order within cones narrow and wide, so that they have to be divided: each hits what it hits alone.
#[test]
fn rays_of_a_cone_hit_what_each_hits_alone() {
    let mut random = uniform(5);
    for (rings, sectors) in [(24, 48), (200, 400)] {
        let (mut positions, faces) = sphere(rings, sectors);
        for p in &mut positions {
            *p = p.map(|v| v * (1.0 + 0.2 * (9.0 * p[0] * p[1] + 5.0 * p[2]).sin()));
        }
        let surface = TriangleSurface::new(&positions, &faces).unwrap();
        for k in 0..40 {
            let origin = Point3::new(random(-2.0, 2.0), random(-2.0, 2.0), random(-2.0, 2.0));
            let axis = (Vector3::from_fn(|_, _| random(-1.0, 1.0)) - origin.coords).normalize();
            let width = [0.02, 0.15, 0.5, 1.5][k % 4];
            let count = [9, 200, 1024, 3000][k / 4 % 4];
            let direction =
                |_| (axis + Vector3::from_fn(|_, _| width * random(-1.0, 1.0) * random(0.0, 1.0))).normalize();
            let directions: Vec<Vector3<f64>> = (0..count).map(direction).collect();
            let max = random(0.5, 4.0);
            for (direction, hit) in directions.iter().zip(surface.cast_beam(&origin, &directions, max)) {
                assert_eq!(hit, surface.cast(&origin, direction, max), "{rings} rings, from {origin} to {direction}");
            }
        }
    }
}

/// Rays of a cone from inside closed meshes, every other one straight at a vertex or an edge: how many meet nothing, of how many.
fn leaks(cones: u32) -> (usize, usize) {
    let mut random = uniform(8);
    let (mut leaks, mut rays) = (0, 0);
    for rings in [30, 300] {
        let (positions, faces) = sphere(rings, 2 * rings);
        let surface = TriangleSurface::new(&positions, &faces).unwrap();
        let corner = |v: u32| Vector3::from(positions[v as usize].map(f64::from));
        for _ in 0..cones {
            let origin = Point3::from(Vector3::from_fn(|_, _| random(-0.4, 0.4)));
            let axis = Vector3::from_fn(|_, _| random(-1.0, 1.0)).normalize();
            let width = random(0.02, 0.4);
            let mut directions = Vec::with_capacity(2048);
            while directions.len() < 2048 {
                directions.push((axis + Vector3::from_fn(|_, _| width * random(-1.0, 1.0))).normalize());
                let ahead =
                    surface.cast(&origin, &directions[directions.len() - 1], 10.0).map(|hit| faces[hit.face as usize]);
                let [a, b, _] = ahead.unwrap_or_default().map(corner);
                let share = [0.0, 0.5, random(0.0, 1.0)][directions.len() / 2 % 3];
                directions.push((Point3::from(a + (b - a) * share) - origin).normalize());
            }
            leaks += surface.cast_beam(&origin, &directions, 10.0).iter().filter(|hit| hit.is_none()).count();
            rays += directions.len();
        }
    }
    (leaks, rays)
}

#[test]
fn no_ray_of_a_cone_leaves_a_closed_mesh() {
    let (leaks, rays) = leaks(250);
    assert!(leaks == 0 && rays > 1_000_000, "{leaks} of {rays}");
}

/// Minutes: `cargo test --release -p paint-sim --test it -- --ignored hundred_million`.
#[test]
#[ignore = "takes minutes"]
fn no_ray_of_a_hundred_million_leaves_a_closed_mesh() {
    let (leaks, rays) = leaks(24_500);
    assert!(leaks == 0 && rays > 100_000_000, "{leaks} of {rays}");
}
