//! Pose graphs of 2500 and 5000 poses, from where odometry leads to the minimum.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use paintcopter_benches::{criterion, pose_graphs};
use tsdf_hash::pose_graph::PoseGraphSettings;

fn optimise(c: &mut Criterion) {
    for (name, graph) in pose_graphs::graphs() {
        c.bench_function(&format!("pose graph: {name}"), |b| {
            b.iter(|| {
                let mut graph = black_box(&graph).clone();
                graph.optimise(&PoseGraphSettings::default())
            });
        });
        c.bench_function(&format!("pose graph: {name}, chordal relaxation"), |b| {
            b.iter(|| {
                let mut graph = black_box(&graph).clone();
                graph.initialise()
            });
        });
    }
}

criterion_group! {
    name = benches;
    config = criterion();
    targets = optimise
}
criterion_main!(benches);
