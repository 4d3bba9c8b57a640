//! No library may depend on another, in any kind of dependency.

use std::process::Command;

const LIBRARIES: [&str; 7] =
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
