//! The gantry planner against brute force and closed forms, over paint that is a formula.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use paint_planner::gantry::{
    BeamSettings, DensityMap, DepositEstimate, DepositModel, GantrySample, GantrySettings, GantryState, Lattice,
    PaintModel, PoseFilter, PoseFilterSettings, PoseSmoother, RangeReading, Registration, RegistrationSettings,
    RobotMotion, RoundedPath, Segment, all_paths, greedy_path, plan_gantry, random_path, rank, refine,
};
use paint_planner::{Error, Hit, Surface};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};

/// Need as waves over time and position; a path places the need under it.
struct Waves {
    phase: [f64; 2],
    speed: f64,
    simulated: usize,
}

impl Waves {
    fn new(seed: u64) -> Self {
        let mut random = SplitMix64::seed_from_u64(seed);
        let phase = [0, 1].map(|_| (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64 * 6.3);
        Self { phase, speed: 0.1, simulated: 0 }
    }

    fn need(&self, time: f64, position: f64) -> f64 {
        1.0 + (9.0 * time + self.phase[0]).sin() * (150.0 * position + self.phase[1]).cos()
    }
}

impl PaintModel for Waves {
    fn required_density(&mut self, samples: &[GantrySample]) -> Vec<f32> {
        samples.iter().map(|s| self.need(s.time, s.position).min(s.saturation) as f32).collect()
    }

    fn cross_speed(&self, _time: f64) -> f64 {
        self.speed
    }

    fn simulate(&mut self, path: &[Segment]) -> f64 {
        self.simulated += 1;
        let along = |s: &Segment, share: f64| self.need(s.start + share * s.duration, s.from + share * (s.to - s.from));
        path.iter().map(|s| (0..50).map(|k| along(s, (f64::from(k) + 0.5) / 50.0)).sum::<f64>() / 50.0).sum()
    }
}

/// The printed equations: no cut at the flux.
fn printed(flux_speed: f64) -> GantrySettings {
    GantrySettings { flux_speed, least_use: 1.0, saturate: false, ..GantrySettings::default() }
}

const MIDDLE: GantryState = GantryState { position: 0.05, speed: 0 };

/// Eqs. (2)-(5) written out for one movement, over the exact need.
fn score(model: &Waves, s: &Segment, settings: &GantrySettings) -> f64 {
    let nozzle = (((s.to - s.from) / s.duration).powi(2) + model.speed * model.speed).sqrt();
    let flux = settings.flux_speed / nozzle;
    let need = |k: u32| {
        let share = (f64::from(k) + 0.5) / 32.0;
        model.need(s.start + share * s.duration, s.from + share * (s.to - s.from))
    };
    (0..32).map(need).filter(|need| settings.least_use * flux < *need).sum::<f64>() / 32.0
}

#[test]
fn the_best_path_is_that_of_brute_force() {
    for (seed, least_use) in (0..10).map(|seed| (seed, 1.0)).chain((10..20).map(|seed| (seed, 0.5))) {
        let mut model = Waves::new(seed);
        // Samples so dense that interpolation does not decide.
        let settings = GantrySettings { density_spacing: [1e-4, 1e-3], speed_change: 1, least_use, ..printed(0.07) };
        let plan = plan_gantry(&mut model, MIDDLE, &settings).unwrap();
        let mut best = f64::MIN;
        let mut count = 0;
        for code in 0..3_i32.pow(7) {
            let speeds: Vec<i32> = (0..7).map(|k| code / 3_i32.pow(k) % 3 - 1).collect();
            let gentle =
                speeds.iter().scan(0, |last, &s| Some((s - std::mem::replace(last, s)).abs() <= 1)).all(|ok| ok);
            if gentle {
                count += 1;
                best = best.max(plan.lattice.path(&speeds).iter().map(|s| score(&model, s, &settings)).sum());
            }
        }
        // Speeds change by one step at most: 577 of 2187 paths from rest, as a transfer matrix counts them.
        assert_eq!(count, 577);
        let mine: f64 = plan.path().iter().map(|s| score(&model, s, &settings)).sum();
        assert!((plan.score - mine).abs() < 5e-3 * mine && mine > best * (1.0 - 5e-3), "{} {mine} {best}", plan.score);
    }
}

#[test]
fn all_paths_are_simulated_and_the_beam_is_no_worse_than_its_start() {
    for seed in 0..5 {
        let mut model = Waves::new(seed);
        let mut plan = plan_gantry(&mut model, MIDDLE, &printed(0.07)).unwrap();
        let all = all_paths(&mut model, &plan.lattice);
        assert_eq!((all.len(), model.simulated), (2187, 2187));
        let start = model.simulate(&plan.path());
        let found = refine(&mut plan, &mut model, &BeamSettings::default()).unwrap();
        assert!(found >= start && (found - model.simulate(&plan.path())).abs() < 1e-12);
        assert!(rank(found, &all) <= rank(start, &all));
        assert!(rank(found, &all) <= 5, "{}", rank(found, &all));
        let greedy = greedy_path(&mut model, &plan.lattice);
        assert!(greedy.len() == 7 && rank(model.simulate(&plan.lattice.path(&greedy)), &all) <= 2187);
        // A random path is one of all of them.
        let paint = model.simulate(&plan.lattice.path(&random_path(&plan.lattice, seed)));
        assert!(all.contains(&paint));
    }
    assert_eq!([rank(3.0, &[1.0, 3.0, 3.0, 5.0]), rank(5.0, &[1.0, 5.0])], [2, 1]);
}

#[test]
fn a_nozzle_at_the_end_of_its_slide_stays_on_it() {
    let settings = printed(0.05);
    for (position, speed) in [(0.0, -1), (0.1, 1), (0.002, -1), (0.098, 1)] {
        let mut model = Waves::new(3);
        let plan = plan_gantry(&mut model, GantryState { position, speed }, &settings).unwrap();
        assert!(plan.path().iter().all(|s| s.to > -1e-9 && s.to < 0.1 + 1e-9));
        assert!(all_paths(&mut model, &plan.lattice).len() < 2187);
    }
    let beside = GantryState { position: 0.11, speed: 0 };
    assert!(matches!(Lattice::new(beside, &settings), Err(Error::Setting { .. })));
    let even = GantrySettings { directions: 4, ..settings };
    assert!(matches!(Lattice::new(MIDDLE, &even), Err(Error::Setting { name: "gantry.directions", .. })));
}

/// Nothing is needed anywhere.
struct Bare;

impl PaintModel for Bare {
    fn required_density(&mut self, samples: &[GantrySample]) -> Vec<f32> {
        vec![0.0; samples.len()]
    }

