//! A chain of one's own: a barrel on a turret. Aiming, planning and the collision body ask for nothing but the trait.

use nalgebra::{Isometry3, Matrix6xX, Point3, UnitVector3, Vector3, Vector6};
use ptu_kinematics::{CollisionBody, Error, Hover, KinematicChain, Nozzle, Range};

/// Azimuth and elevation turn about one point, 30 cm ahead of the body's origin; the barrel is as long as its field says.
struct Turret {
    barrel: f64,
}

const PIVOT: Vector3<f64> = Vector3::new(0.3, 0.0, 0.0);
const LIMITS: [Range; 2] = [Range { min: -1.5, max: 1.5 }, Range { min: -0.8, max: 0.8 }];

fn axis([azimuth, elevation]: [f64; 2]) -> Vector3<f64> {
    Vector3::new(elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin())
}

impl KinematicChain for Turret {
    type Joints = [f64; 2];

    fn limits(&self) -> Vec<Range> {
        LIMITS.to_vec()
    }

    fn forward(&self, world_from_body: &Isometry3<f64>, joints: &[f64; 2]) -> Nozzle {
        let direction = world_from_body.rotation * axis(*joints);
        let tip = world_from_body * Point3::from(PIVOT) + self.barrel * direction;
        Nozzle { tip, direction: UnitVector3::new_normalize(direction) }
    }

    fn point(&self, azimuth: f64, elevation: f64) -> [f64; 2] {
        [azimuth, elevation]
    }

    fn inverse(&self, tip: &Point3<f64>, direction: &UnitVector3<f64>, heading: f64) -> Result<Hover<[f64; 2]>, Error> {
        let level = Hover { position: Point3::origin(), heading, joints: [0.0; 2] }.world_from_body();
        let in_body = level.rotation.inverse() * direction.into_inner();
        let joints = [in_body.y.atan2(in_body.x), in_body.z.asin()];
        for ((value, limit), joint) in joints.into_iter().zip(LIMITS).zip(["azimuth", "elevation"]) {
            if !(limit.min..=limit.max).contains(&value) {
                return Err(Error::OutOfLimits { joint, value, min: limit.min, max: limit.max });
            }
        }
        let position = tip - level.rotation * PIVOT - self.barrel * direction.into_inner();
        Ok(Hover { position, heading, joints })
    }

    fn jacobian(&self, hover: &Hover<[f64; 2]>) -> Matrix6xX<f64> {
        // Central differences are enough for whoever has no closed form at hand.
        let column = |k: usize, step: f64| {
            let mut at = *hover;
            match k {
                0..3 => at.position[k] += step,
                3 => at.heading += step,
                _ => at.joints[k - 4] += step,
            }
            let nozzle = self.forward(&at.world_from_body(), &at.joints);
            let (p, h) = (nozzle.tip, nozzle.direction);
            Vector6::new(p.x, p.y, p.z, h.x, h.y, h.z)
        };
        let columns: Vec<_> = (0..6).map(|k| (column(k, 1e-6) - column(k, -1e-6)) / 2e-6).collect();
        Matrix6xX::from_columns(&columns)
    }

    fn members(&self, world_from_body: &Isometry3<f64>, joints: &[f64; 2]) -> Vec<Point3<f64>> {
        vec![world_from_body * Point3::from(PIVOT), self.forward(world_from_body, joints).tip]
    }
}

#[test]
fn a_turret_keeps_the_promises_of_the_trait() {
    let turret = Turret { barrel: 0.25 };
    for k in 0..50 {
        let t = f64::from(k);
        let (heading, joints) = (2.0 * (0.7 * t).sin(), [1.4 * (1.3 * t).sin(), 0.7 * (2.1 * t).cos()]);
        let level = Hover { position: Point3::new(t, -t, 2.0), heading, joints };
        let nozzle = turret.forward(&level.world_from_body(), &joints);
        let found = turret.inverse(&nozzle.tip, &nozzle.direction, heading).unwrap();
        assert!((found.position - level.position).norm() < 1e-9);
        assert!((0..2).all(|k| (found.joints[k] - joints[k]).abs() < 1e-9));
        // The provided angles are those of the spray, and lead back to the joints.
        let [azimuth, elevation] = turret.spray_angles(&joints);
        assert!((azimuth - joints[0]).abs() < 1e-12 && (elevation - joints[1]).abs() < 1e-12);
        // The tip moves with the body, and across the barrel by its length where the elevation changes.
        let jacobian = turret.jacobian(&level);
        assert_eq!(jacobian.ncols(), 4 + turret.limits().len());
        assert!((jacobian.fixed_view::<3, 1>(0, 5).norm() - 0.25).abs() < 1e-6);
    }
    let behind = turret.inverse(&Point3::origin(), &-Vector3::x_axis(), 0.0);
    assert!(matches!(behind, Err(Error::OutOfLimits { .. })));
}

#[test]
fn the_collision_body_covers_its_barrel() {
    let (turret, pose) = (Turret { barrel: 0.14 }, Isometry3::translation(0.0, 0.0, 2.0));
    let mut spheres = Vec::new();
    CollisionBody::default().spheres(&turret, &pose, &[0.4, -0.3], &mut spheres);
    let [from, to] = turret.members(&pose, &[0.4, -0.3])[..] else { panic!("a barrel has two ends") };
    // All of it but the last centimetres: three spheres of 2.5 cm reach along 15 cm.
    for share in (0..80).map(|k| f64::from(k) / 100.0) {
        let point = from + (to - from) * share;
        assert!(spheres.iter().any(|(centre, radius)| (centre - point).norm() <= radius + 1e-9), "{share}");
    }
}

#[test]
fn spheres_lie_along_the_barrel_and_the_last_ends_at_the_tip() {
    let (turret, pose) = (Turret { barrel: 0.14 }, Isometry3::translation(0.0, 0.0, 2.0));
    let body = CollisionBody { vehicle_radius: 0.35, arm_radius: 0.02 };
    let mut spheres = Vec::new();
    body.spheres(&turret, &pose, &[0.4, -0.3], &mut spheres);
    let [from, tip] = turret.members(&pose, &[0.4, -0.3])[..] else { panic!("a barrel has two ends") };
    let nozzle = turret.forward(&pose, &[0.4, -0.3]);
    let end = tip - 0.02 * nozzle.direction.into_inner();
    let expected = [0.33, 0.67, 1.0].map(|share| from + (end - from) * share);
    for ((centre, radius), expected) in spheres[spheres.len() - 3..].iter().zip(expected) {
        assert!((centre - expected).norm() < 1e-12 && *radius == 0.02, "{centre}");
    }
}
