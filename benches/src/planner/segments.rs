//! Straight segments on a wall of a million triangles.

use std::error::Error;
use std::f64::consts::TAU;

use nalgebra::{Point3, UnitVector3, Vector3};
use paint_planner::{OptimalPlanner, Planner, Target};
use paint_sim::TriangleSurface;
use paintcopter::adapters::{MeshSurface, Robot};
use paintcopter::mission::MissionSettings;
use ptu_kinematics::Ptu;
use serde_json::json;

use crate::cpu::seconds;
use crate::{Rng, rock};

/// Quads of the mesh along its sides, and metres of each side.
const QUADS: [usize; 2] = [1000, 500];
const SIDES: [f64; 2] = [10.0, 5.0];
/// Segments planned on it.
const SEGMENTS: usize = 200;
/// Distance of the targets, metres.
const SPACING: f64 = 0.01;

/// A wall with bumps of five centimetres, a million triangles.
fn large_mesh() -> Result<TriangleSurface, Box<dyn Error>> {
    let [columns, rows] = QUADS.map(|quads| quads + 1);
    let mut positions = Vec::with_capacity(columns * rows);
    for j in 0..rows {
        for i in 0..columns {
            let [y, z] = [SIDES[0] * i as f64 / QUADS[0] as f64, SIDES[1] * j as f64 / QUADS[1] as f64];
            positions.push([bump(y, z), y, z].map(|c| c as f32));
        }
    }
    let mut faces = Vec::with_capacity(2 * QUADS[0] * QUADS[1]);
    for j in 0..QUADS[1] {
        for i in 0..QUADS[0] {
            let corner = |i: usize, j: usize| (j * columns + i) as u32;
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            faces.extend([[a, c, b], [a, d, c]]);
        }
    }
    Ok(TriangleSurface::new(&positions, &faces)?)
}

fn bump(y: f64, z: f64) -> f64 {
    0.05 * (3.9 * y).sin() * (2.7 * z + 0.4).cos()
}

/// Straight segments on the large mesh, targets a centimetre apart: all stages of a plan.
pub(super) fn segments(length: f64) -> Result<(), Box<dyn Error>> {
    let MissionSettings { planner: settings, ptu, .. } = MissionSettings::default();
    let mesh = large_mesh()?;
    let (robot, wall) = (Robot::new(Ptu::new(ptu)?), MeshSurface(&mesh));
    let mut rng = Rng::new(5);
    let (mut times, mut served, mut asked) = (Vec::new(), 0, 0);
    for _ in 0..SEGMENTS {
        let (y, z) = (rng.between(1.5, SIDES[0] - 1.5), rng.between(1.5, SIDES[1] - 1.5));
        let (sin, cos) = rng.between(0.0, TAU).sin_cos();
        let target = |k: usize| {
            let (y, z) = (y + SPACING * k as f64 * cos, z + SPACING * k as f64 * sin);
            let slope = |h: [f64; 2]| (bump(y + h[0], z + h[1]) - bump(y - h[0], z - h[1])) / 2e-5;
            let normal = UnitVector3::new_normalize(Vector3::new(-1.0, slope([1e-5, 0.0]), slope([0.0, 1e-5])));
            Target { point: Point3::new(bump(y, z), y, z), normal, dose: rock::DOSE, time: None, stand_off: None }
        };
        let targets: Vec<Target> = (0..=(length / SPACING).round() as usize).map(target).collect();
        let (plan, time) = seconds(|| OptimalPlanner::default().plan(&targets, &wall, &robot, &settings));
        (served, asked) = (served + plan?.report.served, asked + targets.len());
        times.push(1e3 * time);
    }
    times.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| times[(share * (times.len() - 1) as f64) as usize];
    println!(
        "{}",
        json!({
            "fig": format!("segment_of_{length}_m_on_a_million_triangles"), "peer": "paint-planner", "segments": SEGMENTS,
            "served_share": f64::from(served as u32) / f64::from(asked as u32), "cpu_ms_median": at(0.5), "cpu_ms_p99": at(0.99),
        })
    );
    Ok(())
}
