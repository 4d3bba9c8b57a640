//! A simulated recording, ways to spoil it, and the binary.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use paintcopter::vio::{Flight, SimulationSettings};
use vio_ekf::Camera;
use vio_ekf::sim::{RoomSettings, Scenario, SimulatedCamera};

/// A flight seen by a small camera, so that the tests stay short.
pub(crate) fn flight(seconds: f64, raw: bool) -> SimulationSettings {
    let euroc = Camera::euroc();
    let camera = Camera { width: 376, height: 240, fx: 229.3, fy: 228.6, cx: 183.4, cy: 123.9, ..euroc };
    let room = RoomSettings { texture_size: 512, ..RoomSettings::default() };
    let cameras = vec![SimulatedCamera { camera, ..SimulatedCamera::default() }];
    let scenario = Scenario { cameras, room, seed: 5, ..Scenario::default() };
    SimulationSettings { flight: Flight::Room, seconds, scenario, mcap: true, raw, threads: 2 }
}

pub(super) fn vio(arguments: &[&str], out: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_vio")).args(arguments).arg("--out").arg(out).output().unwrap()
}

pub(super) fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.path().is_dir() { copy(&entry.path(), &target) } else { drop(std::fs::copy(entry.path(), target)) }
    }
}

/// Changes a text file below the folder.
pub(super) fn edit(folder: &Path, name: &str, change: impl Fn(&str) -> String) {
    let path = folder.join("mav0").join(name);
    std::fs::write(&path, change(&std::fs::read_to_string(&path).unwrap())).unwrap();
}

/// Changes the numbered columns of every data line of the inertial samples.
pub(super) fn columns(text: &str, change: impl Fn(&mut Vec<String>)) -> String {
    let line = |line: &str| {
        if line.starts_with('#') {
            return line.to_string();
        }
        let mut fields: Vec<String> = line.split(',').map(str::to_string).collect();
        change(&mut fields);
        fields.join(",")
    };
    text.lines().map(|l| line(l) + "\n").collect()
}

pub(super) fn images(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder.join("mav0/cam0/data")).unwrap();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}
pub(super) fn run_folder(folder: &Path, more: &[&str]) -> (Option<i32>, String, Option<serde_json::Value>) {
    let out = folder.join("out");
    let output = vio(&[&["--euroc", folder.to_str().unwrap()], more].concat(), &out);
    let report = std::fs::read_to_string(out.join("report.json")).ok();
    let report = report.map(|text| serde_json::from_str(&text).unwrap());
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned(), report)
}
