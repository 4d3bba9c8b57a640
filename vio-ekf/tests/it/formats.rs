//! The three text formats: what is read, what is refused and where, and that nothing panics.

use crate::support::recorded;
use crate::support::rng::Rng;
use nalgebra::{Isometry3, Vector3};
use vio_ekf::format::{InvalidStamp, euroc, kitti, tum};
use vio_ekf::lie::so3;
use vio_ekf::{Error, Stamp, Trajectory, nalgebra};

#[test]
fn stamps_are_exact_in_every_notation() {
    for (text, nanos) in [
        ("1403636580.838555574", 1_403_636_580_838_555_574),
        ("1.403715529112143517e+09", 1_403_715_529_112_143_517),
        ("0.0000000005", 1),
        ("-0.0000000005", -1),
        ("0.00000000049999", 0),
        ("+12", 12_000_000_000),
        (".5", 500_000_000),
        ("5.", 5_000_000_000),
        ("-1.5E-3", -1_500_000),
        ("1e-99", 0),
        ("9223372036.854775807", i64::MAX),
    ] {
        assert_eq!(text.parse(), Ok(Stamp::from_nanos(nanos)), "{text}");
    }
    for text in ["", ".", "-", "1e", "e5", "nan", "inf", "1_0", "0x10", "1..2", "9223372036.9", "1e99", "1e999", " 1"] {
        assert_eq!(text.parse::<Stamp>(), Err(InvalidStamp { text: text.to_owned() }));
    }
    for nanos in [0, 1, -1, 999_999_999, -1_000_000_001, i64::MAX, i64::MIN + 1] {
        assert_eq!(Stamp::from_nanos(nanos).to_string().parse(), Ok(Stamp::from_nanos(nanos)));
    }
    assert_eq!(Stamp::from_nanos(-1_500_000_000).to_string(), "-1.500000000");
    assert_eq!(Stamp::from_secs(-0.25), Ok(Stamp::from_nanos(-250_000_000)));
    assert!(Stamp::from_secs(f64::NAN).is_err() && Stamp::from_secs(1e10).is_err());
    // Farther apart than an i64 reaches.
    let ends = Stamp::from_nanos(i64::MAX).secs_since(Stamp::from_nanos(i64::MIN));
    assert!((ends - 18446744073.709551615).abs() < 1e-5);
}

fn line_of(error: &Error) -> Option<usize> {
    if let Error::Line { line, .. } = error { Some(*line) } else { None }
}

#[test]
fn tum_accepts_what_it_documents_and_names_the_line_of_the_rest() {
    let good = "\u{feff}# comment\r\n\r\n1 0 0 0 0 0 0 1\r\n  2.5\t1 2  3 0 0 0 -1  \r\n";
    let trajectory = tum::read(good).unwrap();
    assert_eq!(trajectory.stamps(), [Stamp::from_nanos(1_000_000_000), Stamp::from_nanos(2_500_000_000)]);
    assert_eq!(trajectory.poses()[1].translation.vector, Vector3::new(1.0, 2.0, 3.0));
    for (bad, line) in [
        ("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 1", 2),
        ("1 0 0 0 0 0 0 1 7", 1),
        ("# x\n1 0 nan 0 0 0 0 1", 2),
        ("1 0 inf 0 0 0 0 1", 1),
        ("1 0 1e300 0 0 0 0 1", 1),
        ("nan 0 0 0 0 0 0 1", 1),
        ("1 0 0 0 0 0 0 0", 1),
        ("1 0 0 0 0 0 0 1.02", 1),
        ("1 0 0 0 0 0 0 1\n\n0.9 0 0 0 0 0 0 1", 3),
        ("1,0,0,0,0,0,0,1", 1),
        ("99999999999 0 0 0 0 0 0 1", 1),
    ] {
        assert_eq!(line_of(&tum::read(bad).unwrap_err()), Some(line), "{bad}");
    }
    assert!(matches!(tum::read("# nothing\n"), Err(Error::TooFew { .. })));
    // A repeated stamp, as public files have it, keeps the first of the two.
    let repeated = tum::read("1 5 0 0 0 0 0 1\n1 6 0 0 0 0 0 1\n2 7 0 0 0 0 0 1").unwrap();
    assert_eq!(repeated.poses().iter().map(|p| p.translation.x).collect::<Vec<_>>(), [5.0, 7.0]);
}

