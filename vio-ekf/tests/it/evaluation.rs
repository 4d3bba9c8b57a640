//! Evaluation against closed forms, brute force and `scipy.stats`; agreement with `evo` is in `evo.rs`.

use crate::support::rng::Rng;
use nalgebra::{Isometry3, Matrix3, Similarity3, Translation3, UnitQuaternion, Vector3};
use vio_ekf::eval::{
    Alignment, Association, EvaluationSettings, PoseCovariance, RpeSettings, Span, Stats, Tolerance, align, apply,
    associate, ate, chi2, evaluate, nees, rpe,
};
use vio_ekf::lie::so3;
use vio_ekf::trajectory::path_lengths;
use vio_ekf::{Error, Stamp, Trajectory, nalgebra};

fn stamps(nanos: &[i64]) -> Vec<Stamp> {
    nanos.iter().copied().map(Stamp::from_nanos).collect()
}

fn random_poses(rng: &mut Rng, count: usize) -> Vec<Isometry3<f64>> {
    (0..count)
        .map(|_| Isometry3::from_parts(Translation3::from(rng.vector() * 5.0), so3::exp(&(rng.vector() * 1.5))))
        .collect()
}

#[test]
fn association_is_nearest_one_to_one_and_monotone() {
    let s = |millis: &[i64]| stamps(&millis.iter().map(|m| m * 1_000_000).collect::<Vec<_>>());
    // The tie at 15 goes to the earlier; 40 and 42 both want 41, 40 and 42 are equally near, the first keeps it.
    let long = s(&[0, 10, 20, 41, 60, 80, 100]);
    assert_eq!(associate(&long, &s(&[15, 40, 42, 95]), 0.005).unwrap(), [(1, 0), (3, 1), (6, 3)]);
    // Swapped roles give swapped pairs; the limit itself is allowed, a nanosecond more is not.
    assert_eq!(associate(&s(&[15, 40, 42, 95]), &long, 0.005).unwrap(), [(0, 1), (1, 3), (3, 6)]);
    assert!(matches!(associate(&s(&[0]), &stamps(&[5_000_001]), 0.005), Err(Error::NoMatches { .. })));

    let mut rng = Rng::new(6);
    for _ in 0..300 {
        let mut series = |n: u64| {
            let mut t = 0;
            let next = |_| {
                t += 1 + (rng.bits() % 40) as i64;
                t
            };
            stamps(&(0..n).map(next).collect::<Vec<_>>())
        };
        let (a, b) = (series(30), series(17));
        let limit = 12_u64;
        let Ok(pairs) = associate(&a, &b, limit as f64 * 1e-9) else { continue };
        assert!(pairs.windows(2).all(|w| w[0].0 < w[1].0 && w[0].1 < w[1].1), "{pairs:?}");
        for (j, s) in b.iter().enumerate() {
            // Brute force: the nearest within the limit is either ours, or was kept by another at least as near.
            let distance = |i: usize, s: &Stamp| a[i].nanos().abs_diff(s.nanos());
            let nearest = (0..a.len()).min_by_key(|&i| distance(i, s)).unwrap();
            let ours = pairs.iter().find(|p| p.1 == j);
            if distance(nearest, s) > limit {
                assert_eq!(ours, None);
            } else if let Some(&(i, _)) = ours {
                assert_eq!(i, nearest);
            } else {
                let keeper = pairs.iter().find(|p| p.0 == nearest).unwrap();
                assert!(distance(nearest, &b[keeper.1]) <= distance(nearest, s));
            }
        }
    }
}

#[test]
fn every_mode_recovers_its_own_transform() {
    let mut rng = Rng::new(7);
    for _ in 0..300 {
        let estimate = random_poses(&mut rng, 12);
        let far = Translation3::from(rng.vector() * 1e4);
        let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), rng.signed() * 3.1);
        for (mode, rotation, scale) in [
            (Alignment::PosYaw, yaw, 1.0),
            (Alignment::Se3, so3::exp(&(rng.vector() * 3.0)), 1.0),
            (Alignment::Sim3, so3::exp(&(rng.vector() * 3.0)), 1.0 + 0.9 * rng.signed()),
        ] {
            let truth = Similarity3::from_parts(far, rotation, scale);
            let reference = apply(&truth, &estimate);
            let found = align(&reference, &estimate, mode).unwrap();
            assert!((found.scaling() / scale - 1.0).abs() < 1e-11);
            assert!(so3::angle_between(&found.isometry.rotation, &rotation) < 1e-11);
            let ate = ate(&reference, &estimate, mode).unwrap();
            assert!(ate.position.max < 1e-10 && ate.orientation.max < 1e-11, "{mode:?}: {:?}", ate.position);
        }
    }
}

