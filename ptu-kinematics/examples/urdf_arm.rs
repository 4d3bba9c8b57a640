//! A serial arm from URDF behind the same trait as the pan-tilt unit: where to hover, and how to bend, to spray along a column.

use ptu_kinematics::nalgebra::{Point3, UnitVector3, Vector3};
use ptu_kinematics::{Error, KinematicChain, SerialArm};

/// Shoulder, elbow and wrist; the links lie along x at zero angles.
const ARM: &str = r#"
<robot name="arm">
  <joint name="yaw" type="revolute"><parent link="base"/><child link="a"/><origin xyz="0.3 0 0.05"/><axis xyz="0 0 1"/>
    <limit lower="-1.5" upper="1.5"/></joint>
  <joint name="shoulder" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 -1 0"/><limit lower="-1" upper="1"/></joint>
  <joint name="elbow" type="revolute"><parent link="b"/><child link="c"/><origin xyz="0.2 0 0"/><axis xyz="0 -1 0"/>
    <limit lower="-1.2" upper="1.2"/></joint>
  <joint name="gun" type="fixed"><parent link="c"/><child link="nozzle"/><origin xyz="0.25 0 0"/></joint>
</robot>"#;

/// The largest distance between the tip that was asked for and the one that the solution has, metres.
pub(crate) fn spray_a_column() -> Result<f64, Error> {
    let arm = SerialArm::from_urdf(ARM, "nozzle")?;
    let mut worst = 0.0_f64;
    for step in 0..8 {
        let turn = 0.1 * f64::from(step);
        let outward = Vector3::new(turn.cos(), turn.sin(), 0.0);
        // Slightly upwards, from below.
        let (tip, direction) = (Point3::from(1.1 * outward), UnitVector3::new_normalize(0.3 * Vector3::z() - outward));
        let heading = turn + std::f64::consts::PI;
        let hover = arm.inverse(&tip, &direction, heading)?;
        let nozzle = arm.forward(&hover.world_from_body(), &hover.joints);
        println!("{turn:.1} rad: body at {:.3}, joints {:.3?} rad", hover.position, hover.joints);
        worst = worst.max((nozzle.tip - tip).norm());
    }
    Ok(worst)
}

fn main() -> Result<(), Error> {
    println!("the nozzle is within {:.1e} m", spray_a_column()?);
    Ok(())
}
