//! The solvers against Clarabel, and stage 1 against a known optimum.

use super::clarabel_solver::Clarabel;
use super::quadratic_program::{QuadraticProgram, Row};
use super::{
    GaussSeidel, InteriorPoint, Mode, PrimalDualActiveSet, QpSolver, initial_states, optimise, stroke_program,
};
use crate::settings::NozzleSettings;
use crate::target::Target;
use nalgebra::{Matrix2x5, Matrix5, Point3, UnitVector3, Vector2, Vector3, Vector5};

/// Uniform numbers in [-1, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / f64::from(1_u32 << 26) / f64::from(1_u32 << 26) - 1.0
    }
}

/// A random strictly convex program whose hard rows admit the origin and whose soft ones, partly, do not.
fn random_program(count: usize, random: &mut Random) -> QuadraticProgram {
    let mut program = QuadraticProgram::new(count, 4, 3, 0.3);
    for i in 0..count {
        let root = Matrix5::from_fn(|_, _| random.next());
        program.hessian.diagonal[i] = root * root.transpose() + Matrix5::identity() * 4.0;
        if i + 1 < count {
            program.hessian.lower[i] = Matrix5::from_fn(|_, _| 0.3 * random.next());
        }
        program.gradient[i] = Vector5::from_fn(|_, _| 3.0 * random.next());
        program.soft_map[i] = Matrix2x5::from_fn(|_, _| random.next());
        for _ in 0..4 {
            program.push_hard(Vector3::from_fn(|_, _| random.next()), 0.05 + 0.2 * random.next().abs());
        }
        for _ in 0..3 {
            program.push_soft(Vector2::new(random.next(), random.next()), 0.2 * random.next());
        }
    }
    program
}

#[test]
fn the_solvers_of_whole_paths_agree_with_clarabel() {
    let mut random = Random(11);
    let (mut relaxed, mut settled, mut handed_on) = (0, 0, 0);
    for round in 0..40 {
        let count = 1 + 3 * (round % 20);
        let program = random_program(count, &mut random);
        let mut expected = vec![Vector5::zeros(); count];
        let general = Clarabel::default().solve(&program, &mut expected).unwrap();
        let mut steps = [0; 2];
        let solvers: [&dyn QpSolver; 2] = [&InteriorPoint, &PrimalDualActiveSet];
        for (solver, steps) in solvers.into_iter().zip(&mut steps) {
            let mut x = vec![Vector5::zeros(); count];
            let outcome = solver.solve(&program, &mut x).unwrap();
            *steps = outcome.steps;
            relaxed += usize::from(outcome.slack > 1e-3);
            assert!((outcome.slack - general.slack).abs() < 1e-6, "round {round}");
            assert!(x.iter().zip(&expected).all(|(x, expected)| (x - expected).amax() < 1e-6), "round {round}");
        }
        // Rounds that did not settle, and the steps of the interior-point method on top of them.
        settled += usize::from(steps[1] < steps[0]);
        handed_on += usize::from(steps[1] > steps[0] + 10);
    }
    assert!(relaxed > 40 && settled > 10 && handed_on > 0, "{relaxed} {settled} {handed_on}");
}

