//! Wet paint: runs against Huppert's law and the yield height, drying against closed forms, the account exact.

use nalgebra::{Point3, UnitVector3, Vector3};
use paint_sim::film::wet::{Ground, Side, WetFilm, WetPaint};
use paint_sim::{Error, Film, Shot, SprayModel, Texel};

use crate::deposit::far_plate;

const QUANTUM: f64 = 1e-18;

/// A plane wall of `across` columns and `down` rows of square texels, leaning back by `lean` from the vertical; rows from the top.
pub(crate) fn wall(across: usize, down: usize, edge: f64, lean: f64) -> (Vec<Texel>, Vec<Side>) {
    let (sin, cos) = lean.sin_cos();
    let index = |column: usize, row: usize| (row * across + column) as u32;
    let (mut texels, mut sides) = (Vec::new(), Vec::new());
    for row in 0..down {
        for column in 0..across {
            let way = row as f64 * edge;
            let point = Point3::new(-way * sin, column as f64 * edge, -way * cos);
            let normal = UnitVector3::new_normalize(Vector3::new(-cos, 0.0, sin));
            texels.push(Texel { point, normal, area: edge * edge });
            let beyond = [
                (column > 0).then(|| index(column - 1, row)),
                (column + 1 < across).then(|| index(column + 1, row)),
                (row > 0).then(|| index(column, row - 1)),
                (row + 1 < down).then(|| index(column, row + 1)),
            ];
            sides.extend(beyond.map(|beyond| Side { texel: index(column, row), beyond }));
        }
    }
    (texels, sides)
}

/// Puts a wet film of `thickness` onto texel `k` alone: one shot from so near that its spot stays on it.
pub(crate) fn wet(film: &mut WetFilm, paint: &WetPaint, k: usize, thickness: f64) {
    let texel = film.film().texels()[k];
    let origin = texel.point + texel.normal.into_inner() * texel.area.sqrt();
    let near = SprayModel { sigma: 0.14, ..SprayModel::default() };
    let mut shot = Shot { origin, axis: -texel.normal, volume: 1.0 };
    let shares = film.film().shares(&[shot], &near, &far_plate(), 1).unwrap();
    let share = shares[0].iter().find(|(texel, _)| *texel as usize == k).unwrap().1;
    assert!(share > 0.98);
    shot.volume = thickness * texel.area * paint.solids / share;
    film.deposit(&[shot], &near, &far_plate(), 1, &mut |_, _| ()).unwrap();
}

/// A liquid that does not dry.
fn newtonian() -> WetPaint {
    WetPaint { density: 1200.0, viscosity: 0.12, yield_stress: 0.0, evaporation: 0.0, ..WetPaint::default() }
}

/// Huppert 1982: the front of a volume A per width is at (9 A² g t / 4 nu)^(1/3) once the top of the film has thinned.
#[test]
fn a_run_goes_down_a_wall_as_huppert_says() {
    let edge = 0.5e-3;
    for lean in [0.0_f64, 0.5] {
        let (texels, sides) = wall(1, 400, edge, lean);
        let paint = newtonian();
        let mut film = WetFilm::new(Film::new(texels).unwrap(), &sides, paint, Ground::default()).unwrap();
        for k in 0..10 {
            wet(&mut film, &paint, k, 2e-3);
        }
        let (a, nu, g) = (10.0 * edge * 2e-3, 0.12 / 1200.0, 9.81 * lean.cos());
        let mut before = 0.0;
        for time in [10.0_f64, 100.0] {
            let flow = film.step(time - before).unwrap();
            before = time;
            assert_eq!(flow.held_back, 0);
            let closed = (9.0 * a * a * g * time / (4.0 * nu)).cbrt();
            let most = (0..400).map(|k| film.wet_thickness(k)).fold(0.0, f64::max);
            let front = (0..400).rfind(|&k| film.wet_thickness(k) > 0.5 * most).unwrap();
            let front = (front as f64 + 1.0) * edge;
            assert!((front / closed - 1.0).abs() < 0.02, "lean {lean}, {time} s: {front} m, closed form {closed} m");
            // Behind it the film is sqrt(nu x / g t) thick.
            let half = (0.5 * closed / edge) as usize;
            let film_there = (nu * (half as f64 + 0.5) * edge / (g * time)).sqrt();
            assert!((film.wet_thickness(half) / film_there - 1.0).abs() < 0.02);
        }
    }
}