#[test]
fn no_small_change_of_an_alignment_improves_it() {
    let mut rng = Rng::new(8);
    let cost = |s: &Similarity3<f64>, reference: &[Isometry3<f64>], estimate: &[Isometry3<f64>]| -> f64 {
        let moved = apply(s, estimate);
        reference.iter().zip(&moved).map(|(g, e)| (g.translation.vector - e.translation.vector).norm_squared()).sum()
    };
    for round in 0..100 {
        // Every other time the best orthogonal matrix is a reflection, which must not be taken.
        let estimate = random_poses(&mut rng, 8);
        let mut reference = random_poses(&mut rng, 8);
        if round % 2 == 0 {
            for (g, e) in reference.iter_mut().zip(&estimate) {
                g.translation.vector = e.translation.vector.component_mul(&Vector3::new(1.0, 1.0, -1.0)) + rng.vector();
            }
        }
        for mode in [Alignment::PosYaw, Alignment::Se3, Alignment::Sim3] {
            let best = align(&reference, &estimate, mode).unwrap();
            let least = cost(&best, &reference, &estimate);
            for _ in 0..50 {
                let axis = if mode == Alignment::PosYaw { Vector3::z() } else { rng.vector() };
                let turn = so3::exp(&(axis * (0.3 * rng.signed())));
                let scale = if mode == Alignment::Sim3 { 1.0 + 0.1 * rng.signed() } else { 1.0 };
                let other = Similarity3::from_parts(
                    Translation3::from(best.isometry.translation.vector + rng.vector() * 0.1),
                    turn * best.isometry.rotation,
                    best.scaling() * scale,
                );
                assert!(cost(&other, &reference, &estimate) >= least, "{mode:?}");
            }
        }
    }
}

#[test]
fn alignments_that_are_not_determined_are_refused() {
    let line: Vec<_> = (0..9).map(|i| Isometry3::translation(f64::from(i), 2.0 * f64::from(i), 1e4)).collect();
    let vertical: Vec<_> = (0..9).map(|i| Isometry3::translation(3.0, -7.0, f64::from(i))).collect();
    let point = vec![Isometry3::translation(0.1, 1e5, 0.3); 9];
    for mode in [Alignment::Se3, Alignment::Sim3] {
        assert!(matches!(align(&line, &line, mode), Err(Error::Degenerate { .. })));
    }
    assert!(align(&line, &line, Alignment::PosYaw).is_ok());
    assert!(matches!(align(&vertical, &vertical, Alignment::PosYaw), Err(Error::Degenerate { .. })));
    for mode in [Alignment::PosYaw, Alignment::Se3, Alignment::Sim3] {
        assert!(matches!(align(&point, &line, mode), Err(Error::Degenerate { .. })));
        assert!(matches!(align(&line, &point, mode), Err(Error::Degenerate { .. })));
        assert!(matches!(align(&[], &[], mode), Err(Error::TooFew { .. })));
        assert!(matches!(align(&line, &line[1..], mode), Err(Error::LengthMismatch { .. })));
    }
    assert!(matches!(ate(&[], &[], Alignment::None), Err(Error::TooFew { .. })));
    let mut broken = line.clone();
    broken[4].translation.y = f64::INFINITY;
    assert!(matches!(ate(&line, &broken, Alignment::Se3), Err(Error::NonFinite { index: 4, .. })));
}

