#!/usr/bin/env python3
"""Peers of paint-sim on one core: Kubelka-Munk in numpy, colours with colour-science. One JSON line per figure.

  pip install numpy colour-science
  python3 sim_peers.py                   then: cargo run --release -p paintcopter-benches --bin library_figures -- sim
  python3 sim_peers.py --count 100000    fewer films and colours

km_*_x36: reflectance of films over 36 bands, K and S of one paint, thickness 0 to 60 um. `coth` is the printed form, which
loses digits for thin and weakly absorbing films; `exp` the form without cancellation that paint-sim uses.
xyz_to_lab, de00: colours one by one, as arrays. cpu_ms = median of the runs, CPU time of the process."""

import argparse
import json
import os
import statistics
import time

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
import numpy as np


def measure(fig, peer, count, runs, job):
    job()
    times = []
    for _ in range(runs):
        start = time.process_time()
        job()
        times.append(time.process_time() - start)
    print(json.dumps(dict(fig=fig, peer=peer, count=count, runs=runs, cpu_ms=round(1e3 * statistics.median(times), 2))))


def reflectance_coth(k, s, d, ground):
    """Kubelka 1948, as printed."""
    a = 1 + k / s
    b = np.sqrt(a * a - 1)
    c = b / np.tanh(b * s * d)
    return (1 - ground * (a - c)) / (a - ground + c)


def reflectance_exp(k, s, d, ground):
    """The same with t = tanh(g d)/g, g = sqrt(K (K + 2 S))."""
    g = np.sqrt(k) * np.sqrt(k + 2 * s)
    x = g * d
    e = np.exp(-2 * x)
    t = np.where(x < 0.1, d * (1 - x * x / 3), (1 - e) / (np.maximum(g, 1e-30) * (1 + e)))
    scattered = s * (1 - ground)
    return (ground + t * (scattered - k * ground)) / (1 + t * (scattered + k))


def films(count, runs):
    rng = np.random.default_rng(2)
    bands = np.linspace(380, 730, 36)
    for name, kind in (("f32", np.float32), ("f64", np.float64)):
        k = (1e5 / (1 + np.exp((bands - 500) / 20)) + 500).astype(kind)
        s = np.full(36, 5e4, kind)
        d = rng.uniform(1e-9, 60e-6, (count, 1)).astype(kind)
        for form in (reflectance_coth, reflectance_exp):
            peer = f"numpy_{np.__version__}_{form.__name__.split('_')[1]}"
            measure(f"km_{name}_x36", peer, count, runs, lambda: form(k, s, d, kind(0.5)))


def colours(count, runs):
    import colour

    peer = f"colour-science_{colour.__version__}"
    rng = np.random.default_rng(4)
    xyz = rng.uniform(0.01, 0.9, (count, 3))
    lab = rng.uniform([0, -80, -80], [100, 80, 80], (2, count, 3))
    measure("xyz_to_lab", peer, count, runs, lambda: colour.XYZ_to_Lab(xyz))
    measure("de00", peer, count, runs, lambda: colour.delta_E(lab[0], lab[1], method="CIE 2000"))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=1_000_000)
    parser.add_argument("--runs", type=int, default=5)
    a = parser.parse_args()
    if a.count < 1 or a.runs < 1:
        parser.error("--count and --runs must be at least 1")
    films(a.count, a.runs)
    colours(a.count, a.runs)


if __name__ == "__main__":
    main()
