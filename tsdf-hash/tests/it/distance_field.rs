//! Distances far from surfaces: exact, and the same however the map came about.

use nalgebra::{Isometry3, Point3, Vector3};
use tsdf_hash::distance_field::{DistanceField, DistanceSettings};
use tsdf_hash::storage::MemoryLimits;
use tsdf_hash::{Error, Map, Settings};

use crate::eviction::{FREE, add, take_out};
use crate::random::Random;
use crate::scene::room;

/// Points at random in the room and a little around it.
struct Points(Random);

impl Points {
    fn new(seed: u64) -> Self {
        Self(Random::new(seed))
    }

    fn next(&mut self) -> Point3<f64> {
        let [low, high] = [Vector3::new(-3.3, -2.3, -0.3), Vector3::new(3.3, 2.3, 3.3)];
        Point3::from(low.map_with_location(|k, _, low| low + (high[k] - low) * self.0.uniform()))
    }
}

fn field(radius: f64) -> DistanceField {
    DistanceField::new(&DistanceSettings { max_distance: radius }).unwrap()
}

fn scratch(map: &Map, radius: f64) -> DistanceField {
    let mut field = field(radius);
    field.update(map).unwrap();
    field
}

/// The same sites, and the same answers to the bit.
fn assert_same(a: &DistanceField, b: &DistanceField, seed: u64) {
    assert!(a.sites().eq(b.sites()));
    let mut points = Points::new(seed);
    for _ in 0..300 {
        let point = points.next();
        assert_eq!(a.distance_and_gradient(&point), b.distance_and_gradient(&point), "{point}");
    }
}

/// The distance to the nearest site, by asking them all.
fn brute_force(sites: &[Point3<f64>], point: &Point3<f64>, radius: f64) -> Option<f64> {
    let nearest = sites.iter().map(|site| (point - site).norm_squared()).fold(f64::INFINITY, f64::min).sqrt();
    (nearest < radius).then_some(nearest)
}

#[test]
fn equals_brute_force_over_all_sites() {
    let mut map = Map::new(FREE).unwrap();
    for shot in &room::tour(12, 8, &Isometry3::identity())[..7] {
        add(&mut map, shot).unwrap();
    }
    // From less than a block to more than the room.
    for radius in [0.05, 0.4, 1.0, 3.0, 50.0] {
        let field = scratch(&map, radius);
        let sites: Vec<_> = field.sites().collect();
        let (mut points, mut found) = (Points::new(radius.to_bits()), 0);
        for _ in 0..200 {
            let point = points.next();
            let (answer, expected) = (field.distance_and_gradient(&point), brute_force(&sites, &point, radius));
            assert_eq!(answer.is_some(), expected.is_some(), "{point}");
            let (Some((distance, gradient)), Some(expected)) = (answer, expected) else { continue };
            found += 1;
            assert!((distance - expected).abs() < 1e-12, "{distance} instead of {expected}");
            assert!((gradient.norm() - 1.0).abs() < 1e-12);
            // Following it down ends at the site.
            assert!(field.distance(&(point - gradient * distance)).unwrap() < 1e-6);
        }
        assert!(found > 0 && (radius < 3.0 || found == 200), "{found} within {radius}");
    }
}

/// Brute force over the vertices of the mesh, which another part of the crate finds.
#[test]
fn every_vertex_of_the_mesh_is_a_site() {
    let mut map = Map::new(FREE).unwrap();
    for shot in &room::tour(12, 8, &Isometry3::identity())[2..6] {
        add(&mut map, shot).unwrap();
    }
    let (field, mesh) = (scratch(&map, 0.5), map.mesh());
    assert!(mesh.positions.len() > 10_000);
    for position in &mesh.positions {
        let distance = field.distance(&Point3::from(*position).cast()).unwrap();
        assert!(distance < 1e-6, "{distance} m at {position:?}");
    }
    // The others lie where the observed part of the surface ends.
    let others = field.sites().count() - mesh.positions.len();
    assert!(others < mesh.positions.len() / 4, "{others}");
}

#[test]
fn following_the_map_equals_starting_from_scratch() {
    let shots = room::tour(12, 4, &Isometry3::identity());
    let (mut map, mut field) = (Map::new(FREE).unwrap(), field(1.0));
    for (step, shot) in shots.iter().enumerate() {
        let frame = add(&mut map, shot).unwrap();
        let report = field.update(&map).unwrap();
        assert_eq!((report.changed, report.removed), (frame.blocks, 0));
        assert!(report.rebuilt >= report.changed && report.rebuilt < 2 * report.changed, "{report:?}");
        assert_same(&field, &scratch(&map, 1.0), step as u64);
    }
    assert_eq!(field.update(&map).unwrap().rebuilt, 0);
    let mut removed = 0;
    for (step, shot) in shots.iter().enumerate() {
        let frame = take_out(&mut map, shot).unwrap();
        let report = field.update(&map).unwrap();
        assert_eq!(report.removed, frame.blocks_removed);
        removed += report.removed;
        assert_same(&field, &scratch(&map, 1.0), step as u64);
    }
    assert!(removed > 1000 && map.blocks() == 0);
    assert_eq!((field.sites().count(), field.distance(&Point3::new(0.0, 0.0, 0.1))), (0, None));
}

