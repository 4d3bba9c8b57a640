//! Kinematics: one call each over a thousand seeded poses in front of the wall.

use criterion::Throughput;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use paintcopter_benches::{Rng, criterion};
use ptu_kinematics::{Error, Hover, Joints, Ptu, PtuSettings, Servo, ServoSettings};

const COUNT: usize = 1000;

struct Case {
    /// Tilted by wind.
    world_from_body: Isometry3<f64>,
    /// Within all limits.
    joints: Joints,
    /// In front of the nozzle.
    target: Point3<f64>,
    /// The wanted tip, direction and heading.
    tip: Point3<f64>,
    direction: UnitVector3<f64>,
    heading: f64,
    hover: Hover,
}

fn case(ptu: &Ptu, rng: &mut Rng) -> Case {
    let joints = Joints { pan: rng.between(-1.0, 1.0), tilt: rng.between(-0.7, 0.7) };
    let position = Point3::new(rng.between(-1.5, -1.0), rng.between(-2.0, 2.0), rng.between(1.5, 3.5));
    let heading = rng.between(-0.5, 0.5);
    let attitude = UnitQuaternion::from_euler_angles(rng.between(-0.1, 0.1), rng.between(-0.1, 0.1), heading);
    let world_from_body = Isometry3::from_parts(Translation3::from(position), attitude);
    let nozzle = ptu.forward(&world_from_body, joints);
    let target = nozzle.tip + nozzle.direction.into_inner() * rng.between(0.05, 0.15);
    let sideways = Vector3::new(1.0, rng.between(-0.4, 0.4), rng.between(-0.4, 0.4));
    let hover = Hover { position, heading, joints };
    Case {
        world_from_body,
        joints,
        target,
        tip: nozzle.tip,
        direction: UnitVector3::new_normalize(sideways),
        heading,
        hover,
    }
}

fn main() -> Result<(), Error> {
    let ptu = Ptu::new(PtuSettings::default())?;
    let mut rng = Rng::new(1);
    let cases: Vec<Case> = (0..COUNT).map(|_| case(&ptu, &mut rng)).collect();
    // Refused input would be timed as well: none of it may be.
    for case in &cases {
        ptu.aim(&case.world_from_body, &case.target)?;
        ptu.inverse(&case.tip, &case.direction, case.heading)?;
    }
    let mut criterion = criterion();
    let mut group = criterion.benchmark_group("ptu-kinematics");
    group.throughput(Throughput::Elements(COUNT as u64));
    group.bench_function("forward", |b| {
        b.iter(|| cases.iter().map(|c| ptu.forward(&c.world_from_body, c.joints).tip.x).sum::<f64>());
    });
    group.bench_function("inverse", |b| {
        let inverse = |c: &Case| ptu.inverse(&c.tip, &c.direction, c.heading).map_or(f64::NAN, |h| h.joints.tilt);
        b.iter(|| cases.iter().map(inverse).sum::<f64>());
    });
    group.bench_function("aim", |b| {
        let aim = |c: &Case| ptu.aim(&c.world_from_body, &c.target).map_or(f64::NAN, |a| a.joints.tilt);
        b.iter(|| cases.iter().map(aim).sum::<f64>());
    });
    group.bench_function("jacobian", |b| {
        b.iter(|| cases.iter().map(|c| ptu.jacobian(&c.hover)[(5, 5)]).sum::<f64>());
    });
    let mut servo = Servo::new(ServoSettings::default(), 0.0)?;
    group.bench_function("servo step of 1 ms", |b| {
        b.iter(|| cases.iter().map(|c| servo.step(c.joints.pan, 1e-3)).sum::<f64>());
    });
    group.finish();
    criterion.final_summary();
    Ok(())
}
