//! Programs that are interrupted at any moment: exit code 130, every file that has its name is whole, and what cannot be made again is there.
//!
//! The long form (50 moments for each program):
//! `cargo test --release --workspace --all-features --test it -- --ignored --nocapture interrupted_at_fifty_moments`, of all programs or, with
//! `PROGRAMS=unwrap,vr`, of some.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::scratch::Scratch;

/// Time that a program has to finish what is there, on a machine that is busy.
const LONGEST: Duration = Duration::from_secs(30);

fn start(program: &str, arguments: &[&str]) -> Child {
    let programs = Path::new(env!("CARGO_BIN_EXE_vio")).parent().unwrap();
    let mut command = Command::new(programs.join(program));
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
}

fn signal(child: &Child, name: &str) {
    let sent = Command::new("kill").args([&format!("-{name}"), &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
}

/// Waits for the end; the exit code, and how long it took.
fn wait(mut child: Child) -> (Option<i32>, Duration) {
    let begun = Instant::now();
    while begun.elapsed() < 3 * LONGEST {
        if let Some(status) = child.try_wait().unwrap() {
            return (status.code(), begun.elapsed());
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    (None, begun.elapsed())
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let paths = entries.map(|entry| entry.unwrap().path());
    paths.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

/// Reads every file of a folder by what outside programs read it with.
fn assert_whole(folder: &Path, what: &str) {
    for path in files(folder) {
        let bytes = std::fs::read(&path).unwrap();
        let extension = path.extension().map_or("", |e| e.to_str().unwrap());
        let whole = match extension {
            "json" => serde_json::from_slice::<serde_json::Value>(&bytes).is_ok(),
            "png" => image::load_from_memory(&bytes).is_ok(),
            "toml" => toml::from_str::<toml::Table>(std::str::from_utf8(&bytes).unwrap()).is_ok(),
            "glb" => gltf::Gltf::from_slice(&bytes).is_ok(),
            "mcap" => {
                let summary = mcap::Summary::read(&bytes).ok().flatten();
                summary.is_some() && mcap::MessageStream::new(&bytes).unwrap().all(|message| message.is_ok())
            }
            "ply" | "obj" => paintcopter::mesh_io::read_mesh(&path).is_ok(),
            "urdf" => ptu_kinematics::Ptu::from_urdf(std::str::from_utf8(&bytes).unwrap(), "nozzle").is_ok(),
            "tsdf" => tsdf_hash::storage::MapFile::open(&path).is_ok(),
            "csv" | "tum" | "md" | "mtl" | "yaml" | "files" => bytes.last().is_none_or(|last| *last == b'\n'),
            "layout" => {
                let word = |k: usize| u64::from_le_bytes(bytes[8 * k..8 * k + 8].try_into().unwrap()) as usize;
                // Head, three counts and the texel; sixteen numbers a face, seven a chart, two a page.
                bytes.len() >= 40 && bytes.len() == 8 * (5 + 16 * word(1) + 7 * word(2) + 2 * word(3))
            }
            "part" => false,
            other => panic!("{what}: {} is of a kind that is not checked here ({other})", path.display()),
        };
        assert!(whole, "{what}: {} is not whole", path.display());
    }
}

/// When a program is far enough to be interrupted.
#[derive(Clone, Copy)]
enum Ready {
    AtOnce,
    /// This file is in its folder.
    Writes(&'static str),
    /// It has said this on stderr.
    Says(&'static str),
}

impl Ready {
    fn wait(self, child: &mut Child, out: &Path) {
        match self {
            Self::AtOnce => {}
            Self::Writes(file) => {
                while !out.join(file).exists() && child.try_wait().unwrap().is_none() {
                    std::thread::sleep(Duration::from_millis(2));
                }
            }
            Self::Says(word) => {
                let mut lines = BufReader::new(child.stderr.as_mut().unwrap()).lines();
                assert!(lines.any(|line| line.unwrap().contains(word)), "{word} was never said");
            }
        }
    }
}

/// A program, what it is told beside its folder, when it is interrupted (ms after it is ready), and a file that is then there.
struct Job<'a> {
    program: &'a str,
    arguments: &'a [&'a str],
    ready: Ready,
    moments: &'a [u64],
    left: Option<&'a str>,
}

impl Job<'_> {
    fn interrupt(&self, s: &Scratch) {
        for (number, &moment) in self.moments.iter().enumerate() {
            let name = format!("{} {:?}, after {moment} ms", self.program, self.arguments);
            let out = s.path("out");
            let arguments: Vec<&str> = self.arguments.iter().copied().chain(["--out", &out]).collect();
            let mut child = start(self.program, &arguments);
            self.ready.wait(&mut child, Path::new(&out));
            std::thread::sleep(Duration::from_millis(moment));
            signal(&child, if number % 2 == 0 { "INT" } else { "TERM" });
            let (code, took) = wait(child);
            // It may have been done before, or not yet have been listening.
            assert!(matches!(code, Some(130 | 0) | None), "{name}: exit code {code:?}");
            assert!(took < LONGEST, "{name}: took {took:?} to end");
            assert_whole(Path::new(&out), &name);
            if let Some(file) = self.left {
                assert!(code == Some(130) && Path::new(&out).join(file).exists(), "{name}: {code:?} without {file}");
            }
            let _ = std::fs::remove_dir_all(&out);
        }
    }
}

/// A recording to run over.
fn recording(s: &Scratch) -> String {
    let out = s.path("recording");
    let (code, _) = wait(start("vio", &["sim", "--seconds", "6", "--seed", "3", "--flight", "wall", "--out", &out]));
    assert_eq!(code, Some(0));
    out
}

#[test]
fn what_was_recorded_or_simulated_is_finished_when_somebody_interrupts() {
    let s = Scratch::new("interrupted");
    let recorded = recording(&s);
    let simulated = ["sim", "--seconds", "600", "--mcap", "--flight", "wall"];
    let writes = Ready::Writes("recording.mcap.part");
    for (program, arguments, ready, moments, left) in [
        ("vio", &simulated[..], writes, &[0, 900][..], Some("recording.mcap")),
        ("vio", &["--euroc", &recorded], Ready::AtOnce, &[0, 100, 700], None),
        ("handheld", &[], Ready::Says("object"), &[500], Some("handheld.mcap")),
        ("vr", &["--listen", "127.0.0.1:0"], Ready::Writes("session.mcap.part"), &[500], Some("session.mcap")),
        ("paintcopter", &[], Ready::Writes("mission.toml"), &[0, 1500], None),
        ("plan", &[], Ready::AtOnce, &[30], None),
    ] {
        Job { program, arguments, ready, moments, left }.interrupt(&s);
    }
}

#[test]
#[ignore = "ten minutes; see the head of the file"]
fn interrupted_at_fifty_moments() {
    let s = Scratch::new("interrupted-often");
    let recorded = recording(&s);
    s.write("wall.obj", "v 0 1.3 1\nv 0 -1.3 1\nv 0 -1.3 2.4\nv 0 1.3 2.4\nf 1 2 3\nf 1 3 4\n");
    let mesh = s.path("wall.obj");
    let frames = s.path("frames");
    assert_eq!(wait(start("scan", &["sim", "--out", &frames])).0, Some(0));
    let picture = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/src/images/rock.png");
    let only = std::env::var("PROGRAMS").unwrap_or_default();
    for (program, arguments, longest) in [
        ("vio", &["sim", "--seconds", "600", "--mcap", "--flight", "wall"][..], 8000),
        ("vio", &["--euroc", &recorded], 4000),
        ("handheld", &[], 12_000),
        ("paintcopter", &[], 40_000),
        ("plan", &[], 15_000),
        ("unwrap", &["--mesh", &mesh], 1500),
        ("paint-image", &["--image", picture], 4000),
        ("vr", &["--listen", "127.0.0.1:0"], 5000),
        ("scan", &["--sequence", &frames, "--record"], 5000),
        ("robot", &["--autopilot", "udp:127.0.0.1:14561"], 20_000),
    ] {
        if !only.is_empty() && !only.split(',').any(|name| name == program) {
            continue;
        }
        let moments: Vec<u64> = (0..50).map(|k| 20 + (k * k * longest) / 2500 + 37 * (k % 7)).collect();
        Job { program, arguments, ready: Ready::AtOnce, moments: &moments, left: None }.interrupt(&s);
        println!("{program} {}: 50 interruptions, every file whole", arguments.first().unwrap_or(&""));
    }
}
