#!/usr/bin/env python3
"""General QP solvers as peers of paint-planner's: the same programs, each in the form it takes. One JSON line per solver.

  pip install clarabel osqp piqp daqp
  cargo run --release -p paintcopter-benches --bin library_figures -- planner-instances DIR   writes DIR/path_2000, DIR/path_20000
  python3 planner_peers.py DIR/path_2000 DIR/states
  cargo run --release -p paintcopter-benches --bin library_figures -- planner                 same names, same rules

min 1/2 x'Px + q'x subject to A x <= b; the variables after the first `states` relax one row each. cpu_ms = median of the runs, CPU time
of one thread for setup and solution, matrices already in the solver's format. objective and violation are taken from the states alone:
relaxations are as large as the states make them. DAQP takes dense matrices and is left out above 500 variables.

DIR/states holds the programs of single states, five variables and nine rows, those whose rows can all be held. cpu_us = median time of one;
solver_us = what the solver itself says, where it does. off = largest difference from our state."""

import argparse
import json
import statistics
import sys
import time
from pathlib import Path

import numpy as np
from scipy import sparse

DENSE = 500


def read(folder):
    arrays = {path.stem: np.load(path) for path in Path(folder).glob("*.npy")}
    n, m = len(arrays["q"]), len(arrays["b"])

    def matrix(name, shape):
        places = arrays[f"{name}_row"].astype(int), arrays[f"{name}_column"].astype(int)
        return sparse.csc_matrix((arrays[f"{name}_value"], places), shape=shape)

    return matrix("p", (n, n)), arrays["q"], matrix("a", (m, n)), arrays["b"], int(arrays["states"][0])


def clarabel_solver(p, q, a, b):
    import clarabel

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    cones = [clarabel.NonnegativeConeT(len(b))]
    return lambda: np.array(clarabel.DefaultSolver(p, q, a, b, cones, settings).solve().x)


def osqp_solver(p, q, a, b):
    import osqp

    low = np.full(len(b), -np.inf)

    def solve():
        solver = osqp.OSQP()
        solver.setup(p, q, a, low, b, verbose=False, eps_abs=1e-6, eps_rel=1e-6, max_iter=20000)
        return solver.solve().x

    return solve


def piqp_solver(p, q, a, b):
    import piqp

    whole = (p + sparse.triu(p, 1).T).tocsc()
    none = sparse.csc_matrix((0, len(q)))

    def solve():
        solver = piqp.SparseSolver()
        solver.settings.verbose = False
        solver.setup(whole, q, none, np.zeros(0), a, None, b)
        solver.solve()
        return solver.result.x

    return solve


def daqp_solver(p, q, a, b):
    import daqp
    from ctypes import c_int

    whole = np.ascontiguousarray((p + sparse.triu(p, 1).T).toarray())
    rows = np.ascontiguousarray(a.toarray())
    low = np.full(len(b), -1e30)
    sense = np.zeros(len(b), dtype=c_int)
    return lambda: daqp.solve(whole, q, rows, b, low, sense)[0]


def quality(x, p, q, a, b, states):
    x = np.concatenate([x[:states], np.zeros(len(q) - states)])
    rows = len(b) - (len(q) - states)
    excess = (a @ x - b)[:rows]
    relaxing = a[:rows, states:].tocoo()
    soft = np.zeros(rows, dtype=bool)
    soft[relaxing.row] = True
    penalty = np.zeros(rows)
    penalty[relaxing.row] = q[states + relaxing.col]
    objective = 0.5 * x @ (p + sparse.triu(p, 1).T) @ x + q[:states] @ x[:states] + penalty @ np.maximum(excess, 0)
    return float(objective), float(max(0.0, excess[~soft].max(initial=0.0)))


def single_states(folder, count):
    arrays = {name: np.load(Path(folder) / f"{name}.npy") for name in ("h", "g", "rows", "bounds", "x")}
    n = len(arrays["g"]) // 5
    h, g, a, b, x = (arrays[k].reshape(n, *s) for k, s in (("h", (5, 5)), ("g", (5,)), ("rows", (9, 5)), ("bounds", (9,)), ("x", (5,))))
    chosen = range(0, n, max(1, n // count))

    def daqp_one(i):
        import daqp
        from ctypes import c_int

        found, _, _, info = daqp.solve(h[i], g[i], a[i], b[i], np.full(9, -1e30), np.zeros(9, dtype=c_int))
        return found, info.get("solve_time", 0) + info.get("setup_time", 0)

    def clarabel_one(i):
        solve = clarabel_solver(sparse.csc_matrix(np.triu(h[i])), g[i], sparse.csc_matrix(a[i]), b[i])
        return solve(), None

    for name, one in (("daqp", daqp_one), ("clarabel", clarabel_one)):
        times, inside, off = [], [], 0.0
        try:
            for i in chosen:
                began = time.thread_time()
                found, own = one(i)
                times.append(time.thread_time() - began)
                inside += [] if own is None else [own]
                off = max(off, float(np.abs(found - x[i]).max()))
        except ImportError as error:
            print(json.dumps(dict(fig="state_programs", peer=name, failed=str(error))))
            continue
        figures = dict(fig="state_programs", peer=name, programs=len(times), cpu_us=round(1e6 * statistics.median(times), 3), off=off)
        if inside:
            figures["solver_us"] = round(1e6 * statistics.median(inside), 3)
        print(json.dumps(figures), flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="+")
    parser.add_argument("--runs", type=int, default=5)
    a = parser.parse_args()
    for folder in a.folder:
        if (Path(folder) / "h.npy").exists():
            single_states(folder, 2000)
            continue
        try:
            p, q, rows, b, states = read(folder)
        except (OSError, KeyError) as error:
            sys.exit(f"planner_peers: {folder}: {error}")
        for name, prepare in (("clarabel", clarabel_solver), ("osqp 1e-6", osqp_solver), ("piqp", piqp_solver), ("daqp", daqp_solver)):
            if name == "daqp" and len(q) > DENSE:
                continue
            try:
                solve = prepare(p, q, rows, b)
                times = []
                for _ in range(max(1, a.runs)):
                    began = time.thread_time()
                    x = np.asarray(solve())
                    times.append(time.thread_time() - began)
            except ImportError as error:
                print(json.dumps(dict(fig=Path(folder).name, peer=name, failed=str(error))))
                continue
            objective, violation = quality(x, p, q, rows, b, states)
            figures = dict(fig=Path(folder).name, peer=name, variables=len(q), rows=len(b), objective=objective, violation=violation)
            print(json.dumps(dict(**figures, cpu_ms=round(1e3 * statistics.median(times), 3))), flush=True)


if __name__ == "__main__":
    main()