#[test]
fn segments_are_those_of_a_full_search() {
    let mut rng = Rng::new(9);
    for _ in 0..100 {
        let mut position = Vector3::zeros();
        let poses: Vec<_> = (0..60)
            .map(|_| {
                // Standstill now and then: many poses share one path length.
                if !rng.bits().is_multiple_of(3) {
                    position += rng.vector() * 0.3;
                }
                Isometry3::translation(position.x, position.y, position.z)
            })
            .collect();
        let lengths = path_lengths(&poses);
        let mut expected = Vec::new();
        for i in 0..poses.len() - 1 {
            let miss = |j: usize| (lengths[j] - lengths[i] - 1.0).abs();
            let nearest = (i + 1..poses.len()).min_by(|&a, &b| miss(a).total_cmp(&miss(b))).unwrap();
            if miss(nearest) <= 0.1 {
                expected.push((i, nearest));
            }
        }
        let settings = RpeSettings { span: Span::Metres(1.0), all_pairs: true, ..Default::default() };
        match rpe(&poses, &poses, &settings) {
            Ok(rpe) => assert_eq!(rpe.pairs, expected),
            Err(error) => assert!(expected.is_empty() && matches!(error, Error::NoPairs { .. })),
        }
    }
}

#[test]
fn relative_error_of_a_scaled_circle_is_known() {
    // Radius 1 against radius 1.1, same headings: over one step of angle d the chord 2 sin(d/2) is 10 % too long.
    let circle = |radius: f64| -> Vec<Isometry3<f64>> {
        (0..100)
            .map(|i| {
                let a = f64::from(i) * 0.1;
                Isometry3::new(Vector3::new(a.cos(), a.sin(), 0.0) * radius, Vector3::z() * a)
            })
            .collect()
    };
    let rpe = rpe(&circle(1.0), &circle(1.1), &RpeSettings::default()).unwrap();
    assert_eq!(rpe.pairs.len(), 99);
    assert!((rpe.translation.rmse - 0.2 * 0.05_f64.sin()).abs() < 1e-12 && rpe.translation.std < 1e-12);
    assert!(rpe.rotation.max < 1e-12);
    let ate = ate(&circle(1.0), &circle(1.1), Alignment::None).unwrap();
    assert!((ate.position.min - 0.1).abs() < 1e-12 && (ate.position.max - 0.1).abs() < 1e-12);
    for span in [Span::Frames(0), Span::Metres(0.0), Span::Metres(f64::NAN)] {
        let settings = RpeSettings { span, ..Default::default() };
        assert!(matches!(vio_ekf::eval::rpe(&circle(1.0), &circle(1.0), &settings), Err(Error::InvalidSetting { .. })));
    }
    let negative = RpeSettings {
        span: Span::Metres(1.0),
        all_pairs: true,
        tolerance: Tolerance::Relative(-0.1),
        ..Default::default()
    };
    assert!(matches!(vio_ekf::eval::rpe(&circle(1.0), &circle(1.0), &negative), Err(Error::InvalidSetting { .. })));
}

#[test]
fn statistics_of_small_lists() {
    // By hand: the sum is 12, the sum of squares 50, the squares about the mean 4 + 1 + 0 + 9.
    let s = Stats::of(&[6.0, 1.0, 3.0, 2.0]).unwrap();
    assert_eq!((s.count, s.mean, s.median, s.min, s.max), (4, 3.0, 2.5, 1.0, 6.0));
    assert_eq!((s.rmse, s.std), (12.5_f64.sqrt(), 3.5_f64.sqrt()));
    assert_eq!(Stats::of(&[2.0, 9.0, 4.0]).unwrap().median, 4.0);
    assert_eq!((Stats::of(&[]), Stats::of(&[1.0, f64::NAN])), (None, None));
}

