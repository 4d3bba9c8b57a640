//! Odometry in a stored map: what confirms it, what ends it, and when it is trusted again.

use vio_ekf::fusion::{AidedPose, ImuPairSettings, MapAidedSettings, MapAidedVio, PoseMeasurement, UnifiedSettings};
use vio_ekf::nalgebra::{Isometry3, Vector3};
use vio_ekf::{Camera, ImageView, Imu, Settings, Stamp};

const SIZE: (usize, usize) = (160, 120);
/// Milliseconds between samples, images and poses in the map.
const SAMPLE: i64 = 5;
const IMAGE: i64 = 50;
const POSE: i64 = 100;

fn at(millis: i64) -> Stamp {
    Stamp::from_nanos(millis * 1_000_000)
}

/// A body that stands before tiles.
struct Scene {
    vio: MapAidedVio,
    picture: Vec<u8>,
    now: i64,
}

impl Scene {
    /// Found in the map after a tenth of a second.
    fn started() -> Self {
        let mut scene = Self::looking();
        let found = scene.measured(0.0);
        scene.vio.start(&found).unwrap();
        scene
    }

    /// The tenth of a second before.
    fn looking() -> Self {
        let bright = |k: usize| k % SIZE.0 % 24 < 12 && k / SIZE.0 % 24 < 12;
        let picture = (0..SIZE.0 * SIZE.1).map(|k| if bright(k) { 180 } else { 60 }).collect();
        let camera =
            Camera { width: SIZE.0, height: SIZE.1, fx: 100.0, fy: 100.0, cx: 80.0, cy: 60.0, ..Camera::euroc() };
        let vio = MapAidedVio::new(camera, Settings::default(), MapAidedSettings::default()).unwrap();
        let mut scene = Self { vio, picture, now: 0 };
        scene.sense(100, true);
        scene
    }

    /// The sensor of the poses is the body. Off along x by so much, m.
    fn measured(&self, off: f64) -> PoseMeasurement {
        PoseMeasurement::isotropic(0, at(self.now), Isometry3::translation(off, 0.0, 1.0), 1e-3, 1e-3)
    }

    /// Time goes on, with inertial samples or without; the images follow.
    fn sense(&mut self, millis: i64, moves: bool) {
        for _ in 0..millis / SAMPLE {
            self.now += SAMPLE;
            // No two samples are the same, as of a sensor with noise.
            let hum = 1e-4 * (0.7 * self.now as f64).sin();
            let sample =
                Imu { stamp: at(self.now), gyro: Vector3::repeat(hum), accel: Vector3::new(hum, -hum, 9.81 + hum) };
            if moves {
                self.vio.imu(&sample).unwrap();
            }
            if self.now % IMAGE == 0 {
                self.vio.image(at(self.now), &ImageView::new(SIZE.0, SIZE.1, &self.picture).unwrap()).unwrap();
            }
        }
    }

    fn pose(&self) -> AidedPose {
        self.vio.pose(at(self.now)).unwrap()
    }

    /// A pose in the map after a tenth of a second; whether it confirms what was expected.
    fn map(&mut self, off: f64) -> bool {
        self.sense(POSE, true);
        let expected = self.vio.pose(at(self.now));
        let found = self.measured(off);
        self.vio.map(Some(&found), expected.as_ref()).unwrap()
    }
}

#[test]
fn what_the_map_confirms_is_trusted_until_it_says_nothing() {
    let mut scene = Scene::started();
    for _ in 0..5 {
        assert!(scene.map(0.0));
    }
    let AidedPose { trusted, from_map, position_sigma_m, world_from_body, .. } = scene.pose();
    assert!(trusted && !from_map && position_sigma_m < 0.01);
    assert!((world_from_body.translation.vector - Vector3::z()).norm() < 5e-3, "{world_from_body}");
    scene.sense(400, true);
    assert!(scene.pose().trusted);
    scene.sense(150, true);
    assert!(!scene.pose().trusted && !scene.pose().from_map);
}

#[test]
fn what_the_map_shows_without_fixing_it_is_trusted_as_long_as_the_odometry_knows_its_place() {
    let mut scene = Scene::started();
    assert!(scene.map(0.0) && scene.map(0.0));
    let mut trusted = 0;
    for _ in 0..100 {
        scene.sense(POSE, true);
        let expected = scene.vio.pose(at(scene.now));
        assert!(scene.vio.seen(at(scene.now), expected.as_ref()));
        trusted += usize::from(scene.pose().trusted);
        assert!(!scene.pose().trusted || scene.pose().position_sigma_m <= 0.01);
    }
    assert!((2..90).contains(&trusted), "{trusted}");
    // What was expected of another source says nothing.
    assert!(!scene.map(0.05) && !scene.map(0.07), "5 cm off, and more");
    let held = scene.vio.pose(at(scene.now));
    assert!(!scene.vio.seen(at(scene.now), held.as_ref()));
}

