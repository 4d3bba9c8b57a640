//! Bring your own paint: a wall of texels that each take one shot, under the gantry's controller.

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};
use paint_planner::gantry::{
    Command, Controller, ControllerSettings, DepositModel, Event, Frame, GantrySample, InertialSample, PaintModel,
    RangeReading, RobotMotion, Segment,
};
use paint_planner::{Error, Hit, Surface};

/// Width of a texel, m, and how many there are on either side of the middle.
const TEXEL: f64 = 2e-3;
const HALF: i64 = 200;
/// Distance of the robot from the wall, m.
const STAND_OFF: f64 = 0.06;

/// The wall x = 0, seen from x < 0.
struct Wall;

impl Surface for Wall {
    fn cast(&self, o: &Point3<f64>, d: &UnitVector3<f64>, max: f64) -> Option<Hit> {
        let distance = -o.x / d.x;
        let point = o + d.into_inner() * distance;
        (0.0..max).contains(&distance).then(|| Hit { point, normal: -Vector3::x_axis(), distance })
    }

    fn distance(&self, p: &Point3<f64>, max: f64) -> f64 {
        p.x.abs().min(max)
    }
}

/// Shots that each column of the wall still needs, from the lowest y on.
type Needs = Vec<i64>;

/// A pencil of spray: one shot into the texel before the nozzle. Columns need the same at every height above `from_z`.
struct Pencil {
    from_z: f64,
}

impl Pencil {
    /// The column before the nozzle, if paint is wanted at that height.
    fn column(&self, model_from_robot: &Isometry3<f64>, position: f64) -> Option<usize> {
        let tip = model_from_robot * Point3::new(0.0, 0.0, position - 0.05);
        let axis = model_from_robot.rotation * Vector3::x_axis();
        let hit = Wall.cast(&tip, &axis, 0.3)?;
        (hit.point.z >= self.from_z).then_some(((hit.point.y / TEXEL).floor() as i64 + HALF) as usize)
    }
}

impl DepositModel for Pencil {
    type Deposit = Needs;
    type Footprint = Option<usize>;
    type Error = Error;

    fn surface(&self) -> &dyn Surface {
        &Wall
    }

    fn footprint(&self, model_from_robot: &Isometry3<f64>, position: f64, _step: usize) -> Option<usize> {
        self.column(model_from_robot, position)
    }

    fn score(&self, footprint: &Option<usize>, needs: &Needs) -> f64 {
        footprint.and_then(|column| needs.get(column)).map_or(-1.0, |need| if *need > 0 { 1.0 } else { -1.0 })
    }

    fn spray(&self, footprint: &Option<usize>, open: f64, needs: &mut Needs) {
        if let Some(need) = footprint.and_then(|column| needs.get_mut(column)) {
            *need -= open.round() as i64;
        }
    }

    fn forecast<R>(
        &mut self,
        needs: &Needs,
        motion: &RobotMotion,
        plan: impl FnOnce(&mut dyn PaintModel) -> Result<R, Error>,
    ) -> Result<R, Error> {
        plan(&mut Forecast { pencil: self, needs, motion })
    }
}

struct Forecast<'a> {
    pencil: &'a Pencil,
    needs: &'a Needs,
    motion: &'a RobotMotion,
}

impl PaintModel for Forecast<'_> {
    fn required_density(&mut self, samples: &[GantrySample]) -> Vec<f32> {
        let need = |sample: &GantrySample| {
            let column = self.pencil.column(&self.motion.after(sample.time), sample.position)?;
            self.needs.get(column).map(|need| if *need > 0 { sample.saturation as f32 } else { 0.0 })
        };
        samples.iter().map(|sample| need(sample).unwrap_or(0.0)).collect()
    }

    fn cross_speed(&self, _time: f64) -> f64 {
        self.motion.velocity.y.abs()
    }

    fn simulate(&mut self, _path: &[Segment]) -> f64 {
        0.0
    }
}

/// One shot wanted in every column of the wall between two of them.
fn band(from: i64, to: i64) -> Needs {
    (-HALF..HALF).map(|column| i64::from((from..to).contains(&column))).collect()
}

/// A valve without delay, and markers alone, which leave the place less certain than with an inertial sensor.
fn settings() -> ControllerSettings {
    ControllerSettings {
        valve_delay: 0.0,
        registration: None,
        max_position_sigma: 1.8e-3,
        ..ControllerSettings::default()
    }
}

/// The controller in a robot that does what it is told: the slide follows, the valve switches at once.
struct Bench {
    controller: Controller<Pencil>,
    time: f64,
    position: f64,
    sprayed: f64,
}

