//! The film on a rough wall, from pictures with a lens that falls off, noise, 8 bits, a low sun and mottled ground.

use nalgebra::{Isometry3, Matrix3, Point3, UnitQuaternion, UnitVector3, Vector3};
use paint_sim::colour::decode_srgb8;
use paint_sim::film::inspection::{FilmEstimate, GreyPaint, Mosaic, Picture, estimate_film};
use paint_sim::paint::PaintName;
use paint_sim::render::{Lights, Shading};
use paint_sim::surface::Hit;
use paint_sim::{Camera, Error, Film, Shot, SprayModel, Surface, Texel, TriangleSurface, render};

const UNIT: f64 = 20e-6;
const EDGE: f64 = 0.01;
/// Texels along y and z.
const GRID: (usize, usize) = (120, 80);
const GROUND: f64 = 0.35;

fn wall() -> TriangleSurface {
    // Bulges of 3 cm, 40 cm apart: normals turn by 25 degrees.
    let relief = |y: f64, z: f64| 0.03 * (15.0 * y).sin() * (13.0 * z + 1.0).cos();
    let (columns, rows) = (60, 40);
    let at = |k: usize| {
        let (y, z) = ((k % (columns + 1)) as f64 * 0.02 - 0.6, (k / (columns + 1)) as f64 * 0.02);
        [relief(y, z), y, z].map(|c| c as f32)
    };
    let positions: Vec<[f32; 3]> = (0..(columns + 1) * (rows + 1)).map(at).collect();
    let cell = |k: usize| {
        let first = (k / columns * (columns + 1) + k % columns) as u32;
        let [a, b, c, d] = [0, 1, columns as u32 + 1, columns as u32 + 2].map(|o| first + o);
        [[a, c, b], [b, c, d]]
    };
    let faces: Vec<[u32; 3]> = (0..columns * rows).flat_map(cell).collect();
    TriangleSurface::new(&positions, &faces).unwrap()
}

fn texels(wall: &TriangleSurface) -> Vec<Texel> {
    let texel = |k: usize| {
        let from = Point3::new(-1.0, (k % GRID.0) as f64 * EDGE - 0.595, (k / GRID.0) as f64 * EDGE + 0.005);
        let hit = wall.cast(&from, &Vector3::x_axis(), 3.0).unwrap();
        let normal = UnitVector3::new_normalize(-hit.normal * hit.normal.x.signum());
        Texel { point: from + Vector3::x() * hit.distance, normal, area: EDGE * EDGE / normal.x.abs() }
    };
    (0..GRID.0 * GRID.1).map(texel).collect()
}

