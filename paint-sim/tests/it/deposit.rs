//! Spray on texels: closed forms, balance, shadows, threads.

use nalgebra::{Point3, UnitVector3, Vector3};
use paint_sim::film::MassBalance;
use paint_sim::spray::QUANTUM;
use paint_sim::{Error, Film, Shot, SprayModel, Texel, TriangleSurface};

fn unit(x: f64, y: f64, z: f64) -> UnitVector3<f64> {
    UnitVector3::new_normalize(Vector3::new(x, y, z))
}

/// Two triangles in z = `height`, `size` metres to each side of the axis, cut off at x = `from`.
fn plate(height: f32, from: f32, size: f32) -> ([[f32; 3]; 4], [[u32; 3]; 2]) {
    ([[from, -size, height], [size, -size, height], [size, size, height], [from, size, height]], [[0, 1, 2], [0, 2, 3]])
}

/// A surface that is never in the way.
pub(crate) fn far_plate() -> TriangleSurface {
    let (positions, faces) = plate(-50.0, -1.0, 1.0);
    TriangleSurface::new(&positions, &faces).unwrap()
}

/// Square texels of side `step` on the plane through (0, 0, d), tilted by `tilt` about y, as seen from a nozzle at the
/// origin that sprays along z.
pub(crate) fn tilted_plane(tilt: f64, d: f64, step: f64, half: f64) -> Vec<Texel> {
    let (s, c) = tilt.sin_cos();
    let n = (half / step) as i32;
    let place = |i: i32, j: i32| {
        let (u, v) = (f64::from(i) * step, f64::from(j) * step);
        Texel { point: Point3::new(u * c, v, d + u * s), normal: unit(s, 0.0, -c), area: step * step }
    };
    (-n..=n).flat_map(|i| (-n..=n).map(move |j| place(i, j))).collect()
}

pub(crate) fn shot(x: f64, y: f64, volume: f64) -> Shot {
    Shot { origin: Point3::new(x, y, 0.0), axis: unit(0.0, 0.0, 1.0), volume }
}

fn spray(
    film: &mut Film,
    shots: &[Shot],
    model: &SprayModel,
    surface: &TriangleSurface,
    threads: usize,
) -> MassBalance {
    film.deposit(shots, model, surface, threads, &mut |_, _| {}).unwrap()
}

/// A whole Gaussian: the cut leaves 2e-22 of it.
fn uncut() -> SprayModel {
    SprayModel { cut: 10.0, ..SprayModel::default() }
}

#[test]
fn density_on_tilted_planes() {
    // Sigma 8 degrees, 10 cm, unit volume: values by an independent evaluation, checked there by Monte Carlo.
    let expected =
        [(0.0, [805.78, 587.21, 559.63]), (30.0, [697.82, 479.14, 616.58]), (60.0, [402.89, 282.11, 499.87])];
    for (degrees, values) in expected {
        let (s, c) = f64::to_radians(degrees).sin_cos();
        for ((u, v), value) in [(0.0, 0.0), (0.01, 0.005), (-0.012, 0.0)].into_iter().zip(values) {
            let point = Point3::new(u * c, v, 0.1 + u * s);
            let density = uncut().density(&Point3::origin(), &unit(0.0, 0.0, 1.0), &point, &unit(s, 0.0, -c));
            assert!((density / value - 1.0).abs() < 1.3e-5, "{degrees} {u}: {density} instead of {value}");
        }
    }
}

#[test]
fn all_paint_lands_on_a_plane_whatever_its_tilt() {
    // A cone wider than 1.8 sigmas would not be closed by the plane of 75 degrees.
    for (degrees, cut, step) in [(0.0, 3.0, 3e-3), (30.0, 3.0, 3e-3), (60.0, 3.0, 3e-3), (75.0_f64, 1.5, 1e-3)] {
        let model = SprayModel { cut, range: 5.0, ..SprayModel::default() };
        let mut texels = tilted_plane(degrees.to_radians(), 0.1, step, 0.4);
        texels.retain(|texel| texel.point.y.abs() < 0.17);
        let mut film = Film::new(texels).unwrap();
        let balance = spray(&mut film, &[shot(0.0, 0.0, 1e-9)], &model, &far_plate(), 1);
        let share = balance.deposited as f64 / balance.emitted as f64;
        assert!((share - 1.0).abs() < 1e-3, "{degrees}: {share}");
        assert!(balance.balanced() && balance.emitted == 1_000_000_000);
        assert_eq!(film.volumes().iter().sum::<u64>(), balance.deposited);
    }
}

