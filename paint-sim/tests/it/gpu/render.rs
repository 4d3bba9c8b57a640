//! Pictures: the same bytes, with shadows of sun and lamps.

use nalgebra::{Point3, UnitVector3, Vector3};
use paint_sim::render::{Coat, Frame, Lamp, Lights, Shading, Sky};
use paint_sim::surface::{GpuSurface, Hit, Surface};
use paint_sim::{Camera, TriangleSurface, render};

use super::spray::rock;
use super::{available, options};

const PIXELS: (u32, u32) = (160, 120);

/// Colours by triangle, one in five of them glossy.
fn shade(hit: &Hit) -> Shading {
    let part = |k: u32| 0.2 + 0.7 * (hit.face.wrapping_mul(k) % 97) as f32 / 97.0;
    let coat = hit.face.is_multiple_of(5).then(|| Coat::new(0.1).unwrap());
    Shading { coat, ..Shading::matt([part(7), part(31), part(53)], hit.normal) }
}

/// A low sun, a sky, and two lamps, one of them behind the rock.
fn lights(offset: Vector3<f64>) -> Lights {
    let towards_sun = UnitVector3::new_normalize(Vector3::new(0.8, 0.2, 0.35));
    let sky = Sky::uniform([0.1, 0.12, 0.2]).unwrap();
    let lamp = |x: f64, z: f64| Lamp { position: Point3::new(x, 0.1, z) + offset, light: [0.05, 0.04, 0.02] };
    let lamps = vec![lamp(-0.2, 0.15), lamp(0.0, -0.3)];
    Lights { towards_sun, sun: [0.7; 3], sky: Some(sky), lamps, ..Lights::default() }
}

/// A surface that throws no shadow.
struct Unshaded<'a>(&'a TriangleSurface);

impl Surface for Unshaded<'_> {
    fn cast(&self, origin: &Point3<f64>, direction: &Vector3<f64>, max: f64) -> Option<Hit> {
        self.0.cast(origin, direction, max)
    }

    fn occluded(&self, _: &Point3<f64>, _: &Vector3<f64>, _: f64) -> bool {
        false
    }

    fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
        self.0.distance(point, max)
    }
}

fn frames(surface: &dyn Surface, offset: Vector3<f64>) -> Vec<Frame> {
    let picture = |(eye, size): ([f64; 3], u32)| {
        let eye = Point3::from(eye) + offset;
        let camera = Camera::looking_at(&eye, &(Point3::origin() + offset), &Vector3::z(), 1.0, PIXELS).unwrap();
        render(surface, &camera, &shade, &lights(offset), size, 1).unwrap()
    };
    [([0.1, -0.4, 0.5], 1), ([0.3, 0.5, 0.2], 3), ([2.0, -1.0, 3.0], 2)].map(picture).into()
}

#[test]
fn pictures_are_those_of_the_processor() {
    for away in [[0.0; 3], [3000.0, -20.0, 500.0]] {
        let surface = rock(away);
        let offset = Vector3::from(away.map(f64::from));
        let Some(gpu) = available(GpuSurface::new(&surface, &options())) else { return };
        let (expected, found) = (frames(&surface, offset), frames(&gpu, offset));
        for (k, (expected, found)) in expected.iter().zip(&found).enumerate() {
            assert!(found.depth == expected.depth && found.faces == expected.faces, "{k}");
            assert!(found == expected, "{k}");
            let seen = expected.faces.iter().filter(|face| **face != u32::MAX).count();
            assert!(seen > 200 && seen < expected.faces.len(), "{seen}");
        }
        let rays = gpu.rays();
        println!("{away:?}: {rays:?}");
        // Nearly all of them are the device's.
        assert!(rays.left * 50 < rays.asked, "{rays:?}");
        assert!(gpu.fault().is_none());
        // Shadows are in it, also those of the lamps.
        let unshaded = frames(&Unshaded(&surface), offset);
        for (found, unshaded) in found.iter().zip(&unshaded) {
            assert!(found.depth == unshaded.depth && found.colour != unshaded.colour);
        }
    }
}

/// A wall of two triangles fills the picture: nearly all its shadow rays begin closer to it than single precision can tell.
#[test]
fn a_wall_of_two_triangles_does_not_shade_itself() {
    let corners = [[-60.0, 0.0, -50.0], [70.0, 0.0, -50.0], [70.0, 0.0, 50.0], [-60.0, 0.0, 50.0]];
    let wall = TriangleSurface::new(&corners, &[[0, 1, 2], [0, 2, 3]]).unwrap();
    let Some(gpu) = available(GpuSurface::new(&wall, &options())) else { return };
    let camera =
        Camera::looking_at(&Point3::new(1.0, -8.0, 2.0), &Point3::new(0.0, 0.0, 1.0), &Vector3::z(), 1.0, PIXELS)
            .unwrap();
    let lights = Lights { towards_sun: UnitVector3::new_normalize(Vector3::new(0.1, -1.0, 0.4)), ..Lights::default() };
    let [expected, found] =
        [&wall as &dyn Surface, &gpu].map(|surface| render(surface, &camera, &shade, &lights, 1, 1).unwrap());
    assert!(found == expected);
    assert!(expected.colour.iter().all(|c| c.iter().any(|c| *c > 60)));
    let rays = gpu.rays();
    println!("{rays:?}");
    assert!(rays.asked > 30_000 && rays.left * 50 < rays.asked, "{rays:?}");
}
