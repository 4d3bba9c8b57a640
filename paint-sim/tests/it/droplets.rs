//! Droplets on texels against closed forms.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use paint_sim::droplets::{
    Coverage, DensityPlace, DensitySettings, DepositSettings, Droplets, Flux, GantryGeometry, Nozzle, PathSimulation,
    SimulatedSegment, StepHits, Sweep, TexelFace, TexelSurface, density_map,
};
use paint_sim::{Error, SprayModel};

const SIDE: usize = 80;
const TEXEL: f32 = 1e-3;

/// A wall of 80 mm in the plane x = `at`, painted on the side of negative x, 1 mm texels; column along -y, row along -z.
fn wall_at(at: f32) -> Vec<TexelFace> {
    let half = SIDE as f32 * TEXEL / 2.0;
    let corner = |u: f32, v: f32| ([at, half - u * TEXEL, half - v * TEXEL], [u, v]);
    let n = SIDE as f32;
    let face = |corners: [([f32; 3], [f32; 2]); 3]| TexelFace {
        corners: corners.map(|c| c.0),
        texels: Some(corners.map(|c| c.1)),
    };
    let [a, b, c, d] = [corner(0.0, 0.0), corner(0.0, n), corner(n, n), corner(n, 0.0)];
    vec![face([a, b, c]), face([a, c, d])]
}

fn surface(faces: &[TexelFace]) -> TexelSurface {
    TexelSurface::new(faces, [SIDE, SIDE], &vec![1e-6; SIDE * SIDE]).unwrap()
}

fn spray() -> SprayModel {
    SprayModel { sigma: 1.0_f64.to_radians(), range: 0.3, ..SprayModel::default() }
}

fn nozzle(y: f64, z: f64) -> Nozzle {
    Nozzle { origin: Point3::new(0.0, y, z), axis: Vector3::x_axis(), up: Vector3::z_axis() }
}

fn ask(surface: &TexelSurface, coverage: &Coverage, nozzles: &[Nozzle], flux: Flux, threads: usize) -> Vec<f32> {
    let places: Vec<_> = nozzles.iter().map(|&nozzle| DensityPlace { nozzle, saturation: f32::INFINITY }).collect();
    let droplets = Droplets::new(&spray(), 1024, 0).unwrap();
    density_map(surface, coverage, &droplets, &places, &DensitySettings { flux, threads })
}

#[test]
fn droplets_spread_as_the_gaussian_of_the_cone() {
    let (sigma, cut) = (1.0_f64.to_radians().tan(), 3.0_f64);
    for number in [0, 1, 77] {
        let set = Droplets::new(&spray(), 4096, number).unwrap();
        let radii: Vec<f64> = set.slopes().map(|[x, y]| f64::from(x).hypot(f64::from(y)) / sigma).collect();
        assert!(radii.iter().all(|r| *r <= cut * (1.0 + 1e-6)));
        // Rayleigh's distribution, cut at three sigmas.
        for at in [0.5, 1.0, 1.5, 2.0] {
            let share = radii.iter().filter(|r| **r <= at).count() as f64 / 4096.0;
            let exact = -(-0.5 * at * at).exp_m1() / -(-0.5 * cut * cut).exp_m1();
            assert!((share - exact).abs() < 4e-3, "{number} {at}: {share} {exact}");
        }
    }
    assert!(matches!(Droplets::new(&spray(), 100, 0), Err(Error::OutOfRange { .. })));
}

/// Eq. (1) over an even target: thickness times distance over cosine, or over the squared distance as printed.
#[test]
fn the_density_of_an_even_wall_is_the_closed_form() {
    let wall = surface(&wall_at(0.06));
    let coverage = Coverage::new(&wall, &vec![20e-6; SIDE * SIDE]).unwrap();
    let tilt = 0.3_f64;
    let tilted = Nozzle {
        axis: UnitQuaternion::from_scaled_axis(Vector3::z() * tilt) * Vector3::x_axis(),
        ..nozzle(-0.01, 0.0)
    };
    let found = ask(&wall, &coverage, &[nozzle(0.0, 0.0), tilted, nozzle(0.0, 0.2)], Flux::Physical, 1);
    // Distance squared over the height above the plane, averaged over the cone: a little more than on the axis.
    let spread = 1.0 + 2.0 * 1.0_f64.to_radians().tan().powi(2) * 0.95;
    assert!((f64::from(found[0]) - 20e-6 * 0.06 * spread).abs() < 1e-3 * 20e-6 * 0.06);
    let slanted = 20e-6 * (0.06 / tilt.cos()) / tilt.cos();
    assert!((f64::from(found[1]) / slanted - 1.0).abs() < 3e-3, "{} {slanted}", found[1]);
    assert_eq!(found[2], 0.0);
    let literal = ask(&wall, &coverage, &[nozzle(0.0, 0.0)], Flux::PaperLiteral, 1);
    assert!((f64::from(literal[0]) / (20e-6 / 0.0036) - 1.0).abs() < 2e-3);
}