#[test]
fn the_rows_that_bind_on_a_rough_stroke_are_found_at_once() {
    let mut random = Random(4);
    let mut noise = || 0.3 * (random.next() + random.next() + random.next());
    let mut target = |k: u32| {
        let s = 0.01 * f64::from(k);
        let normal = UnitVector3::new_normalize(Vector3::new(-1.0, noise(), noise()));
        Target {
            point: Point3::new(0.05 * (4.0 * s).sin(), s, 2.0 + 0.2 * (3.0 * s).cos()),
            normal,
            dose: 0.0,
            time: None,
            stand_off: None,
        }
    };
    let targets: Vec<Target> = (0..300).map(&mut target).collect();
    let (program, start) = stroke_program(&targets, &NozzleSettings::default());
    let mut expected = start.clone();
    Clarabel::default().solve(&program, &mut expected).unwrap();
    let solve = |solver: &dyn QpSolver, most: usize| {
        let mut x = start.clone();
        let outcome = solver.solve(&program, &mut x).unwrap();
        assert!(outcome.steps <= most, "{solver:?}: {}", outcome.steps);
        assert!(x.iter().zip(&expected).all(|(x, expected)| (x - expected).amax() < 1e-6), "{solver:?}");
        x
    };
    solve(&InteriorPoint, 20);
    let x = solve(&PrimalDualActiveSet, 8);
    // The conditions of the optimum, from the program as it stands: no row is exceeded, and the slope is held by rows that bind.
    let (mut bound, mut free) = (0, 0);
    for i in 0..x.len() {
        let slope = program.curvature_times(&x, i) + program.gradient[i];
        let (p, w) = program.views(i, &x[i]);
        let rows =
            &program.rows[i * (program.hard_rows + program.soft_rows)..][..program.hard_rows + program.soft_rows];
        let (hard, soft) = rows.split_at(program.hard_rows);
        let excess =
            hard.iter().map(|row| row.a.dot(&p) - row.b).chain(soft.iter().map(|row| row.a.xy().dot(&w) - row.b));
        let most = excess.fold(f64::NEG_INFINITY, f64::max);
        assert!(most < 1e-9, "state {i}: {most}");
        if most < -1e-9 {
            assert!(slope.amax() < 1e-9, "state {i}: {slope}");
            free += 1;
        } else {
            bound += 1;
        }
    }
    assert!(bound > 30 && free > 30, "{bound} {free}");
}

#[test]
fn state_after_state_agrees_with_clarabel() {
    let mut random = Random(23);
    let (mut relaxed, mut alone) = (0, 0);
    for round in 0..300 {
        let count = 1 + round % 7;
        let mut program = random_program(count, &mut random);
        if round % 3 == 0 {
            // Uncoupled: one sweep.
            program.hessian.lower.iter_mut().for_each(|block| block.fill(0.0));
        }
        let mut x = vec![Vector5::zeros(); count];
        let outcome = GaussSeidel::default().solve(&program, &mut x).unwrap();
        alone += usize::from(outcome.steps == 1);
        relaxed += usize::from(outcome.slack > 1e-3);
        let mut expected = vec![Vector5::zeros(); count];
        let general = Clarabel::default().solve(&program, &mut expected).unwrap();
        assert!((outcome.slack - general.slack).abs() < 1e-6, "round {round}: {} {}", outcome.slack, general.slack);
        assert!(x.iter().zip(&expected).all(|(x, expected)| (x - expected).amax() < 1e-6), "round {round}");
    }
    assert!(relaxed > 150 && alone >= 100, "{relaxed} {alone}");
}

/// The wall x = 0 seen from smaller x; `normal_z` tilts the normal in the xz plane.
fn target(z: f64, normal_z: f64) -> Target {
    let normal = Vector3::new(-(1.0 - normal_z * normal_z).sqrt(), 0.0, normal_z);
    Target {
        point: Point3::new(0.0, 0.0, z),
        normal: UnitVector3::new_normalize(normal),
        dose: 0.0,
        time: None,
        stand_off: None,
    }
}

#[test]
fn three_targets_of_known_optimum() {
    // Solved by hand for c_a = 1, c_d = 4 and a fixed distance of 0.1 m; all other terms switched off.
    let targets = [target(0.0, 0.0), target(0.01, 0.6), target(0.02, 0.0)];
    let settings = NozzleSettings {
        min: 0.1 - 1e-7,
        max: 0.1 + 1e-7,
        ca: 1.0,
        cb: 0.0,
        cc: 1e-9,
        cd: 4.0,
        distance: 0.0,
        rounds: 12,
        ..NozzleSettings::default()
    };
    let initial_states = initial_states(&targets, &settings);
    let result =
        optimise(&targets, &initial_states, &[true; 2], Mode::Sequential, &PrimalDualActiveSet, &settings).unwrap();
    let expected = [[-0.1, 0.0, 0.0111922], [-0.0905293, 0.0, 0.0559610], [-0.1, 0.0, 0.0271922]];
    let deviations = [0.011192, 0.017549, 0.007192];
    for i in 0..3 {
        let p = result.states[i].unwrap().position;
        assert!((p - Point3::from(expected[i])).norm() < 1e-6);
        assert!((targets[i].normal_deviation(&p) - deviations[i]).abs() < 1e-6);
    }
}

