//! Sprays a stroke on a wall, and takes a picture of it.

use std::io::Write;

use paint_sim::nalgebra::{Point3, Vector3};
use paint_sim::render::{Lights, Shading};
use paint_sim::surface::Hit;
use paint_sim::{Camera, Paint, Shot, SprayModel, Substrate, Texel, TriangleSurface, colour, render, spray};

/// Texels along a side of the wall, which has an edge of 40 cm, and their size in metres.
const SIDE: usize = 200;
const TEXEL: f64 = 0.002;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let corners = [[0.0, -0.2, -0.2], [0.0, 0.2, -0.2], [0.0, 0.2, 0.2], [0.0, -0.2, 0.2]];
    let faces = [[0, 2, 1], [0, 3, 2]];
    let wall = TriangleSurface::new(&corners, &faces)?;
    let at = |k: usize| (k as f64 + 0.5) * TEXEL - 0.2;
    let texel = |k| Texel {
        point: Point3::new(0.0, at(k % SIDE), at(k / SIDE)),
        normal: -Vector3::x_axis(),
        area: TEXEL * TEXEL,
    };
    // A stroke of 20 cm from a distance of 10 cm, a shot every 2 mm.
    let shot = |k: i32| Shot {
        origin: Point3::new(-0.1, f64::from(k) * 2e-3, 0.05 * (0.1 * f64::from(k)).sin()),
        axis: Vector3::x_axis(),
        volume: 2e-9,
    };
    let stroke: Vec<Shot> = (-50..=50).map(shot).collect();
    let film = spray((0..SIDE * SIDE).map(texel).collect(), &stroke, &SprayModel::default(), &wall, 1)?;
    assert!(film.mass_balance().balanced());

    let (paint, ground) = (Paint::blue(50e-6)?, Substrate::grey(0.8)?);
    let seen = |k| Ok(colour::spectrum_linear_srgb(paint.over(film.thickness(k), &ground)?.reflectance()));
    let albedo: Vec<[f64; 3]> = (0..SIDE * SIDE).map(seen).collect::<Result<_, paint_sim::Error>>()?;
    let eye = Point3::new(-0.5, -0.15, 0.1);
    let camera = Camera::looking_at(&eye, &Point3::origin(), &Vector3::z(), 0.8, (320, 240))?;
    let shade = |hit: &Hit| {
        let ([a, b], face) = (hit.barycentric, faces[hit.face as usize].map(|v: u32| corners[v as usize]));
        let [i, j] = [1, 2]
            .map(|k| (1.0 - a - b) * f64::from(face[0][k]) + a * f64::from(face[1][k]) + b * f64::from(face[2][k]));
        let [i, j] = [i, j].map(|c| (((c + 0.2) / TEXEL) as usize).min(SIDE - 1));
        Shading::matt(albedo[j * SIDE + i].map(|c| c as f32), hit.normal)
    };
    let picture = render(&wall, &camera, &shade, &Lights::default(), 2, 1)?;
    let path = std::env::temp_dir().join("spray.ppm");
    let mut file = std::fs::File::create(&path)?;
    writeln!(file, "P6 {} {} 255", picture.width, picture.height)?;
    file.write_all(picture.colour.as_flattened())?;
    println!("{}", path.display());
    Ok(())
}