#[test]
fn half_of_the_cone_beside_the_target_needs_half() {
    let wall = surface(&wall_at(0.06));
    // Paint is wanted where y > 0: the left half of the columns.
    let thickness: Vec<f64> = (0..SIDE * SIDE).map(|k| if k % SIDE < SIDE / 2 { 20e-6 } else { 0.0 }).collect();
    let coverage = Coverage::new(&wall, &thickness).unwrap();
    let sigma = 0.06 * 1.0_f64.to_radians().tan();
    let places = [nozzle(0.0, 0.0), nozzle(sigma, 0.0), nozzle(-sigma, 0.0)];
    let found = ask(&wall, &coverage, &places, Flux::Physical, 1);
    for (value, share) in found.iter().zip([0.5, 0.8437, 0.1563]) {
        // The Gaussian's integral, cut at three sigmas.
        assert!((f64::from(*value) / (20e-6 * 0.06) - share).abs() < 0.02, "{value} {share}");
    }
    // Many threads give the same bytes.
    let many: Vec<Nozzle> = (0..57).map(|k| nozzle(1e-3 * f64::from(k - 28), 2e-4 * f64::from(k))).collect();
    let once = ask(&wall, &coverage, &many, Flux::Physical, 1);
    for threads in [2, 3, 64] {
        assert_eq!(ask(&wall, &coverage, &many, Flux::Physical, threads), once);
    }
}

#[test]
fn what_stands_before_the_wall_keeps_the_paint() {
    let mut faces = wall_at(0.06);
    let open = surface(&faces);
    // A plate without texels before the lower half of the wall.
    let plate = [[0.05, -0.04, -0.04], [0.05, 0.04, -0.04], [0.05, 0.04, 0.0], [0.05, -0.04, 0.0]];
    faces.extend([[0, 1, 2], [0, 2, 3]].map(|f| TexelFace { corners: f.map(|k| plate[k]), texels: None }));
    let shadowed = surface(&faces);
    let droplets = Droplets::new(&spray(), 1024, 0).unwrap();
    let hits = |surface: &TexelSurface, z: f64| StepHits::cast(surface, &nozzle(0.0, z), &droplets);
    assert_eq!((hits(&open, -0.02).missed, hits(&shadowed, -0.02).missed), (0, 1024));
    assert_eq!(hits(&shadowed, 0.02), hits(&open, 0.02));
    let half = hits(&shadowed, 0.0).missed;
    assert!((492..=532).contains(&half), "{half}");
    // From behind the wall nothing lands on its painted side.
    let behind = Nozzle { origin: Point3::new(0.12, 0.0, 0.0), axis: -Vector3::x_axis(), up: Vector3::z_axis() };
    assert_eq!(StepHits::cast(&open, &behind, &droplets).missed, 1024);
}

/// Many small faces and few large ones are hit in the same places: the hierarchy and the search by hand agree.
#[test]
fn a_fine_mesh_is_hit_as_a_coarse_one() {
    let coarse = wall_at(0.06);
    let mut fine = Vec::new();
    for face in &coarse {
        // Each face into 64, by halves along its sides.
        let mut parts = vec![*face];
        for _ in 0..3 {
            parts = parts.iter().flat_map(quartered).collect();
        }
        fine.extend(parts);
    }
    assert_eq!(fine.len(), 128);
    let (coarse, fine) = (surface(&coarse), surface(&fine));
    let droplets = Droplets::new(&spray(), 1024, 3).unwrap();
    for k in 0..40 {
        let at = nozzle(1.3e-3 * f64::from(k - 20), 0.7e-3 * f64::from(k - 20));
        let (a, b) = (StepHits::cast(&coarse, &at, &droplets), StepHits::cast(&fine, &at, &droplets));
        assert_eq!((a.missed, b.missed), (0, 0));
        // Rounding may move a droplet over the edge of a texel.
        let moved: i64 = difference(&a, &b);
        assert!(moved <= 4, "{moved}");
    }
}

