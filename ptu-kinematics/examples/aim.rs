//! Points a spray gun at a spot of a wall, and finds where to hover to spray straight at it.

use ptu_kinematics::nalgebra::{Isometry3, Point3, Vector3};
use ptu_kinematics::{Error, Ptu, PtuSettings};

fn main() -> Result<(), Error> {
    let ptu = Ptu::new(PtuSettings::default())?;
    // Where must the gun point to hit this spot of the wall while the robot leans into the wind?
    let world_from_body = Isometry3::new(Vector3::new(0.0, 0.0, 2.0), Vector3::new(0.05, 0.0, 0.0));
    let aim = ptu.aim(&world_from_body, &Point3::new(0.8, 0.1, 2.1))?;
    println!("pan {:.3} rad, tilt {:.3} rad, {:.2} m away", aim.joints.pan, aim.joints.tilt, aim.distance);
    assert!(aim.pointing_error < 1e-12);
    // Where must it hover to spray straight at the wall x = 1?
    let hover = ptu.inverse(&Point3::new(0.9, 0.1, 2.1), &Vector3::x_axis(), 0.0)?;
    println!("hover at {:.3} with pan {:.3} rad, tilt {:.3} rad", hover.position, hover.joints.pan, hover.joints.tilt);
    assert!(hover.position.x < 0.4);
    Ok(())
}
