//! A robot is swept past a wall with a stripe to paint: the controller opens its valve over the stripe, once.
use paint_planner::gantry::{
    Controller, ControllerSettings, DepositModel, Frame, GantrySample, PaintModel, RobotMotion, Segment,
};
use paint_planner::nalgebra::{Isometry3, Point3, UnitVector3, Vector3};
use paint_planner::{Error, Hit, Surface};

struct Wall; // the plane x = 0, seen from x < 0, in columns of 1 mm that each take one shot of paint
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
impl DepositModel for Wall {
    type Deposit = Vec<bool>; // which columns need paint
    type Footprint = usize;
    type Error = Error;
    fn surface(&self) -> &dyn Surface {
        self
    }
    fn footprint(&self, pose: &Isometry3<f64>, _position: f64, _step: usize) -> usize {
        ((pose.translation.y + 0.3) / 1e-3) as usize
    }
    fn score(&self, column: &usize, needs: &Vec<bool>) -> f64 {
        if needs[*column] { 1.0 } else { -1.0 }
    }
    fn spray(&self, column: &usize, open: f64, needs: &mut Vec<bool>) {
        needs[*column] &= open < 0.5;
    }
    fn forecast<R>(
        &mut self,
        needs: &Vec<bool>,
        motion: &RobotMotion,
        plan: impl FnOnce(&mut dyn PaintModel) -> Result<R, Error>,
    ) -> Result<R, Error> {
        plan(&mut Forecast(self, needs, motion))
    }
}
struct Forecast<'a>(&'a Wall, &'a Vec<bool>, &'a RobotMotion);
impl PaintModel for Forecast<'_> {
    fn required_density(&mut self, samples: &[GantrySample]) -> Vec<f32> {
        let needs = |s: &GantrySample| self.1[self.0.footprint(&self.2.after(s.time), s.position, 0)];
        samples.iter().map(|s| if needs(s) { s.saturation as f32 } else { 0.0 }).collect()
    }
    fn cross_speed(&self, _time: f64) -> f64 {
        self.2.velocity.y.abs()
    }
    fn simulate(&mut self, _path: &[Segment]) -> f64 {
        0.0 // only asked for by `refine`, which simulates candidates
    }
}

fn main() -> Result<(), Error> {
    let stripe: Vec<bool> = (0..600).map(|column| (280..320).contains(&column)).collect(); // y from -20 to 20 mm
    let settings = ControllerSettings { max_position_sigma: 1.8e-3, registration: None, ..Default::default() };
    let mut controller = Controller::new(settings, Wall, stripe, Point3::origin())?;
    let (mut position, mut sprayed) = (0.05, 0.0);
    for k in 0..450 {
        let (time, y) = (0.01 * f64::from(k), 1e-3 * f64::from(k) - 0.25); // 0.1 m/s
        let world_from_robot = Some(Isometry3::translation(-0.06, y, 0.0));
        let frame = Frame { time, world_from_robot, inertial: None, ranges: &[], position, sprayed };
        let command = controller.frame(&frame)?;
        if command.valve_open && sprayed == 0.0 {
            println!("{time:.2} s: valve opens at y = {:.0} mm", 1e3 * y);
        }
        (position, sprayed) = (command.slide.position, f64::from(u8::from(command.valve_open)));
    }
    let left = controller.deposit().iter().filter(|needs| **needs).count();
    println!("{left} of 40 columns still need paint");
    Ok(())
}
