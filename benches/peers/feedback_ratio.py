#!/usr/bin/env python3
"""The feedback network beside L-BFGS at equal quality: both paint the same pictures in turn (A B A B ...), on one thread; then, per picture,
the network's PSNR, the fewest iterations at which L-BFGS has it too, and the ratio of the median CPU times. Prints one JSON line per picture
and one for their mean. Needs numpy, scipy, scikit-image and a Rust toolchain.

    python3 paint_baselines.py export --to five
    python3 feedback_ratio.py five                        five photographs of 128 x 128 pixels
    python3 feedback_ratio.py --rounds 5 --passes 6 DIR   more rounds, other passes
"""

import argparse
import glob
import json
import os
import statistics
import subprocess
import time
from argparse import Namespace

import numpy as np
import paint_baselines as peer
from ours import library_figures

MOST_ITERATIONS = 200


def timed(y, iterations):
    """PSNR and CPU seconds of L-BFGS stopped after so many iterations."""
    start = time.process_time()
    v, _ = peer.solve(y, 2, iterations)
    o = np.tanh(peer.G(v))
    return peer.psnr(o, y), time.process_time() - start


def iterations_for(y, wanted):
    """The fewest iterations with that PSNR, by bisection; all of them if none have it."""
    low, high = 1, MOST_ITERATIONS
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if timed(y, middle)[0] >= wanted else (middle + 1, high)
    return low


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("folder")
    a.add_argument("--passes", type=int, default=6)
    a.add_argument("--rounds", type=int, default=3)
    a.add_argument("--ours", help="the binary `library_figures` (default: built here with cargo)")
    o = a.parse_args()
    ours = o.ours or library_figures()
    lines = []
    for file in sorted(glob.glob(os.path.join(o.folder, "*.png"))):
        ((_, y),) = peer.pictures(Namespace(image=[file], size=128))
        iterations, mine, theirs = None, [], []
        for _ in range(o.rounds):
            command = [ours, "paint", "--image", file, "--passes", str(o.passes)]
            one = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
            iterations = iterations or iterations_for(y, one["psnr"])
            psnr, seconds = timed(y, iterations)
            mine.append(one["cpu_s"])
            theirs.append(seconds)
        mine, theirs = statistics.median(mine), statistics.median(theirs)
        line = dict(
            figure="feedback_ratio",
            image=os.path.basename(file),
            ours_psnr=round(one["psnr"], 3),
            lbfgs_psnr=round(psnr, 3),
            lbfgs_iterations=iterations,
            ours_cpu_ms=round(1e3 * mine, 3),
            lbfgs_cpu_ms=round(1e3 * theirs, 2),
            ratio=round(theirs / mine, 2),
        )
        print(json.dumps(line), flush=True)
        lines.append(line)
    mean = {
        k: round(statistics.mean(line[k] for line in lines), 3)
        for k in ("ours_psnr", "lbfgs_iterations", "ours_cpu_ms", "lbfgs_cpu_ms", "ratio")
    }
    print(json.dumps(dict(figure="feedback_ratio", image="mean", **mean)))


main()