#[test]
fn the_answer_is_a_minimum_of_the_cost_as_written() {
    let mut random = Random(5);
    let targets: Vec<Target> = (0..12).map(|i| target(0.025 * f64::from(i), 0.2 * random.next())).collect();
    let settings = NozzleSettings { cb: 0.0, cc: 1e-9, rounds: 10, ..NozzleSettings::default() };
    let initial_states = initial_states(&targets, &settings);
    let result =
        optimise(&targets, &initial_states, &[true; 11], Mode::Sequential, &PrimalDualActiveSet, &settings).unwrap();
    let p: Vec<Point3<f64>> = result.states.iter().map(|s| s.unwrap().position).collect();
    let cost = |p: &[Point3<f64>]| {
        let smooth: f64 = p.windows(2).map(|pair| settings.ca * (pair[1] - pair[0]).norm_squared()).sum();
        let local = |(t, p): (&Target, &Point3<f64>)| {
            let height = t.normal.dot(&(p - t.point));
            settings.cd * t.normal_deviation(p).powi(2) + settings.distance * (height - settings.stand_off).powi(2)
        };
        smooth + targets.iter().zip(p).map(local).sum::<f64>()
    };
    for i in 0..12 {
        for direction in [Vector3::x(), Vector3::y(), Vector3::z()] {
            for step in [-1e-4, 1e-4] {
                let mut moved = p.clone();
                moved[i] += direction * step;
                assert!(cost(&moved) > cost(&p));
            }
        }
    }
}

#[test]
fn cut_links_leave_the_strokes_alone() {
    let targets: Vec<Target> = (0..6).map(|i| target(if i < 3 { 0.02 } else { 1.0 } * f64::from(i), 0.1)).collect();
    let settings = NozzleSettings::default();
    let linked = [true, true, false, true, true];
    let whole = optimise(
        &targets,
        &initial_states(&targets, &settings),
        &linked,
        Mode::Sequential,
        &PrimalDualActiveSet,
        &settings,
    )
    .unwrap();
    let part = optimise(
        &targets[..3],
        &initial_states(&targets[..3], &settings),
        &[true; 2],
        Mode::Sequential,
        &PrimalDualActiveSet,
        &settings,
    );
    for (a, b) in whole.states[..3].iter().zip(part.unwrap().states) {
        assert!((a.unwrap().position - b.unwrap().position).norm() < 1e-6);
    }
}

#[test]
fn programs_without_a_point_are_refused_by_all_solvers() {
    let mut program = random_program(2, &mut Random(3));
    // The first state shall lie on both sides of a plane.
    program.rows[0] = Row { a: Vector3::x(), b: -1.0 };
    program.rows[1] = Row { a: -Vector3::x(), b: -1.0 };
    let mut states = vec![Vector5::zeros(); 2];
    assert!(InteriorPoint.solve(&program, &mut states.clone()).is_err());
    assert!(PrimalDualActiveSet.solve(&program, &mut states.clone()).is_err());
    assert!(GaussSeidel::default().solve(&program, &mut states.clone()).is_err());
    assert!(Clarabel::default().solve(&program, &mut states).is_err());
}

/// The soft rows of a state are an octagon about the target, its corners half the cone away from it.
#[test]
fn the_aim_may_leave_the_target_by_half_the_cone() {
    let settings = NozzleSettings::default();
    let normal = UnitVector3::new_normalize(Vector3::new(-1.0, 0.2, 0.1));
    let targets = [Target { point: Point3::new(2.0, 1.0, 1.5), normal, dose: 0.0, time: None, stand_off: None }];
    let (program, start) = stroke_program(&targets, &settings);
    let rows = &program.rows[program.rows.len() - program.soft_rows..];
    let aimed = program.soft_map[0] * start[0];
    let corner = (settings.cone / 2.0).tan();
    let room = |angle: f64| {
        let beside = aimed + Vector2::new(angle.cos(), angle.sin()) * corner;
        rows.iter().map(|row| row.b - row.a.xy().dot(&beside)).fold(f64::INFINITY, f64::min)
    };
    for k in 0..8 {
        let turn = std::f64::consts::FRAC_PI_4 * f64::from(k);
        assert!(room(turn + std::f64::consts::FRAC_PI_8).abs() < 1e-12, "a corner");
        assert!(room(turn) < -0.05 * corner, "beyond a side");
    }
}