/// The reference value of a Bingham film of half a millimetre: 5.002428e-7 m²/s (integral of its velocity profile).
#[test]
fn the_flux_of_a_bingham_film_is_the_integral_of_its_profile() {
    let paint = WetPaint { viscosity: 0.5, yield_stress: 2.0, ..WetPaint::default() };
    let (h, weight) = (0.5e-3, 1200.0 * 9.81);
    let sheared = h - 2.0 / weight;
    let velocity =
        |y: f64| if y < sheared { weight * (sheared * y - y * y / 2.0) } else { weight * sheared * sheared / 2.0 };
    let steps = 100_000;
    let profile: f64 = (0..steps).map(|k| velocity((f64::from(k) + 0.5) * h / f64::from(steps)) / 0.5).sum();
    let brute = profile * h / f64::from(steps);
    let flux = paint.flux(h, weight, 1.0);
    assert!((flux / brute - 1.0).abs() < 1e-6 && (flux / 5.002428e-7 - 1.0).abs() < 1e-5, "{flux} {brute}");
    assert_eq!(paint.flux(2.0 / weight * 0.999, weight, 1.0), 0.0);
}

/// What a texel gives is the flux of its film, width and time: of fresh paint, and of paint that has lost some of its solvent.
#[test]
fn a_texel_gives_the_flux_of_its_film() {
    // So viscous that the film is the same before and after.
    let paint = WetPaint { viscosity: 5e3, yield_stress: 2.0, evaporation: 4e-7, ..WetPaint::default() };
    let (edge, weight) = (2e-3, 1200.0 * 9.81);
    let (texels, sides) = wall(1, 2, edge, 0.0);
    let mut film = WetFilm::new(Film::new(texels).unwrap(), &sides, paint, Ground::default()).unwrap();
    wet(&mut film, &paint, 0, 0.5e-3);
    for (waits, stiffer) in [(0.0, 0.99..1.01), (150.0, 1.3..1.6)] {
        film.step(waits).unwrap();
        let solids = film.film().thickness(0);
        let (before, thickness) = (film.film().thickness(1), film.wet_thickness(0));
        let stiffening = paint.stiffening(solids / thickness);
        assert!(stiffer.contains(&stiffening), "{stiffening}");
        let time = 1.0;
        film.step(time).unwrap();
        // Solids are their share of what flows.
        let given = (film.film().thickness(1) - before) * edge * thickness / solids;
        let closed = paint.flux(thickness, weight, stiffening) * time;
        assert!((given / closed - 1.0).abs() < 0.03, "after {waits} s: {given} m², closed form {closed} m²");
    }
}

#[test]
fn paint_stays_below_the_sag_thickness_and_runs_above_it() {
    let paint = WetPaint { evaporation: 0.0, yield_stress: 2.0, ..WetPaint::default() };
    for lean in [0.0_f64, 0.6, -0.4] {
        let closed = 2.0 / (1200.0 * 9.81 * lean.cos());
        for (share, runs) in [(0.98, false), (1.02, true)] {
            let (texels, sides) = wall(3, 3, 2e-3, lean);
            assert!((paint.sag_thickness(&texels[4].normal) / closed - 1.0).abs() < 1e-9);
            let mut film = WetFilm::new(Film::new(texels).unwrap(), &sides, paint, Ground::default()).unwrap();
            wet(&mut film, &paint, 4, share * closed);
            let before = film.film().volumes().to_vec();
            film.step(60.0).unwrap();
            assert_eq!(film.ran()[4], runs, "lean {lean}, {share}");
            assert_eq!(film.film().volumes() != before, runs);
            assert_eq!(film.film().volumes()[7] > 0, runs, "downhill");
            assert!([0, 1, 2, 3, 5, 6, 8].iter().all(|&k| film.film().volumes()[k] == 0), "nowhere else");
        }
    }
    assert!(paint.sag_thickness(&Vector3::z_axis()).is_infinite());
}