/// The whole map counts, wherever its blocks are; and another map starts anew.
#[test]
fn evicted_blocks_keep_their_sites() {
    let shots = room::tour(16, 4, &Isometry3::identity());
    let memory =
        MemoryLimits { host_bytes: 64 << 20, max_age: 0.15, max_transfers: 200, merge_timeout: 0.1, ..FREE.memory };
    let mut capped = Map::new(Settings { max_bytes: 2 << 20, memory, ..FREE }).unwrap();
    let (mut free, mut field) = (Map::new(FREE).unwrap(), field(1.0));
    let order: Vec<usize> = (0..16).chain([0, 1, 2, 9, 4]).collect();
    for (step, &k) in order.iter().enumerate() {
        add(&mut capped, &shots[k]).unwrap();
        add(&mut free, &shots[k]).unwrap();
        if step % 3 == 0 {
            field.update(&capped).unwrap();
            assert_same(&field, &scratch(&free, 1.0), step as u64);
        }
    }
    let memory = capped.memory();
    assert!(memory.host_blocks > memory.active_blocks, "{memory:?}");
    for (step, &k) in order[..14].iter().enumerate() {
        take_out(&mut capped, &shots[k]).unwrap();
        take_out(&mut free, &shots[k]).unwrap();
        if step % 3 == 0 {
            field.update(&capped).unwrap();
            assert_same(&field, &scratch(&free, 1.0), step as u64);
        }
    }
    let mut other = Map::new(FREE).unwrap();
    add(&mut other, &shots[7]).unwrap();
    assert_eq!(field.update(&other).unwrap().changed, other.blocks());
    assert_same(&field, &scratch(&other, 1.0), 0);
}

/// The closed form of the room, in the air from a quarter of a voxel on: nothing is nearer than the surface, and where the
/// nearest point of the surface was seen, nothing is farther.
#[test]
fn is_the_distance_of_the_room() {
    let mut map = Map::new(FREE).unwrap();
    for shot in room::tour(30, 2, &Isometry3::identity()) {
        add(&mut map, &shot).unwrap();
    }
    let (field, mut points) = (scratch(&map, 1.0), Points::new(7));
    let (mut near, mut far) = (Vec::new(), Vec::new());
    for _ in 0..40_000 {
        let point = points.next();
        let truth = room::sdf(&point);
        if !(0.25 * FREE.voxel_size..0.9).contains(&truth) {
            continue;
        }
        let error = (field.distance(&point).unwrap_or(99.0) - truth) / FREE.voxel_size;
        near.push(-error);
        let step = |k: usize| Vector3::ith(k, 1e-6);
        let gradient = Vector3::from_fn(|k, _| (room::sdf(&(point + step(k))) - room::sdf(&(point - step(k)))) / 2e-6);
        let foot = point - truth * gradient;
        // And a voxel around it: where the observed part of the surface ends, the nearest of it may be farther.
        let around = [0, 1, 2].iter().flat_map(|&k| [-1.0, 1.0].map(|sign| Vector3::ith(k, sign * FREE.voxel_size)));
        if around.chain([Vector3::zeros()]).all(|step| map.distance(&(foot + step)).is_some()) {
            far.push(error);
        }
    }
    assert!(near.len() > 20_000 && far.len() > 5_000, "{} {}", near.len(), far.len());
    let most = near.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // Surfaces end half a voxel beyond their rims, in steps of a voxel.
    let within = near.iter().filter(|&&error| error < 0.5).count();
    assert!(
        within as f64 > 0.997 * near.len() as f64 && most < 0.75,
        "{within} of {}, nearer by {most} voxels",
        near.len()
    );
    // At the corners of the boxes, which voxels round off, it may be a little more.
    let within = far.iter().filter(|&&error| error < 0.5).count();
    let most = far.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    assert!(within as f64 > 0.998 * far.len() as f64 && most < 0.75, "{within} of {}, {most} voxels", far.len());
}

#[test]
fn nonsense_is_refused() {
    for radius in [0.0, -1.0, 1e7, f64::INFINITY, f64::NAN] {
        let refused = DistanceField::new(&DistanceSettings { max_distance: radius });
        assert!(matches!(refused, Err(Error::InvalidSetting { name: "max_distance", .. })), "{radius}");
    }
    let mut map = Map::new(FREE).unwrap();
    let mut field = field(1e6);
    assert_eq!(field.distance(&Point3::origin()), None);
    field.update(&map).unwrap();
    assert_eq!(field.distance(&Point3::origin()), None);
    add(&mut map, &room::tour(12, 8, &Isometry3::identity())[0]).unwrap();
    field.update(&map).unwrap();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, -1e300, 1e9] {
        assert_eq!(field.distance_and_gradient(&Point3::new(bad, 0.0, 0.0)), None);
    }
    assert!((field.distance(&Point3::new(9e5, 0.0, 0.0)).unwrap() - 9e5).abs() < 4.0);
}