fn quartered(face: &TexelFace) -> [TexelFace; 4] {
    let mid = |a: usize, b: usize| {
        let half = |p: f32, q: f32| 0.5 * (p + q);
        let corner = std::array::from_fn(|k| half(face.corners[a][k], face.corners[b][k]));
        let texels = face.texels.unwrap();
        (corner, std::array::from_fn(|k| half(texels[a][k], texels[b][k])))
    };
    let own = |k: usize| (face.corners[k], face.texels.unwrap()[k]);
    let (ab, bc, ca) = (mid(0, 1), mid(1, 2), mid(2, 0));
    let make = |c: [([f32; 3], [f32; 2]); 3]| TexelFace { corners: c.map(|c| c.0), texels: Some(c.map(|c| c.1)) };
    [make([own(0), ab, ca]), make([ab, own(1), bc]), make([ca, bc, own(2)]), make([ab, bc, ca])]
}

fn difference(a: &StepHits, b: &StepHits) -> i64 {
    let count = |hits: &StepHits, texel: u32| hits.texels.iter().find(|t| t.0 == texel).map_or(0, |t| i64::from(t.1));
    let texels = || a.texels.iter().chain(&b.texels).map(|t| t.0).collect::<std::collections::BTreeSet<_>>();
    texels().into_iter().map(|texel| (count(a, texel) - count(b, texel)).abs()).sum()
}

/// Eqs. (6) and (7) with numbers worked out by hand.
#[test]
fn the_score_of_a_step_is_that_of_the_equations() {
    let hits = StepHits { texels: vec![(3, 2), (5, 4), (8, 1)], missed: 1 };
    let remaining = |texel: u32| [0, 0, 0, 50, 0, 25, 0, 0, -7][texel as usize];
    // Droplets of 10: texel 3 takes 20 of 50; texel 5 takes 25 of 40, 15 too much; texel 8 has too much already.
    let outcome = hits.score(10, 2.0, remaining);
    assert_eq!((outcome.useful, outcome.paint, outcome.score), (45, 70, 45.0 - 2.0 * 25.0));
}

fn sweep() -> Sweep {
    // The robot's x axis looks at the wall; it moves along y.
    Sweep { velocity: Vector3::new(0.0, 0.1, 0.0), ..Sweep::still(Isometry3::translation(0.0, -0.02, 0.0)) }
}

#[test]
fn paths_are_simulated_with_the_paint_that_they_place() {
    let wall = surface(&wall_at(0.06));
    let deposit = DepositSettings::default();
    let sets = Droplets::sets(&spray(), deposit.droplets, 16).unwrap();
    let gantry = GantryGeometry::default();
    let path = [0, 1].map(|k| SimulatedSegment {
        key: [k, 0, 0],
        start: 0.2 * f64::from(k),
        duration: 0.2,
        from: 0.05,
        to: 0.05,
    });
    let run = |thickness: f64| {
        let coverage = Coverage::new(&wall, &vec![thickness; SIDE * SIDE]).unwrap();
        let mut simulation = PathSimulation::new(&wall, &coverage, &sets, &deposit, &gantry, &sweep()).unwrap();
        let first = simulation.simulate(&path);
        // The paint is as before, and the second run uses the hits of the first.
        assert_eq!(simulation.simulate(&path), first);
        first
    };
    // A thick target takes everything: flow times time, to the rounding of a droplet.
    let all = run(1e-3);
    let expected = 0.5e-9 * 0.4 / 1e-18;
    assert!((all.paint as f64 / expected - 1.0).abs() < 1e-4 && all.valve == vec![true; 40]);
    assert_eq!(all.useful, all.paint);
    // One that is thinner than a pass leaves the valve shut part of the time; a bare one never opens it.
    let some = run(3e-7);
    assert!(some.paint < all.paint && some.useful <= some.paint && some.valve.iter().any(|open| !open));
    // Spraying for real places the same.
    let mut coverage = Coverage::new(&wall, &vec![3e-7; SIDE * SIDE]).unwrap();
    let mut placed = 0;
    for k in 0..40 {
        let nozzle = gantry.nozzle(&sweep().at((f64::from(k) + 0.5) * 0.01), 0.05);
        let hits = StepHits::cast(&wall, &nozzle, &sets[k as usize % 16]);
        let outcome = hits.score(deposit.droplet(), deposit.punishment, |texel| coverage.remaining(texel as usize));
        assert_eq!(outcome.score > 0.0, some.valve[k as usize]);
        if outcome.score > 0.0 {
            placed += coverage.spray(&hits, deposit.droplet());
        }
    }
    assert_eq!(placed, some.paint);
}