impl Bench {
    fn new(settings: &ControllerSettings, from_z: f64, needs: Needs) -> Self {
        let made = Controller::new(*settings, Pencil { from_z }, needs, Point3::origin());
        let controller = made.expect("the settings are sound");
        Self { controller, time: 0.0, position: 0.05, sprayed: 0.0 }
    }

    fn frame(&mut self, world_from_robot: Option<Isometry3<f64>>) -> Command {
        let Self { time, position, sprayed, .. } = *self;
        let frame = Frame { time, world_from_robot, inertial: None, ranges: &[], position, sprayed };
        let command = self.controller.frame(&frame).expect("the frame is sound");
        self.time += 0.01;
        self.position = command.slide.position;
        self.sprayed = f64::from(u8::from(command.valve_open));
        command
    }
}

/// Before the wall at a place along it, m.
fn before(y: f64) -> Isometry3<f64> {
    Isometry3::translation(-STAND_OFF, y, 0.0)
}

#[test]
fn the_valve_opens_once_over_each_texel_of_the_target_and_never_again() {
    let mut bench = Bench::new(&settings(), f64::MIN, band(-10, 10));
    // 0.1 m/s, to and back: a millimetre in each frame, two frames over each texel. The filter has two seconds to learn the speed.
    let there = |t: f64| -0.3 + 0.1 * t;
    let mut visited = std::collections::BTreeSet::new();
    for k in 0..1200 {
        let at = |t: f64| if t < 6.0 { there(t) } else { there(12.0 - t) };
        let time = f64::from(k) * 0.01;
        let command = bench.frame(Some(before(at(time))));
        // The texel before the nozzle in the middle of the time step; around the turn there is none of the target.
        let texel = (at(time + 0.005) / TEXEL).floor() as i64;
        let expected = (-10..10).contains(&texel) && visited.insert(texel);
        assert_eq!(command.valve_open, expected, "at {time} s, over texel {texel}");
    }
    assert_eq!(visited.len(), 20);
    assert_eq!(*bench.controller.deposit(), band(0, 0));
}

#[test]
fn paint_that_was_not_commanded_is_counted_where_it_went() {
    let mut bench = Bench::new(&settings(), f64::MIN, band(-10, 10));
    for k in 0..600 {
        let y = -0.3 + 0.1 * (f64::from(k) * 0.01);
        bench.frame(Some(before(y)));
        // A valve that sticks while the robot passes the first half of the target, and is shut by hand before the second.
        let stuck = (-10..0).contains(&(((y + 5e-4) / TEXEL).floor() as i64));
        bench.sprayed = f64::from(u8::from(stuck));
    }
    // Two frames over each texel: one shot more than was wanted. The other half was never sprayed, whatever was commanded.
    let needs = bench.controller.deposit();
    for column in -HALF..HALF {
        let expected = if (-10..0).contains(&column) { -1 } else { i64::from((0..10).contains(&column)) };
        assert_eq!(needs[(column + HALF) as usize], expected, "column {column}");
    }
}

#[test]
fn the_slide_goes_where_paint_is_needed_as_fast_as_it_may() {
    let mut bench = Bench::new(&settings(), 0.02, band(-HALF, HALF));
    let mut reached = None;
    for k in 0..100 {
        let time = f64::from(k) * 0.01;
        let command = bench.frame(Some(before(0.1 * time)));
        assert!(command.slide.velocity.abs() <= 0.05 + 1e-12);
        if command.slide.position >= 0.07 && reached.is_none() {
            reached = Some(time + 0.01);
        }
    }
    // One pose does not tell the place well enough. The second decision, at 0.1 s, is for the movement after the running one: 20 mm from 0.2 s
    // on; the corner is rounded.
    let reached = reached.unwrap();
    assert!((reached - (0.2 + 0.02 / 0.05)).abs() < 0.011, "{reached}");
}

#[test]
fn a_pose_that_jumps_shuts_the_valve_until_the_place_is_known_again() {
    let mut bench = Bench::new(&settings(), f64::MIN, vec![1_000_000; 2 * HALF as usize]);
    for _ in 0..200 {
        bench.frame(Some(before(0.0)));
    }
    assert_eq!(bench.sprayed, 1.0);
    let command = bench.frame(Some(before(0.2)));
    assert!(matches!(command.events[..], [Event::PoseJumped, Event::Held]) && !command.valve_open);
    // One pose is known to 2 mm, and 1.8 are asked for.
    let mut shut = 1;
    while !bench.frame(Some(before(0.2))).valve_open {
        shut += 1;
    }
    assert!((2..50).contains(&shut), "{shut}");
    assert!((bench.controller.motion().unwrap().world_from_robot.translation.y - 0.2).abs() < 1e-9);
}

