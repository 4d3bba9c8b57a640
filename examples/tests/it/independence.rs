//! No library may depend on another, in any kind of dependency, and no two files of a package may import each other.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::module_graph::{ModuleGraph, circles};

pub(crate) const LIBRARIES: [&str; 7] =
    ["tsdf-hash", "vio-ekf", "ptu-kinematics", "paint-planner", "paint-sim", "uv-param", "paint-net"];

#[test]
fn the_libraries_do_not_know_each_other() {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--no-deps", "--format-version", "1", "--manifest-path"])
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/../Cargo.toml"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    let mut seen = 0;
    for package in packages.iter().filter(|p| LIBRARIES.contains(&p["name"].as_str().unwrap())) {
        seen += 1;
        for dependency in package["dependencies"].as_array().unwrap() {
            let name = dependency["name"].as_str().unwrap();
            assert!(dependency["path"].is_null(), "{} depends on {name} by path", package["name"]);
            assert!(!LIBRARIES.contains(&name), "{} depends on {name}", package["name"]);
        }
    }
    assert_eq!(seen, LIBRARIES.len());
}

/// What a library can tell a subscriber of `tracing` costs nobody else a dependency.
#[test]
fn tracing_is_asked_for() {
    for library in LIBRARIES {
        let tree = |features: &[&str]| {
            let output = Command::new(env!("CARGO"))
                .args(["tree", "--offline", "--edges", "normal", "--prefix", "none", "--package", library])
                .args(features)
                .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
                .output()
                .unwrap();
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            String::from_utf8(output.stdout).unwrap()
        };
        assert!(!tree(&[]).contains("tracing"), "{library} has it by default");
        assert!(tree(&["--features", "tracing"]).contains("tracing-core"), "{library} has no feature of that name");
    }
}

/// The root files of a package's targets.
fn crate_roots(package: &Path) -> Vec<PathBuf> {
    let mut roots: Vec<PathBuf> = ["src/lib.rs", "src/main.rs"].map(|name| package.join(name)).into();
    for folder in ["src/bin", "tests", "benches", "examples"] {
        let entries = std::fs::read_dir(package.join(folder)).into_iter().flatten().flatten();
        roots.extend(entries.map(|e| e.path()).map(|p| if p.is_dir() { p.join("main.rs") } else { p }));
    }
    roots.retain(|path| path.is_file() && path.extension().is_some_and(|e| e == "rs"));
    roots.sort();
    roots
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let (mut found, mut files, mut imports_seen) = (String::new(), 0, 0);
    for package in LIBRARIES.into_iter().chain(["examples", "benches"]) {
        for root in crate_roots(&workspace.join(package)) {
            let graph = ModuleGraph::read(&root).unwrap();
            let imports = graph.imports();
            files += graph.files();
            imports_seen += imports.len();
            let name = |path: &Path| path.strip_prefix(workspace).unwrap().display().to_string();
            for circle in circles(&imports) {
                writeln!(found, "{} files import each other:", circle.len()).unwrap();
                for ((from, to), names) in imports.iter().filter(|((a, b), _)| circle.contains(a) && circle.contains(b))
                {
                    let names = names.iter().cloned().collect::<Vec<_>>().join(", ");
                    writeln!(found, "    {} takes {names} from {}", name(from), name(to)).unwrap();
                }
            }
        }
    }
    // The scan sees the workspace at all.
    assert!(files > 300 && imports_seen > 500, "{files} files, {imports_seen} imports");
    assert!(found.is_empty(), "\n{found}");
}
