//! Situations for the planner: a robot on its way past the target, which is partly painted.

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use paint_planner::gantry::GantryState;
use paint_sim::droplets::{Coverage, Sweep};
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};

use super::error::HandheldError;
use super::forecast::PaintJob;
use super::object::{PaintObject, SurfaceSample};
use super::settings::HandheldSettings;

/// One decision to take.
pub struct Scenario {
    /// The paint so far.
    pub coverage: Coverage,
    /// The robot's motion.
    pub sweep: Sweep,
    /// Where the nozzle is.
    pub state: GantryState,
}

/// Most straight passes that were sprayed before.
const MOST_PASSES: u64 = 40;

/// Uniform numbers of one scenario.
struct Random(SplitMix64);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

impl Scenario {
    /// Scenario `number` of a seed, before one of the `faces` to paint. The nozzle starts where all paths stay on the slide.
    ///
    /// # Errors
    /// A target or settings that the simulator refuses.
    pub fn new(
        object: &PaintObject,
        faces: &[SurfaceSample],
        job: &PaintJob,
        seed: u64,
        number: usize,
    ) -> Result<Self, HandheldError> {
        let settings = job.settings;
        let mut random = Random(SplitMix64::seed_from_u64(seed.wrapping_mul(1_000_003).wrapping_add(number as u64)));
        let face = faces[number % faces.len()];
        let mut coverage = object.bare()?;
        let passes = random.0.next_u64() % (MOST_PASSES + 1);
        for _ in 0..passes {
            let sweep = sweep(&face, settings, &mut random);
            let position = settings.geometry.travel * random.between(0.3, 0.7);
            spray_pass(&mut coverage, job, &sweep, position);
        }
        let planner = settings.planner();
        let reach = planner.max_speed * planner.interval * planner.horizon as f64;
        let room = (0.5 * settings.geometry.travel - reach).max(0.0);
        let position = 0.5 * settings.geometry.travel + random.between(-room, room);
        let fastest = (planner.directions / 2) as i32;
        let speed = (random.0.next_u64() % planner.directions as u64) as i32 - fastest;
        let sweep = sweep(&face, settings, &mut random);
        Ok(Self { coverage, sweep, state: GantryState { position, speed } })
    }
}

/// A sweep past the middle of a face, in either direction, as a person may hold it.
fn sweep(face: &SurfaceSample, settings: &HandheldSettings, random: &mut Random) -> Sweep {
    let tilt = [random.between(-0.2, 0.2), random.between(-0.2, 0.2), random.between(-0.1, 0.1)];
    let rotation = facing(face) * UnitQuaternion::from_euler_angles(tilt[2], tilt[0], tilt[1]);
    let distance = settings.stand_off + random.between(-0.01, 0.015);
    let speed = random.between(0.05, 0.15) * if random.0.next_u64() & 1 == 0 { 1.0 } else { -1.0 };
    // The horizon's middle is near the middle of the target.
    let lead = speed * 0.5 * settings.planner.interval * settings.planner.horizon as f64;
    let aside = random.between(-0.02, 0.02) - lead;
    let aim = face.point + rotation * Vector3::new(0.0, aside, random.between(-0.01, 0.01));
    let position: Point3<f64> = aim - rotation * Vector3::x() * distance;
    let drift = Vector3::new(random.between(-0.01, 0.01), speed, random.between(-0.01, 0.01));
    let turning = Vector3::new(0.0, random.between(-0.1, 0.1), random.between(-0.1, 0.1));
    Sweep {
        world_from_robot: Isometry3::from_parts(Translation3::from(position), rotation),
        velocity: rotation * drift,
        angular_velocity: rotation * turning,
    }
}

/// The orientation of a robot that sprays against a surface, its gantry as upright as that allows.
pub(super) fn facing(face: &SurfaceSample) -> UnitQuaternion<f64> {
    let x = -face.normal.into_inner();
    let sideways = Vector3::z().cross(&x);
    let y = if sideways.norm() > 1e-6 { sideways.normalize() } else { Vector3::y() };
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(nalgebra::Matrix3::from_columns(&[
        x,
        y,
        x.cross(&y),
    ])))
}

/// A pass at one gantry position, the valve open where that does good.
fn spray_pass(coverage: &mut Coverage, job: &PaintJob, sweep: &Sweep, position: f64) {
    let settings = job.settings;
    let deposit = &settings.deposit;
    let steps = (settings.planner.interval * settings.planner.horizon as f64 / deposit.step).round() as usize;
    for k in 0..steps {
        let hits = job.hits(&sweep.at((k as f64 + 0.5) * deposit.step), position, k);
        if job.score(&hits, coverage) > 0.0 {
            coverage.spray(&hits, deposit.droplet());
        }
    }
}
