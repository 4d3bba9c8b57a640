//! Agreement with `evo` 1.38.1, the evaluation tool in common use. Its figures stand in `evo_*.txt` beside this file.

use crate::support::recorded;
use nalgebra::Isometry3;
use vio_ekf::eval::{
    Alignment, Association, PairsFrom, PosePairs, RpeSettings, Span, Stats, Tolerance, align, apply, ate, rpe,
};
use vio_ekf::format::{kitti, tum};
use vio_ekf::{Error, nalgebra};

/// A mean of angles or metres of order one, summed in another order, differs by less.
const AGREEMENT: f64 = 1e-9;

type Poses = Vec<Isometry3<f64>>;

/// Our figures for the metric that the first columns of a table line name.
fn measure(metric: &str, alignment: &str, part: &str, reference: &Poses, estimate: &Poses) -> Stats {
    let mode = match alignment {
        "none" => Alignment::None,
        "se3" => Alignment::Se3,
        "sim3" => Alignment::Sim3,
        other => panic!("unknown alignment {other}"),
    };
    if metric == "ape" {
        let ate = ate(reference, estimate, mode).unwrap();
        return if part == "translation" { ate.position } else { ate.orientation };
    }
    let evo = RpeSettings::default();
    let all = RpeSettings { all_pairs: true, ..evo };
    let settings = match metric {
        "rpe_1_frame" => evo,
        "rpe_7_frames" => RpeSettings { span: Span::Frames(7), ..evo },
        "rpe_10_frames_all" => RpeSettings { span: Span::Frames(10), ..all },
        "rpe_1_m" => RpeSettings { span: Span::Metres(1.0), ..evo },
        "rpe_1_m_all" => RpeSettings { span: Span::Metres(1.0), ..all },
        "rpe_1_m_all_reference" => {
            // The same tolerance in the other unit.
            let tolerance = Tolerance::Metres(0.1);
            RpeSettings { span: Span::Metres(1.0), pairs_from: PairsFrom::Reference, tolerance, ..all }
        }
        other => panic!("unknown metric {other}"),
    };
    let moved = apply(&align(reference, estimate, mode).unwrap(), estimate);
    let rpe = rpe(reference, &moved, &settings).unwrap();
    if part == "translation" { rpe.translation } else { rpe.rotation }
}

/// Compares every line of a table; returns how many there were. Cases for which `load` has nothing are left out.
fn compare(table: &str, load: impl Fn(&str) -> Option<(Poses, Poses)>) -> usize {
    let (mut poses, mut lines) = (None, 0);
    for line in table.lines().filter(|line| !line.starts_with('#')) {
        if let Some(case) = line.strip_prefix("case ") {
            poses = load(case);
            continue;
        }
        let Some((reference, estimate)) = &poses else { continue };
        let fields: Vec<&str> = line.split(' ').collect();
        let s = measure(fields[0], fields[1], fields[2], reference, estimate);
        let theirs: Vec<f64> = fields[3..].iter().map(|f| f.parse().unwrap()).collect();
        for (ours, theirs) in [s.count as f64, s.rmse, s.mean, s.median, s.std, s.min, s.max].iter().zip(theirs) {
            assert!((ours - theirs).abs() <= AGREEMENT, "{line}\n  ours {ours}, evo {theirs}");
        }
        lines += 1;
    }
    lines
}

fn paired(reference: &str, estimate: &str, interpolate: bool) -> (Poses, Poses) {
    let association = Association { interpolate, ..Default::default() };
    let PosePairs { reference, estimate, .. } =
        association.pair_up(&tum::read(reference).unwrap(), &tum::read(estimate).unwrap()).unwrap();
    (reference, estimate)
}

#[test]
fn equals_evo_on_a_synthetic_pair() {
    let (reference, estimate) = (include_str!("synthetic_reference.txt"), include_str!("synthetic_estimate.txt"));
    let lines = compare(include_str!("evo_synthetic.txt"), |case| {
        Some(paired(reference, estimate, case.starts_with("interpolated ")))
    });
    assert_eq!(lines, 40);
}

#[test]
fn equals_evo_on_public_recordings() {
    let file = |name: &str| recorded::text(&format!("trajectories/evo/{name}.txt.gz"));
    let lines = compare(include_str!("evo_public.txt"), |case| {
        if case == "KITTI_00" {
            return Some((kitti::read(&file("KITTI_00_gt")?).unwrap(), kitti::read(&file("KITTI_00_ORB")?).unwrap()));
        }
        let name = case.trim_start_matches("interpolated ");
        let truth = if name.starts_with("fr2") { "fr2_desk_groundtruth" } else { "freiburg1_xyz-groundtruth" };
        Some(paired(&file(truth)?, &file(name)?, name != case))
    });
    assert!(lines == 140 || recorded::text("trajectories/evo/V102.txt.gz").is_none(), "{lines} lines");
}

#[test]
fn position_and_yaw_separate_the_runs_that_a_rigid_alignment_cannot() {
    // The second run is the first, seen from a tilted frame. Figures: an independent numpy program, pairs within 0.02 s.
    let file = |name: &str| recorded::text(&format!("trajectories/evo/freiburg1_xyz-{name}.txt.gz"));
    let Some(truth) = file("groundtruth") else { return };
    for (run, metres, degrees) in [("rgbdslam", 0.0140, 1.414), ("rgbdslam_drift", 0.0521, 21.3)] {
        let association = Association { max_difference_s: 0.02, ..Default::default() };
        let truth = tum::read(&truth).unwrap();
        let pairs = association.pair_up(&truth, &tum::read(&file(run).unwrap()).unwrap()).unwrap();
        let ate = ate(&pairs.reference, &pairs.estimate, Alignment::PosYaw).unwrap();
        assert!((ate.position.rmse - metres).abs() < 6e-5, "{run}: {} m", ate.position.rmse);
        let tolerance = if degrees > 10.0 { 0.06 } else { 0.0006 };
        assert!((ate.orientation.rmse.to_degrees() - degrees).abs() < tolerance, "{run}: {:?}", ate.orientation);
    }
}

#[test]
fn no_common_time_is_an_error() {
    let a = tum::read("0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1").unwrap();
    let b = tum::read("5 0 0 0 0 0 0 1").unwrap();
    assert!(matches!(Association::default().pair_up(&a, &b), Err(Error::NoMatches { .. })));
}
