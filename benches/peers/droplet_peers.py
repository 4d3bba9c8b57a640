#!/usr/bin/env python3
"""Peer of paint-sim's droplets as rays on one core: Embree, by embreex. One JSON line per figure.

  pip install numpy trimesh embreex
  library_figures droplets DIR           writes mesh and rays, and prints ours
  python3 droplet_peers.py DIR           casts the same rays at the same mesh

droplet_rays: cones of 1024 droplets at a wall of a million triangles. cpu_ms = median of the runs, CPU time of the process; the arrays are in
Embree's own precision before the clock starts. different = rays for which both name another triangle, or one of them none."""

import argparse
import importlib.metadata
import json
import pathlib
import statistics
import time

import embreex.mesh_construction
import embreex.rtcore_scene
import numpy as np


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--runs", type=int, default=5)
    a = parser.parse_args()
    if a.runs < 1:
        parser.error("--runs must be at least 1")
    load = lambda name, kind: np.ascontiguousarray(np.load(a.folder / f"{name}.npy").reshape(-1, 3), dtype=kind)
    scene = embreex.rtcore_scene.EmbreeScene()
    embreex.mesh_construction.TriangleMesh(scene, load("positions", np.float32), load("faces", np.int32))
    origins, directions = load("origins", np.float32), load("directions", np.float32)
    ids = scene.run(origins, directions)
    times = []
    for _ in range(a.runs):
        start = time.process_time()
        scene.run(origins, directions)
        times.append(time.process_time() - start)
    seconds = statistics.median(times)
    different = int((ids != np.load(a.folder / "ids.npy")).sum())
    peer = f"embreex_{importlib.metadata.version('embreex')}"
    print(json.dumps(dict(
        fig="droplet_rays", peer=peer, rays=len(ids), runs=a.runs, cpu_ms=round(1e3 * seconds, 2),
        million_per_second=round(len(ids) / seconds / 1e6, 2), misses=int((ids < 0).sum()), different=different,
    )))  # fmt: skip


if __name__ == "__main__":
    main()