#[test]
fn a_straight_pass_leaves_the_line_dose() {
    // 0.1 m/s over 0.4 m at 10 cm: dose(y) = Q/(v d t sqrt(2 pi)) exp(-y^2/(2 d^2 t^2)); the centre gets 283.862 Q.
    let (speed, flow, spacing) = (0.1, 1e-6, 1e-3);
    let shots: Vec<Shot> = (-200..=200).map(|i| shot(f64::from(i) * spacing, 0.0, flow * spacing / speed)).collect();
    let offsets = [0.0, 0.01, 0.02, 0.03];
    let texel = |&y: &f64| Texel { point: Point3::new(0.0, y, 0.1), normal: unit(0.0, 0.0, -1.0), area: 1e-8 };
    let mut film = Film::new(offsets.iter().map(texel).collect()).unwrap();
    let balance = spray(&mut film, &shots, &uncut(), &far_plate(), 2);
    assert!(balance.balanced());
    let deviation = 0.1 * 8.0_f64.to_radians().tan();
    for (i, y) in offsets.iter().enumerate() {
        let dose = 283.862 * flow * (-0.5 * (y / deviation).powi(2)).exp();
        // The texels are tiny, so whole femtolitres matter a little.
        assert!((film.thickness(i) / dose - 1.0).abs() < 2e-4, "{y}: {} instead of {dose}", film.thickness(i));
    }
}

#[test]
fn coarse_texels_are_integrated() {
    // One square of 4 cm at 10 cm catches erf(0.02 / (sqrt(2) 0.1 tan 8 deg))^2 of the paint (erf from Python's math).
    let texel = Texel { point: Point3::new(0.0, 0.0, 0.1), normal: unit(0.0, 0.0, -1.0), area: 0.04 * 0.04 };
    let mut film = Film::new(vec![texel]).unwrap();
    let balance = spray(&mut film, &[shot(0.0, 0.0, 1e-9)], &uncut(), &far_plate(), 1);
    let share = balance.deposited as f64 / balance.emitted as f64;
    assert!((share / ERF_SQUARED - 1.0).abs() < 2e-3, "{share}");
}
const ERF_SQUARED: f64 = 0.7145072034719534;

