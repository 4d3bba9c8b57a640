//! Sun, sky and lamps against closed forms, published values and other programs.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};
use paint_sim::colour::encode_srgb8;
use paint_sim::render::{Frame, Lamp, Lights, Shading, Sky, SunPosition, black_body, sunlight};
use paint_sim::{Camera, Error, TriangleSurface, render};

const SIDE: u32 = 33;

/// A camera at the origin that looks along z, and what it sees of white surfaces.
fn seen(positions: &[[f32; 3]], faces: &[[u32; 3]], lights: &Lights, threads: usize) -> Frame {
    let surface = TriangleSurface::new(positions, faces).unwrap();
    let middle = 0.5 * (f64::from(SIDE) - 1.0);
    let world_from_camera = Isometry3::identity();
    let camera = Camera { fx: 20.0, fy: 20.0, cx: middle, cy: middle, width: SIDE, height: SIDE, world_from_camera };
    render(&surface, &camera, &|hit| Shading::matt([1.0; 3], hit.normal), lights, 1, threads).unwrap()
}

/// A wall in the plane z = 2.
const WALL: [[f32; 3]; 4] = [[-9.0, -9.0, 2.0], [9.0, -9.0, 2.0], [9.0, 9.0, 2.0], [-9.0, 9.0, 2.0]];
const WALL_FACES: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];

fn towards(elevation: f64, azimuth: f64) -> UnitVector3<f64> {
    let (up, level) = elevation.to_radians().sin_cos();
    let (sine, cosine) = azimuth.to_radians().sin_cos();
    UnitVector3::new_normalize(Vector3::new(level * cosine, level * sine, up))
}

/// Directions all over the sphere.
fn directions() -> Vec<Vector3<f64>> {
    let ring = |k: i32| (0..12).map(move |j| towards(15.0 * f64::from(k), 30.0 * f64::from(j) + 7.0).into_inner());
    (-6..=6).flat_map(ring).collect()
}

fn near(found: f32, expected: f64, share: f64) -> bool {
    (f64::from(found) - expected).abs() <= share * expected.abs()
}

/// `astropy` 7 (without refraction), and the example of Reda and Andreas 2004, table A5.1.
#[test]
fn the_sun_stands_where_others_have_it() {
    let cases = [
        (1_066_419_030.0, 39.742_476, -105.1786, 194.3402, 39.8720),
        (1_782_036_000.0, 47.4, 8.5, 136.1639, 60.3180),
        (1_797_866_400.0, 47.4, 8.5, 231.8562, 1.5670),
        (921_952_800.0, -33.9, 151.2, 108.4202, -24.9788),
        (2_230_081_200.0, 64.1, -21.9, 23.8198, -15.7407),
        (1_796_018_400.0, -0.2, 36.8, 117.1407, 36.4777),
    ];
    for (time, latitude, longitude, azimuth, elevation) in cases {
        let sun = SunPosition::new(time, f64::to_radians(latitude), f64::to_radians(longitude)).unwrap();
        let off = [sun.azimuth.to_degrees() - azimuth, sun.elevation.to_degrees() - elevation];
        assert!(off.iter().all(|off| off.abs() < 0.03), "{time}: {off:?} degrees");
        // x east, y north, z up.
        let expected = towards(elevation, 90.0 - azimuth);
        assert!(sun.direction().dot(&expected) > 1.0 - 1e-6);
    }
    for [time, latitude, longitude] in
        [[f64::NAN, 0.0, 0.0], [-1e9, 0.0, 0.0], [0.0, 1.6, 0.0], [0.0, f64::NAN, 0.0], [0.0, 0.0, 7.0]]
    {
        assert!(matches!(SunPosition::new(time, latitude, longitude), Err(Error::OutOfRange { .. })));
    }
}

/// CIE x and y of linear sRGB (IEC 61966-2-1).
fn chromaticity(rgb: [f32; 3]) -> [f64; 2] {
    let [r, g, b] = rgb.map(f64::from);
    let x = 0.4124564 * r + 0.3575761 * g + 0.1804375 * b;
    let y = 0.2126729 * r + 0.7151522 * g + 0.072175 * b;
    let z = 0.0193339 * r + 0.119192 * g + 0.9503041 * b;
    [x / (x + y + z), y / (x + y + z)]
}

fn luminance(rgb: [f32; 3]) -> f64 {
    let [r, g, b] = rgb.map(f64::from);
    0.2126729 * r + 0.7151522 * g + 0.072175 * b
}

