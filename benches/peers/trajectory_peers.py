#!/usr/bin/env python3
"""evo as the peer of vio-ekf: the absolute error of one TUM trajectory against another. One JSON line per alignment.

  pip install evo
  python3 trajectory_peers.py reference.txt estimate.txt
  cargo run --release -p paintcopter-benches --bin library_figures -- ate reference.txt estimate.txt      same names, same rules
  cargo run --release -p paintcopter-benches --bin library_figures -- pair DIR                            writes 10,000 poses of either

Pairs are nearest in time within 10 ms. rmse_m, rmse_deg: root mean square of the position and the rotation after the
alignment. cpu_ms = median of the runs, CPU time: pairing, alignment and error, files already read."""

import argparse
import json
import statistics
import sys
import time

from evo.core import metrics, sync
from evo.tools import file_interface


def evaluate(reference, estimate, mode):
    """evo's steps for `evo_ape`, once for either part of the pose."""
    one, other = sync.associate_trajectories(reference, estimate, max_diff=0.01)
    if mode != "none":
        other.align(one, correct_scale=mode == "sim3")
    errors = {}
    for name, part in (
        ("rmse_m", metrics.PoseRelation.translation_part),
        ("rmse_deg", metrics.PoseRelation.rotation_angle_deg),
    ):
        ape = metrics.APE(part)
        ape.process_data((one, other))
        errors[name] = float(ape.get_statistic(metrics.StatisticsType.rmse))
    return one.num_poses, errors


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("reference")
    parser.add_argument("estimate")
    parser.add_argument("--runs", type=int, default=5)
    a = parser.parse_args()
    if a.runs < 1:
        parser.error("--runs must be at least 1")
    try:
        reference, estimate = (file_interface.read_tum_trajectory_file(f) for f in (a.reference, a.estimate))
    except (OSError, file_interface.FileInterfaceException) as error:
        sys.exit(f"trajectory_peers: {error}")
    for mode in ("none", "se3", "sim3"):
        times = []
        for _ in range(a.runs):
            start = time.process_time()
            pairs, errors = evaluate(reference, estimate, mode)
            times.append(time.process_time() - start)
        cpu_ms = round(1e3 * statistics.median(times), 3)
        print(json.dumps(dict(fig=f"ate_{mode}", peer="evo", pairs=pairs, **errors, cpu_ms=cpu_ms)))


if __name__ == "__main__":
    main()
