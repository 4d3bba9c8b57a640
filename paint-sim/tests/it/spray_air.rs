//! Droplets in moving air: closed forms of Stokes' regime, an independent integration beyond it, limits, and a mass balance that stays exact.

use nalgebra::{Point3, Vector3};
use paint_sim::spray::QUANTUM;
use paint_sim::spray::air::{
    AIR_DENSITY, AIR_VISCOSITY, Air, DropletSettings, Jet, RotorWash, drag_factor, drift, drifted, fan_mean_diameter,
    relaxation_time,
};
use paint_sim::{Error, Film, Shot, SprayModel, Texel, TriangleSurface};

/// So small that drag is Stokes', and of a density that gives it a relaxation time.
const TINY: f64 = 1e-12;

fn stokes(time: f64, speed: f64) -> DropletSettings {
    let density = time / relaxation_time(TINY, 1.0);
    DropletSettings { density, speed, momentum: 0.0, ..DropletSettings::default() }
}

#[test]
fn a_small_droplet_flies_as_the_closed_form_says() {
    let (speed, wind, time, wall) = (8.0, 3.0, 5e-3, 0.03);
    let droplets = stokes(time, speed);
    let jet = Jet::new(0.0, speed, 0.14, wall);
    let landing = droplets.path(TINY, &jet, [0.0, wind]).unwrap();
    // wall = speed tau (1 - exp(-T / tau)); x = wind (T - tau (1 - exp(-T / tau))).
    let flight = -time * (1.0 - wall / (speed * time)).ln();
    let offset = wind * (flight - time * (1.0 - (-flight / time).exp()));
    assert!((landing.time / flight - 1.0).abs() < 1e-3, "{landing:?} {flight}");
    assert!((landing.offset / offset - 1.0).abs() < 2e-3, "{landing:?} {offset}");
    assert!((landing.speed - (speed - wall / time)).abs() < 2e-3, "{landing:?}");
    // It stops at speed times tau: a wall beyond is not reached.
    let reached = |wall: f64| droplets.path(TINY, &Jet::new(0.0, speed, 0.14, wall), [0.0, wind]).is_some();
    assert!(reached(0.0398) && !reached(0.0402));
}