#[test]
fn chi_square_equals_scipy() {
    // scipy.stats.chi2.ppf and cdf, version 1.17.1.
    for (p, dof, x) in [
        (0.05, 1, 0.003932140000019522),
        (0.95, 1, 3.841458820694124),
        (0.95, 2, 5.991464547107979),
        (0.99, 2, 9.21034037197618),
        (0.95, 3, 7.814727903251179),
        (0.99, 3, 11.344866730144373),
        (0.95, 6, 12.591587243743977),
        (0.99, 6, 16.811893829770927),
        (0.025, 60, 40.48174804284183),
        (0.975, 60, 83.2976748771732),
        (0.025, 300, 253.91232260248975),
        (0.975, 300, 349.87446882991526),
        (0.975, 30000, 30481.982656347922),
    ] {
        assert!((chi2::quantile(p, dof).unwrap() / x - 1.0).abs() < 1e-11, "{p} {dof}");
    }
    for (x, dof, p) in [
        (0.5, 1, 0.5204998778130466),
        (3.0, 3, 0.6083748237289109),
        (0.001, 2, 0.0004998750208307296),
        (40.0, 3, 0.9999999893449096),
        (100.0, 120, 0.09226505195893298),
        (150.0, 120, 0.9669265190886953),
        (0.1, 500, 0.0),
    ] {
        assert!((chi2::cdf(x, dof) - p).abs() < 1e-13, "{x} {dof}");
    }
    let (low, high) = chi2::mean_band(3, 20, 0.95).unwrap();
    assert!((low - 40.48174804284183 / 20.0).abs() < 1e-10 && (high - 83.2976748771732 / 20.0).abs() < 1e-10);
    for p in [0.0, 1.0, -0.5, f64::NAN] {
        assert!(matches!(chi2::quantile(p, 3), Err(Error::InvalidSetting { .. })));
    }
    assert!(chi2::quantile(0.5, 0).is_err() && chi2::mean_band(3, 0, 0.95).is_err());
    assert_eq!((chi2::cdf(f64::NAN, 3), chi2::cdf(-1.0, 3), chi2::cdf(f64::INFINITY, 3)), (0.0, 0.0, 1.0));
}

#[test]
fn normalised_errors_of_consistent_covariances_average_three() {
    let mut rng = Rng::new(10);
    let (mut reference, mut estimate, mut covariances) = (vec![], vec![], vec![]);
    // Twelve uniforms minus six: variance 1, near enough to normal.
    let normal = |rng: &mut Rng| Vector3::from_fn(|_, _| (0..12).map(|_| rng.signed() / 2.0).sum::<f64>());
    let root = |rng: &mut Rng| Matrix3::from_fn(|_, _| rng.signed() * 0.01) + Matrix3::identity() * 0.02;
    let runs = 2000;
    for pose in random_poses(&mut rng, runs) {
        let (position_root, attitude_root) = (root(&mut rng), root(&mut rng));
        let position = pose.translation.vector + position_root * normal(&mut rng);
        let rotation = pose.rotation * so3::exp(&(attitude_root * normal(&mut rng)));
        reference.push(Isometry3::from_parts(position.into(), rotation));
        estimate.push(pose);
        covariances.push(PoseCovariance {
            position: position_root * position_root.transpose(),
            attitude: attitude_root * attitude_root.transpose(),
        });
    }
    let consistent = nees(&reference, &estimate, &covariances).unwrap();
    let (low, high) = chi2::mean_band(3, runs, 0.999).unwrap();
    for mean in [consistent.position_stats.mean, consistent.attitude_stats.mean] {
        assert!(low < mean && mean < high, "{low} {mean} {high}");
    }
    // By hand: an error of 2σ along one axis.
    let one = PoseCovariance { position: Matrix3::identity() * 0.04, attitude: Matrix3::identity() * 0.01 };
    let shifted = [Isometry3::new(Vector3::x() * 0.4, Vector3::y() * 0.3)];
    let by_hand = nees(&shifted, &[Isometry3::identity()], &[one]).unwrap();
    assert!((by_hand.position[0] - 4.0).abs() < 1e-12 && (by_hand.attitude[0] - 9.0).abs() < 1e-12);

    let mut broken = covariances;
    broken[7].attitude[(0, 1)] += 1.0;
    let refused = nees(&reference, &estimate, &broken);
    assert!(matches!(refused, Err(Error::NotPositiveDefinite { what: "attitude", index: 7 })));
    broken[3].position = Matrix3::zeros();
    let refused = nees(&reference, &estimate, &broken);
    assert!(matches!(refused, Err(Error::NotPositiveDefinite { what: "position", index: 3 })));
}

