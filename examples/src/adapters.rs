//! The lines that join the crates: each library says by a small trait what it needs from the world, and here another library
//! gives it.

use crate::surface::PaintSurface;
use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};
use paint_net::colour::MixingModel;
use paint_planner::constraints::Tether;
use paint_planner::control::{
    AttitudeResponse, ControlReference, ControlState, MpcSettings, TrackingMpc, VehicleModel,
};
use paint_planner::mission::Chart;
use paint_planner::{NozzleState, Plan, Tool, VehicleState};
use paint_sim::TriangleSurface;
use paint_sim::flight::{Airframe, Command, Controller, Estimate, GRAVITY};
use paint_sim::flight::{PanTilt, Reference, ReferenceState};
use paint_sim::paint::{Bands, FilmStack};
use ptu_kinematics::{CollisionBody, Hover, Joints, KinematicChain, Ptu, Servo};

/// The simulator's mesh as the planner's surface.
pub struct MeshSurface<'a>(pub &'a TriangleSurface);

/// Targets are points of the surface but for rounding in single precision, m.
const ON_SURFACE: f64 = 1e-3;

impl paint_planner::Surface for MeshSurface<'_> {
    fn cast(
        &self,
        origin: &Point3<f64>,
        direction: &UnitVector3<f64>,
        max_distance: f64,
    ) -> Option<paint_planner::Hit> {
        let hit = paint_sim::Surface::cast(self.0, origin, direction, max_distance)?;
        let point = origin + direction.into_inner() * hit.distance;
        Some(paint_planner::Hit { point, normal: UnitVector3::new_unchecked(hit.normal), distance: hit.distance })
    }

    fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
        paint_sim::Surface::distance(self.0, point, max)
    }

    fn facet(&self, point: &Point3<f64>) -> Option<[Point3<f64>; 3]> {
        self.0.nearest_triangle(point, ON_SURFACE)
    }
}

/// The picture plane of a surface as the planner's chart, in texels.
impl Chart for PaintSurface {
    fn lift(&self, [x, y]: [f64; 2]) -> Option<(Point3<f64>, UnitVector3<f64>)> {
        self.lift(x, y)
    }

    fn lift_from(&self, place: [f64; 2], offset: [f64; 2]) -> Option<(Point3<f64>, UnitVector3<f64>)> {
        self.lift_from(place, offset)
    }
}

/// The simulator's films over each other on a wall, as what a separation asks for.
pub struct FilmsOnWall<'a> {
    /// The paints, the lowest film first.
    pub stack: &'a FilmStack,
    /// Reflectances of the wall.
    pub grounds: &'a [Bands],
    /// Which of them each pixel has.
    pub of_pixel: &'a [u32],
}

impl MixingModel for FilmsOnWall<'_> {
    fn paints(&self) -> usize {
        self.stack.films()
    }

    fn lab(&self, pixel: usize, depths: &[f64], slopes: &mut [[f64; 3]]) -> [f64; 3] {
        self.stack.lab(depths, &self.grounds[self.of_pixel[pixel] as usize], slopes)
    }
}

/// A kinematic chain, with the room it takes, as the planner's tool.
#[derive(Debug, Clone)]
pub struct Robot<C = Ptu> {
    /// The chain.
    pub chain: C,
    /// The room that it takes.
    pub body: CollisionBody,
    /// The hose or tether that it keeps behind it.
    pub tether: Option<Tether>,
}

impl<C: KinematicChain> Robot<C> {
    /// The chain with its limits and the room of the usual vehicle.
    pub fn new(chain: C) -> Self {
        Self { chain, body: CollisionBody::default(), tether: None }
    }
}

/// The planner's pan and tilt are azimuth and elevation of the spray axis: for the pan-tilt unit with a level gun its
/// joint angles.
impl<C: KinematicChain> Tool for Robot<C> {
    fn vehicle(&self, nozzle: &NozzleState, heading: f64) -> Option<VehicleState> {
        let hover = self.chain.inverse(&nozzle.position, &nozzle.direction, heading).ok()?;
        let [pan, tilt] = self.chain.spray_angles(&hover.joints);
        Some(VehicleState { position: hover.position, heading, pan, tilt })
    }

    fn spheres(&self, vehicle: &VehicleState, out: &mut Vec<(Point3<f64>, f64)>) {
        let joints = self.chain.point(vehicle.pan, vehicle.tilt);
        let hover = Hover { position: vehicle.position, heading: vehicle.heading, joints };
        self.body.spheres(&self.chain, &hover.world_from_body(), &hover.joints, out);
    }

    fn nozzle(&self, vehicle: &VehicleState) -> Option<NozzleState> {
        let joints = self.chain.point(vehicle.pan, vehicle.tilt);
        let hover = Hover { position: vehicle.position, heading: vehicle.heading, joints };
        let nozzle = self.chain.forward(&hover.world_from_body(), &hover.joints);
        Some(NozzleState { position: nozzle.tip, direction: nozzle.direction })
    }

    fn permits(&self, vehicle: &VehicleState) -> bool {
        self.tether.is_none_or(|tether| tether.permits(vehicle))
    }
}

/// The kinematic chain on two servos as the simulator's pan-tilt unit.
pub struct ServoPanTilt {
    ptu: Ptu,
    servos: [Servo; 2],
}

impl ServoPanTilt {
    /// Both servos at rest at zero.
    pub fn new(ptu: Ptu, servo: ptu_kinematics::ServoSettings) -> Result<Self, ptu_kinematics::Error> {
        let servo = Servo::new(servo, 0.0)?;
        Ok(Self { ptu, servos: [servo.clone(), servo] })
    }
}

