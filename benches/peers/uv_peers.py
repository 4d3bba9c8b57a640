#!/usr/bin/env python3
"""Peers of uv-param, timed and measured: libigl (harmonic, LSCM, ARAP, SLIM), xatlas and uvunwrap. One JSON line per figure.

  pip install "libigl==2.6.3" "xatlas==0.0.11" "uvunwrap==0.3.0" numpy scipy
  taskset -c 0 python uv_peers.py disk   mesh.obj --runs 3 --cap 30        a disk: harmonic, lscm, arap, slim
  taskset -c 0 python uv_peers.py disk   mesh.obj --cut --only arap        cut a sphere along its longest shortest path first
  taskset -c 0 python uv_peers.py disk   mesh.obj --loop 2                 Loop-subdivide twice first
  taskset -c 0 python uv_peers.py closed mesh.obj --res 1024 --pad 2       xatlas: default, brute force, loose charts; uvunwrap
  ... --save DIR      also writes DIR/<mesh>_<figure>.obj with vt, ready for uv_evaluation.py

On one core the clock is CPU time (says "clock":"cpu"), on several it is wall time. s = median over runs.
arap = sum A((s1-1)^2+(s2-1)^2)/sum A (s2 signed); sd = sum A(s1^2+s2^2+s1^-2+s2^-2)/(4 sum A), 1 = isometry, |s2| where flipped.
xatlas mirrors whole charts: its arap counts s2 by the chart's majority sign, and mirrored charts are counted apart from flips."""

import argparse
import json
import os
import statistics
import time

import numpy as np
import scipy.sparse as sp

CPUS = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
CLOCK = time.process_time if CPUS == 1 else time.perf_counter


def emit(a, **k):
    name = os.path.basename(a.mesh) + (f"+loop{a.loop}" if a.loop else "") + ("+cut" if a.cut else "")
    k = {x: (float(f"{y:.7g}") if isinstance(y, float) else y) for x, y in k.items()}
    print(json.dumps(dict(mesh=name, clock="cpu" if CPUS == 1 else "wall", cpus=CPUS, **k)), flush=True)


def save(a, figure, V, F, uv, FU=None):
    if not a.save:
        return
    os.makedirs(a.save, exist_ok=True)
    stem = os.path.splitext(os.path.basename(a.mesh))[0]
    with open(os.path.join(a.save, f"{stem}_{figure}.obj"), "w") as f:
        f.writelines(f"v {x!r} {y!r} {z!r}\n" for x, y, z in V.tolist())
        f.writelines(f"vt {x!r} {y!r}\n" for x, y in uv.tolist())
        for t, u in zip((F + 1).tolist(), ((F if FU is None else FU) + 1).tolist()):
            f.write("f " + " ".join(f"{i}/{j}" for i, j in zip(t, u)) + "\n")


def median_time(fn, runs, cap):
    ts, r, start = [], None, CLOCK()
    for _ in range(runs):
        t = CLOCK()
        r = fn()
        ts.append(CLOCK() - t)
        if CLOCK() - start > cap:
            break
    return statistics.median(ts), len(ts), r


def load(a, igl):
    V, F = igl.read_triangle_mesh(a.mesh)
    used, F = np.unique(np.asarray(F), return_inverse=True)  # unreferenced vertices break libigl's solvers
    V, F = np.ascontiguousarray(V[used], dtype=np.float64), np.ascontiguousarray(F.reshape(-1, 3), dtype=np.int64)
    if a.cut:
        V, F = cut_longest(V, F, igl)
    for _ in range(a.loop):
        V, F = igl.loop(V, F)
        V, F = np.ascontiguousarray(V), np.ascontiguousarray(F).astype(np.int64)
    return V, F