#[test]
fn two_contradictions_end_the_odometry_which_is_trusted_again_after_ten_confirmations() {
    let mut scene = Scene::started();
    assert!(scene.map(0.0) && scene.map(0.0));
    let source = scene.pose().source;
    assert!(!scene.map(0.05), "5 cm off");
    let doubted = scene.pose();
    assert!(!doubted.from_map && !doubted.trusted && doubted.source == source);
    assert!(!scene.map(0.07), "and farther");
    let held = scene.pose();
    assert!(held.from_map && !held.trusted && held.source > source);
    assert!((held.world_from_body.translation.x - 0.07).abs() < 1e-9);
    // Two poses that follow from each other start it again.
    assert!(!scene.map(0.07) && scene.pose().from_map);
    assert!(!scene.map(0.07) && !scene.pose().from_map);
    let mut confirmations = 0;
    while !scene.pose().trusted && confirmations < 30 {
        assert!(scene.map(0.07), "{confirmations}");
        confirmations += 1;
    }
    // The position has to be known well enough, too.
    assert!((10..30).contains(&confirmations), "{confirmations}");
}

#[test]
fn without_samples_the_map_stands_in_and_a_stuck_axis_is_no_sample() {
    let mut scene = Scene::started();
    assert!(scene.map(0.0));
    scene.sense(25, false);
    assert!(!scene.pose().from_map && !scene.pose().trusted, "a moment goes by the odometry, but nothing more");
    scene.sense(80, false);
    assert!(scene.pose().from_map && !scene.pose().trusted);
    // What comes after the gap is not believed either.
    scene.sense(10, true);
    assert!(scene.pose().from_map);

    let mut scene = Scene::started();
    assert!(scene.map(0.0));
    for _ in 0..4 {
        scene.now += SAMPLE;
        let hum = 1e-4 * (0.7 * scene.now as f64).sin();
        let accel = Vector3::new(hum, -hum, 9.0);
        scene.vio.imu(&Imu { stamp: at(scene.now), gyro: Vector3::repeat(hum), accel }).unwrap();
    }
    assert!(scene.pose().from_map && !scene.pose().trusted, "z stands at the end of its range");
    scene.sense(600, true);
    assert!(scene.vio.pose(at(scene.now)).is_none(), "and nothing recent says where the body is");
}

/// At the rim of a map, say: one pose is off, and then there is none for a while.
#[test]
fn a_pose_in_the_map_that_errs_alone_does_not_end_the_odometry() {
    let mut scene = Scene::started();
    assert!(scene.map(0.0) && scene.map(0.0) && scene.pose().trusted);
    let source = scene.pose().source;
    assert!(!scene.map(0.05), "5 cm off");
    for _ in 0..2 {
        scene.sense(POSE, true);
        let expected = scene.vio.pose(at(scene.now));
        assert!(!scene.vio.map(None, expected.as_ref()).unwrap());
        let AidedPose { trusted, from_map, world_from_body, .. } = scene.pose();
        assert!(!trusted && !from_map);
        assert!((world_from_body.translation.vector - Vector3::z()).norm() < 5e-3, "{world_from_body}");
    }
    for _ in 0..5 {
        assert!(scene.map(0.0));
    }
    assert!(scene.pose().trusted && !scene.map(0.05));
    assert!(scene.map(0.0) && !scene.pose().trusted, "one is not enough");
    assert!(scene.map(0.0) && scene.pose().trusted && scene.pose().source == source);
    // Nor do two that do not follow from each other.
    assert!(!scene.map(0.05) && !scene.map(-0.5) && scene.pose().source == source);
}

