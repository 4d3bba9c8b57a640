//! The version that programs tell: that of the package and, in a repository, the revision.

use std::process::Command;

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_string())
}

fn main() {
    let version = env!("CARGO_PKG_VERSION");
    // A package that somebody unpacks inside another repository is none of its revisions.
    let own = git(&["ls-files", "--error-unmatch", "build.rs"]).is_some();
    let told = git(&["rev-parse", "--short=12", "HEAD"]).filter(|_| own);
    let told = told.map_or_else(|| version.to_string(), |revision| format!("{version} ({revision})"));
    println!("cargo::rustc-env=PAINTCOPTER_VERSION={told}");
    for name in ["HEAD", "logs/HEAD"] {
        if let Some(path) = git(&["rev-parse", "--git-path", name]).filter(|_| own) {
            println!("cargo::rerun-if-changed={path}");
        }
    }
    println!("cargo::rerun-if-changed=build.rs");
}
