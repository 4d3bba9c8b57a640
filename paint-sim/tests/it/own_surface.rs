//! A surface of one's own, in closed form.

use nalgebra::{Point3, Vector3};
use paint_sim::surface::Hit;
use paint_sim::{SprayModel, Surface};

use crate::deposit::{far_plate, shot, tilted_plane};

/// A ball in the spray, in closed form: a user's own surface.
struct Ball {
    centre: Point3<f64>,
    radius: f64,
}

impl Surface for Ball {
    fn cast(&self, origin: &Point3<f64>, direction: &Vector3<f64>, max: f64) -> Option<Hit> {
        let to_centre = self.centre - origin;
        let along = to_centre.dot(direction);
        let beside = to_centre.norm_squared() - along * along;
        let half = (self.radius * self.radius - beside).max(0.0).sqrt();
        let distance = along - half;
        let meets = beside < self.radius * self.radius && (0.0..=max).contains(&distance);
        let normal = (direction * distance - to_centre) / self.radius;
        meets.then_some(Hit { distance, face: 0, barycentric: [0.0; 2], normal })
    }

    fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
        ((point - self.centre).norm() - self.radius).abs().min(max)
    }
}

#[test]
fn one_call_sprays_past_a_surface_of_the_users_own() {
    let ball = Ball { centre: Point3::new(0.004, 0.0, 0.05), radius: 0.008 };
    let texels = tilted_plane(0.0, 0.1, 1e-3, 0.06);
    let shots = [shot(0.0, 0.0, 1e-9)];
    let film = paint_sim::spray(texels.clone(), &shots, &SprayModel::default(), &ball, 1).unwrap();
    let open = paint_sim::spray(texels, &shots, &SprayModel::default(), &far_plate(), 1).unwrap();
    assert!(film.mass_balance().balanced());
    let (mut dark, mut lit) = (0, 0);
    for (texel, (behind, free)) in film.texels().iter().zip(film.volumes().iter().zip(open.volumes())) {
        // The line from the nozzle to the texel passes the ball's centre at this distance.
        let line = texel.point.coords.normalize();
        let passing = ball.centre.coords.cross(&line).norm();
        if *free == 0 || (passing - ball.radius).abs() < 1e-6 {
            continue;
        }
        if passing < ball.radius {
            assert_eq!(*behind, 0, "{}", texel.point);
            dark += 1;
        } else {
            // What the open plane claims beyond a whole shot by its finite sum is scaled away.
            assert!(behind.abs_diff(*free) <= 1 + free / 1000, "{}", texel.point);
            lit += 1;
        }
    }
    assert!(dark > 100 && lit > 1000, "{dark} {lit}");
}