/// On a wall whose grid is turned by 30 degrees the middle of a run goes straight down all the same.
#[test]
fn a_run_follows_gravity_and_not_the_grid() {
    let (turn, edge, count) = (30.0_f64.to_radians(), 1e-3, 80);
    let (mut texels, sides) = wall(count, count, edge, 0.0);
    for texel in &mut texels {
        let (y, z) = (texel.point.y, texel.point.z);
        texel.point = Point3::new(0.0, y * turn.cos() - z * turn.sin(), y * turn.sin() + z * turn.cos());
    }
    let paint = newtonian();
    let start = texels[20 * count + 50].point;
    let mut film = WetFilm::new(Film::new(texels).unwrap(), &sides, paint, Ground::default()).unwrap();
    wet(&mut film, &paint, 20 * count + 50, 2e-3);
    film.step(20.0).unwrap();
    let total: f64 = film.film().volumes().iter().map(|&v| v as f64).sum();
    let middle = film.film().texels().iter().zip(film.film().volumes());
    let middle: Vector3<f64> = middle.map(|(t, &v)| (t.point - start) * (v as f64 / total)).sum();
    assert!(middle.z < -3e-3 && middle.y.abs() < 0.05 * middle.z.abs(), "{middle}");
}

/// Any numbering of the texels gives the same paint, to the femtolitre.
#[test]
fn the_order_of_the_texels_does_not_matter() {
    let (texels, sides) = wall(12, 30, 2e-3, 0.2);
    let count = texels.len();
    let renumbered: Vec<usize> = (0..count).map(|k| (k * 7 + 3) % count).collect();
    let mut shuffled = texels.clone();
    for (k, texel) in texels.iter().enumerate() {
        shuffled[renumbered[k]] = *texel;
    }
    let new = |k: u32| renumbered[k as usize] as u32;
    let turned: Vec<Side> =
        sides.iter().rev().map(|side| Side { texel: new(side.texel), beyond: side.beyond.map(new) }).collect();
    let paint = WetPaint::default();
    let [mut one, mut two] = [(texels, sides), (shuffled, turned)]
        .map(|(texels, sides)| WetFilm::new(Film::new(texels).unwrap(), &sides, paint, Ground::default()).unwrap());
    for (k, &other) in renumbered.iter().enumerate().take(60) {
        let thickness = 1e-4 + 2e-5 * f64::from(k as u32 % 13);
        wet(&mut one, &paint, k, thickness);
        wet(&mut two, &paint, other, thickness);
    }
    one.step(200.0).unwrap();
    two.step(200.0).unwrap();
    assert!(one.share_ran() > 0.1);
    for (&volume, &other) in one.film().volumes().iter().zip(&renumbered) {
        assert_eq!(volume, two.film().volumes()[other]);
    }
}

/// What is sprayed, dries, soaks in, runs and drips is there in the end, whatever happens on the way.
#[test]
fn nothing_is_lost_in_a_long_run_and_drops_are_booked() {
    let (texels, sides) = wall(5, 20, 2e-3, -0.1);
    let paint = WetPaint { surface_tension: 0.001, ..WetPaint::default() };
    let ground = Ground { sorptivity: 1e-6, capacity: 3e-5 };
    let mut film = WetFilm::new(Film::new(texels).unwrap(), &sides, paint, ground).unwrap();
    for round in 0..40 {
        wet_all(&mut film, round);
        film.step(13.7).unwrap();
        assert!(film.film().mass_balance().balanced() && film.liquid_balance().balanced());
        let there: u64 = film.film().volumes().iter().sum();
        assert_eq!(film.film().mass_balance().deposited, there);
    }
    let (solids, liquid) = (film.film().mass_balance(), film.liquid_balance());
    assert!(solids.dripped > 0 && liquid.dripped > 0 && liquid.soaked > 0 && liquid.evaporated > 0);
    while !film.is_dry() {
        film.step(100.0).unwrap();
    }
    let dry = film.film().volumes().to_vec();
    film.step(1e6).unwrap();
    assert_eq!(film.film().volumes(), dry, "what is dry stays");
}

/// Shots over the wall, a little elsewhere each round.
fn wet_all(film: &mut WetFilm, round: usize) {
    let texels = film.film().texels();
    let texel = texels[(round * 37) % texels.len()];
    let origin = texel.point + texel.normal.into_inner() * 0.05;
    let shot = Shot { origin, axis: -texel.normal, volume: 4e-8 };
    film.deposit(&[shot], &SprayModel::default(), &far_plate(), 1, &mut |_, _| ()).unwrap();
}