/// Points of the Planckian locus: illuminant A (CIE 015), and Wyszecki and Stiles 1982 for 4000, 6500 and 10000 K.
#[test]
fn light_of_a_temperature_has_its_chromaticity() {
    for (temperature, x, y) in
        [(2856.0, 0.4476, 0.4074), (4000.0, 0.3805, 0.3768), (6500.0, 0.3135, 0.3237), (10_000.0, 0.2807, 0.2884)]
    {
        let light = black_body(temperature).unwrap();
        let [found_x, found_y] = chromaticity(light);
        assert!((found_x - x).abs() < 7e-4 && (found_y - y).abs() < 7e-4, "{temperature} K: {found_x} {found_y}");
        assert!((luminance(light) - 1.0).abs() < 1e-3);
    }
    for bad in [f64::NAN, 0.0, 999.0, 1e9] {
        assert!(matches!(black_body(bad), Err(Error::OutOfRange { .. })));
    }
}

/// The formulas in another program (numpy), with the table of ozone at its own wavelengths: linear sRGB over π, cd/m².
#[test]
fn sunlight_reddens_and_fades_with_the_air_mass() {
    for (elevation, turbidity, expected) in [
        (60.0, 2.0, [35_499.97, 30_478.73, 26_677.64]),
        (30.0, 3.0, [26_037.87, 20_416.07, 14_953.40]),
        (6.0, 2.5, [6390.917, 3088.184, 777.4214]),
        (0.0, 2.0, [75.196, 3.352, 0.0]),
    ] {
        let found = sunlight(&towards(elevation, 10.0), turbidity).unwrap();
        assert!((0..3).all(|c| near(found[c], expected[c], 2e-3)), "{elevation}: {found:?}");
    }
    // A sun without air lights 128 kilolux in the mean of the year (Illuminating Engineering Society: 127.5).
    for (turbidity, elevation) in [(f64::NAN, 30.0), (1.0, 30.0), (11.0, 30.0), (3.0, -1.0), (3.0, f64::NAN)] {
        let sun = UnitVector3::new_unchecked(Vector3::new(1.0, 0.0, f64::to_radians(elevation).sin()));
        assert!(matches!(sunlight(&sun, turbidity), Err(Error::OutOfRange { .. })));
        assert!(matches!(Sky::clear(&sun, turbidity, 0.2), Err(Error::OutOfRange { .. })));
    }
}

/// The formulas in another program (numpy): luminance, kcd/m², x and y.
#[test]
fn a_clear_sky_has_the_colours_of_its_authors() {
    for (turbidity, sun_zenith, zenith, azimuth, expected) in [
        (3.0, 40.0, 30.0, 0.0, [19.10397, 0.27038, 0.27860]),
        (2.5, 84.0, 60.0, 90.0, [3.80484, 0.28208, 0.30314]),
        (6.0, 60.0, 80.0, 180.0, [6.16229, 0.32945, 0.34141]),
    ] {
        let sky = Sky::clear(&towards(90.0 - sun_zenith, 25.0), turbidity, 0.2).unwrap();
        let light = sky.radiance(&towards(90.0 - zenith, 25.0 + azimuth));
        let [x, y] = chromaticity(light);
        assert!((1e-3 * luminance(light) / expected[0] - 1.0).abs() < 1e-4, "{light:?}");
        assert!((x - expected[1]).abs() < 1e-4 && (y - expected[2]).abs() < 1e-4, "{x} {y}");
        // The same on both sides of the sun, seen and as a light.
        for turn in [10.0, 70.0, 140.0] {
            let [left, right] = [-turn, turn].map(|turn| towards(20.0, 25.0 + turn));
            for (left, right) in
                [(sky.radiance(&left), sky.radiance(&right)), (sky.on_white(&left), sky.on_white(&right))]
            {
                assert!((0..3).all(|c| near(left[c], f64::from(right[c]), 1e-4)), "{left:?} {right:?}");
            }
        }
    }
}

