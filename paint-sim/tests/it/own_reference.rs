//! A reference of one's own: what the flight is asked to do at any moment.

use nalgebra::{Point3, Vector3};
use paint_sim::flight::*;
use paint_sim::{FlightSettings, fly};

use crate::flight_scene::wall;

/// An ellipse on the wall at up to 0.4 m/s, from 10 cm.
pub(crate) struct Ellipse {
    pub(crate) duration: f64,
}

impl Reference for Ellipse {
    fn duration(&self) -> f64 {
        self.duration
    }

    fn at(&self, t: f64) -> ReferenceState {
        let (a, b, rate) = (0.5, 0.3, 0.8);
        let (s, c) = (rate * t.clamp(0.0, self.duration)).sin_cos();
        let on_wall = Vector3::new(0.0, a * s, 2.0 + b * c);
        ReferenceState {
            position: Point3::from(on_wall - Vector3::new(0.8, 0.0, 0.0)),
            velocity: Vector3::new(0.0, a * rate * c, -b * rate * s),
            acceleration: Vector3::new(0.0, -a * rate * rate * s, -b * rate * rate * c),
            heading: 0.0,
            heading_rate: 0.0,
            aim: Some(Point3::from(on_wall)),
            lever: Vector3::zeros(),
            nozzle_distance: 0.1,
            flow: 5e-7,
        }
    }
}

/// Stands still.
pub(crate) struct Still(pub(crate) ReferenceState);

impl Reference for Still {
    fn duration(&self) -> f64 {
        2.0
    }

    fn at(&self, _: f64) -> ReferenceState {
        self.0
    }
}

#[test]
fn the_spray_goes_round_the_ellipse() {
    let calm =
        FlightSettings { wind: Wind::calm(), localisation: Localisation::perfect(), ..FlightSettings::default() };
    let log = fly(&Ellipse { duration: 10.0 }, &mut IdealPanTilt::default(), &wall(), &calm).unwrap();
    let shots = log.shots(0.0);
    assert!(shots.len() > 900);
    for shot in shots {
        let hit = shot.origin - shot.axis.into_inner() * (shot.origin.x / shot.axis.x);
        let radius = (hit.y / 0.5).hypot((hit.z - 2.0) / 0.3);
        assert!((radius - 1.0).abs() < 0.05, "{hit}");
    }
}