#[test]
fn texels_of_all_sizes_catch_their_part_of_the_gaussian() {
    let deviation = 0.1 * 8.0_f64.to_radians().tan();
    // Simpson's rule of 2000 parts, in deviations.
    let part = |low: f64, high: f64| {
        let (step, gauss) = ((high - low) / 2000.0, |x: f64| (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt());
        let inner = (1..2000).map(|k| f64::from(2 + 2 * (k % 2)) * gauss(low + step * f64::from(k))).sum::<f64>();
        (gauss(low) + inner + gauss(high)) * step / 3.0
    };
    for (size, bound) in
        [(0.2, 1e-5), (0.35, 5e-5), (0.5, 2e-4), (0.51, 2e-5), (0.8, 5e-5), (1.0, 1e-4), (1.01, 5e-5), (2.9, 1e-4)]
    {
        for (x, y) in [(0.0, 0.0), (1.0, -0.5), (2.0, 1.0), (-0.3, 2.5)] {
            let texel = Texel {
                point: Point3::new(x * deviation, y * deviation, 0.1),
                normal: unit(0.0, 0.0, -1.0),
                area: (size * deviation).powi(2),
            };
            let film = Film::new(vec![texel]).unwrap();
            let shares = film.shares(&[shot(0.0, 0.0, 1e-9)], &uncut(), &far_plate(), 1).unwrap();
            let expected = part(x - 0.5 * size, x + 0.5 * size) * part(y - 0.5 * size, y + 0.5 * size);
            let error = shares[0][0].1 / expected - 1.0;
            assert!(error.abs() < bound, "{size} deviations at {x} {y}: {error}");
        }
    }
}

#[test]
fn a_texel_at_the_rim_catches_what_its_corner_catches() {
    // The spot of 3 sigmas ends 42.2 mm from the axis. On the diagonal, a square of 4 cm around a place 24 mm farther out reaches 4 mm into it.
    let across = (0.1 * 3.0 * 8.0_f64.to_radians().tan() + 0.024) / 2.0_f64.sqrt();
    let texel = Texel { point: Point3::new(across, across, 0.1), normal: unit(0.0, 0.0, -1.0), area: 0.04 * 0.04 };
    let mut film = Film::new(vec![texel]).unwrap();
    let balance = spray(&mut film, &[shot(0.0, 0.0, 1e-9)], &SprayModel::default(), &far_plate(), 1);
    assert!(balance.deposited > 0 && balance.deposited < 1_000_000, "{balance:?}");
}

#[test]
fn the_tree_misses_no_texel() {
    let mut state = 11_u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let texels: Vec<Texel> = (0..3000)
        .map(|_| Texel {
            point: Point3::new(uniform() - 0.5, uniform() - 0.5, uniform() - 0.5),
            normal: unit(uniform() - 0.5, uniform() - 0.5, uniform() - 0.5),
            area: 1e-6,
        })
        .collect();
    let model = SprayModel { range: 0.5, ..SprayModel::default() };
    for _ in 0..40 {
        let shot = Shot {
            origin: Point3::new(uniform() - 0.5, uniform() - 0.5, uniform() - 0.5),
            axis: unit(uniform() - 0.5, uniform() - 0.5, uniform() - 0.5),
            volume: 1e-9,
        };
        let mut film = Film::new(texels.clone()).unwrap();
        spray(&mut film, &[shot], &model, &far_plate(), 1);
        for (texel, &volume) in texels.iter().zip(film.volumes()) {
            // Texels right before the nozzle are subdivided, where the plain density is no oracle.
            if (texel.point - shot.origin).dot(&shot.axis) > 0.1 {
                let density = model.density(&shot.origin, &shot.axis, &texel.point, &texel.normal);
                assert!((density * texel.area * 1e9 - volume as f64).abs() <= 1.0, "{density} {volume}");
            }
        }
    }
}

#[test]
fn shadows_and_backs_get_nothing() {
    // A plate at half the height covers x > 0; its own top is not painted (no texels there).
    let (positions, faces) = plate(0.05, 0.0, 1.0);
    let surface = TriangleSurface::new(&positions, &faces).unwrap();
    let mut film = Film::new(tilted_plane(0.0, 0.1, 2e-3, 0.05)).unwrap();
    let mut back = film.layer();
    let balance = spray(&mut film, &[shot(0.0, 0.0, 1e-9)], &SprayModel::default(), &surface, 1);
    for (texel, &volume) in film.texels().iter().zip(film.volumes()) {
        if texel.point.x > 1e-9 {
            assert_eq!(volume, 0, "{}", texel.point);
        } else if texel.point.x < -1e-9 && texel.point.coords.xy().norm() < 0.04 {
            assert!(volume > 0, "{}", texel.point);
        }
    }
    assert!(balance.balanced() && balance.overspray > 0);
    let from_behind = Shot { origin: Point3::new(0.0, 0.0, 0.2), axis: unit(0.0, 0.0, -1.0), volume: 1e-9 };
    assert_eq!(spray(&mut back, &[from_behind], &SprayModel::default(), &far_plate(), 1).deposited, 0);
}

#[test]
fn the_same_bytes_for_any_number_of_threads() {
    let (positions, faces) = plate(0.05, 0.0, 1.0);
    let surface = TriangleSurface::new(&positions, &faces).unwrap();
    let shots: Vec<Shot> = (0..3000).map(|i| shot(0.05 * (f64::from(i) * 0.01).sin(), 0.0, 5.4321e-12)).collect();
    let blank = Film::new(tilted_plane(0.3, 0.1, 2e-3, 0.06)).unwrap();
    let results: Vec<(Vec<u64>, MassBalance)> = [1, 2, 3, 7]
        .map(|threads| {
            let mut film = blank.layer();
            let mut calls = Vec::new();
            film.deposit(&shots, &SprayModel::default(), &surface, threads, &mut |done, all| calls.push((done, all)))
                .unwrap();
            assert_eq!(calls, [(1024, 3000), (2048, 3000), (3000, 3000)]);
            (film.volumes().to_vec(), film.mass_balance())
        })
        .to_vec();
    assert!(results.windows(2).all(|pair| pair[0] == pair[1]));
    let (volumes, balance) = &results[0];
    assert!(balance.balanced() && balance.deposited > 0);
    assert_eq!(volumes.iter().sum::<u64>(), balance.deposited);
    assert_eq!(balance.emitted, 3000 * 5_432_100);
}

#[test]
fn texels_cannot_claim_more_than_was_sprayed() {
    // Every texel twice: the sum claims 200 %.
    let mut texels = tilted_plane(0.0, 0.1, 1e-3, 0.06);
    texels.extend(texels.clone());
    let mut film = Film::new(texels).unwrap();
    let model = SprayModel { efficiency: 0.6, ..SprayModel::default() };
    let balance = spray(&mut film, &[shot(0.0, 0.0, 1e-9)], &model, &far_plate(), 1);
    assert_eq!(
        balance,
        MassBalance { emitted: 1_000_000_000, deposited: 600_000_000, overspray: 400_000_000, dripped: 0 }
    );
}

#[test]
fn thickness_is_volume_over_area() {
    let texel = Texel { point: Point3::new(0.0, 0.0, 0.1), normal: unit(0.0, 0.0, -1.0), area: 1e-6 };
    let mut film = Film::new(vec![texel]).unwrap();
    spray(&mut film, &[shot(0.0, 0.0, 1e-9)], &SprayModel::default(), &far_plate(), 1);
    assert_eq!(film.thickness(0), film.volumes()[0] as f64 * QUANTUM / 1e-6);
    assert_eq!(film.thickness(1), 0.0);
    assert_eq!(film.layer().mass_balance(), MassBalance::default());
}

#[test]
fn bad_input_is_named_and_leaves_the_film_alone() {
    assert!(matches!(Film::new(vec![]), Err(Error::Empty { what: "texels" })));
    let mut texels = tilted_plane(0.0, 0.1, 0.01, 0.02);
    texels[3].point.x = f64::NAN;
    assert!(matches!(Film::new(texels.clone()), Err(Error::NotFinite { index: 3, .. })));
    texels[3].point.x = 0.0;
    texels[3].area = 0.0;
    assert!(matches!(Film::new(texels.clone()), Err(Error::OutOfRange { what: "texel area", .. })));
    texels[3].area = 1e-4;
    let mut film = Film::new(texels).unwrap();
    let mut attempt = |shots: &[Shot], model: &SprayModel, threads| {
        let result = film.deposit(shots, model, &far_plate(), threads, &mut |_, _| {});
        assert_eq!(film.mass_balance(), MassBalance::default());
        result.unwrap_err()
    };
    let (good, model) = (shot(0.0, 0.0, 1e-9), SprayModel::default());
    let mut bad = good;
    bad.origin.y = f64::INFINITY;
    assert!(matches!(attempt(&[good, bad], &model, 1), Error::NotFinite { index: 1, .. }));
    let mut bad = good;
    bad.axis = UnitVector3::new_unchecked(Vector3::new(0.0, 0.0, 2.0));
    assert!(matches!(attempt(&[bad], &model, 1), Error::OutOfRange { .. }));
    assert!(matches!(attempt(&[shot(0.0, 0.0, -1.0)], &model, 1), Error::OutOfRange { .. }));
    assert!(matches!(attempt(&[shot(0.0, 0.0, 10.0), shot(0.0, 0.0, 10.0)], &model, 1), Error::MassOverflow));
    assert!(matches!(attempt(&[good], &model, 0), Error::OutOfRange { what: "threads", .. }));
    let wide = SprayModel { sigma: 2.0, ..model };
    assert!(matches!(attempt(&[good], &wide, 1), Error::OutOfRange { what: "spray.sigma", .. }));
}

#[test]
fn no_shot_loses_or_invents_paint() {
    // Any cone, any shot, any texels; the same for one thread and for three.
    let mut state = 9_u64;
    let mut uniform = move |low: f64, high: f64| {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        low + (high - low) * ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    };
    for _ in 0..60 {
        let model = SprayModel {
            sigma: uniform(0.01, 0.5),
            cut: uniform(0.5, 5.0),
            efficiency: uniform(0.0, 1.0),
            range: uniform(0.05, 1.0),
            ..SprayModel::default()
        };
        let mut film = Film::new(tilted_plane(uniform(-1.0, 1.0), 0.1, uniform(0.002, 0.02), 0.05)).unwrap();
        let shots: Vec<Shot> = (0..20)
            .map(|_| Shot {
                axis: UnitVector3::new_normalize(Vector3::new(uniform(-1.0, 1.0), uniform(-1.0, 1.0), 1.0)),
                ..shot(uniform(-0.05, 0.05), uniform(-0.05, 0.05), uniform(0.0, 1e-12))
            })
            .collect();
        let mut again = film.layer();
        let balance = spray(&mut film, &shots, &model, &far_plate(), 1);
        let emitted: u64 = shots.iter().map(|s| (s.volume / QUANTUM).round() as u64).sum();
        assert!(balance.balanced() && balance.emitted == emitted, "{model:?}");
        assert_eq!(film.volumes().iter().sum::<u64>(), balance.deposited);
        // Rounding may add half a quantum per shot.
        assert!(balance.deposited as f64 <= model.efficiency * emitted as f64 + 20.0, "{balance:?} {model:?}");
        assert_eq!(spray(&mut again, &shots, &model, &far_plate(), 3), balance);
        assert_eq!(again.volumes(), film.volumes());
    }
}

#[test]
fn what_was_deposited_can_be_taken_back_to_the_last_femtolitre() {
    let surface = far_plate();
    let mut film = Film::new(tilted_plane(0.3, 0.1, 2e-3, 0.05)).unwrap();
    let model = SprayModel::default();
    let kept = [shot(0.01, 0.0, 3e-10), shot(0.0, 0.01, 1e-10)];
    let undone: Vec<Shot> = (0..20).map(|k| shot(1e-3 * f64::from(k), -0.005, 2.1e-10)).collect();
    spray(&mut film, &kept, &model, &surface, 1);
    let before = (film.volumes().to_vec(), film.mass_balance());
    let mut touched = Vec::new();
    let add = &mut |texel| touched.push(texel);
    film.deposit_observed(&undone, &model, &surface, 2, add, &mut |_, _| {}).unwrap();
    let changed = |texel: usize, film: &Film| film.volumes()[texel] != before.0[texel];
    assert!((0..film.volumes().len()).all(|k| !changed(k, &film) || touched.contains(&(k as u32))));
    let mut lost = Vec::new();
    film.withdraw(&undone, &model, &surface, 1, &mut |texel| lost.push(texel)).unwrap();
    assert_eq!((film.volumes().to_vec(), film.mass_balance()), before);
    assert_eq!((lost.len(), touched.is_empty()), (touched.len(), false));
    // Shots that were never fired.
    let refused = film.withdraw(&[shot(0.0, 0.0, 1e-8)], &model, &surface, 1, &mut |_| ());
    assert!(matches!(refused, Err(Error::NotDeposited { .. })), "{refused:?}");
    assert_eq!((film.volumes().to_vec(), film.mass_balance()), before);
}

#[test]
fn shares_are_what_a_deposit_rounds() {
    // A shelf shades a part of a tilted plane; near the nozzle texels claim more than was sprayed.
    let (positions, faces) = plate(0.06, 0.01, 1.0);
    let shelf = TriangleSurface::new(&positions, &faces).unwrap();
    for (step, efficiency) in [(0.004, 1.0), (0.03, 0.7)] {
        let model = SprayModel { efficiency, ..SprayModel::default() };
        let shots: Vec<Shot> =
            (0..7).map(|k| shot(0.02 * f64::from(k) - 0.06, 0.01, 1e-12 * f64::from(k + 1))).collect();
        let mut film = Film::new(tilted_plane(0.4, 0.1, step, 0.1)).unwrap();
        let shares = film.shares(&shots, &model, &shelf, 1).unwrap();
        assert_eq!(shares, film.shares(&shots, &model, &shelf, 3).unwrap());
        assert_eq!(film.mass_balance(), MassBalance::default());
        let mut expected = vec![0.0; film.texels().len()];
        for (shot, shares) in shots.iter().zip(&shares) {
            assert!(shares.iter().map(|(_, share)| share).sum::<f64>() <= efficiency + 1e-12);
            for &(texel, share) in shares {
                expected[texel as usize] += share * shot.volume / QUANTUM;
            }
        }
        spray(&mut film, &shots, &model, &shelf, 1);
        let alike = expected.iter().zip(film.volumes()).all(|(expected, &volume)| {
            let off = (expected - volume as f64).abs();
            off <= shots.len() as f64
        });
        assert!(alike && film.mass_balance().overspray > 0, "step {step}");
        let wrong = SprayModel { efficiency: 1.5, ..model };
        assert!(matches!(film.shares(&shots, &wrong, &shelf, 1), Err(Error::OutOfRange { .. })));
    }
}