/// The nozzle of a step is that of its middle: along the slide, and with the robot.
#[test]
fn steps_of_a_path_are_cast_from_their_middles() {
    let wall = surface(&wall_at(0.06));
    let deposit = DepositSettings::default();
    let sets = Droplets::sets(&spray(), deposit.droplets, 16).unwrap();
    let coverage = Coverage::new(&wall, &vec![1e-6; SIDE * SIDE]).unwrap();
    let (gantry, sweep) = (GantryGeometry::default(), sweep());
    let simulation = PathSimulation::new(&wall, &coverage, &sets, &deposit, &gantry, &sweep).unwrap();
    let segment = SimulatedSegment { key: [1, 0, 0], start: 0.2, duration: 0.2, from: 0.02, to: 0.06 };
    let steps = simulation.missing(&segment);
    assert_eq!((steps.len(), steps[0].set, steps[19].set), (20, 20 % 16, 39 % 16));
    for (k, step) in steps.iter().enumerate() {
        let passed = (k as f64 + 0.5) / 20.0;
        // 10 cm/s along y from -2 cm; the slide's zero is 5 cm below the robot.
        let expected = Point3::new(0.0, -0.02 + 0.1 * (0.2 + 0.2 * passed), -0.05 + 0.02 + 0.04 * passed);
        assert!((step.nozzle.origin - expected).norm() < 1e-12, "{k}: {}", step.nozzle.origin);
    }
}

/// Turns are about the axes of the world, and move what is painted as well as the robot.
#[test]
fn a_sweep_turns_about_the_axes_of_the_world() {
    let quarter = std::f64::consts::FRAC_PI_2;
    let turned = UnitQuaternion::from_scaled_axis(Vector3::z() * quarter);
    let still = Sweep::still(Isometry3::from_parts(Vector3::zeros().into(), turned));
    let sweep = Sweep { angular_velocity: Vector3::x() * 0.5, ..still };
    // The robot's x axis is the world's y at first, and has risen after a quarter turn about the world's x.
    let pose = sweep.at(quarter / 0.5);
    assert!((pose.rotation * Vector3::x() - Vector3::z()).norm() < 1e-12, "{pose}");
    let gantry = GantryGeometry::default();
    let level = Sweep::still(Isometry3::identity());
    let both = Sweep { velocity: Vector3::y() * 0.1, angular_velocity: Vector3::z() * 0.5, ..level };
    // 10 cm/s, and half a radian a second of a lever of 20 cm.
    assert!((both.cross_speed(&gantry, 0.2, 0.0) - 0.2).abs() < 1e-12);
    let aside = Sweep { velocity: Vector3::x() * 0.1, ..level };
    assert_eq!(aside.cross_speed(&gantry, 0.2, 0.0), 0.0);
}

#[test]
fn a_target_of_another_size_is_refused() {
    let wall = surface(&wall_at(0.06));
    let wrong = Coverage::new(&wall, &[1e-6; 99]);
    assert!(matches!(wrong, Err(Error::OutOfRange { what: "number of target texels", .. })));
    assert!(matches!(Coverage::new(&wall, &vec![0.0; SIDE * SIDE]), Err(Error::Empty { .. })));
    let thin = TexelFace { corners: [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], texels: None };
    let mut faces = wall_at(0.06);
    faces.push(thin);
    assert_eq!(surface(&faces).faces_left_out(), 1);
    assert!(matches!(TexelSurface::new(&[thin], [1, 1], &[1.0]), Err(Error::NoArea { .. })));
}