impl PanTilt for ServoPanTilt {
    fn command(&self, world_from_body: &Isometry3<f64>, aim: &Point3<f64>) -> [f64; 2] {
        match self.ptu.aim(world_from_body, aim) {
            Ok(aim) => [aim.joints.pan, aim.joints.tilt],
            // A target inside the gun itself: stay where we are until the body has moved off.
            Err(_) => [self.servos[0].angle(), self.servos[1].angle()],
        }
    }

    fn reset(&mut self, angles: [f64; 2]) {
        for (servo, angle) in self.servos.iter_mut().zip(angles) {
            if let Ok(at_rest) = Servo::new(*servo.settings(), angle) {
                *servo = at_rest;
            }
        }
    }

    fn step(&mut self, command: [f64; 2], dt: f64) -> [f64; 2] {
        [self.servos[0].step(command[0], dt), self.servos[1].step(command[1], dt)]
    }

    fn nozzle(&self, world_from_body: &Isometry3<f64>, [pan, tilt]: [f64; 2]) -> (Point3<f64>, UnitVector3<f64>) {
        let nozzle = self.ptu.forward(world_from_body, Joints { pan, tilt });
        (nozzle.tip, nozzle.direction)
    }

    fn delay(&self) -> f64 {
        self.servos[0].delay()
    }
}

/// A plan as the simulator's reference.
pub struct PlanReference<'a, C = Ptu> {
    /// The plan.
    pub plan: &'a Plan,
    /// The chain it was made for.
    pub chain: &'a C,
    /// Distance of the nozzle's tip from the axis about which the gun tilts, metres.
    pub gun_length: f64,
    /// Distance at which the gun points at nothing in particular on flights between strokes, metres.
    pub stand_off: f64,
}

impl<C: KinematicChain> Reference for PlanReference<'_, C> {
    fn duration(&self) -> f64 {
        self.plan.trajectory.duration()
    }

    fn at(&self, t: f64) -> ReferenceState {
        let duration = self.duration();
        let setpoint = self.plan.setpoint(t);
        let sample = setpoint.sample;
        let inside = (0.0..=duration).contains(&t);
        let still = |v: Vector3<f64>| if inside { v } else { Vector3::zeros() };
        // Between strokes the planned joint angles are held: aim at the point ahead of the nozzle they give.
        let (nozzle, aim) = if setpoint.transit {
            let joints = self.chain.point(setpoint.pan, setpoint.tilt);
            let hover = Hover { position: sample.position, heading: sample.heading, joints };
            let nozzle = self.chain.forward(&hover.world_from_body(), &hover.joints);
            let nozzle = NozzleState { position: nozzle.tip, direction: nozzle.direction };
            (nozzle, nozzle.position + nozzle.direction.into_inner() * self.stand_off)
        } else {
            (setpoint.nozzle, setpoint.aim)
        };
        ReferenceState {
            position: sample.position,
            velocity: still(sample.velocity),
            acceleration: still(sample.acceleration),
            heading: sample.heading,
            heading_rate: if inside { sample.heading_rate } else { 0.0 },
            lever: nozzle.position - nozzle.direction.into_inner() * self.gun_length - sample.position,
            aim: Some(aim),
            nozzle_distance: (setpoint.aim - setpoint.nozzle.position).norm(),
            flow: if inside { setpoint.flow } else { 0.0 },
        }
    }
}

/// The motion that a reference wants.
pub fn control_reference(wanted: &ReferenceState) -> ControlReference {
    let ReferenceState { position, velocity, acceleration, heading, heading_rate, lever, .. } = *wanted;
    ControlReference { position, velocity, acceleration, heading, heading_rate, lever }
}

/// A motion as a reference that asks nothing of the gun.
pub fn reference_state(wanted: &ControlReference) -> ReferenceState {
    let ControlReference { position, velocity, acceleration, heading, heading_rate, lever } = *wanted;
    let (aim, nozzle_distance, flow) = (None, 0.0, 0.0);
    ReferenceState { position, velocity, acceleration, heading, heading_rate, lever, aim, nozzle_distance, flow }
}

/// The planner's controller in the simulator.
pub struct MpcController {
    mpc: TrackingMpc,
    mass: f64,
}

impl MpcController {
    /// A controller that knows the responses of the vehicle.
    pub fn new(airframe: &Airframe, settings: MpcSettings) -> Result<Self, paint_planner::Error> {
        let [forward, left, up] = airframe.drag;
        let vehicle = VehicleModel {
            roll: AttitudeResponse { gain: airframe.roll_gain, time_constant: airframe.roll_time_constant },
            pitch: AttitudeResponse { gain: airframe.pitch_gain, time_constant: airframe.pitch_time_constant },
            drag: [0.5 * (forward + left), up],
            tilt_limit: airframe.tilt_limit,
            // Those of the simulator's own controller.
            thrust: [0.2 * GRAVITY, 2.0 * GRAVITY],
        };
        Ok(Self { mpc: TrackingMpc::new(vehicle, settings)?, mass: airframe.mass })
    }
}

impl Controller for MpcController {
    fn command(&mut self, time: f64, estimate: &Estimate, reference: &dyn Reference) -> Command {
        let state = ControlState {
            position: estimate.position,
            velocity: estimate.velocity,
            attitude: estimate.attitude,
            disturbance: estimate.disturbance,
        };
        let command = self.mpc.command(time, &state, &|t| control_reference(&reference.at(t)));
        Command {
            roll: command.roll,
            pitch: command.pitch,
            yaw_rate: command.yaw_rate,
            thrust: command.thrust * self.mass,
        }
    }
}
