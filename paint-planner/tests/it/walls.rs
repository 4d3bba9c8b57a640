//! A bumpy wall, a plane, and a small arm, analytic.

use paint_planner::nalgebra::{Point3, Rotation3, UnitVector3, Vector3};
use paint_planner::{Hit, NozzleState, Surface, Target, Tool, VehicleState};

/// The wall x = depth(y, z), seen from smaller x, the whole world turned by `turn` about z.
pub(crate) struct Wall {
    pub(crate) bumps: f64,
    pub(crate) wavelength: f64,
    pub(crate) turn: f64,
}

impl Wall {
    pub(crate) fn flat() -> Self {
        Self { bumps: 0.0, wavelength: 1.0, turn: 0.0 }
    }

    pub(crate) fn bumpy(bumps: f64) -> Self {
        Self { bumps, wavelength: 1.6, turn: 0.0 }
    }

    fn depth(&self, y: f64, z: f64) -> f64 {
        let k = std::f64::consts::TAU / self.wavelength;
        self.bumps * ((k * y).sin() * (0.7 * k * z + 0.4).cos() + 0.3 * (0.53 * k * y - 0.9 * k * z).sin())
    }

    fn slope(&self, y: f64, z: f64) -> (f64, f64) {
        let h = 1e-5;
        let d = |y, z| self.depth(y, z);
        ((d(y + h, z) - d(y - h, z)) / (2.0 * h), (d(y, z + h) - d(y, z - h)) / (2.0 * h))
    }

    fn rotation(&self) -> Rotation3<f64> {
        Rotation3::from_axis_angle(&Vector3::z_axis(), self.turn)
    }

    pub(crate) fn target(&self, y: f64, z: f64, dose: f64) -> Target {
        let (dy, dz) = self.slope(y, z);
        let point = self.rotation() * Point3::new(self.depth(y, z), y, z);
        let normal = UnitVector3::new_normalize(self.rotation() * Vector3::new(-1.0, dy, dz));
        Target { point, normal, dose, time: None, stand_off: None }
    }

    /// Rows of `width` metres, `spacing` apart, joined at alternating ends, targets 2.5 cm apart.
    pub(crate) fn rows(&self, width: f64, rows: usize, spacing: f64) -> Vec<Target> {
        let per_row = (width / 0.025).round() as usize;
        let between = (spacing / 0.025).round() as usize;
        let mut targets = Vec::new();
        for row in 0..rows {
            let z = 1.5 + spacing * row as f64;
            for i in 0..=per_row {
                let y = width * i as f64 / per_row as f64;
                let dose = if i == per_row { 0.0 } else { 2e-6 };
                targets.push(self.target(if row % 2 == 0 { y } else { width - y }, z, dose));
            }
            if row + 1 < rows {
                let y = if row % 2 == 0 { width } else { 0.0 };
                for k in 1..between {
                    targets.push(self.target(y, z + spacing * k as f64 / between as f64, 0.0));
                }
            }
        }
        targets
    }
}

impl Surface for Wall {
    fn cast(&self, origin: &Point3<f64>, direction: &UnitVector3<f64>, max: f64) -> Option<Hit> {
        let (o, d) = (self.rotation().inverse() * origin, self.rotation().inverse() * direction.into_inner());
        let side = |s: f64| {
            let p = o + d * s;
            p.x - self.depth(p.y, p.z)
        };
        let steps = 200;
        let start = side(0.0).signum();
        let mut low = 0.0;
        for k in 1..=steps {
            let high = max * f64::from(k) / f64::from(steps);
            if side(high).signum() != start {
                let (mut a, mut b) = (low, high);
                for _ in 0..40 {
                    let middle = 0.5 * (a + b);
                    if side(middle).signum() == start { a = middle } else { b = middle }
                }
                let p = o + d * b;
                let (dy, dz) = self.slope(p.y, p.z);
                let normal = UnitVector3::new_normalize(self.rotation() * Vector3::new(-1.0, dy, dz));
                return Some(Hit { point: self.rotation() * p, normal, distance: b });
            }
            low = high;
        }
        None
    }

    fn distance(&self, point: &Point3<f64>, max: f64) -> f64 {
        // The nearest of a grid around the foot point, refined: within millimetres of the truth, which the checks of
        // the tests allow for.
        let p = self.rotation().inverse() * point;
        let away = |y: f64, z: f64| Vector3::new(p.x - self.depth(y, z), p.y - y, p.z - z).norm();
        let mut best = (away(p.y, p.z), p.y, p.z);
        let mut reach = best.0.min(max);
        for _ in 0..4 {
            let (_, y, z) = best;
            for i in -4..=4 {
                for k in -4..=4 {
                    let (a, b) = (y + reach * f64::from(i) / 4.0, z + reach * f64::from(k) / 4.0);
                    let distance = away(a, b);
                    if distance < best.0 {
                        best = (distance, a, b);
                    }
                }
            }
            reach *= 0.3;
        }
        best.0.min(max)
    }
}

/// Pan-tilt arm: nozzle = body + Rz(heading) [ mount + Rz(pan) ( link + Ry(-tilt) gun ) ].
pub(crate) struct Arm {
    pub(crate) mount: Vector3<f64>,
    pub(crate) link: Vector3<f64>,
    pub(crate) gun: Vector3<f64>,
    pub(crate) max_pan: f64,
    pub(crate) max_tilt: f64,
}

impl Default for Arm {
    fn default() -> Self {
        Self {
            mount: Vector3::new(0.55, 0.0, 0.05),
            link: Vector3::new(0.03, 0.0, 0.04),
            gun: Vector3::new(0.12, 0.0, 0.02),
            max_pan: 90_f64.to_radians(),
            max_tilt: 45_f64.to_radians(),
        }
    }
}

fn about(axis: Vector3<f64>, angle: f64) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&UnitVector3::new_normalize(axis), angle)
}

impl Tool for Arm {
    fn vehicle(&self, nozzle: &NozzleState, heading: f64) -> Option<VehicleState> {
        let h = nozzle.direction;
        let azimuth = h.y.atan2(h.x);
        let (sin, cos) = (azimuth - heading).sin_cos();
        let pan = sin.atan2(cos);
        let tilt = h.z.atan2(h.x.hypot(h.y));
        if pan.abs() > self.max_pan || tilt.abs() > self.max_tilt {
            return None;
        }
        let offset = about(Vector3::z(), heading) * self.mount
            + about(Vector3::z(), azimuth) * (self.link + about(Vector3::y(), -tilt) * self.gun);
        Some(VehicleState { position: nozzle.position - offset, heading, pan, tilt })
    }

    fn spheres(&self, v: &VehicleState, out: &mut Vec<(Point3<f64>, f64)>) {
        let body = about(Vector3::z(), v.heading);
        out.push((v.position, 0.4));
        for share in [0.5, 0.8, 1.0] {
            out.push((v.position + body * self.mount * share, 0.06));
        }
        let joint = v.position + body * (self.mount + about(Vector3::z(), v.pan) * self.link);
        let gun = about(Vector3::z(), v.heading + v.pan) * about(Vector3::y(), -v.tilt) * self.gun;
        out.push((joint + gun * 0.5, 0.03));
    }
}