def cut_longest(V, F, igl):
    from scipy.sparse.csgraph import dijkstra

    E = igl.edges(F)
    w = np.linalg.norm(V[E[:, 0]] - V[E[:, 1]], axis=1)
    g = sp.csr_matrix((np.r_[w, w], (np.r_[E[:, 0], E[:, 1]], np.r_[E[:, 1], E[:, 0]])), shape=(len(V),) * 2)
    s = int(np.argmax(dijkstra(g, indices=0)))
    d, pred = dijkstra(g, indices=s, return_predecessors=True)
    path = [int(np.argmax(d))]
    while path[-1] != s:
        path.append(int(pred[path[-1]]))
    on = {(min(x, y), max(x, y)) for x, y in zip(path, path[1:])}
    C = np.array([[(min(t[k], t[(k + 1) % 3]), max(t[k], t[(k + 1) % 3])) in on for k in range(3)] for t in F.tolist()])
    V, F, _ = igl.cut_mesh(V, F, C)
    return np.ascontiguousarray(V), np.ascontiguousarray(F)


def measures(V, F, uv, FU=None, metric=True, chart=None):
    FU = F if FU is None else FU
    e1, e2 = V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]
    l, A = np.linalg.norm(e1, axis=1), 0.5 * np.linalg.norm(np.cross(e1, e2), axis=1)
    ok = (A > 1e-14 * l * l) & (l > 0)
    l, AA = np.where(ok, l, 1), np.where(ok, A, 1)
    x2, y2 = (e1 * e2).sum(1) / l, 2 * AA / l
    q1, q2 = uv[FU[:, 1]] - uv[FU[:, 0]], uv[FU[:, 2]] - uv[FU[:, 0]]
    a, c = q1[:, 0] / l, q1[:, 1] / l
    b, d = (q2[:, 0] - a * x2) / y2, (q2[:, 1] - c * x2) / y2
    s, t = np.hypot(a + d, c - b) / 2, np.hypot(a - d, c + b) / 2
    s1, s2, A = (s + t)[ok], (s - t)[ok], A[ok]
    S = A.sum()
    k = 1.0 if metric else np.sqrt(S / (A * np.abs(s1 * s2)).sum())
    s1, s2, extra = s1 * k, s2 * k, {}
    if chart is not None:
        m = np.where(np.bincount(chart[ok], weights=np.sign(s2), minlength=chart.max() + 1) < 0, -1, 1)
        s2, extra = s2 * m[chart[ok]], dict(mirrored_charts=int((m < 0).sum()))
    n = np.maximum(np.abs(s2), 1e-12)
    st = np.maximum(s1, 1 / n)
    return dict(
        arap=float((A * ((s1 - 1) ** 2 + (s2 - 1) ** 2)).sum() / S),
        sd=float((A * (s1**2 + n**2 + np.maximum(s1, 1e-12) ** -2.0 + n**-2.0)).sum() / (4 * S)),
        flips=int((s2 <= 0).sum()),
        degenerate=int((~ok).sum()),
        l2=float(
            np.sqrt((A * (1 / n**2 + 1 / np.maximum(s1, 1e-12) ** 2) / 2).sum() / S * (A * np.abs(s1 * s2)).sum() / S)
        ),
        p99_stretch=float(np.quantile(st, 0.99)),
        max_stretch=float(st.max()),
        **extra,
    )