/// A place that looks like another 12 cm beside it: poses there follow from each other, before a rim they wobble, and the odometry of a body that
/// stands stays where it is. After the longest time that such a place may be seen it is believed.
#[test]
fn a_map_that_jumps_and_stays_there_does_not_end_a_sound_odometry() {
    let mut scene = Scene::started();
    assert!(scene.map(0.0) && scene.map(0.0));
    let source = scene.pose().source;
    for k in 0..55 {
        assert!(!scene.map(0.12 + 0.03 * f64::from(k % 2)));
        let AidedPose { trusted, from_map, world_from_body, .. } = scene.pose();
        assert!(!trusted && !from_map, "{k}");
        assert!((world_from_body.translation.vector - Vector3::z()).norm() < 0.02, "{k} {world_from_body}");
    }
    assert!(scene.map(0.0) && scene.map(0.0) && scene.pose().source == source);
    let mut poses = 0;
    while scene.pose().source == source && poses < 100 {
        assert!(!scene.map(0.12));
        poses += 1;
    }
    assert!((60..65).contains(&poses), "{poses}");
}

/// As registration says of a smooth wall without a prior: 3 m, 3 rad, and found to a millimetre.
#[test]
fn a_pose_that_is_known_to_metres_confirms_nothing_far_off_and_starts_no_wild_filter() {
    let mut scene = Scene::started();
    let unknown = |scene: &Scene, off: f64| {
        PoseMeasurement::isotropic(0, at(scene.now), scene.measured(off).source_from_sensor, 3.0, 3.0)
    };
    assert!(scene.map(0.0) && scene.map(0.0));
    scene.sense(POSE, true);
    let expected = scene.vio.pose(at(scene.now));
    let found = unknown(&scene, 0.12);
    assert!(!scene.vio.map(Some(&found), expected.as_ref()).unwrap());
    // A gap ends the odometry; two such poses start it again.
    scene.sense(POSE, false);
    scene.sense(POSE, true);
    assert!(scene.pose().from_map);
    let mut poses = 0;
    while scene.pose().from_map && poses < 20 {
        scene.sense(POSE, true);
        let found = unknown(&scene, 0.0);
        scene.vio.map(Some(&found), None).unwrap();
        poses += 1;
    }
    let AidedPose { from_map, position_sigma_m, attitude_sigma_rad, .. } = scene.pose();
    assert!(!from_map && poses < 10, "{poses}");
    assert!(position_sigma_m < 0.04 && attitude_sigma_rad < 0.04, "{position_sigma_m} m, {attitude_sigma_rad} rad");
}

/// Where a depth image tells how far the wall is, that is where new landmarks are.
#[test]
fn an_odometry_starts_with_the_distance_that_is_expected() {
    for distance in [0.6, 4.0] {
        let mut scene = Scene::looking();
        scene.vio.expect_distance(distance, 0.1).unwrap();
        let found = scene.measured(0.0);
        scene.vio.start(&found).unwrap();
        scene.sense(6 * IMAGE, true);
        let landmarks: Vec<f64> = scene.vio.unified().vio().landmarks().map(|mark| mark.inverse_distance).collect();
        let mean = landmarks.iter().sum::<f64>() / landmarks.len() as f64;
        assert!(landmarks.len() > 4 && (mean * distance - 1.0).abs() < 0.1, "{landmarks:?}");
    }
    let mut scene = Scene::looking();
    for (distance, share) in [(0.0, 0.1), (-1.0, 0.1), (f64::NAN, 0.1), (1.0, -0.1), (1.0, f64::NAN)] {
        assert!(scene.vio.expect_distance(distance, share).is_err(), "{distance} {share}");
    }
}

/// Samples that are a few hundredths of a second late say where a body was; it has moved on.
#[test]
fn of_late_samples_the_odometry_is_moved_on() {
    let mut scene = Scene::started();
    scene.vio.image(at(scene.now), &ImageView::new(SIZE.0, SIZE.1, &scene.picture.clone()).unwrap()).unwrap();
    // 2 m/s² along x for 0.3 s.
    for _ in 0..60 {
        scene.now += SAMPLE;
        let hum = 1e-4 * (0.7 * scene.now as f64).sin();
        let accel = Vector3::new(2.0 + hum, -hum, 9.81 + hum);
        scene.vio.imu(&Imu { stamp: at(scene.now), gyro: Vector3::repeat(hum), accel }).unwrap();
    }
    let now = scene.pose().world_from_body.translation.x;
    let late = scene.vio.pose(at(scene.now + 50)).unwrap();
    assert!(!late.trusted && !late.from_map);
    // 0.6 m/s for 50 ms.
    assert!((late.world_from_body.translation.x - now - 0.03).abs() < 2e-3, "{now} {}", late.world_from_body);
}

