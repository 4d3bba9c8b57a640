//! What all programs have in common on their command lines.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Command, Output};

use crate::scratch::Scratch;

const PROGRAMS: [&str; 10] =
    ["handheld", "paint-image", "paintcopter", "plan", "robot", "scan", "spray", "unwrap", "vio", "vr"];

fn run(program: &str, arguments: &[&str]) -> Output {
    let programs = Path::new(env!("CARGO_BIN_EXE_vio")).parent().unwrap();
    Command::new(programs.join(program)).args(arguments).env_remove("RUST_LOG").output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn every_program_tells_its_version_completes_itself_and_has_a_manual() {
    let mut seen = BTreeSet::new();
    for program in PROGRAMS {
        let output = run(program, &["--version"]);
        let version = text(&output.stdout);
        assert!(
            output.status.success() && version.starts_with(&format!("{program} {}", env!("CARGO_PKG_VERSION"))),
            "{version}"
        );
        // What it does comes first, and is its own.
        let does = text(&run(program, &["--help"]).stdout).lines().next().unwrap_or_default().to_string();
        assert!(does.len() > 40 && seen.insert(does.clone()), "{program}: {does}");
        for shell in ["bash", "zsh", "fish"] {
            let output = run(program, &["--completions", shell]);
            let script = text(&output.stdout);
            assert!(output.status.success() && script.contains(program) && script.contains("out"), "{program} {shell}");
        }
        let output = run(program, &["--manual"]);
        let page = text(&output.stdout);
        assert!(output.status.success() && page.contains(&format!(".TH {program} 1")), "{program}");
        for section in [".SH SYNOPSIS", ".SH OPTIONS", "\\-\\-quiet", "\\-\\-out"] {
            assert!(page.contains(section), "{program}: {section}");
        }
    }
    assert!(
        text(&run("vio", &["--manual"]).stdout).contains("vio\\-sim")
            || text(&run("vio", &["--manual"]).stdout).contains("vio sim")
    );
}

#[test]
fn quiet_is_quiet_and_json_is_the_report_alone() {
    let s = Scratch::new("command-line");
    s.write("wall.obj", "v 0 1.3 1\nv 0 -1.3 1\nv 0 -1.3 2.4\nv 0 1.3 2.4\nf 1 2 3\nf 1 3 4\n");
    let (mesh, out) = (s.path("wall.obj"), s.path("out"));
    let usual = run("unwrap", &["--mesh", &mesh, "--out", &out]);
    assert!(usual.status.success() && !usual.stderr.is_empty());
    let output = run("unwrap", &["--mesh", &mesh, "--out", &out, "--quiet", "--json"]);
    assert!(output.status.success() && output.stderr.is_empty(), "{}", text(&output.stderr));
    assert_eq!(text(&output.stdout), std::fs::read_to_string(format!("{out}/report.json")).unwrap());
    // What goes wrong is said all the same.
    let output = run("unwrap", &["-q", "--mesh", &s.path("none.obj"), "--out", &out]);
    assert!(output.status.code() == Some(1) && text(&output.stderr).contains("none.obj"));
}

#[test]
fn what_the_libraries_do_is_said_where_somebody_asks() {
    let s = Scratch::new("verbose");
    s.write("wall.obj", "v 0 1.3 1\nv 0 -1.3 1\nv 0 -1.3 2.4\nv 0 1.3 2.4\nf 1 2 3\nf 1 3 4\n");
    let (mesh, out) = (s.path("wall.obj"), s.path("out"));
    let arguments = ["--mesh", &mesh, "--out", &out];
    let quiet = text(&run("unwrap", &arguments).stderr);
    assert!(!quiet.contains("uv_param"), "{quiet}");
    let loud = text(&run("unwrap", &[&arguments[..], &["-v"]].concat()).stderr);
    assert!(loud.contains("uv_param") && loud.contains("time.busy"), "{loud}");
    let programs = Path::new(env!("CARGO_BIN_EXE_vio")).parent().unwrap();
    let filtered = |filter: &str| {
        let output = Command::new(programs.join("unwrap")).args(arguments).env("RUST_LOG", filter).output().unwrap();
        assert!(output.status.success());
        text(&output.stderr)
    };
    assert!(filtered("uv_param=debug").contains("time.busy") && !filtered("vio_ekf=debug").contains("time.busy"));
    assert!(filtered("uv_param=loud").contains("warning: RUST_LOG"));
}

#[test]
fn without_arguments_vio_names_the_ways_in() {
    let output = run("vio", &[]);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1));
    assert!(["--euroc", "--mcap", "vio sim"].iter().all(|way| said.contains(way)), "{said}");
}
