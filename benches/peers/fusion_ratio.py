#!/usr/bin/env python3
"""tsdf-hash beside Open3D's VoxelBlockGrid on one stream of synth_rgbd.py: both fuse it in turn (A B A B ...), on one
thread, with colour; then the ratio of their median CPU times per image, and the accuracy of our mesh.  Prints one JSON
line per figure.  Needs numpy, open3d and a Rust toolchain.

    python3 synth_rgbd.py loop --preset loop
    python3 fusion_ratio.py loop                          at 20, 10 and 5 mm
    python3 fusion_ratio.py loop --voxel 0.01 --rounds 3
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile

from ours import library_figures

HERE = os.path.dirname(os.path.abspath(__file__))


def last_json(command):
    """The last JSON line that a command prints, or the end of this program with its complaint."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{' '.join(command)}\n{done.stderr.strip()[-2000:]}")
    return json.loads(done.stdout.strip().splitlines()[-1])


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("stream")
    a.add_argument("--voxel", type=float, nargs="+", default=[0.02, 0.01, 0.005], metavar="METRES")
    a.add_argument("--rounds", type=int, default=2)
    a.add_argument("--ours", help="the binary `library_figures` (default: built here with cargo)")
    o = a.parse_args()
    ours = o.ours or library_figures()
    peers = [sys.executable, os.path.join(HERE, "mapping_peers.py")]
    with tempfile.TemporaryDirectory() as folder:
        for voxel in o.voxel:
            mesh = os.path.join(folder, "ours.ply")
            ms = {"ours": [], "open3d": []}
            for _ in range(max(1, o.rounds)):
                one = last_json([ours, "tsdf", o.stream, "--voxel", str(voxel), "--out", mesh])
                # One ray cast is the least that `fuse` does beside fusing and meshing.
                other = last_json([*peers, "fuse", o.stream, "--voxel", str(voxel), "--every", "1000000"])
                ms["ours"].append(one["integrate_cpu_ms"])
                ms["open3d"].append(other["integrate_cpu_ms"])
            evaluated = last_json([*peers, "mesh", o.stream, "--file", mesh])
            mine, theirs = statistics.median(ms["ours"]), statistics.median(ms["open3d"])
            figures = dict(
                figure="fusion_ratio",
                stream=os.path.basename(os.path.normpath(o.stream)),
                voxel_m=voxel,
                rounds=len(ms["ours"]),
                ours_cpu_ms=round(mine, 3),
                open3d_cpu_ms=round(theirs, 3),
                ratio=round(mine / theirs, 4),
                deintegrate_over_integrate=round(one["deintegrate_cpu_ms"] / one["integrate_cpu_ms"], 4),
                empty_again=one["empty_again"],
                fused_share=round(one["fused_share"], 5),
                map_hash=one["map_hash"],
            )
            keep = ("err_mean_mm", "err_p95_mm", "err_max_mm", "compl_5mm", "edges_nonmanifold")
            print(json.dumps(figures | {"ours_" + k: evaluated[k] for k in keep if k in evaluated}), flush=True)


main()