#[test]
fn interpolation_is_linear_and_slerp_and_stays_inside() {
    let quarter = Vector3::z() * std::f64::consts::FRAC_PI_2;
    let mut to = Isometry3::new(Vector3::new(4.0, 0.0, -8.0), quarter);
    // The same rotation with the other sign: the way must stay short.
    to.rotation = UnitQuaternion::new_unchecked(-to.rotation.into_inner());
    let trajectory = Trajectory::new(stamps(&[100, 500]), vec![Isometry3::identity(), to]).unwrap();
    let pose = trajectory.pose_at(Stamp::from_nanos(200)).unwrap();
    assert!((pose.translation.vector - Vector3::new(1.0, 0.0, -2.0)).norm() < 1e-15);
    assert!((so3::log(&pose.rotation) - quarter / 4.0).norm() < 1e-15);
    assert_eq!(trajectory.pose_at(Stamp::from_nanos(500)).unwrap(), to);
    assert!(matches!(trajectory.pose_at(Stamp::from_nanos(99)), Err(Error::OutOfRange { .. })));
    assert!(matches!(trajectory.resample(&stamps(&[300, 200])), Err(Error::NotIncreasing { index: 1, .. })));
    assert_eq!(trajectory.resample(&stamps(&[100, 300])).unwrap().len(), 2);

    assert!(matches!(Trajectory::new(stamps(&[1, 1]), vec![to, to]), Err(Error::NotIncreasing { index: 1, .. })));
    assert!(matches!(Trajectory::new(stamps(&[1]), vec![]), Err(Error::LengthMismatch { .. })));
    to.rotation = UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(0.0, 0.0, 0.0, 0.0));
    assert!(matches!(Trajectory::new(stamps(&[1]), vec![to]), Err(Error::NonFinite { index: 0, .. })));
    assert!(Trajectory::default().pose_at(Stamp::default()).is_err());
}

#[test]
fn the_one_call_report_tells_coverage_and_segments() {
    // 20 m along a circle at 1 m/s and 10 Hz; the estimate starts 5 s late and misses 2 s. Its steps are 1 % too long.
    let pose = |t: f64, scale: f64| {
        Isometry3::new(Vector3::new((t / 3.0).cos(), (t / 3.0).sin(), 0.0) * 3.0 * scale, Vector3::z() * (t / 3.0))
    };
    let (mut reference, mut estimate) = (Trajectory::default(), Trajectory::default());
    for i in 0..=200 {
        let (stamp, t) = (Stamp::from_nanos(i * 100_000_000), i as f64 * 0.1);
        reference.push(stamp, pose(t, 1.0)).unwrap();
        if i >= 50 && !(100..120).contains(&i) {
            estimate.push(stamp, pose(t, 1.01)).unwrap();
        }
    }
    let report = evaluate(&reference, &estimate, &EvaluationSettings::default()).unwrap();
    assert_eq!((report.pairs, report.coverage), (131, 0.75));
    assert!((report.longest_gap_s - 2.1).abs() < 1e-12);
    let lengths: Vec<_> = report.segments.iter().map(|s| (s.length_m, s.rpe.is_some())).collect();
    assert_eq!(lengths, [(8.0, true), (16.0, false), (24.0, false), (32.0, false), (40.0, false)]);
    // All circles about one centre: the relative error is 1 % of a chord.
    let rpe = report.segments[0].rpe.as_ref().unwrap();
    for (&(i, j), error) in rpe.pairs.iter().zip(&rpe.translation_errors) {
        let kept: Vec<_> = (50..=200).filter(|i| !(100..120).contains(i)).collect();
        let angle = f64::from(kept[j] - kept[i]) * 0.1 / 3.0;
        assert!((error - 0.01 * 6.0 * (angle / 2.0).sin().abs()).abs() < 1e-12);
    }
    // Scale is what remains between the modes.
    let sim3 = EvaluationSettings { alignment: Alignment::Sim3, ..Default::default() };
    assert!(evaluate(&reference, &estimate, &sim3).unwrap().ate.position.rmse < 1e-12);
    assert!(report.ate.position.rmse > 0.01);
    let bad = EvaluationSettings {
        association: Association { max_difference_s: f64::NAN, interpolate: false },
        ..Default::default()
    };
    assert!(matches!(evaluate(&reference, &estimate, &bad), Err(Error::InvalidSetting { .. })));
}
