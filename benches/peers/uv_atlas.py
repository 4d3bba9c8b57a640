#!/usr/bin/env python3
"""Atlases by uv-param (the binary `unwrap`), by xatlas and by uvunwrap on the same meshes in one run, all evaluated by
uv_evaluation.py. Prints one Markdown row per mesh and tool.  Needs numpy, scipy, libigl, xatlas, uvunwrap and a Rust toolchain.

    python3 uv_atlas.py a.obj b.off ...
    python3 uv_atlas.py --unwrap target/release/unwrap --gutter 2 --page 1024 a.obj

s is CPU time of one thread without reading and writing; charts in parentheses are mirrored; seam is relative to the square root
of the area; p99 and max are of the stretch max(s1, 1/|s2|); util is the share of the page that charts cover; overlaps are
pairs of faces. Ours is measured in metres, the others in the scale that keeps their area. The texel of ours is chosen so that a page of --page texels holds the surface when two thirds are used."""

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile

import numpy as np
import uv_evaluation as evaluation

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))


def area_of(path):
    """Area of a mesh, from the positions and fanned faces of an OBJ or OFF file."""
    points, faces = [], []
    lines = [line.split("#")[0].split() for line in open(path, errors="replace")]
    lines = [words for words in lines if words]
    if lines[0][0].startswith("OFF"):
        count, face_count = (int(n) for n in lines[1][:2])
        points = [[float(x) for x in words[:3]] for words in lines[2 : 2 + count]]
        polygons = [[int(i) for i in words[1 : 1 + int(words[0])]] for words in lines[2 + count : 2 + count + face_count]]
    else:
        points = [[float(x) for x in words[1:4]] for words in lines if words[0] == "v"]
        corners = [[int(c.split("/")[0]) for c in words[1:]] for words in lines if words[0] == "f"]
        polygons = [[i - 1 if i > 0 else len(points) + i for i in corner] for corner in corners]
    for polygon in polygons:
        faces += [[polygon[0], polygon[k], polygon[k + 1]] for k in range(1, len(polygon) - 1)]
    corners = np.array(points)[np.array(faces)]
    return 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()


def run(command):
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stdout, done.stderr.strip(), done.returncode


def row(mesh, tool, seconds, path, utilisation, metres=None, aspect=1.0):
    """`aspect` is the height of a page over its width: v is in units of the height."""
    positions, coordinates, faces, coordinate_faces = evaluation.read_obj(path)
    e = evaluation.evaluate(positions, coordinates * [1.0, aspect], faces, coordinate_faces, metres)
    cells = [
        f"{mesh} ({e['faces']})",
        tool,
        f"{seconds:.2f}",
        f"{e['charts']}" + (f" ({e['mirrored_charts']})" if e["mirrored_charts"] else ""),
        f"{e['seam_ratio']:.2f}",
        f"{utilisation:.3f}",
        f"{e['stretch_p99']:.3f}",
        f"{e['stretch_max']:.2f}" if e["stretch_max"] is not None and e["stretch_max"] < 1e3 else "collapsed",
        f"{e['flips_in_chart']} / {e['overlap_pairs']}",
    ]
    print("| " + " | ".join(cells) + " |", flush=True)


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("mesh", nargs="+")
    a.add_argument("--unwrap", help="the binary `unwrap` (default: built here with cargo)")
    a.add_argument("--gutter", type=int, default=2)
    a.add_argument("--page", type=int, default=1024)
    a.add_argument("--utilisation", help="that of `unwrap`: charts are cut until they fill this share of the page")
    a.add_argument("--max-stretch", help="that of `unwrap` (default: its own, which it relaxes)")
    a.add_argument("--without-peers", action="store_true")
    o = a.parse_args()
    unwrap = o.unwrap
    if not unwrap:
        subprocess.run(["cargo", "build", "--release", "-q", "--bin", "unwrap"], cwd=ROOT, check=True)
        unwrap = os.path.join(ROOT, "target", "release", "unwrap")
    print("| mesh (faces) | tool | s | charts | seam | util | p99 | max | flips / overlaps |\n" + "|---" * 9 + "|")
    with tempfile.TemporaryDirectory() as folder:
        for path in o.mesh:
            stem = os.path.splitext(os.path.basename(path))[0]
            out = os.path.join(folder, stem)
            texel = math.sqrt(1.5 * area_of(path)) / o.page
            command = [unwrap, "--mesh", path, "--scale", "1", "--texel", f"{texel:.6g}", "--gutter", str(o.gutter), "--out", out]
            for option, value in (("--utilisation", o.utilisation), ("--max-stretch", o.max_stretch)):
                command += [option, value] if value else []
            _, error, code = run(command)
            if code:
                print(f"{stem}: unwrap: {error}", file=sys.stderr)
            else:
                report = json.load(open(os.path.join(out, "report.json")))
                metres = report["page_width_px"] * report["texel_m"]
                aspect = report["page_height_px"] / report["page_width_px"]
                row(stem, "unwrap", report["cpu_s"], os.path.join(out, "atlas.obj"), report["utilisation"], metres, aspect)
            if o.without_peers:
                continue
            peers = [sys.executable, os.path.join(HERE, "uv_peers.py"), "closed", path, "--runs", "1"]
            peers += ["--res", str(o.page), "--pad", str(o.gutter), "--only", "default,uvunwrap", "--save", folder]
            text, error, code = run(["taskset", "-c", "0", *peers])
            lines = [json.loads(line) for line in text.splitlines() if line.startswith("{")]
            for tool, file in [("xatlas", f"{stem}_xatlas_default.obj"), ("uvunwrap", f"{stem}_uvunwrap.obj")]:
                found = [line for line in lines if line.get("fig") == tool]
                saved = os.path.join(folder, file)
                if not found or not os.path.exists(saved):
                    print(f"{stem}: {tool}: {error[-300:]}", file=sys.stderr)
                else:
                    row(stem, tool, found[-1]["s"], saved, found[-1]["util_true"])


if __name__ == "__main__":
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        main()