#[test]
fn lost_markers_shut_the_valve_in_their_frame_and_the_nozzle_comes_to_rest() {
    let mut bench = Bench::new(&settings(), 0.02, vec![1_000_000; 2 * HALF as usize]);
    for _ in 0..100 {
        bench.frame(Some(before(0.0)));
    }
    assert_eq!(bench.sprayed, 1.0);
    let lost = bench.frame(None);
    assert!(matches!(lost.events[..], [Event::TrackingLost, Event::Held]) && !lost.valve_open);
    let mut held = 1;
    for _ in 1..100 {
        let command = bench.frame(None);
        assert!(!command.valve_open && command.events.iter().all(|event| matches!(event, Event::Held)));
        held += command.events.len();
    }
    assert_eq!(held, 10);
    assert_eq!(bench.controller.slide_at(bench.time).velocity, 0.0);
    let found = bench.frame(Some(before(0.0)));
    assert!(matches!(found.events[..], [Event::TrackingFound { after }, ..] if (after - 1.0).abs() < 1e-9));
}

#[test]
fn distances_to_the_wall_correct_where_it_is_believed_to_stand() {
    let registration = Some(paint_planner::gantry::RegistrationSettings::default());
    let controller = ControllerSettings { registration, ..settings() };
    let mut controller =
        Controller::new(controller, Pencil { from_z: f64::MIN }, band(0, 1), Point3::origin()).unwrap();
    // The wall stands 5 mm behind its model.
    let ranges: Vec<RangeReading> = [[0.0, 0.0], [0.3, 0.0], [-0.3, 0.0], [0.0, 0.3], [0.0, -0.3]]
        .map(|[y, z]| {
            let direction = UnitVector3::new_normalize(Vector3::new(1.0, y, z));
            let distance = Some((STAND_OFF + 5e-3) / direction.x);
            RangeReading { origin: Point3::origin(), direction, distance }
        })
        .to_vec();
    for k in 0..100 {
        let still = InertialSample { specific_force: Vector3::z() * 9.80665, angular_velocity: Vector3::zeros() };
        let frame = Frame {
            time: f64::from(k) * 0.01,
            world_from_robot: Some(before(0.0)),
            inertial: Some(still),
            ranges: &ranges,
            position: 0.05,
            sprayed: 0.0,
        };
        controller.frame(&frame).unwrap();
    }
    let place = controller.object_place();
    assert!((place.translation.x - 5e-3).abs() < 1e-4 && place.rotation.angle() < 1e-6, "{place}");
}

#[test]
fn frames_that_no_sensor_gives_and_settings_of_no_robot_are_refused() {
    let mut bench = Bench::new(&settings(), f64::MIN, band(0, 1));
    let sound = Frame {
        time: 0.0,
        world_from_robot: Some(before(0.0)),
        inertial: None,
        ranges: &[],
        position: 0.05,
        sprayed: 0.0,
    };
    let still = InertialSample { specific_force: Vector3::repeat(f64::NAN), angular_velocity: Vector3::zeros() };
    for (frame, field) in [
        (Frame { time: f64::INFINITY, ..sound }, "`time`"),
        (Frame { position: f64::NAN, ..sound }, "`position`"),
        (Frame { world_from_robot: Some(before(f64::NAN)), ..sound }, "`world_from_robot`"),
        (Frame { inertial: Some(still), ..sound }, "`inertial`"),
        (Frame { sprayed: 2.0, ..sound }, "`sprayed`"),
    ] {
        let refused = bench.controller.frame(&frame).unwrap_err();
        assert!(matches!(refused, Error::Frame { .. }) && refused.to_string().contains(field), "{refused}");
    }
    // A nozzle that does not stand on its slide: said when it is to be moved.
    let beside = |k: i32| Frame { position: 0.2, time: 0.01 * f64::from(k), ..sound };
    let refused = (0..20).find_map(|k| bench.controller.frame(&beside(k)).err());
    assert!(matches!(refused, Some(Error::Setting { value: 0.2, .. })), "{refused:?}");
    let base = settings();
    for wrong in [
        ControllerSettings { step: 0.0, ..base },
        ControllerSettings { corner_acceleration: -1.0, ..base },
        ControllerSettings { valve_delay: f64::NAN, ..base },
    ] {
        let refused = Controller::new(wrong, Pencil { from_z: 0.0 }, band(0, 1), Point3::origin());
        assert!(matches!(refused, Err(Error::Setting { .. })));
    }
}