/// Closed forms: even light of 1 shows as 1; under the covered sky 7/9 of the zenith upwards, and on a wall 3/14 + 4/(7π) of that from above
/// the horizon.
#[test]
fn a_surface_has_the_irradiance_of_the_sky() {
    let even = Sky::uniform([1.0; 3]).unwrap();
    for normal in directions() {
        assert!(even.on_white(&normal).iter().all(|c| near(*c, 1.0, 1e-3)), "{normal}");
        assert_eq!(even.radiance(&normal), [1.0; 3]);
    }
    let covered = Sky::overcast(900.0, 0.0).unwrap();
    let (up, wall) = (luminance(covered.on_white(&Vector3::z())), luminance(covered.on_white(&Vector3::x())));
    // Two orders leave an error of a hundredth (Ramamoorthi and Hanrahan 2001).
    assert!((up / 700.0 - 1.0).abs() < 0.02, "{up}");
    let expected = 700.0 * (3.0 / 14.0 + 4.0 / (7.0 * PI));
    assert!((wall / expected - 1.0).abs() < 0.03, "{wall} instead of {expected}");
    assert!((luminance(covered.radiance(&Vector3::x())) / 300.0 - 1.0).abs() < 1e-3);
    // A ground of albedo 0.5 shows half of what comes down.
    let ground = Sky::overcast(900.0, 0.5).unwrap().radiance(&-Vector3::z());
    assert!((luminance(ground) / 350.0 - 1.0).abs() < 0.02, "{ground:?}");
    // Brute force over the upper half of the clear sky, no ground.
    let sun = towards(40.0, 0.0);
    let clear = Sky::clear(&sun, 3.0, 0.0).unwrap();
    for normal in [towards(90.0, 0.0), towards(0.0, 0.0), towards(20.0, 180.0)] {
        let (mut sum, rings, sectors) = (0.0, 200, 400);
        for k in 0..rings * sectors {
            let z: f64 = (f64::from(k / sectors) + 0.5) / f64::from(rings);
            let direction = towards(z.asin().to_degrees(), 360.0 * f64::from(k % sectors) / f64::from(sectors));
            sum += normal.dot(&direction).max(0.0) * luminance(clear.radiance(&direction));
        }
        let expected = 2.0 * sum / f64::from(rings * sectors);
        let found = luminance(clear.on_white(&normal));
        assert!((found / expected - 1.0).abs() < 0.06, "{normal:?}: {found} instead of {expected}");
    }
    assert!(Sky::uniform([f32::NAN; 3]).is_err() && Sky::overcast(-1.0, 0.2).is_err());
    assert!(Sky::overcast(1e3, 1.5).is_err() && Sky::clear(&sun, 3.0, f64::NAN).is_err());
}

/// White furnace: in even light a white surface cannot be told from it; the sky is seen beside it.
#[test]
fn nothing_is_seen_in_a_furnace() {
    let lights = Lights { exposure: 0.5, ..Lights::without_sun(Sky::uniform([1.0; 3]).unwrap(), Vec::new()) };
    let slanted = [[-0.5, -0.5, 2.0], [0.5, -0.7, 2.5], [0.3, 0.6, 1.5]];
    let frame = seen(&slanted, &[[0, 1, 2]], &lights, 1);
    assert!(frame.faces.contains(&0) && frame.faces.contains(&u32::MAX));
    assert!(frame.colour.iter().flatten().all(|c| c.abs_diff(encode_srgb8(0.5).0) <= 1));
}

/// Inverse square and cosine on a plane, and the shadow of a plate before the lamp.
#[test]
fn lamps_light_by_distance_and_cosine_and_throw_shadows() {
    let lamps = [([0.3, -0.2, 1.0], [0.5, 0.3, 0.1]), ([1.3, 0.2, 1.0], [0.1, 0.2, 0.4])];
    let lamp = |(position, light): ([f64; 3], [f32; 3])| Lamp { position: position.into(), light };
    let lights = Lights::without_sun(Sky::uniform([0.0; 3]).unwrap(), lamps.map(lamp).into());
    let mut positions = WALL.to_vec();
    positions.extend([[0.5, -9.0, 1.5], [0.8, -9.0, 1.5], [0.8, 9.0, 1.5], [0.5, 9.0, 1.5]]);
    let frame = seen(&positions, &[[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]], &lights, 1);
    let mut shaded = [0; 2];
    for (k, colour) in frame.colour.iter().enumerate().filter(|(k, _)| frame.faces[*k] < 2) {
        let (u, v) = ((k % SIDE as usize) as f64 - 16.0, (k / SIDE as usize) as f64 - 16.0);
        let (x, y) = (u / 10.0, v / 10.0);
        // The lamps' rays cross the plate half way to the wall.
        let crossings = lamps.map(|([across, ..], _)| 0.5 * (across + x));
        if crossings.iter().any(|crossing| (crossing - 0.5).abs() < 1e-3 || (crossing - 0.8).abs() < 1e-3) {
            continue;
        }
        let mut expected = [0.0; 3];
        for (k, ([across, up, _], light)) in lamps.into_iter().enumerate() {
            if (0.5..0.8).contains(&crossings[k]) {
                shaded[k] += 1;
                continue;
            }
            let shine = Vector3::new(across - x, up - y, -1.0).norm().powi(-3);
            expected = std::array::from_fn(|c| expected[c] + f64::from(light[c]) * shine);
        }
        for c in 0..3 {
            let code = encode_srgb8(expected[c]).0;
            assert!(colour[c].abs_diff(code) <= 1, "{x} {y}: {} instead of {code}", colour[c]);
        }
    }
    assert!(shaded.iter().all(|shaded| *shaded > 30), "{shaded:?}");
    // 4π² lumens from everywhere: π candela, and 1 cd/m² of a white surface 1 m away.
    let warm = Lamp::new(Point3::origin(), 4.0 * PI * PI, 2856.0).unwrap();
    assert!((luminance(warm.light) - 1.0).abs() < 1e-3);
    assert!(Lamp::new(Point3::origin(), f64::NAN, 3000.0).is_err() && Lamp::new(Point3::origin(), 1.0, 0.0).is_err());
}