/// The equation of motion by Runge and Kutta in small steps, with the air written down once more.
/// Offset and time; nothing for what has not arrived after a tenth of a second.
fn integrated(d: f64, settings: &DropletSettings, slope: f64, wall: f64, wind: [f64; 2]) -> Option<[f64; 2]> {
    let tau = settings.density * d * d / (18.0 * 1.82e-5);
    let radius = 2.0 * slope * wall;
    let rate = |[z, _, w, v]: [f64; 4]| {
        let strength = (settings.momentum / (std::f64::consts::PI * 1.204)).sqrt() / (2.0 * slope);
        let jet = if z > 0.0 { (strength / z).min(settings.speed) } else { settings.speed };
        let drawn = if settings.momentum > 0.0 { 1.0 - jet / settings.speed } else { 1.0 };
        let air = [(jet + drawn * wind[0]) * ((wall - z) / radius).min(1.0), drawn * wind[1]];
        let reynolds = 1.204 * d / 1.82e-5 * ((air[0] - w).powi(2) + (air[1] - v).powi(2)).sqrt();
        let f = 1.0 + 0.15 * reynolds.powf(0.687);
        [w, v, (air[0] - w) * f / tau, (air[1] - v) * f / tau]
    };
    let (h, mut state, mut time) = (1e-6, [0.0, 0.0, settings.speed, 0.0], 0.0);
    while state[0] < wall {
        if time > 0.1 {
            return None;
        }
        let moved = |k: [f64; 4], h: f64| std::array::from_fn(|i| state[i] + h * k[i]);
        let a = rate(state);
        let b = rate(moved(a, 0.5 * h));
        let c = rate(moved(b, 0.5 * h));
        let d = rate(moved(c, h));
        state = std::array::from_fn(|i| state[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
        time += h;
    }
    Some([state[1], time])
}

#[test]
fn larger_droplets_fly_as_an_integration_in_small_steps_says() {
    for momentum in [0.0, 0.05] {
        let droplets = DropletSettings { momentum, ..DropletSettings::default() };
        for (d, wall) in [(26e-6, 0.1), (30e-6, 0.1), (40e-6, 0.04), (60e-6, 0.1), (120e-6, 0.15)] {
            for wind in [[0.0, 2.0], [-1.5, 4.0], [1.5, 0.5]] {
                let jet = Jet::new(momentum, droplets.speed, 0.14, wall);
                let found = droplets.path(d, &jet, wind).map(|landing| [landing.offset, landing.time]);
                let expected = integrated(d, &droplets, 0.14, wall, wind);
                // Drag stops some before the wall when no air goes with them.
                assert_eq!(found.is_some(), expected.is_some(), "{d} {wind:?}");
                let (Some(found), Some(expected)) = (found, expected) else {
                    assert_eq!(momentum, 0.0);
                    continue;
                };
                for k in 0..2 {
                    assert!((found[k] / expected[k] - 1.0).abs() < 5e-3, "{d} {wind:?}: {found:?} {expected:?}");
                }
            }
        }
    }
}

#[test]
fn heavy_droplets_fly_straight_and_light_ones_go_with_the_air() {
    let heavy = DropletSettings { density: 1e9, ..DropletSettings::default() };
    let jet = Jet::new(heavy.momentum, heavy.speed, 0.14, 0.1);
    assert!(heavy.path(1e-3, &jet, [0.0, 10.0]).unwrap().offset < 1e-7);
    // Air of 5 m/s towards the wall, turning only just before it.
    let light = stokes(3e-5, 20.0);
    let landing = light.path(TINY, &Jet::new(0.0, 20.0, 1e-3, 0.1), [5.0, 2.0]).unwrap();
    assert!((landing.offset / (2.0 * 0.1 / 5.0) - 1.0).abs() < 0.02, "{landing:?}");
}

/// Behind a stagnation point `tau y'' + y' + a y = 0` reaches zero from the speed of the air where `a tau > 1/4`, from more speed where
/// `w tau > y (1 + sqrt(1 - 4 a tau)) / 2`.
#[test]
fn droplets_land_whose_stokes_number_is_above_a_quarter() {
    let (wall, slope, air) = (0.1, 0.1, 4.0);
    let radius = 2.0 * slope * wall;
    let lands = |number: f64, speed: f64, wall: f64| {
        let droplets = stokes(number * radius / air, speed);
        droplets.path(TINY, &Jet::new(0.0, speed, radius / (2.0 * wall), wall), [air, 0.0]).is_some()
    };
    // A little more, as who is late is swept away.
    assert!(!lands(0.25, air, wall) && lands(0.26, air, wall));
    // From the border of the turning air, so that the speed is still that of the nozzle.
    let limit = |number: f64| air * 0.5 * (1.0 + (1.0 - 4.0 * number).sqrt()) / number;
    for number in [0.05, 0.1, 0.2] {
        let fast = limit(number);
        assert!(!lands(number, 0.98 * fast, radius) && lands(number, 1.02 * fast, radius), "{number}");
    }
}

#[test]
fn sizes_are_those_of_rosin_and_rammler() {
    let droplets = DropletSettings { uniformity: 2.0, ..DropletSettings::default() };
    assert!((droplets.diameter(1.0 - (-1.0_f64).exp()) / 60e-6 - 1.0).abs() < 1e-12);
    // Sauter's mean diameter is size / Gamma(1 - 1 / q), and Gamma(1/2) is the root of pi.
    let count = 1_000_000;
    let inverse = (0..count).map(|k| 1.0 / droplets.diameter((f64::from(k) + 0.5) / f64::from(count))).sum::<f64>();
    let sauter = f64::from(count) / inverse;
    assert!((sauter * std::f64::consts::PI.sqrt() / 60e-6 - 1.0).abs() < 1e-3, "{sauter}");
    // Without viscosity the second term alone: 0.26 (0.03 * 1200 / (1.204 * 3e-4 * 1e7))^(1/4) diameters.
    let mean = fan_mean_diameter(3e-4, 1e7, 0.03, 0.0, 1200.0);
    assert!((mean / 24.64e-6 - 1.0).abs() < 1e-3, "{mean}");
    assert!((drag_factor(1000.0) / drag_factor(1000.1) - 1.0).abs() < 0.01);
}

/// A wall at x = 0 of millimetre texels as seen by a nozzle at x = -d, far enough for everything that drifts.
fn wall() -> (TriangleSurface, Film) {
    let corners = [[0.0, -9.0, -9.0], [0.0, 9.0, -9.0], [0.0, 0.0, 9.0]];
    let texel = |k: usize| {
        let [y, z] = [k % 400, k / 400].map(|i| (i as f64 - 199.5) * 1e-3);
        Texel { point: Point3::new(0.0, y, z), normal: -Vector3::x_axis(), area: 1e-6 }
    };
    (TriangleSurface::new(&corners, &[[0, 2, 1]]).unwrap(), Film::new((0..160_000).map(texel).collect()).unwrap())
}

fn shots(volume: f64) -> Vec<Shot> {
    let shot = |k: i32| Shot {
        origin: Point3::new(-0.1, 0.01 * f64::from(k), 0.0),
        axis: Vector3::x_axis(),
        volume: volume * (1.0 + 0.1 * f64::from(k)),
    };
    (-3..=3).map(shot).collect()
}

fn wind(y: f64, z: f64, turbulence: f64) -> Air {
    Air { velocity: Vector3::new(-7.0, y, z), turbulence }
}

/// Total and moments about the nozzle's axis, in quanta, m and m².
fn moments(film: &Film) -> (u64, [f64; 2], [f64; 3]) {
    let total: u64 = film.volumes().iter().sum();
    let mean = |f: &dyn Fn(&Point3<f64>) -> f64| {
        film.texels().iter().zip(film.volumes()).map(|(t, v)| f(&t.point) * *v as f64).sum::<f64>() / total as f64
    };
    let [y, z] = [mean(&|p| p.y), mean(&|p| p.z)];
    let covariance = [mean(&|p| (p.y - y).powi(2)), mean(&|p| (p.y - y) * (p.z - z)), mean(&|p| (p.z - z).powi(2))];
    (total, [y, z], covariance)
}

#[test]
fn still_air_leaves_every_byte_as_it_is() {
    let (surface, mut film) = wall();
    let spray = SprayModel { aspect: 1.5, turn: 0.3, efficiency: 0.7, ..SprayModel::default() };
    let (shots, droplets) = (shots(3e-10), DropletSettings::default());
    // What blows straight at the wall has turned before it.
    for still in [Air::still(), wind(0.0, 0.0, 0.0)] {
        let same = drifted(&shots, &spray, &droplets, &surface, &mut |_| still).unwrap();
        assert!(same.iter().map(|(shot, _)| shot).eq(&shots) && same.iter().all(|(_, own)| *own == spray));
        let mut other = film.layer();
        film = film.layer();
        let balance = film.deposit(&shots, &spray, &surface, 1, &mut |_, _| ()).unwrap();
        assert_eq!(other.deposit_each(&same, &surface, 3).unwrap(), balance);
        assert_eq!(other.volumes(), film.volumes());
        assert_eq!(other.mass_balance(), film.mass_balance());
    }
}

#[test]
fn the_spot_moves_and_widens_as_its_droplets_do() {
    let (surface, film) = wall();
    let (droplets, distance) = (DropletSettings::default(), 0.1);
    let spray = SprayModel { aspect: 1.6, turn: 0.4, ..SprayModel::default() };
    let shot = Shot { origin: Point3::new(-distance, 0.0, 0.0), axis: Vector3::x_axis(), volume: 1e-9 };
    // The axis is x: left is y, up is z.
    for (speed, turbulence) in [(1.2, 0.0), (3.0, 0.4), (6.0, 0.0)] {
        let angle = 0.9_f64;
        let air = wind(speed * angle.cos(), speed * angle.sin(), turbulence);
        let sprayed = |shots: &[(Shot, SprayModel)]| {
            let mut film = film.layer();
            assert!(film.deposit_each(shots, &surface, 2).unwrap().balanced());
            moments(&film)
        };
        let calm = sprayed(&[(shot, spray)]);
        let bent = drifted(&[shot], &spray, &droplets, &surface, &mut |_| air).unwrap();
        let found = sprayed(&bent);
        // Droplet by droplet: of those that land, four thousand classes of equal volume.
        let jet = Jet::new(droplets.momentum, droplets.speed, spray.sigma.tan(), distance);
        // Two stand-offs away they are carried past.
        let swept = |d: f64| {
            let way = droplets.path(d, &jet, [0.0, speed.hypot(turbulence)])?.offset;
            (way <= 2.0 * distance).then_some(way)
        };
        let finest =
            (1..100_000).map(|k| f64::from(k) * 1e-5).find(|&p| swept(droplets.diameter(p)).is_some()).unwrap();
        let ways: Vec<f64> = (0..4000)
            .map(|k| finest + (1.0 - finest) * (f64::from(k) + 0.5) / 4000.0)
            .filter_map(|p| swept(droplets.diameter(p)))
            .map(|way| way / speed.hypot(turbulence))
            .collect();
        let [first, second] = [1, 2].map(|n| ways.iter().map(|w| w.powi(n)).sum::<f64>() / ways.len() as f64);
        let (shift, gusts) = (speed * first, turbulence * turbulence * second);
        let along = speed * speed * (second - first * first);
        let (s, c) = angle.sin_cos();
        let (middle, widened) =
            ([shift * c, shift * s], [along * c * c + gusts, along * c * s, along * s * s + gusts].map(|v| 1e6 * v));
        for k in 0..2 {
            let moved = found.1[k] - calm.1[k];
            assert!((moved / middle[k] - 1.0).abs() < 0.02, "{speed}: {moved} {middle:?}");
        }
        for k in 0..3 {
            let wider = 1e6 * (found.2[k] - calm.2[k]);
            assert!(
                (wider - widened[k]).abs() < 0.05 * widened[k].abs() + 0.02 * widened[0],
                "{speed}: {wider} {widened:?}"
            );
        }
        assert_eq!(bent.len(), if speed > 2.0 { 2 } else { 1 }, "{speed}");
    }
}

#[test]
fn what_lands_and_what_is_lost_is_what_was_sprayed() {
    let (surface, film) = wall();
    let (spray, droplets) = (SprayModel { efficiency: 0.9, ..SprayModel::default() }, DropletSettings::default());
    // Volumes that no share divides, and a nozzle askew: the wind along the wall goes against it.
    let mut shots = shots(1.234_567_890_123e-10);
    for shot in &mut shots {
        shot.axis = nalgebra::UnitVector3::new_normalize(Vector3::new(1.0, -0.8, 0.1));
    }
    let emitted: u64 = shots.iter().map(|shot| (shot.volume / QUANTUM).round() as u64).sum();
    let mut kept = Vec::new();
    for speed in [0.0, 2.0, 5.0, 9.0] {
        let sprays = drifted(&shots, &spray, &droplets, &surface, &mut |_| wind(speed, 0.0, 0.2)).unwrap();
        let films = [1, 3].map(|threads| {
            let mut film = film.layer();
            let balance = film.deposit_each(&sprays, &surface, threads).unwrap();
            assert!(balance.balanced() && balance.emitted == emitted, "{speed}: {balance:?}");
            assert_eq!(balance.deposited, film.volumes().iter().sum::<u64>());
            film
        });
        assert_eq!(films[0].volumes(), films[1].volumes());
        kept.push(sprays[0].1.efficiency);
    }
    assert!(kept.is_sorted_by(|a, b| a >= b) && kept[0] > 0.899 && kept[3] < 0.85 && kept[3] > 0.3, "{kept:?}");
}

#[test]
fn the_share_that_lands_is_that_of_the_droplets_which_land() {
    let (droplets, spray) = (DropletSettings::default(), SprayModel::default());
    for (distance, along) in [(0.06, 0.0), (0.1, 0.0), (0.15, 0.0), (0.1, -3.0)] {
        let drift = drift(&droplets, &spray, distance, [along, 1.0], 0.0).unwrap();
        let jet = Jet::new(droplets.momentum, droplets.speed, spray.sigma.tan(), distance);
        let lands =
            |d: f64| droplets.path(d, &jet, [along, 1.0]).is_some_and(|landing| landing.offset < 2.0 * distance);
        let finest = (1..2000).map(|k| f64::from(k) * 1e-7).find(|&d| lands(d)).unwrap();
        let landed = (-(finest / 60e-6).powf(2.5)).exp();
        assert!((drift.landed - landed).abs() < 2e-3, "{distance}: {drift:?} {landed}");
        assert!(drift.landed > 0.5 && drift.landed < 0.99 && (along < 0.0) == (drift.kept() < 0.999), "{drift:?}");
    }
}

#[test]
fn the_wash_is_that_of_momentum_theory_and_of_jets() {
    let wash = RotorWash::default();
    let area = 6.0 * std::f64::consts::PI * 0.19 * 0.19;
    assert!((2.0 * AIR_DENSITY * area * wash.induced_speed().powi(2) / wash.thrust - 1.0).abs() < 1e-12);
    // The wake holds its momentum, near and far; far below, its middle is 6.3 u d / z.
    for depth in [0.1, 2.0, 4.2, 9.0] {
        let flux: f64 = (0..40_000)
            .map(|k| (f64::from(k) + 0.5) * 1e-3)
            .map(|r| AIR_DENSITY * wash.wake(depth, r).powi(2) * std::f64::consts::TAU * r * 1e-3)
            .sum();
        assert!((flux / wash.thrust - 1.0).abs() < 1e-3, "{depth}: {flux}");
    }
    let (speed, diameter) = (2.0 * wash.induced_speed(), (2.0 * area / std::f64::consts::PI).sqrt());
    assert!((wash.wake(0.1, 0.0) - speed).abs() < 1e-12 && wash.wake(-0.1, 0.0) == 0.0);
    assert!((0..700).all(|k| wash.wake(1e-300, 1e-3 * f64::from(k)).is_finite()));
    assert!((wash.wake(9.0, 0.0) / (6.3 * speed * diameter / 9.0) - 1.0).abs() < 1e-9);
    let floor = wash.at(&Point3::new(1.0, 2.0, 1.5), &Point3::new(1.0, 4.0, 0.0), &Vector3::z());
    let closed = 1.03 * speed * diameter / 2.0;
    assert!((floor.velocity - Vector3::y() * closed).norm() < 1e-9 && floor.turbulence > 0.0, "{floor:?}");
    assert!(wash.at(&Point3::new(0.0, 0.0, 1.5), &Point3::origin(), &Vector3::z()).velocity.norm() < 1e-12);
    // Along the floor it holds no more than the momentum that came down: a half-width of 0.087 r (Rajaratnam 1976), a Gaussian over the height.
    let thickness = 0.087 * 3.0 / (2.0_f64.ln() * 2.0).sqrt() * (std::f64::consts::PI / 4.0).sqrt();
    let outwards = AIR_DENSITY * wash.floor_jet(1.5, 3.0).powi(2) * std::f64::consts::TAU * 3.0 * thickness;
    assert!(outwards < wash.thrust && outwards > 0.3 * wash.thrust, "{outwards}");
    // On a slope of 60 degrees, two metres uphill of where the wake meets it, half of the momentum goes outwards.
    let (sin, cos) = 60.0_f64.to_radians().sin_cos();
    let slope =
        wash.at(&Point3::new(0.0, 0.0, 3.0), &Point3::new(4.0 * cos, 0.0, 4.0 * sin), &Vector3::new(-sin, 0.0, cos));
    let outwards = Vector3::new(cos, 0.0, sin) * (1.03 * speed * diameter / 4.0 * cos.sqrt());
    assert!((slope.velocity - outwards).norm() < 1e-6, "{slope:?} {outwards}");
    // A wall ahead of the vehicle is beside the wake; one far below gets what goes along it.
    let ahead = wash.at(&Point3::origin(), &Point3::new(0.6, 0.0, -0.1), &-Vector3::x());
    assert!(ahead.velocity.norm() < 1e-3, "{ahead:?}");
    let below = wash.at(&Point3::origin(), &Point3::new(0.3, 0.0, -3.0), &-Vector3::x());
    assert!((below.velocity.z + wash.wake(3.0, 0.3)).abs() < 1e-12 && below.velocity.z < -1.0, "{below:?}");
}

/// Without air that goes with them, fine droplets stop before a wall that is far: all of them are overspray, and counted.
#[test]
fn a_spray_that_never_arrives_is_overspray() {
    let (surface, mut film) = wall();
    let fine = DropletSettings { size: 2e-6, momentum: 0.0, ..DropletSettings::default() };
    let sprays = drifted(&shots(1e-10), &SprayModel::default(), &fine, &surface, &mut |_| wind(1.0, 0.0, 0.1)).unwrap();
    let balance = film.deposit_each(&sprays, &surface, 1).unwrap();
    assert!(balance.balanced() && balance.deposited == 0 && balance.overspray == 700_000_000, "{balance:?}");
    // Sprays at the bounds of their settings stay within them in a storm.
    for spray in [
        SprayModel { sigma: 1e-4, aspect: 20.0, yaw: 1.4, ..SprayModel::default() },
        SprayModel { sigma: 1.4, cut: 0.1, aspect: 0.05, pitch: -1.4, ..SprayModel::default() },
    ] {
        let storm = wind(60.0, -60.0, 50.0);
        let bent = drifted(&shots(1e-10), &spray, &DropletSettings::default(), &surface, &mut |_| storm).unwrap();
        assert!(film.deposit_each(&bent, &surface, 1).unwrap().balanced());
    }
}

/// Droplet by droplet in three dimensions, sizes and directions at random: what the wind adds to the middle and to the
/// covariance of the spot is what it adds to droplets on the axis.
#[test]
fn single_droplets_of_a_whole_cone_land_where_the_spot_says() {
    let (droplets, spray, distance) = (DropletSettings::default(), SprayModel::default(), 0.1);
    let (slope, wind) = (spray.sigma.tan(), 2.5);
    let strength = (droplets.momentum / (std::f64::consts::PI * 1.204)).sqrt() / (2.0 * slope);
    let radius = 2.0 * slope * distance;
    // Along x; the air of the jet goes out along the droplet's own ray, the wind along y.
    let land = |d: f64, start: [f64; 2], wind: f64| {
        let tau = droplets.density * d * d / (18.0 * 1.82e-5);
        let rate = |[x, _, _, a, b, c]: [f64; 6]| {
            let jet = if x > 0.0 { (strength / x).min(droplets.speed) } else { droplets.speed };
            let along = jet * ((distance - x) / radius).min(1.0);
            let aside = start.map(|slope| jet * slope);
            let air = [along, aside[0] + (1.0 - jet / droplets.speed) * wind, aside[1]];
            let slip = [air[0] - a, air[1] - b, air[2] - c];
            let speed = slip.iter().map(|s| s * s).sum::<f64>().sqrt();
            let f = (1.0 + 0.15 * (1.204 * d / 1.82e-5 * speed).powf(0.687)) / tau;
            [a, b, c, slip[0] * f, slip[1] * f, slip[2] * f]
        };
        let along = droplets.speed / (1.0 + start[0] * start[0] + start[1] * start[1]).sqrt();
        let (h, mut state) = (2e-5, [0.0, 0.0, 0.0, along, along * start[0], along * start[1]]);
        for _ in 0..5000 {
            if state[0] >= distance {
                return Some([state[1], state[2]]);
            }
            let one = rate(state);
            let two = rate(std::array::from_fn(|i| state[i] + h * one[i]));
            state = std::array::from_fn(|i| state[i] + 0.5 * h * (one[i] + two[i]));
        }
        None
    };
    let mut state = 5_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    };
    let found = drift(&droplets, &spray, distance, [0.0, wind], 0.0).unwrap();
    let (main, share) = (found.main, found.landed * found.main.share);
    let mut pairs = Vec::new();
    for k in 0..4000 {
        // The coarse ones, which make the main spot, in equal shares.
        let d = 60e-6 * (-(share * (f64::from(k) + 0.5) / 4000.0).ln()).powf(1.0 / 2.5);
        let (r, angle) = (slope * (-2.0 * random().ln()).sqrt(), std::f64::consts::TAU * random());
        let start = [r * angle.cos(), r * angle.sin()];
        if let (Some(calm), Some(windy)) = (land(d, start, 0.0), land(d, start, wind)) {
            pairs.push([calm, windy]);
        }
    }
    let mean = |f: &dyn Fn(&[[f64; 2]; 2]) -> f64| pairs.iter().map(f).sum::<f64>() / pairs.len() as f64;
    let [shift, aside] = [0, 1].map(|k| mean(&|p| p[1][k] - p[0][k]));
    let variance = mean(&|p| (p[1][0] - p[0][0] - shift).powi(2));
    let at = mean(&|p| p[0][0]);
    let covariance = mean(&|p| (p[1][0] - p[0][0] - shift) * (p[0][0] - at));
    assert!((shift / main.shift - 1.0).abs() < 0.03 && aside.abs() < 0.01 * shift, "{shift} {aside} {main:?}");
    assert!((variance / main.variances[0] - 1.0).abs() < 0.1, "{variance} {main:?}");
    // Drag couples both a little: against the wind it is larger.
    let calm = mean(&|p| (p[0][0] - at).powi(2));
    assert!(covariance.abs() < 0.03 * calm, "{covariance} {calm}");
}

#[test]
fn air_and_droplets_that_make_no_sense_are_refused() {
    let (surface, _) = wall();
    let (spray, droplets) = (SprayModel::default(), DropletSettings::default());
    let refused =
        |droplets: DropletSettings, air: Air| drifted(&shots(1e-9), &spray, &droplets, &surface, &mut |_| air);
    let good = wind(1.0, 0.0, 0.0);
    for (settings, name) in [
        (DropletSettings { size: f64::NAN, ..droplets }, "droplets.size"),
        (DropletSettings { uniformity: 0.0, ..droplets }, "droplets.uniformity"),
        (DropletSettings { density: -1.0, ..droplets }, "droplets.density"),
        (DropletSettings { speed: f64::INFINITY, ..droplets }, "droplets.speed"),
        (DropletSettings { momentum: -0.1, ..droplets }, "droplets.momentum"),
    ] {
        assert!(matches!(refused(settings, good), Err(Error::OutOfRange { what, .. }) if what == name), "{name}");
    }
    assert!(matches!(
        refused(droplets, wind(f64::NAN, 0.0, 0.0)),
        Err(Error::NotFinite { what: "air at shot", index: 0 })
    ));
    assert!(matches!(refused(droplets, wind(1e4, 0.0, 0.0)), Err(Error::OutOfRange { .. })));
    assert!(matches!(refused(droplets, wind(1.0, 0.0, -0.5)), Err(Error::OutOfRange { what: "turbulence", .. })));
    assert!(RotorWash { radius: 0.0, ..RotorWash::default() }.check().is_err());
    assert!(AIR_VISCOSITY > 0.0 && RotorWash::default().check().is_ok());
}