#[test]
fn quaternion_orders_differ_between_tum_and_euroc() {
    // A quarter turn about z takes x to y.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let from_tum = tum::read(&format!("1 0 0 0 0 0 {half} {half}")).unwrap();
    let from_euroc = euroc::read(&format!("1000000000,0,0,0,{half},0,0,{half}")).unwrap().trajectory;
    assert_eq!(from_tum, from_euroc);
    assert!((from_tum.poses()[0] * Vector3::x() - Vector3::y()).norm() < 1e-15);
    let from_kitti = kitti::read("0 -1 0 0 1 0 0 0 0 0 1 0").unwrap();
    assert!(so3::angle_between(&from_kitti[0].rotation, &from_tum.poses()[0].rotation) < 1e-15);
}

#[test]
fn euroc_reads_8_11_and_17_columns_and_nothing_between() {
    let header = "#timestamp [ns],p_x,...\r\n";
    let full = "7,1,2,3,1,0,0,0,4,5,6,7,8,9,10,11,12\r\n";
    let states = euroc::read(&format!("{header}{full}")).unwrap();
    assert_eq!(states.velocities_in_world, [Vector3::new(4.0, 5.0, 6.0)]);
    assert_eq!(states.gyro_biases, [Vector3::new(7.0, 8.0, 9.0)]);
    assert_eq!(states.accel_biases, [Vector3::new(10.0, 11.0, 12.0)]);
    assert_eq!(euroc::read(&euroc::write(&states).unwrap()), Ok(states.clone()));
    for (bad, line) in [
        (format!("{full}8,1,2,3,1,0,0,0"), 2),
        ("7,1,2,3,1,0,0,0,4".to_owned(), 1),
        ("7,1,2,3,1,0,0,0,".to_owned(), 1),
        ("7,1,2,3,1,0,0,".to_owned(), 1),
        (format!("{header}7,1,2,3,1,0,0,x"), 2),
        ("9223372036854775808,1,2,3,1,0,0,0".to_owned(), 1),
    ] {
        assert_eq!(line_of(&euroc::read(&bad).unwrap_err()), Some(line), "{bad}");
    }
    let repeated = euroc::read(&format!("{full}{full}")).unwrap();
    assert_eq!((repeated.trajectory.len(), repeated.velocities_in_world.len()), (1, 1));
    let broken = euroc::States { velocities_in_world: vec![], ..states };
    assert!(matches!(euroc::write(&broken), Err(Error::LengthMismatch { .. })));
}

#[test]
fn kitti_takes_the_nearest_rotation_and_refuses_what_is_none() {
    // Printed with four digits: the nearest rotation undoes the rounding to second order.
    let angle = 0.3_f64;
    let (s, c) = (format!("{:.4}", angle.sin()), format!("{:.4}", angle.cos()));
    let poses = kitti::read(&format!("{c} -{s} 0 1 {s} {c} 0 2 0 0 1 3")).unwrap();
    assert!((so3::log(&poses[0].rotation) - Vector3::z() * angle).norm() < 1e-4);
    assert!((poses[0].rotation.coords.norm() - 1.0).abs() < 1e-15);
    for bad in [
        "1 0 0 0 0 1 0 0 0 0 1",
        "1 0 0 0 0 1 0 0 0 0 1 0 0",
        "2 0 0 0 0 1 0 0 0 0 1 0",
        "1 0 0 0 0 1 0 0 0 0 -1 0",
        "0 0 0 0 0 0 0 0 0 0 0 0",
        "1e200 0 0 0 -1e200 1 0 0 0 0 1 0",
        "1 0 0 nan 0 1 0 0 0 0 1 0",
        "1 0 0 1e200 0 1 0 0 0 0 1 0",
    ] {
        assert_eq!(line_of(&kitti::read(bad).unwrap_err()), Some(1), "{bad}");
    }
}

#[test]
fn writing_and_reading_gives_the_same_poses() {
    let mut rng = Rng::new(4);
    let mut trajectory = Trajectory::default();
    for i in 0..200 {
        let position = rng.vector() * 10_f64.powi(i % 12 - 6);
        let pose = Isometry3::from_parts(position.into(), so3::exp(&(rng.vector() * 3.0)));
        trajectory.push(Stamp::from_nanos(i64::from(i) * 1_000_003 - 50_000_000), pose).unwrap();
    }
    let states = euroc::States { trajectory: trajectory.clone(), ..Default::default() };
    for read in [
        tum::read(&tum::write(&trajectory)).unwrap(),
        euroc::read(&euroc::write(&states).unwrap()).unwrap().trajectory,
        Trajectory::new(trajectory.stamps().to_vec(), kitti::read(&kitti::write(trajectory.poses())).unwrap()).unwrap(),
    ] {
        assert_eq!(read.stamps(), trajectory.stamps());
        for (a, b) in read.poses().iter().zip(trajectory.poses()) {
            assert_eq!(a.translation, b.translation);
            assert!(so3::angle_between(&a.rotation, &b.rotation) < 1e-14);
        }
    }
}