def disk(a):
    import igl

    V, F = load(a, igl)
    want = a.only.split(",") if a.only else ["harmonic", "lscm", "arap", "slim"]
    emit(a, fig="mesh", vertices=len(V), faces=len(F))
    loop = igl.boundary_loop(F).astype(np.int64)
    if len(loop) == 0:
        raise SystemExit("uv_peers: the mesh is closed; use --cut or the mode `closed`")
    area3 = igl.doublearea(V, F).sum()
    fit = lambda uv: np.ascontiguousarray(
        uv * np.sqrt(area3 / np.abs(igl.doublearea(np.c_[uv, 0 * uv[:, 0]], F)).sum())
    )

    def harmonic():
        b = igl.boundary_loop(F).astype(np.int64)
        return igl.harmonic(
            V, F, b, np.ascontiguousarray(igl.map_vertices_to_circle(np.asfortranarray(V), b.astype(np.int32))), 1
        )

    s, n, uv = median_time(harmonic, a.runs, a.cap)
    uv0 = fit(uv)
    if not np.isfinite(uv0).all():
        emit(a, fig="harmonic", error="non-finite UVs")
        return
    if "harmonic" in want:
        emit(a, fig="harmonic", s=s, runs=n, **measures(V, F, uv0))
        save(a, "harmonic", V, F, uv0)
    if "lscm" in want:

        def lscm():
            b = igl.boundary_loop(F)
            return igl.lscm(V, F, np.array([b[0], b[len(b) // 2]], dtype=np.int64), np.array([[0.0, 0], [1, 0]]))[0]

        try:
            s, n, uv = median_time(lscm, min(a.runs, 3), a.cap)
            emit(a, fig="lscm", s=s, runs=n, **measures(V, F, fit(uv)))
            save(a, "lscm", V, F, fit(uv))
        except RuntimeError as e:
            emit(a, fig="lscm", error=str(e))
    if "arap" in want:

        def arap(iters):
            d = igl.ARAPData()
            d.max_iter = iters
            b = np.array([int(F[0, 0])], np.int32)
            t0 = CLOCK()
            igl.arap_precomputation(V, F, 2, b, d)
            t1 = CLOCK()
            u = igl.arap_solve(np.ascontiguousarray(uv0[b]), d, uv0.copy())
            return np.ascontiguousarray(u), t1 - t0, (CLOCK() - t1) / iters

        for iters in (10, 50):
            try:
                s, n, (u, pre, per) = median_time(lambda: arap(iters), a.runs if iters == 10 else 1, a.cap)
            except RuntimeError as e:
                emit(a, fig=f"arap{iters}", error=str(e))
                continue
            if not np.isfinite(u).all():
                emit(a, fig=f"arap{iters}", error="non-finite UVs")
                continue
            emit(a, fig=f"arap{iters}", s=s, pre_s=pre, iter_s=per, runs=n, **measures(V, F, u))
            save(a, f"arap{iters}", V, F, u)
    if "slim" in want:
        start = uv0
        if measures(V, F, uv0)["flips"]:  # cotangents went negative: uniform weights are injective
            from scipy.sparse.linalg import spsolve

            Ad = igl.adjacency_matrix(F)
            L = (sp.diags(np.asarray(Ad.sum(1), float).ravel()) - Ad).tocsr()
            inner, x = np.setdiff1d(np.arange(len(V)), loop), np.zeros((len(V), 2))
            x[loop] = igl.map_vertices_to_circle(np.asfortranarray(V), loop.astype(np.int32))
            x[inner] = spsolve(L[inner][:, inner].tocsc(), -(L[inner][:, loop] @ x[loop]))
            start = fit(x)
        t0 = CLOCK()
        d = igl.slim_precompute(
            np.asfortranarray(V),
            np.asfortranarray(F.astype(np.int32)),
            np.asfortranarray(start),
            igl.MappingEnergyType.SYMMETRIC_DIRICHLET,
            np.zeros(0, np.int32),
            np.asfortranarray(np.zeros((0, 2))),
            0.0,
        )
        pre, its, E = CLOCK() - t0, [], []
        while True:
            t0 = CLOCK()
            u = np.ascontiguousarray(igl.slim_solve(d, 1)[:, :2])
            its.append(CLOCK() - t0)
            m = measures(V, F, u)
            E.append(round(m["sd"], 6))
            done = len(E) > 1 and (E[-2] - E[-1]) / E[-2] < 1e-5
            if done or sum(its) + its[-1] > a.cap or len(its) >= 200:
                break
        emit(
            a,
            fig="slim",
            s=pre + sum(its),
            pre_s=pre,
            iter_s=statistics.median(its),
            iters=len(its),
            converged=bool(done),
            trace=E,
            **m,
        )
        save(a, "slim", V, F, u)


def closed(a):
    import igl
    import xatlas

    V, F = load(a, igl)
    emit(a, fig="mesh", vertices=len(V), faces=len(F), bbox_diag=float(np.linalg.norm(np.ptp(V, axis=0))))
    X32, F32 = (V * a.scale).astype(np.float32), F.astype(np.uint32)

    def run(brute=False, cost=None, iters=None):
        at, co, po = xatlas.Atlas(), xatlas.ChartOptions(), xatlas.PackOptions()
        at.add_mesh(X32, F32)
        po.resolution, po.padding, po.bruteForce = a.res, a.pad, brute
        if cost:
            co.max_cost, co.max_iterations = cost, iters
        at.generate(co, po)
        return at

    for name, kw in (("default", {}), ("brute", dict(brute=True)), ("loose", dict(cost=16.0, iters=4))):
        if a.only and name not in a.only.split(","):
            continue
        s, n, at = median_time(lambda: run(**kw), a.runs, a.cap)
        vm, ix, uv = at[0]
        ix, wh = ix.astype(np.int64), np.array([at.width, at.height], float)
        u = uv.astype(np.float64) * wh  # pixels: xatlas divides by width and height separately
        q = u[ix]
        au = 0.5 * np.abs(
            (q[:, 1, 0] - q[:, 0, 0]) * (q[:, 2, 1] - q[:, 0, 1])
            - (q[:, 1, 1] - q[:, 0, 1]) * (q[:, 2, 0] - q[:, 0, 0])
        )
        ncomp, comp = igl.facet_components(ix)
        E = igl.boundary_facets(ix)
        E = E[0] if isinstance(E, tuple) else E
        X = V[vm]
        border = np.linalg.norm(X[E[:, 0]] - X[E[:, 1]], axis=1).sum()
        E0 = igl.boundary_facets(F)
        E0 = E0[0] if isinstance(E0, tuple) else E0
        open_ = np.linalg.norm(V[E0[:, 0]] - V[E0[:, 1]], axis=1).sum() if len(E0) else 0.0
        emit(
            a,
            fig="xatlas",
            variant=name,
            s=s,
            runs=n,
            charts=int(ncomp),
            width=int(at.width),
            height=int(at.height),
            pages=int(at.atlas_count),
            util_reported=float(at.utilization),
            util_true=float(au.sum() / wh.prod()),
            seam_ratio=float((border - open_) / 2 / np.sqrt(igl.doublearea(V, F).sum() / 2)),
            **measures(X, ix, u, metric=False, chart=np.asarray(comp)),
        )
        save(a, f"xatlas_{name}", V, vm[ix].astype(np.int64), u / wh.max(), ix)
    if not a.only or "uvunwrap" in a.only.split(","):
        import uvunwrap

        mesh = uvunwrap.Mesh(X32, F32)
        s, n, at = median_time(lambda: uvunwrap.generate([mesh], page_size=a.res, padding=a.pad), a.runs, a.cap)
        out, wh = at.meshes[0], np.array([at.width, at.height], float)
        ix = np.array(out.indices, dtype=np.int64).reshape(-1, 3)
        u = np.array(out.uv, dtype=np.float64).reshape(-1, 2) * wh
        q = u[ix]
        (ax, ay), (bx, by) = (q[:, 1] - q[:, 0]).T, (q[:, 2] - q[:, 0]).T
        util = float((0.5 * np.abs(ax * by - ay * bx)).sum() / wh.prod())
        emit(a, fig="uvunwrap", s=s, runs=n, charts=int(at.chart_count), pages=int(at.page_count), util_true=util)
        save(a, "uvunwrap", V, np.array(out.xref, dtype=np.int64)[ix], u / wh.max(), ix)


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("mode", choices=["disk", "closed"])
    ap.add_argument("mesh")
    ap.add_argument("--runs", type=int, default=3)
    ap.add_argument("--cap", type=float, default=60, help="seconds per figure")
    ap.add_argument("--loop", type=int, default=0, help="Loop subdivisions before the start")
    ap.add_argument("--cut", action="store_true", help="cut a sphere-like mesh to a disk along a farthest pair")
    ap.add_argument("--only", default="", help="comma list: harmonic,lscm,arap,slim or default,brute,loose,uvunwrap")
    ap.add_argument("--res", type=int, default=1024)
    ap.add_argument("--pad", type=int, default=2)
    ap.add_argument(
        "--scale", type=float, default=1.0, help="multiply the coordinates given to xatlas (it is not scale invariant)"
    )
    ap.add_argument("--save", metavar="DIR", default="")
    a = ap.parse_args()
    {"disk": disk, "closed": closed}[a.mode](a)


if __name__ == "__main__":
    main()
