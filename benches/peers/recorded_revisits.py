#!/usr/bin/env python3
"""Which frames of a second recording, in the 7-Scenes layout and the world of a first one, `scan --relocalise` places, each for itself, by
how much of what they see was mapped. Needs numpy and pillow.

    scan --sequence KITCHEN --frames 0..200:2 --poses given --voxel 0.02 --out map
    python3 recorded_revisits.py KITCHEN SPARSE map/map.tsdf --scan PROGRAM

A measured point counts as mapped where every tenth frame of the first recording has one within the same cell of 5 cm or beside it.
`wrong` are placed frames that lie more than 5 cm or 5 degrees from the given pose (the bound that is usual for 7-Scenes).
"""

import argparse
import glob
import os
import subprocess
import tempfile

import numpy as np
from PIL import Image

CELL = 0.05
RATE = 30.0


def pose(name):
    return np.loadtxt(name.replace(".depth.png", ".pose.txt"))


def points(name, k):
    depth = np.array(Image.open(name))[::4, ::4]
    v, u = 4 * np.mgrid[: depth.shape[0], : depth.shape[1]]
    z = depth / 1000.0
    ok = (z > 0.3) & (z < 4.0)
    p = np.stack([(u - k[0, 2]) / k[0, 0] * z, (v - k[1, 2]) / k[1, 1] * z, z], -1)[ok]
    m = pose(name)
    return p @ m[:3, :3].T + m[:3, 3]


def cells(p):
    return np.unique(np.floor(p / CELL).astype(np.int64), axis=0)


def code(c):
    return ((c[:, 0] + 5000) * 10000 + c[:, 1] + 5000) * 10000 + c[:, 2] + 5000


def rotation(q):
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def alone(a, index):
    """Where `scan` places one frame, by its number; empty if it does not."""
    with tempfile.TemporaryDirectory() as out:
        frames = f"{index}..{index + 1}"
        subprocess.run([a.scan, "--sequence", a.revisits, "--frames", frames, "--relocalise", a.map, "--out", out, "--quiet"], stderr=subprocess.DEVNULL)
        try:
            rows = np.loadtxt(os.path.join(out, "trajectory.tum"), ndmin=2)
        except OSError:
            return {}
    return {round(row[0] * RATE): row[1:] for row in rows}


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("mapped")
    p.add_argument("revisits")
    p.add_argument("map")
    p.add_argument("--scan", default="scan", help="the program `scan`")
    a = p.parse_args()
    k = np.loadtxt(a.mapped + "/camera-intrinsics.txt")
    seen = np.unique(np.concatenate([cells(points(n, k)) for n in sorted(glob.glob(a.mapped + "/*.depth.png"))[::10]]), axis=0)
    around = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3), -1).reshape(-1, 3)
    near = np.unique(np.concatenate([code(seen + d) for d in around]))
    rows = []
    for index, name in enumerate(sorted(glob.glob(a.revisits + "/*.depth.png"))):
        placed = alone(a, index)
        number = int(os.path.basename(name).split("-")[1].split(".")[0])
        share = np.isin(code(np.floor(points(name, k) / CELL).astype(np.int64)), near).mean()
        found, wrong = number in placed, False
        if found:
            truth, got = pose(name), placed[number]
            turn = np.degrees(np.arccos(np.clip((np.trace(truth[:3, :3].T @ rotation(got[3:])) - 1) / 2, -1, 1)))
            off = np.linalg.norm(truth[:3, 3] - got[:3])
            wrong = off > 0.05 or turn > 5
        rows.append((share, found, wrong))
        where = f", placed {100 * off:.1f} cm and {turn:.1f} degrees off" if found else ""
        print(f"frame {number}: {share:.0%} of it mapped{where}")
    for least in (0.4, 0.5, 0.6, 0.7, 0.8, 0.9):
        these = [(found, wrong) for share, found, wrong in rows if share >= least]
        found = sum(f for f, _ in these)
        print(f"mapped to {least:.0%} or more: {found} of {len(these)} placed")
    print(f"placed {sum(f for _, f, _ in rows)} of {len(rows)}, wrong {sum(w for *_, w in rows)}")


main()