/// Turned by 1.7 degrees, which contradicts unless the map knows no better.
#[test]
fn a_pose_in_the_map_contradicts_only_as_far_as_it_is_known() {
    for (attitude_sigma, confirms) in [(2e-2, true), (1e-3, false)] {
        let mut scene = Scene::started();
        assert!(scene.map(0.0) && scene.map(0.0));
        scene.sense(POSE, true);
        let expected = scene.vio.pose(at(scene.now));
        let turned = Isometry3::new(Vector3::z(), Vector3::new(0.0, 0.0, 0.03));
        let found = PoseMeasurement::isotropic(0, at(scene.now), turned, 1e-3, attitude_sigma);
        assert_eq!(scene.vio.map(Some(&found), expected.as_ref()).unwrap(), confirms, "{attitude_sigma} rad");
    }
}

/// Poses come 60 ms late, from a body that swings by half a metre with up to 2 m/s².
#[test]
fn in_motion_it_starts_again_with_the_velocity_of_the_moment() {
    let mut scene = Scene::started();
    let start = scene.now;
    let time = |now: i64| 1e-3 * (now - start) as f64;
    let place = |now: i64| 0.5 * (1.0 - (2.0 * time(now)).cos());
    let mut taken = None;
    let mut off = Vec::new();
    for k in 1..=400 {
        scene.now += SAMPLE;
        let hum = 1e-4 * (0.7 * scene.now as f64).sin();
        let accel = Vector3::new(2.0 * (2.0 * time(scene.now)).cos() + hum, -hum, 9.81 + hum);
        scene.vio.imu(&Imu { stamp: at(scene.now), gyro: Vector3::repeat(hum), accel }).unwrap();
        if k % 20 == 0 {
            taken = Some((scene.now, scene.vio.pose(at(scene.now))));
        }
        if let Some((then, expected)) = taken.filter(|(then, _)| scene.now - then == 60) {
            // The first two contradict what is expected.
            let wrong = if k < 60 { 0.05 } else { 0.0 };
            let pose = Isometry3::translation(place(then) + wrong, 0.0, 1.0);
            let found = PoseMeasurement::isotropic(0, at(then), pose, 1e-3, 1e-3);
            scene.vio.map(Some(&found), expected.as_ref()).unwrap();
        }
        let pose = scene.pose();
        if k > 40 && !pose.from_map {
            off.push((pose.world_from_body.translation.x - place(scene.now)).abs());
        }
    }
    // Two seconds, of which it flies by the map for the first half second or less.
    assert!(off.len() > 280, "{}", off.len());
    let most = off.iter().copied().fold(0.0, f64::max);
    assert!(most < 0.01, "{most} m");
}

/// A body that stands, with two sensors of which `sample` gives what each reads at a millisecond, `None` where it is silent. What is known at each
/// sample from the start on; every tenth of a second a pose in the map says that it has not moved.
fn two_sensors(millis: i64, sample: impl Fn(i64, usize) -> Option<Imu>) -> Vec<Option<AidedPose>> {
    let camera = Camera { width: SIZE.0, height: SIZE.1, fx: 100.0, fy: 100.0, cx: 80.0, cy: 60.0, ..Camera::euroc() };
    let pair = ImuPairSettings { timeout_s: 0.01, ..ImuPairSettings::default() };
    let unified = UnifiedSettings { imu_pair: Some(pair), ..UnifiedSettings::default() };
    let settings = MapAidedSettings { unified, ..MapAidedSettings::default() };
    let mut vio = MapAidedVio::new(camera, Settings::default(), settings).unwrap();
    let mut known = Vec::new();
    for now in (SAMPLE..=millis).step_by(SAMPLE as usize) {
        if let Some(first) = sample(now, 0) {
            vio.imu(&first).unwrap();
        }
        if let Some(second) = sample(now, 1) {
            vio.second_imu(&second).unwrap();
        }
        let found = PoseMeasurement::isotropic(0, at(now), Isometry3::identity(), 1e-3, 1e-3);
        if now == 100 {
            vio.start(&found).unwrap();
        } else if now % POSE == 0 {
            let expected = vio.pose(at(now));
            vio.map(Some(&found), expected.as_ref()).unwrap();
        }
        if now >= 100 {
            known.push(vio.pose(at(now)));
        }
    }
    known
}

/// No two samples are the same, nor are the two sensors.
fn standing(millis: i64, which: usize) -> Imu {
    let hum = 1e-4 * ((0.7 + which as f64) * millis as f64).sin();
    Imu { stamp: at(millis), gyro: Vector3::repeat(hum), accel: Vector3::new(hum, -hum, 9.81 + hum) }
}

