//! A command line of `scan`, carried out: the recording is mapped, the folder is filled.

use std::path::Path;

use super::arguments::{self, Arguments, Command};
use super::mapped::Scan;
use super::options::in_options;
use super::report::ScanReport;
use super::simulate::simulate;
use super::views::save_views;
use crate::interruption::Finishing;
use crate::mesh_io::{PlyMesh, write_ply};
use crate::report::save_figures;
use crate::{result, say};
use crate::{run_folder, whole_file};

/// Maps the recording of a command line and writes what became of it; an error in the words of the command line.
///
/// # Errors
/// One line that names the input and the way out.
pub fn execute(arguments: &Arguments) -> Result<(), String> {
    run(arguments).map_err(|error| in_options(&error.to_string()))
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn std::error::Error>> {
    if let Some(Command::Sim(simulation)) = &arguments.command {
        prepare(&simulation.out, "scan-sim")?;
        simulate(simulation)?;
        result!("{}", simulation.out.display());
        return Ok(());
    }
    let folder = &arguments.out;
    prepare(folder, "scan")?;
    let sequence = arguments::sequence(arguments)?;
    say!("{}: {} layout, {} frames", arguments.recording().display(), sequence.layout, sequence.frames.len());
    say!("{:28} {}", "camera", sequence.description());
    let settings = arguments::settings(arguments)?;
    // The map and its files are finished where somebody interrupts.
    let _finishing = Finishing::begin();
    let scan = Scan::run(arguments.recording(), &sequence, &settings)?;
    for (_, why) in &scan.skipped {
        say!("left out: {}", in_options(why));
    }
    // What cannot be made again comes first, pictures last.
    scan.save(&folder.join("map.tsdf"), arguments.recording())?;
    let ply = folder.join("mesh.ply");
    let tsdf_hash::mesh::Mesh { positions, normals, colours, faces, .. } = &scan.mesh;
    write_ply(&ply, &PlyMesh { positions, normals: Some(normals), colours, faces })
        .map_err(|e| format!("{}: cannot be written ({e})", ply.display()))?;
    let tum = folder.join("trajectory.tum");
    whole_file::write(&tum, vio_ekf::format::tum::write(&scan.trajectory))
        .map_err(|e| format!("{}: cannot be written ({e})", tum.display()))?;
    save_views(&scan, &sequence, folder, settings.slam.map.threads)?;
    // Last, so that its presence means the folder is complete.
    save_figures(&ScanReport::new(&scan, &sequence), folder)?;
    result!("{}", folder.join("mesh.ply").display());
    scan.verdict(&sequence)?;
    Ok(())
}

/// Makes the folder, and tries it before any work is done.
fn prepare(folder: &Path, program: &str) -> Result<(), String> {
    let refuse = |e: std::io::Error| format!("{}: cannot be written to ({e}): choose another --out", folder.display());
    run_folder::begin(folder, program).map_err(refuse)?;
    let probe = folder.join(".tried");
    std::fs::write(&probe, b"").map_err(refuse)?;
    std::fs::remove_file(&probe).map_err(refuse)
}