/// A film dries when the air has taken `h (1 - s / t)` of solvent, with the solids s in the can and t touch-dry.
#[test]
fn a_film_is_dry_to_touch_when_its_solvent_has_gone() {
    let paint = WetPaint { evaporation: 1e-7, ..WetPaint::default() };
    let (texels, sides) = wall(1, 1, 1e-2, 0.0);
    let mut film = WetFilm::new(Film::new(texels).unwrap(), &sides, paint, Ground::default()).unwrap();
    let thickness = 1e-4;
    wet(&mut film, &paint, 0, thickness);
    let closed = thickness * (1.0 - paint.solids / paint.touch_dry) / paint.evaporation;
    assert!((film.time_to_dry() / closed - 1.0).abs() < 1e-6);
    assert!((paint.drying_time(thickness) / closed - 1.0).abs() < 1e-12);
    film.step(closed - 10.0).unwrap();
    assert!(!film.is_dry());
    film.step(20.0).unwrap();
    assert!(film.is_dry() && film.wet_thickness(0) == 0.0 && film.time_to_dry() == 0.0);
    let left = film.film().thickness(0);
    assert!((left - paint.solids * thickness).abs() < 1e-6 * left, "the solids stay: {left}");
}

/// Washburn 1921: a wet ground soaks up sorptivity times the root of the time, however that is divided, until it is full.
#[test]
fn the_ground_soaks_up_by_the_root_of_the_time_until_it_is_full() {
    let paint = WetPaint { evaporation: 0.0, touch_dry: 0.9, packing: 1.0, ..WetPaint::default() };
    let ground = Ground { sorptivity: 2e-6, capacity: 4e-5 };
    for pieces in [1, 7] {
        let (texels, sides) = wall(1, 1, 1e-2, 0.0);
        let mut film = WetFilm::new(Film::new(texels).unwrap(), &sides, paint, ground).unwrap();
        wet(&mut film, &paint, 0, 1e-4);
        let soaked = |film: &WetFilm| film.liquid_balance().soaked as f64 * QUANTUM / 1e-4;
        for _ in 0..pieces {
            film.step(100.0 / f64::from(pieces)).unwrap();
        }
        let closed = 2e-6 * 100.0_f64.sqrt();
        assert!((soaked(&film) / closed - 1.0).abs() < 1e-6, "{} {closed}", soaked(&film));
        film.step(1000.0).unwrap();
        assert!((soaked(&film) / 4e-5 - 1.0).abs() < 1e-6, "full: {}", soaked(&film));
    }
}

/// Paint over paint that is dry to touch does not run the earlier for it; over wet paint it does.
#[test]
fn a_second_coat_runs_on_a_wet_one_only() {
    let paint = WetPaint::default();
    for (pause, runs) in [(0.0, true), (3600.0, false)] {
        let (texels, sides) = wall(1, 4, 2e-3, 0.0);
        let sag = paint.sag_thickness(&texels[0].normal);
        let mut film = WetFilm::new(Film::new(texels).unwrap(), &sides, paint, Ground::default()).unwrap();
        wet(&mut film, &paint, 0, 0.7 * sag);
        film.step(pause).unwrap();
        wet(&mut film, &paint, 0, 0.7 * sag);
        film.step(60.0).unwrap();
        assert_eq!(film.ran()[0], runs, "after {pause} s");
    }
}

#[test]
fn a_stiff_paint_flows_as_much_less_as_it_is_stiffer() {
    // Maron and Pierce: (1 - s / p)^-2 over that of the can.
    let paint = WetPaint { solids: 0.3, touch_dry: 0.55, packing: 0.6, yield_stress: 0.0, ..WetPaint::default() };
    assert!((paint.stiffening(0.45) - (0.5_f64 / 0.25).powi(2)).abs() < 1e-12);
    let [thin, stiff] = [1.0, 4.0].map(|stiffening| paint.flux(1e-4, 1e4, stiffening));
    assert!((thin / stiff - 4.0).abs() < 1e-12);
}

