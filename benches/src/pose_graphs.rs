//! Pose graphs for the benches and for GTSAM: the spirals that the tests of `tsdf-hash` use, in the size of the literature's.

// The tests' worlds stand for themselves.
#[path = "../../tsdf-hash/tests/it/pose_graph/worlds.rs"]
mod worlds;

use std::error::Error;
use std::path::Path;

use serde_json::json;
use tsdf_hash::pose_graph::{PoseGraph, PoseGraphSettings};

use crate::Rng;
use crate::cpu::median_seconds;
use worlds::{Noise, sphere, torus};

const NOISE: Noise = Noise { turn: 0.03, shift: 0.05 };

/// Name and graph: 2500 poses on a sphere, 5000 on a torus, in the places where odometry alone leads.
pub fn graphs() -> [(&'static str, PoseGraph); 2] {
    let mut rng = Rng::new(1);
    let sphere = sphere(50, 50, NOISE, &mut || rng.unit());
    let torus = torus(100, 50, NOISE, &mut || rng.unit());
    [("sphere", sphere.graph), ("torus", torus.graph)]
}

/// Writes both as g2o text.
pub fn write(folder: &Path) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    for (name, graph) in graphs() {
        let path = folder.join(format!("{name}.g2o"));
        std::fs::write(&path, graph.to_g2o()).map_err(|e| format!("{}: {e}", path.display()))?;
    }
    Ok(())
}

/// Optimises a graph from the poses in the file, and from those of the chordal relaxation.
pub fn run(path: &Path, runs: usize) -> Result<(), Box<dyn Error>> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    let given = PoseGraph::from_g2o(&text)?;
    for (fig, relaxed) in [("given", false), ("chordal", true)] {
        let solve = || -> Result<_, tsdf_hash::Error> {
            let mut graph = given.clone();
            if relaxed {
                graph.initialise()?;
            }
            graph.optimise(&PoseGraphSettings::default())
        };
        let report = solve()?;
        let cpu_ms = 1e3 * median_seconds(runs, &solve);
        let (poses, factors) = (given.poses.len(), given.betweens.len());
        println!(
            "{}",
            json!({
                "fig": format!("pose_graph_{fig}"), "peer": "tsdf-hash", "poses": poses, "factors": factors,
                "initial_cost": given.cost()?, "cost": report.cost, "iterations": report.iterations, "cpu_ms": cpu_ms,
            })
        );
    }
    Ok(())
}
