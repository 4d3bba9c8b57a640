//! The closed loop: figures of the painting flight, and the laws of its parts.

use nalgebra::{Point3, Vector3};
use paint_sim::flight::*;
use paint_sim::{FlightSettings, TriangleSurface, fly};

/// A wall in the plane x = 0, painted from -x.
fn wall() -> TriangleSurface {
    let (w, h) = (10.0_f32, 10.0_f32);
    let corners = [[0.0, -w, -h], [0.0, w, -h], [0.0, w, h], [0.0, -w, h]];
    TriangleSurface::new(&corners, &[[0, 2, 1], [0, 3, 2]]).unwrap()
}

/// A horizontal ellipse on the wall at up to 0.4 m/s, from 10 cm.
struct Loop {
    duration: f64,
}

impl Reference for Loop {
    fn duration(&self) -> f64 {
        self.duration
    }

    fn at(&self, t: f64) -> ReferenceState {
        let t = t.clamp(0.0, self.duration);
        let rate = 0.8;
        let (s, c) = (rate * t).sin_cos();
        let (a, b) = (0.5, 0.3);
        let on_wall = Vector3::new(0.0, a * s, 2.0 + b * c);
        ReferenceState {
            position: Point3::from(on_wall - Vector3::new(0.8, 0.0, 0.0)),
            velocity: Vector3::new(0.0, a * rate * c, -b * rate * s),
            acceleration: Vector3::new(0.0, -a * rate * rate * s, -b * rate * rate * c),
            heading: 0.0,
            heading_rate: 0.0,
            aim: Some(Point3::from(on_wall)),
            nozzle_distance: 0.1,
            flow: 5e-7,
        }
    }
}

#[test]
fn tune() {
    let mut ptu = StraightPanTilt::on_arm(ServoSettings::default()).unwrap();
    for (name, wind, loc) in [
        ("def", Wind::default(), Localisation::mocap()),
        ("calm", Wind::calm(), Localisation::mocap()),
        ("perf", Wind::default(), Localisation::perfect()),
        ("slam", Wind::default(), Localisation::slam_7cm()),
    ] {
        for locked in [false, true] {
            let settings = FlightSettings {
                ptu_locked: locked,
                wind,
                localisation: loc,
                tether: Some(Tether {
                    base: Point3::new(-2.0, 0.0, 0.0),
                    length: 5.0,
                    line_density: 0.12,
                    base_on_floor: true,
                }),
                ..FlightSettings::default()
            };
            let start = std::time::Instant::now();
            let log = fly(&Loop { duration: 120.0 }, &mut ptu, &wall(), &settings).unwrap();
            println!("{name} {locked} {:?} {:#?}", start.elapsed(), log.statistics());
        }
    }
}
