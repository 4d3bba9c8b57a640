//! The simulator's droplets as the gantry planner's paint.

use nalgebra::Isometry3;
use paint_planner::gantry::{GantrySample, PaintModel, Segment};
use paint_sim::droplets::{
    Coverage, DensityPlace, DensitySettings, Droplets, Flux, PathOutcome, PathSimulation, SimulatedSegment, StepCast,
    StepHits, Sweep, TexelSurface, density_map,
};
use paint_sim::spray::QUANTUM;

use super::error::HandheldError;
use super::settings::HandheldSettings;

/// Where densities are computed and droplets are cast.
pub trait PaintDevice {
    /// Required density of a nozzle at each place.
    ///
    /// # Errors
    /// What the device says.
    fn density(&mut self, coverage: &Coverage, places: &[DensityPlace], flux: Flux) -> Result<Vec<f32>, HandheldError>;

    /// Hits of steps of path simulation; `None` leaves them to the simulation.
    ///
    /// # Errors
    /// What the device says.
    fn hits(&mut self, _steps: &[StepCast]) -> Result<Option<Vec<StepHits>>, HandheldError> {
        Ok(None)
    }

    /// Its name for the report.
    fn name(&self) -> String;
}

/// The processor.
pub struct Processor<'a> {
    /// The object.
    pub surface: &'a TexelSurface,
    /// Rays of a sample.
    pub droplets: Droplets,
    /// Threads that share the samples.
    pub threads: usize,
}

impl PaintDevice for Processor<'_> {
    fn density(&mut self, coverage: &Coverage, places: &[DensityPlace], flux: Flux) -> Result<Vec<f32>, HandheldError> {
        let settings = DensitySettings { flux, threads: self.threads };
        Ok(density_map(self.surface, coverage, &self.droplets, places, &settings))
    }

    fn name(&self) -> String {
        "processor".into()
    }
}

/// What does not change from decision to decision.
pub struct PaintJob<'a> {
    /// The object.
    pub surface: &'a TexelSurface,
    /// Robot, spray, planner.
    pub settings: &'a HandheldSettings,
    /// Droplets of the time steps.
    pub sets: Vec<Droplets>,
}

impl<'a> PaintJob<'a> {
    /// With the droplets of these settings.
    ///
    /// # Errors
    /// Settings out of range.
    pub fn new(surface: &'a TexelSurface, settings: &'a HandheldSettings) -> Result<Self, HandheldError> {
        Ok(Self { surface, settings, sets: settings.droplet_sets()? })
    }

    /// Where the droplets of a time step land, from a pose of the robot and a gantry position, m.
    pub(super) fn hits(&self, world_from_robot: &Isometry3<f64>, position: f64, step: usize) -> StepHits {
        let nozzle = self.settings.geometry.nozzle(world_from_robot, position);
        StepHits::cast(self.surface, &nozzle, &self.sets[step % self.sets.len()])
    }

    /// What a whole step of spray is worth there.
    pub(super) fn score(&self, hits: &StepHits, coverage: &Coverage) -> f64 {
        let deposit = &self.settings.deposit;
        hits.score(deposit.droplet(), deposit.punishment, |texel| coverage.remaining(texel as usize)).score
    }
}

/// The paint as it would go on from one moment.
pub struct Forecast<'a> {
    simulation: PathSimulation<'a>,
    coverage: &'a Coverage,
    device: &'a mut dyn PaintDevice,
    settings: &'a HandheldSettings,
    sweep: Sweep,
    flux: Flux,
    /// The first fault of the device; densities after it are zero, and the processor casts.
    fault: Option<HandheldError>,
}

impl<'a> Forecast<'a> {
    /// From the paint and the motion of the robot.
    ///
    /// # Errors
    /// Settings out of range.
    pub fn new(
        job: &'a PaintJob,
        coverage: &'a Coverage,
        device: &'a mut dyn PaintDevice,
        sweep: &Sweep,
    ) -> Result<Self, HandheldError> {
        let PaintJob { surface, sets, settings } = job;
        let simulation = PathSimulation::new(surface, coverage, sets, &settings.deposit, &settings.geometry, sweep)?;
        Ok(Self { simulation, coverage, device, settings, sweep: *sweep, flux: settings.flux(), fault: None })
    }

    /// What a path does, in full.
    pub fn outcome(&mut self, path: &[Segment]) -> PathOutcome {
        let segments: Vec<SimulatedSegment> = path.iter().map(simulated).collect();
        if let Err(fault) = self.cast(&segments) {
            self.fault.get_or_insert(fault);
        }
        self.simulation.simulate(&segments)
    }

    /// Has the device cast the steps that are not known yet, all at once.
    fn cast(&mut self, segments: &[SimulatedSegment]) -> Result<(), HandheldError> {
        let missing: Vec<Vec<StepCast>> = segments.iter().map(|segment| self.simulation.missing(segment)).collect();
        let steps = missing.concat();
        if steps.is_empty() {
            return Ok(());
        }
        let Some(mut hits) = self.device.hits(&steps)? else { return Ok(()) };
        // From the last segment on, whose hits stand at the end.
        for (segment, steps) in segments.iter().zip(&missing).rev().filter(|(_, steps)| !steps.is_empty()) {
            self.simulation.keep(segment, hits.split_off(hits.len().saturating_sub(steps.len())))?;
        }
        Ok(())
    }