/// A number of the standard normal distribution, by its place.
fn noise(seed: u64, place: u64) -> f64 {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ place.wrapping_mul(0xD1B5_4A32_D192_ED03);
    let mut uniform = || {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (state ^ (state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    };
    (-2.0 * (1.0 - uniform()).ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos()
}

/// A scene with what is on the wall.
struct Scene<'a> {
    wall: &'a TriangleSurface,
    film: &'a Film,
    paint: GreyPaint,
    lights: Lights,
    exposure: f64,
    seed: u64,
}

impl Scene<'_> {
    /// Mottled by a fifth, with paint over it.
    fn albedo(&self, hit: &Hit) -> f64 {
        let p = self.wall.point(hit).unwrap();
        let ground = GROUND * (1.0 + 0.2 * (40.0 * p.y + 3.0).sin() * (31.0 * p.z).cos());
        let (x, y) = ((p.y + 0.595) / EDGE, (p.z - 0.005) / EDGE);
        let at = |x: f64, y: f64| {
            let x = x.clamp(0.0, (GRID.0 - 1) as f64) as usize;
            self.film.thickness(y.clamp(0.0, (GRID.1 - 1) as f64) as usize * GRID.0 + x)
        };
        let (right, high) = (x - x.floor(), y - y.floor());
        let row = |y: f64| at(x.floor(), y) * (1.0 - right) + at(x.floor() + 1.0, y) * right;
        self.paint.reflectance(row(y.floor()) * (1.0 - high) + row(y.floor() + 1.0) * high, ground)
    }

    /// What the camera writes down, as linear light.
    fn picture(&self, index: u64, camera: &Camera) -> Vec<f32> {
        let shade = |hit: &Hit| Shading::matt([self.albedo(hit) as f32; 3], hit.normal);
        let frame = render(self.wall, camera, &shade, &self.lights, 1, 2).unwrap();
        let linear = |srgb: u8| decode_srgb8(srgb);
        let levels: Vec<f64> = (0..=255).map(linear).collect();
        let pixel = |(k, colour): (usize, &[u8; 3])| {
            let (x, y) =
                (f64::from(k as u32 % camera.width) - camera.cx, f64::from(k as u32 / camera.width) - camera.cy);
            let r2 = 4.0 * (x * x + y * y) / f64::from(camera.width.pow(2) + camera.height.pow(2));
            // cos^4 of a lens of 40 degrees to the corner.
            let fall_off = 1.0 / (1.0 + r2 * 40.0_f64.to_radians().tan().powi(2)).powi(2);
            let light = self.exposure * fall_off * linear(colour[0]);
            let noisy = light * (1.0 + 0.01 * noise(self.seed + index, k as u64))
                + 0.001 * noise(self.seed ^ index, !(k as u64));
            let byte = levels.partition_point(|level| *level < noisy).min(255);
            levels[byte] as f32
        };
        frame.colour.iter().enumerate().map(pixel).collect()
    }

    /// Twelve pictures on the way along the wall, at poses that err by a millimetre or so.
    fn mosaic(&self, texels: &[Texel]) -> Mosaic {
        let mut mosaic = Mosaic::new(texels.to_vec());
        let axes = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
        for k in 0..12_u64 {
            let eye = Vector3::new(-0.7, 0.15 * (k % 6) as f64 - 0.375, if k < 6 { 0.25 } else { 0.55 });
            let pose = Isometry3::from_parts(eye.into(), UnitQuaternion::from_matrix(&axes));
            let camera =
                Camera { fx: 229.0, fy: 229.0, cx: 187.5, cy: 119.5, width: 376, height: 240, world_from_camera: pose };
            let light = self.picture(k, &camera);
            let err = |which: u64| 1e-3 * noise(self.seed + 77, 10 * k + which);
            let wrong = Isometry3::from_parts(
                Vector3::new(err(0), err(1), err(2)).into(),
                UnitQuaternion::from_scaled_axis(Vector3::new(err(3), err(4), err(5)) * 0.5),
            );
            let camera = Camera { world_from_camera: wrong * pose, ..camera };
            let seen = mosaic.add(&Picture { camera, light: &light }, self.wall, 2).unwrap();
            assert!(seen > 1000, "{seen}");
        }
        mosaic
    }
}

/// Strokes along y, of more paint from one to the next, and bare wall between them and on top.
fn strokes(wall: &TriangleSurface, texels: &[Texel]) -> (Film, Vec<bool>) {
    let mut film = Film::new(texels.to_vec()).unwrap();
    let spray = SprayModel { sigma: 0.05_f64.atan(), cut: 4.0, ..SprayModel::default() };
    for (stroke, peak) in [3e-6, 8e-6, 14e-6, 20e-6].into_iter().enumerate() {
        let z = 0.08 + 0.15 * stroke as f64;
        // A line of spots 1 cm apart and 2.5 cm wide: its peak is their volume over the spacing and sqrt(2 pi) deviations.
        let volume = peak * 0.01 * std::f64::consts::TAU.sqrt() * 0.025;
        let shot =
            |k: usize| Shot { origin: Point3::new(-0.5, 0.01 * k as f64 - 0.4, z), axis: Vector3::x_axis(), volume };
        film.deposit(&(0..80).map(shot).collect::<Vec<_>>(), &spray, wall, 2, &mut |_, _| ()).unwrap();
    }
    let bare = texels.iter().map(|texel| texel.point.z > 0.68 || texel.point.y.abs() > 0.53).collect();
    (film, bare)
}

/// Root mean square error over the root mean square of the truth, of texels with at least a tenth of a unit of paint; how many of those are
/// told; largest thickness that is told of bare wall.
fn judge(film: &Film, bare: &[bool], told: &[Option<FilmEstimate>]) -> (f64, f64, f64) {
    let (mut errors, mut squares, mut count, mut painted, mut bare_most) = (0.0, 0.0, 0, 0, 0.0_f64);
    for (k, told) in told.iter().enumerate() {
        let truth = film.thickness(k);
        if let Some(told) = told
            && bare[k]
        {
            bare_most = bare_most.max(told.thickness);
        }
        if truth < 0.1 * UNIT {
            continue;
        }
        painted += 1;
        if let Some(told) = told.filter(|told| !told.opaque) {
            count += 1;
            errors += (told.thickness - truth).powi(2);
            squares += truth * truth;
        }
    }
    ((errors / squares).sqrt(), f64::from(count) / f64::from(painted), bare_most)
}

fn lights(towards_sun: Vector3<f64>) -> Lights {
    Lights {
        towards_sun: UnitVector3::new_normalize(towards_sun),
        sun: [0.9; 3],
        ambient: [0.35; 3],
        ..Lights::default()
    }
}

/// The bound is the goal: a tenth, lit by a low sun.
#[test]
fn the_film_is_told_from_pictures_in_low_sun() {
    let wall = wall();
    let texels = texels(&wall);
    let (film, bare) = strokes(&wall, &texels);
    let paint = GreyPaint::at(&PaintName::Charcoal.paint(UNIT).unwrap(), 550.0);
    // Fifteen degrees above the horizon, from far aside: relief throws shadows.
    let low = lights(Vector3::new(-0.6, 0.9, 0.29));
    let scene = Scene { wall: &wall, film: &film.layer(), paint, lights: low.clone(), exposure: 0.9, seed: 5 };
    let before = scene.mosaic(&texels);
    let sun_moved = lights(Vector3::new(-0.7, 0.8, 0.35));
    for (name, lights, most) in [("same sun", low, 0.1), ("later", sun_moved, 0.15)] {
        let after = Scene { film: &film, lights, exposure: 0.7, seed: 900, ..scene }.mosaic(&texels);
        let told = estimate_film(&before, &after, Some(&bare), &paint, GROUND).unwrap();
        let (error, share, bare_most) = judge(&film, &bare, &told);
        println!("{name}: error {error:.4}, told {share:.4}, bare {:.2} um", 1e6 * bare_most);
        assert!(error <= most && share > 0.9, "{name}: {error} {share}");
    }
    // Where nothing stayed bare, the light has to be the same.
    let after = Scene { film: &film, seed: 900, ..scene }.mosaic(&texels);
    let (error, ..) = judge(&film, &bare, &estimate_film(&before, &after, None, &paint, GROUND).unwrap());
    assert!(error <= 0.1, "{error}");
}

#[test]
fn what_cannot_be_told_is_refused() {
    let wall = wall();
    let texels = texels(&wall);
    let paint = GreyPaint::at(&PaintName::Charcoal.paint(UNIT).unwrap(), 550.0);
    let unseen = Mosaic::new(texels.clone());
    let bare = vec![true; texels.len()];
    let error = estimate_film(&unseen, &unseen, Some(&bare), &paint, GROUND).unwrap_err();
    assert!(matches!(error, Error::WrongLength { found: 0, .. }), "{error}");
    let short = estimate_film(&unseen, &Mosaic::new(texels[1..].to_vec()), Some(&bare), &paint, GROUND).unwrap_err();
    assert!(short.to_string().contains("texels of the mosaic after"), "{short}");
    let camera =
        Camera::looking_at(&Point3::new(-1.0, 0.0, 0.4), &Point3::new(0.0, 0.0, 0.4), &Vector3::z(), 1.0, (4, 3))
            .unwrap();
    let mut mosaic = unseen.clone();
    assert!(matches!(mosaic.add(&Picture { camera, light: &[0.5; 11] }, &wall, 1), Err(Error::WrongLength { .. })));
    assert!(matches!(mosaic.add(&Picture { camera, light: &[f32::NAN; 12] }, &wall, 1), Err(Error::NotFinite { .. })));
}