/// At the end of its range it ends the odometry, however the other hums: what was read of it until then is wrong. The other goes on alone.
#[test]
fn an_axis_of_one_of_two_sensors_that_stands_still_is_seen() {
    for clipped in [0, 1] {
        let known = two_sensors(3000, |millis, which| {
            let mut sample = standing(millis, which);
            if which == clipped && millis > 400 {
                sample.accel.z = 9.0;
            }
            Some(sample)
        });
        let from_map = |millis: i64| known[((millis - 100) / SAMPLE) as usize].unwrap().from_map;
        // Three equal readings are one too many; two poses in the map with all samples between start it again.
        assert!((105..3000).step_by(5).all(|millis| from_map(millis) == (420..600).contains(&millis)), "{clipped}");
        let AidedPose { trusted, world_from_body, .. } = known.last().unwrap().unwrap();
        assert!(trusted && world_from_body.translation.vector.norm() < 2e-3, "{clipped}: {world_from_body}");
    }
}

/// Samples are missing for a second.
#[test]
fn one_of_two_sensors_is_done_without() {
    for silent in [0, 1] {
        let known = two_sensors(2000, |millis, which| {
            (which != silent || !(400..1500).contains(&millis)).then(|| standing(millis, which))
        });
        let odometry = |pose: &Option<AidedPose>| pose.is_some_and(|pose| !pose.from_map && pose.source == 1);
        assert!(known.iter().all(odometry), "{silent}");
        assert!(known.last().unwrap().unwrap().trusted);
    }
}

/// A gyroscope errs by 0.3 rad/s for a second: the body stands, and the map says which of them is right.
#[test]
fn of_two_gyroscopes_that_contradict_each_other_one_is_believed() {
    for wrong in [0, 1] {
        let known = two_sensors(4000, |millis, which| {
            let mut sample = standing(millis, which);
            if which == wrong && (1000..2000).contains(&millis) {
                sample.gyro.x += 0.3;
            }
            Some(sample)
        });
        let at = |millis: i64| known[((millis - 100) / SAMPLE) as usize].unwrap();
        assert!(at(1000).trusted);
        let most =
            known.iter().flatten().map(|pose| pose.world_from_body.translation.vector.norm()).fold(0.0, f64::max);
        let turn = known.iter().flatten().map(|pose| pose.world_from_body.rotation.angle()).fold(0.0, f64::max);
        assert!(most < 0.01 && turn < 0.05, "{wrong}: {most} m, {turn} rad");
        assert!(!at(1990).from_map && at(3500).trusted, "{wrong}");
    }
}

/// Two sensors whose constant errors are opposite: what the pair reads has none, so the body stays where it is without help from the map;
/// the first alone flies off. A second one that falls silent is done without.
#[test]
fn a_second_sensor_is_joined_and_done_without() {
    let camera = Camera { width: SIZE.0, height: SIZE.1, fx: 100.0, fy: 100.0, cx: 80.0, cy: 60.0, ..Camera::euroc() };
    let pair = ImuPairSettings { timeout_s: 0.01, ..ImuPairSettings::default() };
    let fly = |imu_pair: Option<ImuPairSettings>| {
        let unified = UnifiedSettings { imu_pair, ..UnifiedSettings::default() };
        let settings = MapAidedSettings { unified, ..MapAidedSettings::default() };
        let mut vio = MapAidedVio::new(camera, Settings::default(), settings).unwrap();
        let sample = |millis: i64, off: f64| {
            let hum = 1e-4 * (0.7 * millis as f64).sin();
            let accel = Vector3::new(off + hum, -hum, 9.81 + hum);
            Imu { stamp: at(millis), gyro: Vector3::repeat(hum), accel }
        };
        for millis in (5..=2000).step_by(5) {
            vio.imu(&sample(millis, 0.1)).unwrap();
            match imu_pair {
                Some(_) if millis <= 1500 => vio.second_imu(&sample(millis, -0.1)).unwrap(),
                Some(_) => {}
                None => assert!(vio.second_imu(&sample(millis, -0.1)).is_err()),
            }
            if millis == 100 {
                let found = PoseMeasurement::isotropic(0, at(millis), Isometry3::identity(), 1e-3, 1e-3);
                vio.start(&found).unwrap();
            }
        }
        vio.pose(at(2000)).unwrap().world_from_body.translation.vector.x
    };
    let (both, one) = (fly(Some(pair)), fly(None));
    // Half of 0.1 m/s² over 1.9 s squared.
    assert!((one - 0.18).abs() < 0.02 && both.abs() < 0.02, "{one} m, {both} m");
}