    /// What went wrong with the device, if anything.
    ///
    /// # Errors
    /// The device's first fault.
    pub fn check(self) -> Result<(), HandheldError> {
        self.fault.map_or(Ok(()), Err)
    }
}

fn simulated(segment: &Segment) -> SimulatedSegment {
    SimulatedSegment {
        key: [segment.layer as i32, segment.cell, segment.speed],
        start: segment.start,
        duration: segment.duration,
        from: segment.from,
        to: segment.to,
    }
}

impl PaintModel for Forecast<'_> {
    fn required_density(&mut self, samples: &[GantrySample]) -> Vec<f32> {
        let mut time = f64::NAN;
        let mut pose = self.sweep.world_from_robot;
        let places: Vec<DensityPlace> = samples
            .iter()
            .map(|sample| {
                if sample.time != time {
                    (time, pose) = (sample.time, self.sweep.at(sample.time));
                }
                let nozzle = self.settings.geometry.nozzle(&pose, sample.position);
                DensityPlace { nozzle, saturation: sample.saturation as f32 }
            })
            .collect();
        self.device.density(self.coverage, &places, self.flux).unwrap_or_else(|fault| {
            self.fault.get_or_insert(fault);
            vec![0.0; samples.len()]
        })
    }

    fn cross_speed(&self, time: f64) -> f64 {
        self.sweep.cross_speed(&self.settings.geometry, self.settings.stand_off, time)
    }

    fn simulate(&mut self, path: &[Segment]) -> f64 {
        self.outcome(path).paint as f64 * QUANTUM
    }
}

#[cfg(test)]
mod tests {
    use paint_sim::droplets::SimulatedSegment;

    use super::super::object::PaintObject;
    use super::*;
    use crate::mesh_io::TriangleMesh;

    /// A square of 20 cm before the robot on which 10 µm of paint are wanted below z = -2 cm.
    fn square() -> PaintObject {
        let mesh = TriangleMesh {
            positions: vec![[0.06, 0.1, -0.1], [0.06, -0.1, -0.1], [0.06, -0.1, 0.1], [0.06, 0.1, 0.1]],
            faces: vec![[0, 1, 2], [0, 2, 3]],
            ..TriangleMesh::default()
        };
        PaintObject::new(&mesh, &[], 1e-3, &mut |s| if s.point.z < -0.02 { 1e-5 } else { 0.0 }).unwrap()
    }

    /// Casts elsewhere what the processor would cast.
    struct Elsewhere<'a>(&'a PaintJob<'a>, usize);

    impl PaintDevice for Elsewhere<'_> {
        fn density(&mut self, _: &Coverage, places: &[DensityPlace], _: Flux) -> Result<Vec<f32>, HandheldError> {
            Ok(vec![0.0; places.len()])
        }

        fn hits(&mut self, steps: &[StepCast]) -> Result<Option<Vec<StepHits>>, HandheldError> {
            self.1 += steps.len();
            let PaintJob { surface, sets, .. } = self.0;
            Ok(Some(steps.iter().map(|s| StepHits::cast(surface, &s.nozzle, &sets[s.set])).collect()))
        }

        fn name(&self) -> String {
            "elsewhere".into()
        }
    }

    /// Three segments of different lengths, one of them known before: each gets the hits of its own steps, and none is cast twice.
    #[test]
    fn hits_of_a_device_go_to_their_segments() {
        let object = square();
        let settings = HandheldSettings::default();
        let job = PaintJob::new(&object.surface, &settings).unwrap();
        let coverage = object.bare().unwrap();
        let sweep = Sweep::still(Isometry3::identity());
        let segment = |layer: usize, duration: f64, from: f64| {
            let (start, to) = (0.1 * layer as f64, from + 0.02);
            Segment { layer, cell: 0, speed: 1, start, duration, from, to }
        };
        let path = [segment(0, 0.05, 0.0), segment(1, 0.1, 0.02), segment(2, 0.02, 0.04)];
        let mut device = Elsewhere(&job, 0);
        let mut forecast = Forecast::new(&job, &coverage, &mut device, &sweep).unwrap();
        let first = forecast.outcome(&path[1..2]);
        let whole = forecast.outcome(&path);
        forecast.check().unwrap();
        assert_eq!(device.1, 17, "steps of 10 ms");

        let geometry = &settings.geometry;
        let mut simulation =
            PathSimulation::new(&object.surface, &coverage, &job.sets, &settings.deposit, geometry, &sweep).unwrap();
        let segments: Vec<SimulatedSegment> = path.iter().map(simulated).collect();
        assert_eq!(first, simulation.simulate(&segments[1..2]));
        assert_eq!(whole, simulation.simulate(&segments));
        assert!(whole.paint > first.paint && first.paint > 0);
        assert_eq!(whole.valve.len(), 17);
    }
}