    fn cross_speed(&self, _time: f64) -> f64 {
        0.1
    }

    fn simulate(&mut self, _path: &[Segment]) -> f64 {
        0.0
    }
}

#[test]
fn a_nozzle_without_work_comes_to_rest() {
    let settings = GantrySettings { directions: 9, speed_change: 2, ..printed(0.05) };
    let plan = plan_gantry(&mut Bare, GantryState { position: 0.05, speed: 4 }, &settings).unwrap();
    assert_eq!((plan.score, plan.speeds.as_slice()), (0.0, &[2, 0, 0, 0, 0, 0, 0][..]));
}

#[test]
fn the_density_is_sampled_where_the_nozzle_can_be() {
    let mut model = Waves::new(1);
    let settings = printed(0.05);
    let map = DensityMap::sample(&mut model, 0.05, &settings).unwrap();
    assert!(map.samples().all(|([time, position], _)| (position - 0.05).abs() <= 0.05 * time + 1.3e-3));
    // Exact at the samples, and between them no further off than a quarter of the second derivatives' worth of a cell.
    for ([time, position], value) in map.samples() {
        assert!((f64::from(value) - model.need(time, position)).abs() < 1e-6);
    }
    let [dx, dt] = map.spacing();
    let bound = (150.0_f64 * dx).powi(2) / 8.0 + (9.0 * dt).powi(2) / 8.0 + 1e-6;
    for (time, position) in [(0.512, 0.0533), (0.33, 0.0411), (0.687, 0.0602)] {
        assert!((f64::from(map.at(time, position)) - model.need(time, position)).abs() < bound);
    }
}

#[test]
fn rounded_corners_keep_the_acceleration_and_leave_the_corner_by_the_closed_form() {
    let lattice = Lattice::new(MIDDLE, &GantrySettings::default()).unwrap();
    let (path, a) = (lattice.path(&[1, -1, -1, 0, 1, 1, 0]), 5.0);
    let rounded = RoundedPath::new(&path, 0.0, a).unwrap();
    assert!((rounded.peak_acceleration() - a).abs() < 1e-9);
    // At the corner the nozzle is dv^2 / (8 a) off: 0.1 m/s there are 0.25 mm.
    assert!((path[1].from - rounded.at(0.1).0 - 0.1 * 0.1 / (8.0 * a)).abs() < 1e-12);
    let h = 1e-4;
    for k in 0..6990 {
        let t = f64::from(k) * h;
        let (now, next) = (rounded.at(t), rounded.at(t + h));
        assert!((next.1 - now.1).abs() <= a * h * (1.0 + 1e-9));
        assert!((next.0 - now.0 - 0.5 * h * (now.1 + next.1)).abs() < 1e-8);
    }
    assert!(RoundedPath::new(&[], 0.0, a).is_err() && RoundedPath::new(&path, 0.0, 0.0).is_err());
}

fn normal(random: &mut SplitMix64) -> f64 {
    // Twelve uniform numbers: variance 1, near enough to a Gaussian.
    (0..12).map(|_| (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64).sum::<f64>() - 6.0
}

/// A hand that swings with 27 mm at 0.6 Hz, measured with 2 mm of noise.
#[test]
fn the_filter_follows_a_swinging_hand_and_knows_how_well() {
    let place = |t: f64| Vector3::new(0.0, 0.027 * (3.7 * t).sin(), 0.5);
    let force = |t: f64| Vector3::new(0.0, -0.027 * 3.7 * 3.7 * (3.7 * t).sin(), 9.80665);
    let mut random = SplitMix64::seed_from_u64(5);
    let mut errors = [0.0; 2];
    for (inertial, error) in [false, true].into_iter().zip(&mut errors) {
        let mut filter = PoseFilter::new(PoseFilterSettings::default()).unwrap();
        assert!(filter.position_sigma().is_infinite());
        for k in 0..2000 {
            let t = f64::from(k) * 0.01;
            let mut noise = |sigma: f64| Vector3::from_fn(|_, _| sigma * normal(&mut random));
            let shifted = Translation3::from(place(t) + noise(2e-3));
            let pose = Isometry3::from_parts(shifted, UnitQuaternion::from_scaled_axis(noise(3.5e-3)));
            filter.update(Some(&pose), 0.01);
            if inertial {
                // A bias that the filter has to find.
                let bias = Vector3::new(0.03, -0.03, 0.0);
                filter.inertial(&(force(t) + bias + noise(0.05)), &noise(5e-3));
            }
            if k >= 500 {
                let found = filter.motion().unwrap().world_from_robot.translation.vector;
                *error += (found - place(t)).norm_squared() / 1500.0;
            }
        }
        *error = (*error / 3.0).sqrt();
        // The error is what the covariance says, within a third.
        let ratio = *error / filter.position_sigma();
        assert!((0.67..1.5).contains(&ratio), "{inertial}: {error} against {}", filter.position_sigma());
        let before = filter.position_sigma();
        (0..30).for_each(|_| filter.update(None, 0.01));
        assert!(filter.position_sigma() > 2.0 * before);
    }
    assert!(errors[0] < 1.4e-3 && errors[1] < 0.7 * errors[0], "{errors:?}");
}

/// Half a second of later poses halves the error: the smoother's variance is a quarter of the filter's where a double integrator driven by
/// white noise is measured in white noise.
#[test]
fn the_smoother_knows_twice_as_well_where_the_robot_was() {
    let place = |t: f64| Vector3::new(0.0, 0.027 * (3.7 * t).sin(), 0.5);
    let force = |t: f64| Vector3::new(0.0, -0.027 * 3.7 * 3.7 * (3.7 * t).sin(), 9.80665);
    let tilt = |t: f64| UnitQuaternion::from_scaled_axis(Vector3::z() * 0.05 * (2.0 * t).sin());
    let rate = |t: f64| Vector3::z() * 0.1 * (2.0 * t).cos();
    let mut random = SplitMix64::seed_from_u64(6);
    let mut filter = PoseFilter::new(PoseFilterSettings::default()).unwrap();
    let mut smoother = PoseSmoother::new(61);
    // Passed over: the filter has seen nothing.
    smoother.push(&filter);
    assert!(smoother.latest_first().is_empty());
    let mut errors = [[0.0; 2]; 2];
    for k in 0..3000 {
        let t = f64::from(k) * 0.01;
        let mut noise = |sigma: f64| Vector3::from_fn(|_, _| sigma * normal(&mut random));
        let turned = UnitQuaternion::from_scaled_axis(noise(3.5e-3)) * tilt(t);
        let pose = Isometry3::from_parts(Translation3::from(place(t) + noise(2e-3)), turned);
        filter.update(Some(&pose), 0.01);
        filter.inertial(&(tilt(t).inverse() * force(t) + noise(0.05)), &(rate(t) + noise(5e-3)));
        smoother.push(&filter);
        let motions = smoother.latest_first();
        assert_eq!(motions[0], *filter.motion().unwrap());
        if k < 500 {
            continue;
        }
        for (age, [position, rotation]) in [0, 50].into_iter().zip(&mut errors) {
            let (pose, then) = (motions[age].world_from_robot, t - 0.01 * age as f64);
            *position += (pose.translation.vector - place(then)).norm_squared();
            *rotation += pose.rotation.angle_to(&tilt(then)).powi(2);
        }
    }
    let ratio = |k: usize| (errors[1][k] / errors[0][k]).sqrt();
    assert!((0.4..0.65).contains(&ratio(0)) && (0.3..0.8).contains(&ratio(1)), "{} {}", ratio(0), ratio(1));
    assert_eq!(filter.restarts(), 0);
}

/// A robot that stands, with sensors that say otherwise: the biases are found, and nothing is believed to move.
#[test]
fn biases_of_a_robot_that_stands_are_found() {
    let pose = Isometry3::new(Vector3::new(0.1, -0.2, 0.5), Vector3::new(0.0, 0.0, 0.7));
    let (force, rate) = (Vector3::new(0.03, -0.02, 9.80665 + 0.04), Vector3::new(0.004, -0.003, 0.005));
    let mut filter = PoseFilter::new(PoseFilterSettings::default()).unwrap();
    for _ in 0..3000 {
        filter.update(Some(&pose), 0.01);
        filter.inertial(&force, &rate);
    }
    let motion = filter.motion().unwrap();
    // A tenth of the biases, as rates and as what acceleration makes of a place between two poses.
    assert!(motion.angular_velocity.norm() < 0.1 * rate.norm(), "{}", motion.angular_velocity);
    assert!(motion.velocity.norm() < 1e-4, "{}", motion.velocity);
    assert!((motion.world_from_robot.translation.vector - pose.translation.vector).norm() < 1e-5);
    assert!(motion.world_from_robot.rotation.angle_to(&pose.rotation) < 1e-5);
}

#[test]
fn a_pose_that_jumps_starts_the_filter_anew() {
    let mut filter = PoseFilter::new(PoseFilterSettings::default()).unwrap();
    let mut smoother = PoseSmoother::new(20);
    let mut step = |x: f64| {
        filter.update(Some(&Isometry3::translation(x, 0.0, 0.0)), 0.01);
        smoother.push(&filter);
        (filter.restarts(), filter.position_sigma(), smoother.latest_first())
    };
    for _ in 0..100 {
        assert_eq!(step(0.0).0, 0);
    }
    let (restarts, sigma, _) = step(0.3);
    assert!(restarts == 1 && (sigma - 2e-3).abs() < 1e-12);
    // What comes after a jump says nothing about what was before.
    let (_, _, motions) = (0..5).map(|_| step(0.3)).last().unwrap();
    for (age, motion) in motions.iter().enumerate() {
        let expected = if age <= 5 { 0.3 } else { 0.0 };
        assert!((motion.world_from_robot.translation.x - expected).abs() < 1e-9, "{age}");
    }
}

/// A book of where the robot was, and how far the valve was open, at each shot.
struct Book;

impl DepositModel for Book {
    type Deposit = Vec<(f64, f64)>;
    type Footprint = f64;
    type Error = Error;

    fn surface(&self) -> &dyn Surface {
        &Corner
    }

    fn footprint(&self, model_from_robot: &Isometry3<f64>, position: f64, _step: usize) -> f64 {
        model_from_robot.translation.y + position
    }

    fn score(&self, _: &f64, _: &Self::Deposit) -> f64 {
        0.0
    }

    fn spray(&self, place: &f64, open: f64, deposit: &mut Self::Deposit) {
        deposit.push((*place, open));
    }

    fn forecast<R>(
        &mut self,
        _: &Self::Deposit,
        _: &RobotMotion,
        plan: impl FnOnce(&mut dyn PaintModel) -> Result<R, Error>,
    ) -> Result<R, Error> {
        plan(&mut Bare)
    }
}

/// The robot slides at 0.2 m/s, and every shot is booked in the middle of its step: half a step is a millimetre.
#[test]
fn paint_is_booked_in_the_middle_of_its_step() {
    let dt = 0.01;
    let mut filter = PoseFilter::new(PoseFilterSettings::default()).unwrap();
    let mut estimate = DepositEstimate::<Book>::new(Vec::new(), dt, 10);
    let model_from_world = Isometry3::translation(0.0, 0.7, 0.0);
    for step in 0..300 {
        filter.update(Some(&Isometry3::translation(0.0, 0.2 * dt * step as f64, 0.0)), dt);
        estimate.observe(&filter);
        estimate.sprayed(step, 0.01, 1.0 / (1 + step) as f64);
        if step % 10 != 9 {
            continue;
        }
        let booked = estimate.estimate(&Book, &model_from_world, step);
        assert_eq!(booked.len(), step + 1);
        for (k, (place, open)) in booked.iter().enumerate() {
            let middle = 0.2 * dt * (k as f64 + 0.5) + 0.7 + 0.01;
            // The filter learns the speed in its first steps.
            assert!(k < 100 || (place - middle).abs() < 1e-4, "shot {k} at {place} instead of {middle}");
            assert_eq!(*open, 1.0 / (1 + k) as f64);
        }
    }
}

/// A corner of three planes, seen from inside the positive octant.
struct Corner;

impl Surface for Corner {
    fn cast(&self, o: &Point3<f64>, d: &UnitVector3<f64>, max: f64) -> Option<Hit> {
        let hits = (0..3).filter_map(|k| {
            let distance = -o[k] / d[k];
            let point = o + d.into_inner() * distance;
            let on_wall = distance > 0.0 && distance < max && (0..3).all(|j| j == k || point[j] >= 0.0);
            let mut normal = Vector3::zeros();
            normal[k] = 1.0;
            on_wall.then(|| Hit { point, normal: UnitVector3::new_unchecked(normal), distance })
        });
        hits.min_by(|a, b| a.distance.total_cmp(&b.distance))
    }

    fn distance(&self, p: &Point3<f64>, max: f64) -> f64 {
        p.coords.min().abs().min(max)
    }
}

#[test]
fn the_registration_finds_an_object_that_stands_elsewhere() {
    let truth = Isometry3::new(Vector3::new(4e-3, -3e-3, 2e-3), Vector3::new(0.0, 0.01, -0.008));
    let middle = Point3::new(0.05, 0.05, 0.05);
    let settings = RegistrationSettings { range_sigma: 1e-3, ..RegistrationSettings::default() };
    let mut registration = Registration::new(middle, settings).unwrap();
    let mut random = SplitMix64::seed_from_u64(9);
    for k in 0..3000 {
        let origin = Point3::new(0.15, 0.15, 0.15) + Vector3::from_fn(|_, _| 0.02 * normal(&mut random));
        let aim = -Vector3::repeat(1.0) + Vector3::from_fn(|_, _| 0.5 * normal(&mut random));
        let direction = UnitVector3::new_normalize(aim);
        let seen = Corner.cast(&(truth.inverse() * origin), &(truth.inverse() * direction), 1.0);
        // Every twentieth beam errs wildly.
        let outlier = if k % 20 == 7 { 0.05 } else { 0.0 };
        let distance = seen.map(|hit| hit.distance + 1e-3 * normal(&mut random) + outlier);
        registration.update(&RangeReading { origin, direction, distance }, &Corner, 0.01);
    }
    let found = registration.correction();
    assert!((found * middle - truth * middle).norm() < 4e-4, "{}", found * middle - truth * middle);
    assert!(found.rotation.angle_to(&truth.rotation) < 4e-3);
    assert!(registration.rejected >= 140 && registration.used > 1500);
    assert!(registration.translation_sigmas().max() < 1e-3);
}

/// The width, or the area, over which a Gaussian is even for its own droplets: one over the integral of its square, summed here.
#[test]
fn the_flux_is_that_of_the_nozzles_gaussian() {
    let (flow, sigma, punishment) = (2e-9, 0.1_f64, 3.0);
    let (spread, step) = (sigma.tan(), 1e-4);
    let gaussian = |x: f64| (-0.5 * (x / spread).powi(2)).exp() / (std::f64::consts::TAU.sqrt() * spread);
    let squared: f64 = (-10_000..=10_000).map(|k| gaussian(step * f64::from(k)).powi(2) * step).sum();
    let usual = GantrySettings::default();
    let [physical, literal] = [false, true].map(|literal| usual.with_spray(flow, sigma, punishment, literal));
    assert!((physical.flux_speed / (flow * squared) - 1.0).abs() < 1e-9, "{}", physical.flux_speed);
    assert!((literal.flux_speed / (flow * squared * squared) - 1.0).abs() < 1e-9, "{}", literal.flux_speed);
    // One part gained for three lost; Eq. (4) asks for all of the flux.
    assert_eq!((physical.least_use, literal.least_use), (0.75, 1.0));
    assert!(!literal.saturate && physical.saturate == usual.saturate);
}