/// What is all solids in the can is dry where it lands, however thick; between, its states lie in proportion.
#[test]
fn paint_without_solvent_stays_where_it_lands() {
    let half = WetPaint::of_solids(0.675);
    assert!((half.touch_dry - 0.775).abs() < 1e-12 && (half.packing - 0.82).abs() < 1e-12, "{half:?}");
    let (texels, sides) = wall(1, 3, 2e-3, 0.0);
    let paint = WetPaint::of_solids(1.0);
    let mut film = WetFilm::new(Film::new(texels).unwrap(), &sides, paint, Ground::default()).unwrap();
    wet(&mut film, &paint, 0, 1e-2);
    assert!(film.is_dry());
    film.step(100.0).unwrap();
    assert_eq!((film.film().volumes()[1], film.ran()[0]), (0, false));
}

#[test]
fn what_makes_no_sense_is_refused_by_name() {
    let (texels, sides) = wall(2, 2, 1e-2, 0.0);
    let film = Film::new(texels).unwrap();
    let refused = |paint: WetPaint, ground: Ground, sides: &[Side]| {
        WetFilm::new(film.clone(), sides, paint, ground).map(|_| ()).unwrap_err().to_string()
    };
    let paint = WetPaint::default();
    let ground = Ground::default();
    assert!(refused(WetPaint { viscosity: 0.0, ..paint }, ground, &sides).starts_with("wet.viscosity"));
    assert!(refused(WetPaint { density: f64::NAN, ..paint }, ground, &sides).starts_with("wet.density"));
    assert!(refused(WetPaint { touch_dry: 0.3, ..paint }, ground, &sides).starts_with("wet.touch_dry"));
    assert!(refused(WetPaint { packing: 0.5, ..paint }, ground, &sides).starts_with("wet.packing"));
    assert!(refused(WetPaint { yield_stress: -1.0, ..paint }, ground, &sides).starts_with("wet.yield_stress"));
    assert!(refused(paint, Ground { sorptivity: -1.0, ..ground }, &sides).starts_with("ground.sorptivity"));
    let elsewhere = [Side { texel: 0, beyond: Some(4) }];
    assert!(refused(paint, ground, &elsewhere).starts_with("texel of a side = 4"));
    let mut film = WetFilm::new(film, &sides, paint, ground).unwrap();
    assert!(matches!(film.step(f64::NAN), Err(Error::OutOfRange { .. })));
    assert!(matches!(film.step(-1.0), Err(Error::OutOfRange { .. })));
}

/// Shots with a spray each bring the can's solvent as shots with one do.
#[test]
fn shots_with_sprays_of_their_own_are_wet_too() {
    let (texels, sides) = wall(9, 9, 2e-3, 0.0);
    let film = WetFilm::new(Film::new(texels).unwrap(), &sides, WetPaint::default(), Ground::default()).unwrap();
    let shot = Shot { origin: Point3::new(-0.05, 8e-3, -8e-3), axis: Vector3::x_axis(), volume: 2e-9 };
    let spray = SprayModel::default();
    let (mut one, mut each) = (film.clone(), film);
    let balance = one.deposit(&[shot, shot], &spray, &far_plate(), 1, &mut |_, _| ()).unwrap();
    assert_eq!(each.deposit_each(&[(shot, spray); 2], &far_plate(), 2).unwrap(), balance);
    for film in [&mut one, &mut each] {
        film.step(60.0).unwrap();
    }
    assert_eq!(one.film().volumes(), each.film().volumes());
    assert!(one.liquid_balance() == each.liquid_balance() && one.liquid_balance().landed > 0);
}

/// A metre of paint does not hang the program, and says that it was held back.
#[test]
fn a_flood_ends_and_says_so() {
    let (texels, sides) = wall(1, 50, 1e-2, 0.0);
    let paint = WetPaint { viscosity: 1e-3, yield_stress: 0.0, ..WetPaint::default() };
    let mut film = WetFilm::new(Film::new(texels).unwrap(), &sides, paint, Ground::default()).unwrap();
    wet(&mut film, &paint, 0, 1.0);
    let flow = film.step(10.0).unwrap();
    assert!(flow.held_back > 0 && flow.steps <= 20_002);
    assert!(film.film().mass_balance().balanced() && film.film().mass_balance().dripped > 0);
}
