//! The coat over the paint: closed forms and energy.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, UnitVector3, Vector3};
use paint_sim::render::{Coat, Lights, Shading, Sky};
use paint_sim::{Camera, Error, TriangleSurface, render};

fn from_normal(angle: f64, around: f64) -> Vector3<f64> {
    let (sine, cosine) = angle.to_radians().sin_cos();
    Vector3::new(sine * around.cos(), sine * around.sin(), cosine)
}

/// All of the light that falls on white paint under a coat comes back, whatever comes from the coat itself: summed over directions of even light.
#[test]
fn a_coat_loses_and_makes_no_light() {
    for (roughness, angle) in [(0.1, 0.0), (0.1, 50.0), (0.3, 30.0), (0.3, 80.0), (0.6, 70.0), (1.0, 20.0)] {
        let coat = Coat::new(roughness).unwrap();
        let eye = from_normal(angle, 0.0);
        let (mut matt, mut gloss, rings, sectors) = (0.0, 0.0, 600, 1200);
        for k in 0..rings * sectors {
            let cosine: f64 = (f64::from(k / sectors) + 0.5) / f64::from(rings);
            let around = TAU * f64::from(k % sectors) / f64::from(sectors);
            let light = from_normal(cosine.acos().to_degrees(), around);
            let [paint, surface] = coat.reflected(&Vector3::z(), &eye, &light);
            // Light of a white surface that faces it, over π: the mean over the half sphere times 2.
            matt += 2.0 * paint / f64::from(rings * sectors);
            gloss += 2.0 * surface / f64::from(rings * sectors);
        }
        let cosine = angle.to_radians().cos();
        assert!((gloss - coat.albedo(cosine)).abs() < 0.01, "{roughness} {angle}: {gloss} {}", coat.albedo(cosine));
        assert!((matt + gloss - 1.0).abs() < 0.015, "{roughness} {angle}: {matt} + {gloss}");
        assert!(gloss > 0.0 && matt > 0.0);
    }
}

/// A coat that is nearly a mirror reflects by Fresnel (n = 1.5).
#[test]
fn a_smooth_coat_reflects_by_fresnel() {
    let coat = Coat::new(0.02).unwrap();
    assert!((coat.albedo(1.0) - 0.04).abs() < 1e-3, "{}", coat.albedo(1.0));
    // At Brewster's angle, tan = 1.5, only the half polarised across: ((n² - 1)/(n² + 1))² / 2 = 25/338.
    let brewster = 1.0 / f64::sqrt(1.0 + 2.25);
    assert!((coat.albedo(brewster) - 25.0 / 338.0).abs() < 2e-3, "{}", coat.albedo(brewster));
    let mean: f64 = (0..1000).map(|k| f64::from(k) * 1e-3 + 5e-4).map(|c| 2.0 * c * coat.albedo(c)).sum::<f64>() / 1e3;
    // Saunderson's k1 of diffuse light; facets hide each other where one looks along the surface.
    assert!((mean - 0.09178).abs() < 3e-3, "{mean}");
}

/// Light and eye may be exchanged (Helmholtz), once each cosine is taken off; nothing comes from behind.
#[test]
fn eye_and_light_may_be_exchanged() {
    let coat = Coat::new(0.25).unwrap();
    let (a, b) = (from_normal(20.0, 0.3), from_normal(65.0, 2.0));
    let (there, back) = (coat.reflected(&Vector3::z(), &a, &b), coat.reflected(&Vector3::z(), &b, &a));
    assert!((0..2).all(|k| (there[k] / b.z - back[k] / a.z).abs() < 1e-12));
    assert_eq!(coat.reflected(&Vector3::z(), &a, &from_normal(91.0, 0.0)), [0.0; 2]);
    for bad in [0.0, -1.0, 1.1, f64::NAN] {
        assert!(matches!(Coat::new(bad), Err(Error::OutOfRange { .. })));
    }
}

/// In even light white paint looks the same with and without a coat; black paint shows what the coat reflects.
#[test]
fn a_picture_of_a_coat_has_its_albedo() {
    let corners = [[-9.0, -9.0, 2.0], [9.0, -9.0, 2.0], [9.0, 9.0, 2.0], [-9.0, 9.0, 2.0]];
    let surface = TriangleSurface::new(&corners, &[[0, 1, 2], [0, 2, 3]]).unwrap();
    let camera =
        Camera { fx: 20.0, fy: 20.0, cx: 4.0, cy: 4.0, width: 9, height: 9, world_from_camera: Isometry3::identity() };
    let coat = Coat::new(0.2).unwrap();
    let centre = |albedo: f32, coat: Option<Coat>, lights: &Lights| {
        let shade = |hit: &paint_sim::surface::Hit| Shading { coat, ..Shading::matt([albedo; 3], hit.normal) };
        render(&surface, &camera, &shade, lights, 1, 1).unwrap().colour[40][0]
    };
    let code = |linear: f64| paint_sim::colour::encode_srgb8(linear).0;
    let sky = Lights { exposure: 0.9, ..Lights::without_sun(Sky::uniform([1.0; 3]).unwrap(), Vec::new()) };
    assert!(centre(1.0, Some(coat), &sky).abs_diff(code(0.9)) <= 1);
    assert!(centre(0.0, Some(coat), &sky).abs_diff(code(0.9 * coat.albedo(1.0))) <= 1);
    assert_eq!(centre(0.0, None, &sky), 0);
    // The mirror image of the sun is bright on black paint, and nowhere near it dark.
    let sun = |towards: Vector3<f64>| Lights {
        towards_sun: UnitVector3::new_normalize(towards),
        sun: [0.1; 3],
        ambient: [0.0; 3],
        ..Lights::default()
    };
    let straight = coat.reflected(&-Vector3::z(), &-Vector3::z(), &-Vector3::z())[1];
    assert!(straight > 0.2 && centre(0.0, Some(coat), &sun(-Vector3::z())).abs_diff(code(0.1 * straight)) <= 1);
    assert!(centre(0.0, Some(coat), &sun(Vector3::new(1.0, 0.0, -1.0))) < 8);
}