#[test]
fn a_white_card_is_exposed_and_what_clips_is_counted() {
    let lights = Lights::daylight(towards(35.0, -90.0), 3.0, 0.2).unwrap();
    let point = Point3::new(0.0, 0.0, 2.0);
    let exposed = lights.exposed_at(&point, 0.9).unwrap();
    let card = exposed.on_card(&point, &exposed.towards_sun);
    assert!((card.into_iter().fold(0.0, f32::max) - 0.9).abs() < 1e-5, "{card:?}");
    // Once more changes nothing.
    let again = exposed.clone().exposed_at(&point, 0.9).unwrap();
    assert!((again.exposure / exposed.exposure - 1.0).abs() < 1e-5);

    // Even light of 2 clips the wall's pixels and those beside it; of 1 none.
    for (level, share) in [(2.0, 1.0), (0.99, 0.0)] {
        let lights = Lights { ambient: [level; 3], sun: [0.0; 3], background: [0.0; 3], ..Lights::default() };
        let frame = seen(&WALL, &WALL_FACES, &lights, 1);
        assert_eq!(frame.clipped, (share * frame.colour.len() as f64) as usize);
    }
    let dark = Lights::without_sun(Sky::uniform([0.0; 3]).unwrap(), Vec::new());
    assert!(dark.exposed_at(&point, 0.9).is_err());
    assert!(Lights::default().exposed_at(&point, f32::NAN).is_err());
}

#[test]
fn threads_do_not_matter_and_bad_lights_are_refused() {
    let lamp = Lamp::new(Point3::new(0.5, 0.5, 1.0), 1000.0, 3000.0).unwrap();
    let mut lights = Lights::daylight(towards(30.0, -100.0), 4.0, 0.3).unwrap();
    lights.lamps = vec![lamp];
    let lights = lights.exposed_at(&Point3::new(0.0, 0.0, 2.0), 0.9).unwrap();
    let frame = seen(&WALL, &WALL_FACES, &lights, 1);
    assert!((2..5).all(|threads| seen(&WALL, &WALL_FACES, &lights, threads) == frame));

    let surface = TriangleSurface::new(&WALL, &WALL_FACES).unwrap();
    let camera =
        Camera::looking_at(&Point3::origin(), &Point3::new(0.0, 0.0, 2.0), &Vector3::y(), 1.0, (4, 4)).unwrap();
    let refused = |lights: Lights| {
        render(&surface, &camera, &|hit| Shading::matt([1.0; 3], hit.normal), &lights, 1, 1).unwrap_err()
    };
    let broken = Lamp { position: Point3::new(f64::NAN, 0.0, 0.0), ..lamp };
    assert_eq!(
        refused(Lights { lamps: vec![lamp, broken], ..Lights::default() }),
        Error::NotFinite { what: "lamp", index: 1 }
    );
    assert!(matches!(refused(Lights { exposure: f32::NAN, ..Lights::default() }), Error::OutOfRange { .. }));
    assert!(matches!(refused(Lights { sun: [f32::NAN; 3], ..Lights::default() }), Error::NotFinite { .. }));
}