#[test]
fn figures_count_paint_inside_outside_and_above() {
    let wall = surface(&wall_at(0.06));
    let mut thickness = vec![0.0; SIDE * SIDE];
    thickness[..4].fill(10e-6);
    let mut coverage = Coverage::new(&wall, &thickness).unwrap();
    // A coat is 1e-11 m^3 = 1e7 fL on a texel. Half, all, 1.2 coats, and half a coat beside the target twice.
    for (texel, paint) in [(0, 5_000_000), (1, 10_000_000), (2, 12_000_000), (9, 5_000_000), (10, 5_000_000)] {
        assert_eq!(coverage.add(texel, paint), paint);
    }
    let figures = coverage.figures();
    assert_eq!((figures.inside, figures.outside, figures.above), (2.5 / 4.0, 1.0 / 4.0, 0.2 / 4.0));
    let one = 1.0 / (SIDE * SIDE) as f64;
    assert_eq!((figures.overdosed_wanted, figures.overdosed_bare, figures.overdosed()), (one, 2.0 * one, 3.0 * one));
}

/// Only texels that want a full coat count: half a coat more on one of two, nothing of what differs elsewhere.
#[test]
fn the_difference_of_two_paintings_is_told_where_a_full_coat_is_wanted() {
    let wall = surface(&wall_at(0.06));
    let mut thickness = vec![0.0; SIDE * SIDE];
    (thickness[0], thickness[1], thickness[2]) = (10e-6, 10e-6, 5e-6);
    let mut one = Coverage::new(&wall, &thickness).unwrap();
    let mut other = one.clone();
    one.add(0, 5_000_000);
    other.add(2, 5_000_000);
    other.add(9, 5_000_000);
    assert!((one.difference(&other) - 0.125_f64.sqrt()).abs() < 1e-9);
    assert_eq!((one.difference(&other), one.difference(&one)), (other.difference(&one), 0.0));
}

/// Texels of the page that are no surface, and those beyond it.
#[test]
fn paint_beside_the_surface_is_not_booked() {
    let mut areas = vec![1e-6; SIDE * SIDE];
    areas[7] = 0.0;
    let wall = TexelSurface::new(&wall_at(0.06), [SIDE, SIDE], &areas).unwrap();
    let mut coverage = Coverage::new(&wall, &vec![10e-6; SIDE * SIDE]).unwrap();
    assert_eq!([6, 7, SIDE * SIDE].map(|texel| coverage.add(texel, 1000)), [1000, 0, 0]);
    assert_eq!((coverage.current()[6], coverage.current()[7]), (1000, 0));
}

/// The GPU agrees with the processor within what is stated.
#[cfg(feature = "gpu")]
#[test]
fn the_gpu_gives_the_same_density() {
    use paint_sim::droplets::GpuDensity;
    let mut faces = wall_at(0.06);
    for _ in 0..3 {
        faces = faces.iter().flat_map(quartered).collect();
    }
    let wall = surface(&faces);
    let thickness: Vec<f64> =
        (0..SIDE * SIDE).map(|k| if (k / SIDE + k % SIDE) % 7 < 3 { 20e-6 } else { 0.0 }).collect();
    let coverage = Coverage::new(&wall, &thickness).unwrap();
    let droplets = Droplets::new(&spray(), 1024, 0).unwrap();
    let Some(gpu) = crate::gpu::available(GpuDensity::new(&droplets, &crate::gpu::options())) else { return };
    let place = |k: i32| {
        let turned =
            UnitQuaternion::from_scaled_axis(Vector3::new(0.1, 0.02 * f64::from(k % 9), 0.01 * f64::from(k % 5)));
        let at = nozzle(1e-3 * f64::from(k % 41 - 20), 1e-3 * f64::from(k % 37 - 18));
        let nozzle = Nozzle { axis: turned * at.axis, up: turned * at.up, ..at };
        DensityPlace { nozzle, saturation: if k % 2 == 0 { f32::INFINITY } else { 5e-7 } }
    };
    let places: Vec<_> = (0..500).map(place).collect();
    for flux in [Flux::Physical, Flux::PaperLiteral] {
        let expected = density_map(&wall, &coverage, &droplets, &places, &DensitySettings { flux, threads: 2 });
        let found = gpu.density_map(&wall, &coverage, &places, flux).unwrap();
        let most = expected.iter().copied().fold(0.0, f32::max);
        let worst = expected.iter().zip(&found).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        // A droplet that changes its texel moves the mean by a thousandth of a full need at most.
        assert!(most > 0.0 && worst <= 3e-3 * most, "{worst} of {most}");
        let mean = expected.iter().zip(&found).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>() / 500.0;
        assert!(mean <= 1e-4 * f64::from(most), "{mean} of {most}");
    }
    assert!(!gpu.name().is_empty());
}

