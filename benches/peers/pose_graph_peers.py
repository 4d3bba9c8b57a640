#!/usr/bin/env python3
"""GTSAM as the peer of tsdf-hash's pose graphs: the same g2o file, from the same poses. One JSON line per solver.

  pip install gtsam
  cargo run --release -p paintcopter-benches --bin library_figures -- graph-worlds DIR      writes sphere.g2o and torus.g2o
  python3 pose_graph_peers.py DIR/sphere.g2o
  cargo run --release -p paintcopter-benches --bin library_figures -- graph DIR/sphere.g2o  same names, same rules

The first pose is held. cost = half of the sum of squared residuals, each in units of its covariance; `given` starts at the poses of
the file, `chordal` at those of the chordal relaxation. cpu_ms = median of the runs, CPU time of all threads, the file already read."""

import argparse
import json
import statistics
import sys
import time

import gtsam
import numpy as np


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file")
    parser.add_argument("--runs", type=int, default=5)
    a = parser.parse_args()
    try:
        graph, given = gtsam.readG2o(a.file, True)
    except RuntimeError as error:
        sys.exit(f"pose_graph_peers: {error}")
    held = gtsam.NonlinearFactorGraph(graph)
    first = min(given.keys())
    held.add(gtsam.NonlinearEqualityPose3(first, given.atPose3(first)))
    # The relaxation wants a prior.
    anchored = gtsam.NonlinearFactorGraph(graph)
    anchored.add(gtsam.PriorFactorPose3(first, given.atPose3(first), gtsam.noiseModel.Isotropic.Sigma(6, 1e-3)))
    for start in ("given", "chordal"):
        for name, optimizer, params in (
            ("LM", gtsam.LevenbergMarquardtOptimizer, gtsam.LevenbergMarquardtParams()),
            ("GN", gtsam.GaussNewtonOptimizer, gtsam.GaussNewtonParams()),
        ):
            params.setRelativeErrorTol(1e-8)
            params.setMaxIterations(100)
            times = []
            for _ in range(max(1, a.runs)):
                began = time.process_time()
                initial = given
                if start == "chordal":
                    initial = gtsam.InitializePose3.initialize(anchored)
                    initial.update(first, given.atPose3(first))
                solver = optimizer(held, initial, params)
                try:
                    found = solver.optimize()
                except RuntimeError:
                    found = None
                times.append(time.process_time() - began)
            if found is None:
                print(json.dumps(dict(fig=f"pose_graph_{start}", peer=f"gtsam {name}", failed="indeterminate system")))
                continue
            figures = dict(
                fig=f"pose_graph_{start}", peer=f"gtsam {name}", poses=given.size(), factors=graph.size(),
                initial_cost=float(graph.error(given)), cost=float(graph.error(found)), iterations=int(solver.iterations()),
                cpu_ms=round(1e3 * statistics.median(times), 3),
            )
            figures = {k: v for k, v in figures.items() if not isinstance(v, float) or np.isfinite(v)}
            print(json.dumps(figures))


if __name__ == "__main__":
    main()
