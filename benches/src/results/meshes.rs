//! The usual mission on public meshes, each three metres long, and on one of them as a scanner would leave it.

use std::error::Error;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Parser;
use paintcopter::mesh_io::read_mesh;
use paintcopter::mission::{Mission, inspect, report};
use paintcopter::mission_arguments::MissionArguments;

use crate::Rng;

use super::extent::Extent;
use super::table::{Table, number};

/// Names the folder with the meshes.
const DATA: &str = "MESHES";

/// Name and file.
const MESHES: [(&str, &str); 7] = [
    ("mountain", "odedstein/mountain/mountain.obj"),
    ("Demosthenes (bust)", "odedstein/demosthenes/demosthenes-low-res.obj"),
    ("camel's head", "libigl/camelhead.off"),
    ("cow's head", "bff/cowhead.obj"),
    ("lion", "libigl/lion.off"),
    ("spothead (cartoon cow)", NOISED),
    ("hemisphere", "bff/hemisphere.obj"),
];

/// The mesh that is painted with noise, too.
const NOISED: &str = "bff/spothead.obj";
/// Standard deviation of its vertices, each coordinate, as a share of the longest side.
const NOISE: f64 = 0.003;

/// A mission as the command line names it.
#[derive(Parser)]
struct Arguments {
    #[command(flatten)]
    mission: MissionArguments,
}

/// The table; empty in a quick rerun, which needs no data, and without data.
///
/// # Errors
/// Those of the missions, and meshes that cannot be read.
pub fn tables(extent: Extent, scratch: &Path) -> Result<Vec<Table>, Box<dyn Error>> {
    let (Extent::Whole, Some(data)) = (extent, std::env::var_os(DATA)) else {
        println!("meshes: left out: {DATA} names the folder with the meshes, and a quick rerun paints none of them");
        return Ok(Vec::new());
    };
    let data = Path::new(&data);
    let head = [
        "mesh",
        "faces",
        "area; m²",
        "in reach; %",
        "off the normal: mean / largest; mm",
        "hit error: RMS; cm",
        "canvas over ideal in reach; dB",
        "collisions",
        "limits violated",
    ];
    let mut table = Table::new("meshes", &head);
    for (name, file) in MESHES {
        table.row(row(name, &data.join(file), scratch)?);
    }
    let noisy = noisy(&data.join(NOISED), scratch)?;
    table.row(row("spothead with noise of 0.3 % of its longest side", &noisy, scratch)?);
    Ok(vec![table])
}

/// What `paintcopter --mesh FILE --scale fit` finds.
fn row(name: &str, mesh: &Path, scratch: &Path) -> Result<[String; 9], Box<dyn Error>> {
    let mesh = format!("--mesh={}", mesh.display());
    let arguments = Arguments::try_parse_from(["paintcopter", &mesh, "--scale=fit"])?;
    let mission = Mission::run(arguments.mission.mission_file()?.decide(scratch)?)?;
    let report = report(&mission, &inspect(&mission)?)?;
    let [mean, largest] =
        [report.normal_deviation_mean_m, report.normal_deviation_max_m].map(|off| number(1e3 * off, 1));
    Ok([
        name.into(),
        report.faces.to_string(),
        number(report.surface_area_m2, 1),
        number(100.0 * report.reach_share, 0),
        format!("{mean} / {largest}"),
        number(100.0 * report.hit_error_rms_m, 1),
        number(report.psnr_canvas_in_reach_db - report.psnr_ideal_in_reach_db, 1),
        report.collisions.to_string(),
        report.limit_violations.to_string(),
    ])
}

/// A mesh with Gaussian noise on its vertices, in a file of its own.
fn noisy(mesh: &Path, scratch: &Path) -> Result<PathBuf, Box<dyn Error>> {
    let mesh = read_mesh(mesh)?;
    let (low, high) = mesh.bounds();
    let longest = (0..3).map(|k| f64::from(high[k] - low[k])).fold(0.0, f64::max);
    let mut random = Rng::new(1);
    let mut moved = |x: f32| f64::from(x) + NOISE * longest * random.normal();
    let mut text = String::new();
    for vertex in &mesh.positions {
        let [x, y, z] = vertex.map(&mut moved);
        writeln!(text, "v {x} {y} {z}")?;
    }
    for [a, b, c] in &mesh.faces {
        writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1)?;
    }
    std::fs::create_dir_all(scratch)?;
    let file = scratch.join("noisy.obj");
    std::fs::write(&file, text)?;
    Ok(file)
}