#[test]
fn damaged_text_is_an_error_or_a_trajectory_but_never_a_panic() {
    let valid = [
        "# t\n1403636580.838555574 1.5 -2e-3 0.25 0.1 0.2 0.3 0.9273618495495703\n1403636580.85 0 0 0 0 0 0 1\n",
        "#t\n1403636580838555648,4.6,-1.78,0.78,0.5,-0.5,-0.5,0.5,0.1,0,0\n1403636580848555648,1,2,3,1,0,0,0,0,0,0\n",
        "1.0e+00 9e-12 2e-11 5e-17 9e-12 1.0 2e-10 3e-16 2e-11 2e-10 9.999999e-01 -4e-16\n",
    ];
    let noise = [
        "nan",
        "-inf",
        "1e308",
        "-",
        "e",
        ",",
        "\r",
        "\u{fe0f}",
        "9999999999999999999999999999999999999999",
        "#",
        "\n",
    ];
    let mut rng = Rng::new(5);
    let (mut accepted, mut refused) = (0, 0);
    for _ in 0..20_000 {
        let mut text = valid[(rng.bits() % 3) as usize].to_owned();
        for _ in 0..=rng.bits() % 3 {
            let mut at = (rng.bits() % (text.len() as u64 + 1)) as usize;
            while !text.is_char_boundary(at) {
                at -= 1;
            }
            match rng.bits() % 3 {
                0 => text.truncate(at),
                1 => text.insert_str(at, noise[(rng.bits() % noise.len() as u64) as usize]),
                _ if at < text.len() => drop(text.remove(at)),
                _ => {}
            }
        }
        let results = [tum::read(&text), euroc::read(&text).map(|s| s.trajectory)];
        let poses = results.iter().flatten().flat_map(Trajectory::poses).copied();
        let poses: Vec<Isometry3<f64>> = poses.chain(kitti::read(&text).into_iter().flatten()).collect();
        if poses.is_empty() {
            refused += 1;
        } else {
            accepted += 1;
        }
        for pose in poses {
            assert!(pose.translation.vector.iter().all(|v| v.is_finite()), "{text}");
            assert!((pose.rotation.coords.norm() - 1.0).abs() < 1e-12, "{text}");
        }
    }
    assert!(accepted > 1000 && refused > 1000, "{accepted} accepted, {refused} refused");
}

#[test]
fn reads_every_recorded_trajectory() {
    // Durations and lengths as published with the data sets (MH_01: 181.9 s, 80.6 m; MH_03: 131.5 s, 130.9 m).
    for (path, seconds, metres) in [
        ("trajectories/euroc/MH_01_easy.txt.gz", 181.9, 80.6),
        ("trajectories/euroc/MH_03_medium.txt.gz", 131.5, 130.9),
    ] {
        let Some(text) = recorded::text(path) else { return };
        let trajectory = tum::read(&text).unwrap();
        assert!((trajectory.duration_s() - seconds).abs() < 0.06, "{path}: {} s", trajectory.duration_s());
        assert!((trajectory.path_length() - metres).abs() < 0.06, "{path}: {} m", trajectory.path_length());
    }
    for (path, poses) in [
        ("trajectories/evo/V102.txt.gz", 803),
        ("trajectories/kaist_vio/circle_fast.txt.gz", 7852),
        ("trajectories/uzhfpv/indoor_forward_3_snapdragon_with_gt.txt.gz", 24750),
        ("trajectories/tum_vi/dataset-room1_512_16.txt.gz", 16541),
    ] {
        let Some(text) = recorded::text(path) else { return };
        assert_eq!(tum::read(&text).unwrap().len(), poses, "{path}");
    }
    let Some(text) = recorded::text("vio/euroc_imu_gt/MH_04_difficult/groundtruth_MH_04_difficult.csv.gz") else {
        return;
    };
    let states = euroc::read(&text).unwrap();
    // Published: 98.8 s, 91.7 m. Velocities and biases are given for each pose.
    assert!(
        (states.trajectory.duration_s() - 98.8).abs() < 0.06 && (states.trajectory.path_length() - 91.7).abs() < 0.06
    );
    assert_eq!(states.velocities_in_world.len(), states.trajectory.len());
    assert_eq!(states.accel_biases.len(), states.trajectory.len());
}
