//! The whole job on a panel of one square metre: what it leaves behind, and that it is the same for any number of threads.

use std::path::{Path, PathBuf};

use paintcopter_examples::design::Design;
use paintcopter_examples::mesh_io::{TriangleMesh, read_mesh};
use paintcopter_examples::mission::{Mission, MissionSettings, save};

/// A panel 1.2 m wide and 0.8 m high with a soft bulge, facing -x, its lower edge 2 m up.
fn panel() -> TriangleMesh {
    let (columns, rows) = (24_u32, 16_u32);
    let mut mesh = TriangleMesh::default();
    for row in 0..=rows {
        for column in 0..=columns {
            let (u, v) = (f64::from(column) / f64::from(columns), f64::from(row) / f64::from(rows));
            let bulge = 0.08 * (std::f64::consts::PI * u).sin() * (std::f64::consts::PI * v).sin();
            mesh.positions.push([-bulge as f32, (0.6 - 1.2 * u) as f32, (2.0 + 0.8 * v) as f32]);
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let at = |r: u32, c: u32| r * (columns + 1) + c;
            let [a, b, c, d] = [at(row, column), at(row, column + 1), at(row + 1, column + 1), at(row + 1, column)];
            mesh.faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

/// Paints the panel into a folder of its own.
fn paint(threads: usize) -> (PathBuf, paintcopter_examples::report::Report) {
    let folder = std::env::temp_dir().join(format!("paintcopter-mission-{}-{threads}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let settings = MissionSettings { seed: 3, threads, ..MissionSettings::default() };
    let mission = Mission::run("panel", &panel(), &Design::Gradient, settings).unwrap();
    let report = save(&mission, &folder).unwrap();
    (folder, report)
}

#[test]
fn a_panel_is_painted_and_the_threads_leave_no_trace() {
    let (one, report) = paint(1);
    let (three, _) = paint(3);
    let read = |folder: &Path, name: &str| std::fs::read(folder.join(name)).unwrap();
    for name in [
        "wanted.png",
        "painted.png",
        "painted_view.png",
        "error.png",
        "path.png",
        "angles.png",
        "surface.ply",
        "scan.ply",
        "mission.mcap",
        "flight_true.tum",
        "flight_slam.tum",
    ] {
        assert!(read(&one, name) == read(&three, name), "{name} depends on the number of threads");
    }

    // The figures are those of a flat, easy panel.
    assert!((report.surface_area_m2 - 0.99).abs() < 0.04, "{}", report.surface_area_m2);
    assert_eq!((report.uv_flips, report.collisions, report.limit_violations), (0, 0, 0));
    assert_eq!(report.mass_balance_relative, 0.0);
    assert!(report.hit_error_rms_m < 0.015 && report.normal_deviation_max_m < 0.02);
    assert!(report.ssim_painted > 0.9 * report.ssim_canvas && report.psnr_painted_db > 25.0);
    assert!(report.scan_error_mean_m < 0.005);

    // The painted mesh reads back with the gradient on it: dark on the right as the robot sees it, which is -y.
    let mesh = read_mesh(&one.join("surface.ply")).unwrap();
    let colours = mesh.colours.unwrap();
    let mean = |side: f32| {
        let greens: Vec<f32> =
            mesh.positions.iter().zip(&colours).filter(|(p, _)| p[1] * side > 0.3).map(|(_, c)| c[1]).collect();
        greens.iter().sum::<f32>() / greens.len() as f32
    };
    assert!(mean(1.0) > mean(-1.0) + 0.2, "{} against {}", mean(1.0), mean(-1.0));

    let json: serde_json::Value = serde_json::from_slice(&read(&one, "report.json")).unwrap();
    assert!(json.as_object().unwrap().len() >= 33);
    for folder in [one, three] {
        std::fs::remove_dir_all(folder).unwrap();
    }
}
