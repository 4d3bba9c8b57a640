#!/usr/bin/env python3
"""Every peer that installs as a package beside ours, in turn (A B A B ...) in one run, each on one thread: median CPU times, their ratio,
and whether the answers agree. Writes a table as CSV, the rows where the peer is faster first. Needs requirements.txt and a Rust toolchain.

    python3 side_by_side.py --out peers.csv
    cargo run --release -p paintcopter-benches --bin results -- --only peers      the same into the book (PYTHON: this interpreter)

Data: the built-in rock wall, a sphere with bumps, the planner's programs, two trajectories of 10,000 poses, a graph of 2500 poses, random
films and colours, five photographs of scikit-image, and a stream of synth_rgbd.py."""

import argparse
import csv
import json
import os
import statistics
import subprocess
import sys
import tempfile
from importlib.metadata import version

import numpy as np
from ours import ROOT, library_figures

HERE = os.path.dirname(os.path.abspath(__file__))
ENVIRONMENT = dict(os.environ, **{name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")})
HEAD = ["what", "peer", "peer; ms", "ours; ms", "ours over peer", "answers"]


def lines(command):
    """The JSON lines that a command prints."""
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=ENVIRONMENT)
    if done.returncode:
        sys.exit(f"{' '.join(command)}\n{done.stderr.strip()[-2000:]}")
    return [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]


def script(name, *arguments):
    """A script of this folder on one core, where its clock is CPU time."""
    return ["taskset", "-c", "0", sys.executable, os.path.join(HERE, name), *arguments]


def named(found, fig, peer=None):
    return next(line for line in found if line.get("fig") == fig and (peer is None or line.get("peer", "").startswith(peer)))


def bumpy_sphere(path):
    """A closed surface of 20,480 faces."""
    t = (1 + 5**0.5) / 2
    points = [(-1, t, 0), (1, t, 0), (-1, -t, 0), (1, -t, 0), (0, -1, t), (0, 1, t), (0, -1, -t), (0, 1, -t)]
    points += [(t, 0, -1), (t, 0, 1), (-t, 0, -1), (-t, 0, 1)]
    faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6), (7, 1, 8)]
    faces += [(3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    points = [np.array(p) / np.linalg.norm(p) for p in points]
    for _ in range(5):
        middles, split = {}, []
        for a, b, c in faces:
            m = []
            for edge in ((a, b), (b, c), (c, a)):
                key = tuple(sorted(edge))
                if key not in middles:
                    middle = points[edge[0]] + points[edge[1]]
                    middles[key] = len(points)
                    points.append(middle / np.linalg.norm(middle))
                m.append(middles[key])
            split += [(a, m[0], m[2]), (b, m[1], m[0]), (c, m[2], m[1]), tuple(m)]
        faces = split
    with open(path, "w") as file:
        for p in points:
            x, y, z = p * (1 + 0.1 * np.sin(5 * p[0]) * np.sin(4 * p[1]) * np.cos(6 * p[2]))
            file.write(f"v {x:.9f} {y:.9f} {z:.9f}\n")
        file.writelines(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in faces)


def charts(ours, folder):
    rock = os.path.join(folder, "rock.obj")
    lines([ours, "rock", rock])
    mine = lines([ours, "uv", rock, "--runs", "1"])
    igl = f"libigl {version('libigl')}"
    theirs = lines(script("uv_peers.py", "disk", rock, "--runs", "1", "--only", "arap,slim"))
    for what, one, other, energy in (
        ("ARAP of the rock wall; 32384 faces", "uv-param_arap", "arap50", "arap"),
        ("symmetric Dirichlet of the rock wall", "uv-param_symmetric_dirichlet", "slim", "sd"),
    ):
        a, b = named(mine, one), named(theirs, other)
        yield what, f"{igl} {other}", b["s"] * 1e3, a["s"] * 1e3, f"energy {a[energy]:.6f}; peer {b[energy]:.6f}"


def atlases(ours, folder):
    sphere = os.path.join(folder, "sphere.obj")
    bumpy_sphere(sphere)
    unwrap = os.path.join(os.path.dirname(ours), "unwrap")
    done = subprocess.run(script("uv_atlas.py", "--unwrap", unwrap, "--max-stretch", "1.15", sphere), capture_output=True, text=True, check=True, env=ENVIRONMENT)
    rows = {cells[2].strip(): cells for cells in (line.split("|") for line in done.stdout.splitlines()[2:])}
    quality = lambda cells: f"seam {cells[5].strip()}; stretch {cells[7].strip()}"
    for tool in ("xatlas", "uvunwrap"):
        yield (
            "atlas of a closed surface; 20480 faces; stretch up to 1.15", f"{tool} {version(tool)}", 1e3 * float(rows[tool][3]),
            1e3 * float(rows["unwrap"][3]), f"{quality(rows['unwrap'])}; peer {quality(rows[tool])}",
        )  # fmt: skip


def programs(ours, folder):
    instances = os.path.join(folder, "programs")
    if not os.path.isdir(instances):
        lines([ours, "planner-instances", instances])
    path = named(lines([ours, "planner", "--runs", "1", "--only", "path_2000"]), "path_2000")
    state = named(lines([ours, "planner", "--runs", "1", "--only", "state"]), "state_programs")
    theirs = lines(script("planner_peers.py", f"{instances}/path_2000", f"{instances}/states", "--runs", "1"))
    for name in ("clarabel", "osqp", "piqp"):
        b = named(theirs, "path_2000", name)
        off = abs(b["objective"] / path["objective"] - 1)
        yield "program of 2000 nozzle states", f"{name} {version(name)}", b["cpu_ms"], path["cpu_ms"], f"objective within {off:.0e}"
    for name in ("daqp", "clarabel"):
        b = named(theirs, "state_programs", name)
        peer, us = f"{name} {version(name)}", b["cpu_us"]
        if "solver_us" in b:
            peer, us = f"{peer} by its own clock", b["solver_us"]
        yield "program of one state", peer, us / 1e3, state["cpu_us"] / 1e3, f"states within {b['off']:.0e}"


def trajectories(ours, folder):
    pair = os.path.join(folder, "pair")
    if not os.path.isdir(pair):
        lines([ours, "pair", pair])
    files = [os.path.join(pair, name) for name in ("reference.txt", "estimate.txt")]
    a = named(lines([ours, "ate", *files, "--runs", "1"]), "ate_se3")
    b = named(lines(script("trajectory_peers.py", *files, "--runs", "1")), "ate_se3")
    yield "ATE of 10000 poses", f"evo {version('evo')}", b["cpu_ms"], a["cpu_ms"], f"RMSE within {abs(a['rmse_m'] / b['rmse_m'] - 1):.0e}"


def graphs(ours, folder):
    worlds = os.path.join(folder, "graphs")
    if not os.path.isdir(worlds):
        lines([ours, "graph-worlds", worlds])
    sphere = os.path.join(worlds, "sphere.g2o")
    a = named(lines([ours, "graph", sphere, "--runs", "1"]), "pose_graph_given")
    b = named(lines(script("pose_graph_peers.py", sphere, "--runs", "1")), "pose_graph_given", "gtsam LM")
    yield "pose graph of 2500 poses", f"gtsam {version('gtsam')}", b["cpu_ms"], a["cpu_ms"], f"cost within {abs(a['cost'] / b['cost'] - 1):.0e}"


def films(ours, _):
    mine = lines([ours, "sim", "--count", "300000", "--runs", "1"])
    theirs = lines(script("sim_peers.py", "--count", "300000", "--runs", "1"))
    for kind in ("f32", "f64"):
        for form, said in (("coth", "the printed form; loses digits"), ("exp", "the same form")):
            b = next(line for line in theirs if line["fig"] == f"km_{kind}_x36" and line["peer"].endswith(form))
            a = named(mine, f"km_{kind}_x36")
            yield f"Kubelka-Munk; 300000 x 36; {kind}", f"numpy {version('numpy')}", b["cpu_ms"], a["cpu_ms"], said
    a, b = named(mine, "de00"), named(theirs, "de00")
    yield "CIEDE2000 of 300000 pairs", f"colour-science {version('colour-science')}", b["cpu_ms"], a["cpu_ms"], ""


def calibrations(ours, folder):
    data = os.path.join(folder, "calibration")
    mine = lines([ours, "calibration", data, "--runs", "1"])
    theirs = lines(script("calibration_peers.py", data, "--runs", "1"))
    for fig, what, key in (
        ("spray_calibration", "spray from five bursts; 98415 readings", "flow"),
        ("layer_chart", "absorption and scattering of 36 bands from a chart", "scattering_sum"),
    ):
        a = named(mine, fig)
        for b in (line for line in theirs if line["fig"] == fig):
            said = f"{key.replace('_', ' ')} within {abs(a[key] / b[key] - 1):.0e}"
            yield what, f"scipy {version('scipy')}; {b['jac']} Jacobian", b["cpu_ms"], a["cpu_ms"], said


def painters(ours, folder):
    five = os.path.join(folder, "five")
    if not os.path.isdir(five):
        lines(script("paint_baselines.py", "export", "--to", five))
    found = lines(script("feedback_ratio.py", five, "--rounds", "1", "--ours", ours))
    mean = next(line for line in found if line["image"] == "mean")
    yield "five pictures at equal PSNR", f"scipy {version('scipy')} L-BFGS", mean["lbfgs_cpu_ms"], mean["ours_cpu_ms"], f"{mean['ours_psnr']:.2f} dB"


def maps(ours, folder):
    stream = os.path.join(folder, "loop")
    if not os.path.isdir(stream):
        lines(script("synth_rgbd.py", stream, "--preset", "loop"))
    for voxel in ("0.02", "0.01"):
        (one,) = lines([sys.executable, os.path.join(HERE, "fusion_ratio.py"), stream, "--voxel", voxel, "--rounds", "1", "--ours", ours])
        mean = f"mesh off by {one['ours_err_mean_mm']:.2f} mm in the mean"
        yield f"fusion of an image at {float(voxel) * 1e3:.0f} mm", f"open3d {version('open3d')}", one["open3d_cpu_ms"], one["ours_cpu_ms"], mean


def digits(ms):
    """Three digits, without an exponent."""
    return f"{float(f'{ms:.3g}'):.10f}".rstrip("0").rstrip(".")


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("--out", required=True, help="CSV to write")
    a.add_argument("--rounds", type=int, default=3)
    a.add_argument("--ours", help="the binary `library_figures`, with `unwrap` beside it (default: both built here with cargo)")
    a.add_argument("--only", default="", help="only the jobs whose name contains this: charts, programs, maps, ...")
    o = a.parse_args()
    ours = o.ours or library_figures()
    if not o.ours:
        build = ["cargo", "build", "--release", "-q", "-p", "paintcopter", "--features", "unwrap", "--bin", "unwrap"]
        subprocess.run(build, cwd=ROOT, check=True)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for job in (charts, atlases, programs, trajectories, graphs, films, calibrations, painters, maps):
            if o.only not in job.__name__:
                continue
            rounds = [list(job(ours, folder)) for _ in range(max(1, o.rounds))]
            for same in zip(*rounds):
                what, peer, *_, said = same[0]
                theirs, mine = (statistics.median(row[k] for row in same) for k in (2, 3))
                rows.append((mine / theirs, [what, peer, *(digits(ms) for ms in (theirs, mine)), f"{mine / theirs:.2g}", said]))
            print(f"{job.__name__}: {len(rounds[0])} rows", file=sys.stderr, flush=True)
    rows.sort(key=lambda row: -row[0])
    with open(o.out, "w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([HEAD, *(row for _, row in rows)])


if __name__ == "__main__":
    main()
