//! Elliptic and off-axis sprays against closed forms and sums over planes.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use paint_sim::droplets::{Droplets, Nozzle, StepHits, TexelFace, TexelSurface};
use paint_sim::{Error, Film, Shot, SprayModel, Texel};

use crate::deposit::{far_plate, tilted_plane};

fn fan() -> SprayModel {
    let sigma = 5.0_f64.to_radians();
    SprayModel { sigma, cut: 2.5, aspect: 2.0, turn: 0.6, yaw: 0.06, pitch: -0.04, ..SprayModel::default() }
}

fn random() -> impl FnMut(f64, f64) -> f64 {
    let mut state = 23_u64;
    move |low, high| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn unit(vector: Vector3<f64>) -> UnitVector3<f64> {
    UnitVector3::new_normalize(vector)
}

/// The density of a nozzle in the origin that sprays along x, left is y and up is z, on a plane that faces it, written down once more.
fn expected(spray: &SprayModel, point: &Point3<f64>) -> f64 {
    let (y, z) = (point.y / point.x - spray.yaw.tan(), point.z / point.x - spray.pitch.tan());
    let (long, short) = (spray.sigma.tan() * spray.aspect.sqrt(), spray.sigma.tan() / spray.aspect.sqrt());
    let along = (y * spray.turn.cos() + z * spray.turn.sin()) / long;
    let across = (z * spray.turn.cos() - y * spray.turn.sin()) / short;
    let square = along * along + across * across;
    let kept = 1.0 - (-0.5 * spray.cut * spray.cut).exp();
    if square > spray.cut * spray.cut {
        return 0.0;
    }
    let gaussian = (-0.5 * square).exp() / (2.0 * std::f64::consts::PI * long * short * kept);
    // Solid angle of a square metre, with the cosine of the incidence, per slope.
    let (r, z) = (point.coords.norm(), point.x);
    gaussian * (r / z).powi(3) * (z / r) / (r * r)
}

#[test]
fn an_ellipse_lies_where_the_nozzle_has_left_and_up() {
    let spray = fan();
    let at = Point3::new(0.1, 0.006, 0.001);
    let found = spray.density(&Point3::origin(), &Vector3::x_axis(), &at, &-Vector3::x_axis());
    assert!((found / expected(&spray, &at) - 1.0).abs() < 1e-12, "{found}");
    // The same nozzle turned about the vertical and moved, and one that looks up at a ceiling, whose up is where it came from.
    let world = Isometry3::from_parts(
        Translation3::new(1.0, -2.0, 0.5),
        UnitQuaternion::from_scaled_axis(Vector3::z() * 2.2) * UnitQuaternion::from_scaled_axis(Vector3::y() * 0.7),
    );
    let ceiling = Isometry3::rotation(-Vector3::y() * std::f64::consts::FRAC_PI_2);
    for pose in [world, ceiling] {
        let [axis, normal] = [Vector3::x(), -Vector3::x()].map(|v| unit(pose * v));
        let moved = spray.density(&(pose * Point3::origin()), &axis, &(pose * at), &normal);
        assert!((moved / found - 1.0).abs() < 1e-9, "{moved} {found}");
        let told = spray.density_from(&pose, &(pose * at), &normal);
        assert!((told / found - 1.0).abs() < 1e-9, "{told} {found}");
    }
    // A nozzle that rolls turns the ellipse and the jet with it.
    let roll = Isometry3::rotation(Vector3::x() * 0.9);
    let rolled = spray.density_from(&roll, &(roll * at), &-Vector3::x_axis());
    assert!((rolled / found - 1.0).abs() < 1e-12, "{rolled} {found}");
}

#[test]
fn an_ellipse_leaves_all_its_paint_on_a_plane() {
    let (spray, nozzle) = (fan(), Point3::new(0.0, 0.0, 0.0));
    for degrees in [0.0, 30.0, 60.0_f64] {
        let texels = tilted_plane(degrees.to_radians(), 0.1, 5e-4, 0.4);
        let density = |t: &Texel| spray.density(&nozzle, &Vector3::z_axis(), &t.point, &t.normal);
        let landed: f64 = texels.iter().map(|t| density(t) * t.area).sum();
        assert!((landed - 1.0).abs() < 1e-3, "{degrees}: {landed}");
        let mut film = Film::new(tilted_plane(degrees.to_radians(), 0.1, 3e-3, 0.4)).unwrap();
        let shot = Shot { origin: nozzle, axis: Vector3::z_axis(), volume: 1e-9 };
        let balance = film.deposit(&[shot], &spray, &far_plate(), 1, &mut |_, _| {}).unwrap();
        let share = balance.deposited as f64 / balance.emitted as f64;
        assert!(balance.balanced() && (share - 1.0).abs() < 3e-3, "{degrees}: {share}");
    }
}

#[test]
fn a_pass_of_an_ellipse_leaves_its_profile_across_the_pass() {
    // Along y over a wall at x = 0.1: the dose over z is the ellipse seen from the side.
    let spray = SprayModel { cut: 9.0, ..fan() };
    let (speed, flow, spacing, d) = (0.1, 1e-6, 1e-3, 0.1);
    let shot = |i: i32| Shot {
        origin: Point3::new(0.0, f64::from(i) * spacing, 0.0),
        axis: Vector3::x_axis(),
        volume: flow * spacing / speed,
    };
    let shots: Vec<Shot> = (-250..=250).map(shot).collect();
    let places = [-0.02, -0.004, 0.0, 0.015];
    let texel = |&z: &f64| Texel { point: Point3::new(d, 0.0, z), normal: -Vector3::x_axis(), area: 1e-8 };
    let mut film = Film::new(places.iter().map(texel).collect()).unwrap();
    film.deposit(&shots, &spray, &far_plate(), 1, &mut |_, _| {}).unwrap();
    let t = spray.sigma.tan();
    let side = t * (2.0 * spray.turn.sin().powi(2) + 0.5 * spray.turn.cos().powi(2)).sqrt();
    for (k, z) in places.iter().enumerate() {
        let off = (z / d - spray.pitch.tan()) / side;
        let dose = flow / (speed * d * side * std::f64::consts::TAU.sqrt()) * (-0.5 * off * off).exp();
        assert!((film.thickness(k) / dose - 1.0).abs() < 5e-4, "{z}: {} {dose}", film.thickness(k));
    }
}

#[test]
fn no_texel_of_an_ellipse_is_missed() {
    let mut uniform = random();
    let mut vector = || Vector3::from_fn(|_, _| uniform(-0.5, 0.5));
    let texels: Vec<Texel> =
        (0..3000).map(|_| Texel { point: Point3::from(vector()), normal: unit(vector()), area: 1e-6 }).collect();
    let mut wet = 0;
    for k in 0..40 {
        let aspect = [0.1, 0.7, 4.0, 15.0][k % 4];
        let [yaw, pitch] = [vector().x, vector().y];
        let spray =
            SprayModel { sigma: 0.15, aspect, turn: 7.0 * vector().x, yaw, pitch, range: 0.5, ..SprayModel::default() };
        let shot = Shot { origin: Point3::from(vector()), axis: unit(vector()), volume: 1e-9 };
        let mut film = Film::new(texels.clone()).unwrap();
        film.deposit(&[shot], &spray, &far_plate(), 1, &mut |_, _| {}).unwrap();
        for (texel, &volume) in texels.iter().zip(film.volumes()) {
            // Near the nozzle texels are subdivided, where the density at their centre is no oracle.
            if (texel.point - shot.origin).dot(&shot.axis) > 0.25 {
                let density = spray.density(&shot.origin, &shot.axis, &texel.point, &texel.normal);
                assert!((density * texel.area * 1e9 - volume as f64).abs() <= 1.0, "{spray:?} {density} {volume}");
                wet += usize::from(volume > 0);
            }
        }
    }
    assert!(wet > 200, "{wet}");
}

#[test]
fn coarse_texels_of_a_narrow_fan_are_integrated() {
    // Squares twice as wide as the fan's short deviation, which is a sixteenth of the long one.
    let spray = SprayModel { aspect: 16.0, sigma: 0.05, cut: 6.0, turn: 0.0, yaw: 0.0, pitch: 0.0, ..fan() };
    let step = 0.1 * spray.sigma.tan() / 2.0;
    let mut film = Film::new(tilted_plane(0.0, 0.1, step, 0.12)).unwrap();
    let shot = Shot { origin: Point3::origin(), axis: Vector3::z_axis(), volume: 1e-9 };
    let balance = film.deposit(&[shot], &spray, &far_plate(), 1, &mut |_, _| {}).unwrap();
    assert!(balance.deposited as f64 > 0.998 * balance.emitted as f64, "{balance:?}");
}

#[test]
fn the_default_spray_is_the_round_one_to_the_last_bit() {
    let (spray, mut uniform) = (SprayModel::default(), random());
    let t = 8.0_f64.to_radians().tan();
    let kept = -(-0.5 * 9.0_f64).exp_m1();
    for _ in 0..2000 {
        let origin = Point3::new(uniform(-1.0, 1.0), uniform(-1.0, 1.0), uniform(-1.0, 1.0));
        let axis = unit(Vector3::new(uniform(-1.0, 1.0), uniform(-1.0, 1.0), uniform(-1.0, 1.0)));
        let point = origin
            + axis.into_inner() * uniform(0.05, 0.5)
            + Vector3::new(uniform(-0.05, 0.05), uniform(-0.05, 0.05), uniform(-0.05, 0.05));
        let ray = point - origin;
        let depth = ray.dot(&axis);
        let slope_squared = (ray / depth - axis.into_inner()).norm_squared();
        let inside = slope_squared <= (3.0 * t) * (3.0 * t);
        let scale = 1.0 / (std::f64::consts::TAU * t * t * kept);
        let density = scale * (-0.5 / (t * t) * slope_squared).exp() * ray.dot(&axis) / (depth * depth * depth);
        let found = spray.density(&origin, &axis, &point, &-axis);
        assert_eq!(found, if inside { density } else { 0.0 });
    }
    let number = 5_u64;
    let steps = [0.7548776662466927, 0.5698402909980532];
    let mut slopes: Vec<[u32; 2]> = (0..256)
        .map(|k| {
            let at = (number * 256 + k) as f64 + 1.0;
            let [u, v] = steps.map(|step: f64| (0.5 + at * step).fract());
            let radius = t * (-2.0 * (-u * kept).ln_1p()).sqrt();
            let (sine, cosine) = (std::f64::consts::TAU * v).sin_cos();
            [((radius * cosine) as f32).to_bits(), ((radius * sine) as f32).to_bits()]
        })
        .collect();
    let mut found: Vec<[u32; 2]> =
        Droplets::new(&spray, 256, number).unwrap().slopes().map(|s| s.map(f32::to_bits)).collect();
    slopes.sort_unstable();
    found.sort_unstable();
    assert_eq!(found, slopes);
}

#[test]
fn droplets_follow_the_ellipse() {
    let spray = SprayModel { cut: 3.0, ..fan() };
    let slopes: Vec<[f64; 2]> = Droplets::new(&spray, 8192, 1).unwrap().slopes().map(|s| s.map(f64::from)).collect();
    let count = slopes.len() as f64;
    let mean = [0, 1].map(|k| slopes.iter().map(|s| s[k]).sum::<f64>() / count);
    let t = spray.sigma.tan();
    assert!((mean[0] - 0.06_f64.tan()).abs() < 2e-3 * t && (mean[1] + 0.04_f64.tan()).abs() < 2e-3 * t, "{mean:?}");
    let product =
        |a: usize, b: usize| slopes.iter().map(|s| (s[a] - mean[a]) * (s[b] - mean[b])).sum::<f64>() / count / (t * t);
    // A Gaussian cut at three deviations has this share of its variance.
    let share = 1.0 - 4.5 * (-4.5_f64).exp() / (1.0 - (-4.5_f64).exp());
    let (s, c) = 0.6_f64.sin_cos();
    let expected = [2.0 * c * c + 0.5 * s * s, 1.5 * s * c, 2.0 * s * s + 0.5 * c * c].map(|v| share * v);
    for (found, expected) in [product(0, 0), product(0, 1), product(1, 1)].into_iter().zip(expected) {
        assert!((found - expected).abs() < 5e-3, "{found} {expected}");
    }
}

#[test]
fn droplets_land_where_shots_do() {
    // A wall of 1 mm texels at x = 0.1 in tiles of 5 mm; the middle of the paint, by either way.
    let (spray, side) = (SprayModel { sigma: 0.03, ..fan() }, 80_usize);
    let half = side as f32 * 5e-4;
    let corner = |u: usize, v: usize| {
        let [u, v] = [u as f32, v as f32];
        ([0.1, half - u * 1e-3, half - v * 1e-3], [u, v])
    };
    let face = |c: [([f32; 3], [f32; 2]); 3]| TexelFace { corners: c.map(|c| c.0), texels: Some(c.map(|c| c.1)) };
    let tile = |k: usize| {
        let (u, v) = (k % 16 * 5, k / 16 * 5);
        let [a, b, c, d] = [corner(u, v), corner(u, v + 5), corner(u + 5, v + 5), corner(u + 5, v)];
        [face([a, b, c]), face([a, c, d])]
    };
    let tiles: Vec<TexelFace> = (0..256).flat_map(tile).collect();
    let wall = TexelSurface::new(&tiles, [side, side], &vec![1e-6; side * side]).unwrap();
    let nozzle = Nozzle { origin: Point3::origin(), axis: Vector3::x_axis(), up: Vector3::z_axis() };
    let hits = StepHits::cast(&wall, &nozzle, &Droplets::new(&spray, 1 << 14, 0).unwrap());
    assert_eq!(hits.missed, 0);
    let place = |k: usize| [k % side, k / side].map(|at| f64::from(half) - at as f64 * 1e-3 - 5e-4);
    let middle = |paint: &[(usize, f64)]| {
        let total: f64 = paint.iter().map(|(_, v)| v).sum();
        let sum = |f: &dyn Fn([f64; 2]) -> f64| paint.iter().map(|(k, v)| v * f(place(*k))).sum::<f64>() / total;
        [sum(&|p| p[0]), sum(&|p| p[1]), sum(&|p| p[0] * p[1])]
    };
    let cast: Vec<(usize, f64)> = hits.texels.iter().map(|&(k, n)| (k as usize, f64::from(n))).collect();
    let texel =
        |k: usize| Texel { point: Point3::new(0.1, place(k)[0], place(k)[1]), normal: -Vector3::x_axis(), area: 1e-6 };
    let film = Film::new((0..side * side).map(texel).collect()).unwrap();
    let shot = Shot { origin: Point3::origin(), axis: Vector3::x_axis(), volume: 1e-9 };
    let shares = film.shares(&[shot], &spray, &far_plate(), 1).unwrap();
    let sprayed: Vec<(usize, f64)> = shares[0].iter().map(|&(k, share)| (k as usize, share)).collect();
    let [one, two] = [middle(&cast), middle(&sprayed)];
    assert!((one[0] - 0.1 * 0.06_f64.tan()).abs() < 5e-5, "{one:?}");
    for k in 0..3 {
        assert!((one[k] - two[k]).abs() < [5e-5, 5e-5, 5e-7][k], "{one:?} {two:?}");
    }
}

#[test]
fn shapes_that_are_no_ellipse_are_refused() {
    let refused = |spray: SprayModel| match Droplets::new(&spray, 64, 0) {
        Err(Error::OutOfRange { what, .. }) => what,
        other => panic!("{other:?}"),
    };
    let good = SprayModel::default();
    assert_eq!(refused(SprayModel { aspect: 0.0, ..good }), "spray.aspect");
    assert_eq!(refused(SprayModel { turn: f64::NAN, ..good }), "spray.turn");
    assert_eq!(refused(SprayModel { yaw: 1.6, ..good }), "spray.yaw");
    assert_eq!(refused(SprayModel { pitch: f64::INFINITY, ..good }), "spray.pitch");
}