/// Droplets cast on the GPU land where the processor's do, and a path simulated from them does the same.
#[cfg(feature = "gpu")]
#[test]
fn a_path_simulated_with_the_hits_of_a_gpu_is_that_of_the_processor() {
    use paint_sim::droplets::{GpuHits, StepCast};
    let mut faces = wall_at(0.06);
    for _ in 0..3 {
        faces = faces.iter().flat_map(quartered).collect();
    }
    let wall = surface(&faces);
    let thickness: Vec<f64> =
        (0..SIDE * SIDE).map(|k| if (k / SIDE + k % SIDE) % 17 < 9 { 5e-6 } else { 0.0 }).collect();
    let coverage = Coverage::new(&wall, &thickness).unwrap();
    let (deposit, gantry) = (DepositSettings::default(), GantryGeometry::default());
    let sets = Droplets::sets(&spray(), deposit.droplets, 16).unwrap();
    let options = crate::gpu::options();
    assert!(matches!(GpuHits::new(&[], &options), Err(Error::Empty { .. })));
    let Some(gpu) = crate::gpu::available(GpuHits::new(&sets, &options)) else { return };
    let segment =
        |k: i32, to: f64| SimulatedSegment { key: [k, 0, 0], start: 0.1 * f64::from(k), duration: 0.1, from: 0.05, to };
    let path: Vec<_> = (0..20).map(|k| segment(k, if k % 3 == 0 { 0.055 } else { 0.045 })).collect();
    let new = || PathSimulation::new(&wall, &coverage, &sets, &deposit, &gantry, &sweep()).unwrap();
    let (mut alone, mut helped) = (new(), new());
    let (mut droplets, mut elsewhere) = (0, 0);
    for segment in &path {
        let steps = helped.missing(segment);
        let found = gpu.cast(&wall, &steps).unwrap();
        assert_eq!((steps.len(), found.len()), (10, 10));
        for (step, hits) in steps.iter().zip(&found) {
            let expected = StepHits::cast(&wall, &step.nozzle, &sets[step.set]);
            let count = |hits: &StepHits| {
                let mut counts = vec![0_i64; SIDE * SIDE + 1];
                hits.texels.iter().for_each(|&(texel, n)| counts[texel as usize] += i64::from(n));
                counts[SIDE * SIDE] = i64::from(hits.missed);
                counts
            };
            droplets += deposit.droplets;
            elsewhere += count(&expected).iter().zip(count(hits)).map(|(a, b)| (a - b).unsigned_abs()).sum::<u64>() / 2;
        }
        // Another number of steps is refused; what is kept is not asked for again.
        assert!(helped.keep(segment, found[1..].to_vec()).is_err());
        helped.keep(segment, found).unwrap();
        assert!(helped.missing(segment).is_empty());
    }
    assert!(elsewhere as f64 <= 1e-3 * droplets as f64, "{elsewhere} of {droplets}");
    let (a, b) = (alone.simulate(&path), helped.simulate(&path));
    let open = a.valve.iter().filter(|open| **open).count();
    assert!(open > 20 && open < a.valve.len(), "{open}");
    assert!((a.useful as f64 / b.useful as f64 - 1.0).abs() < 2e-3, "{} {}", a.useful, b.useful);
    let other = a.valve.iter().zip(&b.valve).filter(|(a, b)| a != b).count();
    assert!(other <= 2, "{other}");
    assert!(matches!(
        gpu.cast(&wall, &[StepCast { set: 16, ..alone.missing(&segment(99, 0.05))[0] }]),
        Err(Error::OutOfRange { .. })
    ));
}
