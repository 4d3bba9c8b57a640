#!/usr/bin/env python3
"""Independent evaluation of a UV layout: reads an OBJ with vt indices, prints one JSON object.

needs numpy only.   example:  python uv_evaluation.py atlas.obj --texel 0.0125
s1 >= |s2| are the signed singular values of the map surface triangle -> UV triangle times metres_per_uv;
metres_per_uv is sqrt(surface area / UV area) unless --metres-per-uv is given (1 = UVs already in metres).

  faces, charts          triangles (polygons are fanned); components joined by edges that share both v and vt
  flips                  triangles whose UV orientation is not positive, exact sign on the f64 of the written decimals
  flips_f32              the same after rounding the UVs to f32 (what a GPU or a glTF file sees)
  flips_in_chart         triangles of the minority sign inside their chart; mirrored_charts: charts of negative majority
  overlap_pairs          pairs of UV triangles whose interiors meet, exact; overlap_area_frac: sum of the pairs' common area / UV area
  arap                   sum A((s1-1)^2+(s2-1)^2)/sum A, s2 signed; arap_unmirrored: s2 signed by the chart's majority
  sym_dirichlet          sum A(s1^2+s2^2+s1^-2+s2^-2)/(4 sum A), 1 = isometry; null when a triangle is flipped in its chart
  l2_stretch             Sander: sqrt(sum A(s1^-2+s2^-2)/2 / sum A) at the area-preserving scale
  stretch_p99, _max      of max(s1, 1/|s2|) over faces; stretch_p99_area is weighted by surface area
  length_err_mean, _p99  area-weighted max(|s1-1|, ||s2|-1|): the metric error of a stroke
  seam_len, seam_ratio   length of surface edges whose two sides have different vt; divided by sqrt(surface area)
  boundary_ratio         open surface edges, divided by sqrt(surface area)
  util_unit, util_bbox   (UV area - overlaps) / unit square (null when a UV leaves it), / bounding box of the UVs
  scale_*                metres per uv unit of each chart, sqrt(A3/Auv): area-weighted mean, std, rel_std, min, max
exit status: 0 evaluated, 2 unreadable input."""

import argparse
import json
import math
import sys
from fractions import Fraction

import numpy as np

EPS_ORIENT = (3 + 16 * 2.0**-53) * 2.0**-53  # forward error bound of the naive 2x2 determinant


def read_obj(path):
    v, vt, fv, ft = [], [], [], []
    for no, line in enumerate(open(path, errors="replace"), 1):
        t = line.split()
        if not t or t[0] not in ("v", "vt", "f"):
            continue
        if t[0] == "v":
            v.append([float(x) for x in t[1:4]])
        elif t[0] == "vt":
            vt.append([float(x) for x in t[1:3]])
        else:
            p = [c.split("/") for c in t[1:]]
            if any(len(c) < 2 or not c[1] for c in p):
                raise ValueError(f"line {no}: face corner without a vt index")
            a = [int(c[0]) - 1 if int(c[0]) > 0 else len(v) + int(c[0]) for c in p]
            b = [int(c[1]) - 1 if int(c[1]) > 0 else len(vt) + int(c[1]) for c in p]
            for k in range(1, len(p) - 1):
                fv.append([a[0], a[k], a[k + 1]])
                ft.append([b[0], b[k], b[k + 1]])
    if not fv:
        raise ValueError("no faces")
    V, T, F, G = np.array(v), np.array(vt), np.array(fv), np.array(ft)
    if F.min() < 0 or G.min() < 0 or F.max() >= len(V) or G.max() >= len(T):
        raise ValueError("index out of range")
    if not (np.isfinite(V[F]).all() and np.isfinite(T[G]).all()):
        raise ValueError("non-finite coordinate")
    return V, T, F, G


def orient(a, b, c):
    """exact sign of the signed area of (a, b, c): float filter, rationals where it cannot tell"""
    l = (a[:, 0] - c[:, 0]) * (b[:, 1] - c[:, 1])
    r = (a[:, 1] - c[:, 1]) * (b[:, 0] - c[:, 0])
    d = l - r
    s = np.sign(d).astype(np.int8)
    for i in np.nonzero(np.abs(d) <= EPS_ORIENT * (np.abs(l) + np.abs(r)) + 1e-300)[0]:
        if (a[i] == c[i]).all() or (b[i] == c[i]).all() or (a[i] == b[i]).all():
            s[i] = 0
            continue
        ax, ay, bx, by, cx, cy = (Fraction(float(x)) for x in (*a[i], *b[i], *c[i]))
        e = (ax - cx) * (by - cy) - (ay - cy) * (bx - cx)
        s[i] = (e > 0) - (e < 0)
    return s


def charts_of(F, G):
    """chart label per face, and surface edges: list of (face, corner) sides per undirected v edge"""
    n = len(F)
    lo = np.minimum(F, F[:, [1, 2, 0]]).ravel()
    hi = np.maximum(F, F[:, [1, 2, 0]]).ravel()
    sw = (F > F[:, [1, 2, 0]]).ravel()
    t0, t1 = G.ravel(), G[:, [1, 2, 0]].ravel()
    tl, th = np.where(sw, t1, t0), np.where(sw, t0, t1)
    face = np.repeat(np.arange(n), 3)
    o = np.lexsort((th, tl, hi, lo))
    key = np.c_[lo, hi, tl, th][o]
    fo = face[o]
    same = (key[1:] == key[:-1]).all(1)
    parent = np.arange(n)

    def find(x):
        while parent[x] != x:
            parent[x] = parent[parent[x]]
            x = parent[x]
        return x

    for i in np.nonzero(same)[0]:
        a, b = find(fo[i]), find(fo[i + 1])
        if a != b:
            parent[max(a, b)] = min(a, b)
    lab = np.unique([find(i) for i in range(n)], return_inverse=True)[1]
    first = np.r_[True, (key[1:, :2] != key[:-1, :2]).any(1)]
    grp = np.cumsum(first) - 1
    count = np.bincount(grp)
    differ = np.bincount(grp[1:], weights=(~same) & ~first[1:], minlength=len(count)) > 0
    ends = key[first][:, :2]
    return lab, ends[differ], ends[count == 1], int((count > 2).sum())


def candidate_pairs(lo, hi, limit):
    """pairs whose open boxes meet; quad tree, each pair reported by the cell that holds its reference corner"""
    out, total = [], 0
    whole = (lo.min(0), hi.max(0) + 1e-6 * (hi.max(0) - lo.min(0)))
    stack = [(np.arange(len(lo)), whole[0], whole[1], 0)]
    while stack:
        idx, a, b, depth = stack.pop()
        if len(idx) < 2:
            continue
        if len(idx) > 48 and depth < 48:
            m = (a + b) / 2
            L, H = lo[idx], hi[idx]
            kids = []
            for x in (0, 1):
                for y in (0, 1):
                    ca = np.array([m[0] if x else a[0], m[1] if y else a[1]])
                    cb = np.array([b[0] if x else m[0], b[1] if y else m[1]])
                    k = idx[((H >= ca) & (L < cb)).all(1)]
                    kids.append((k, ca, cb, depth + 1))
            if sum(len(k[0]) for k in kids) < 2.5 * len(idx):
                stack += kids
                continue
        rows = max(1, 2_000_000 // len(idx))
        for r in range(0, len(idx), rows):
            i, j = np.nonzero(np.arange(len(idx))[None, :] > np.arange(r, min(r + rows, len(idx)))[:, None])
            p, q = idx[i + r], idx[j]
            ref = np.maximum(lo[p], lo[q])
            ok = (ref < np.minimum(hi[p], hi[q])).all(1) & (ref >= a).all(1) & (ref < b).all(1)
            out.append(np.c_[p[ok], q[ok]])
            total += int(ok.sum())
            if total > limit:
                break
        if total > limit:
            return np.concatenate(out), False
    return (np.concatenate(out) if out else np.zeros((0, 2), int)), True


def meets(P, Q):
    """interiors of positively oriented triangles meet: no edge line of either separates them"""
    sep = np.zeros(len(P), bool)
    for X, Y in ((P, Q), (Q, P)):
        for k in range(3):
            live = np.nonzero(~sep)[0]
            if not len(live):
                return ~sep
            a, b = X[live, k], X[live, (k + 1) % 3]
            away = np.ones(len(live), bool)
            for m in range(3):
                w = np.nonzero(away)[0]
                away[w] = orient(a[w], b[w], Y[live[w], m]) <= 0
            sep[live[away]] = True
    return ~sep


def clip_area(P, Q):
    poly = [tuple(x) for x in P]
    for k in range(3):
        (ax, ay), (bx, by) = Q[k], Q[(k + 1) % 3]
        side = [(bx - ax) * (y - ay) - (by - ay) * (x - ax) for x, y in poly]
        new = []
        for i, (p, s) in enumerate(zip(poly, side)):
            q, t = poly[(i + 1) % len(poly)], side[(i + 1) % len(poly)]
            if s >= 0:
                new.append(p)
            if s * t < 0:
                f = s / (s - t)
                new.append((p[0] + f * (q[0] - p[0]), p[1] + f * (q[1] - p[1])))
        poly = new
        if len(poly) < 3:
            return 0.0
    return 0.5 * abs(sum(p[0] * q[1] - q[0] * p[1] for p, q in zip(poly, poly[1:] + poly[:1])))


def wquantile(x, w, q):
    o = np.argsort(x)
    c = np.cumsum(w[o])
    return float(x[o][min(np.searchsorted(c, q * c[-1]), len(x) - 1)])


def evaluate(V, T, F, G, metres=None, texel=None, pair_limit=20_000_000):
    X, U = V[F], T[G]
    e1, e2 = X[:, 1] - X[:, 0], X[:, 2] - X[:, 0]
    A = 0.5 * np.linalg.norm(np.cross(e1, e2), axis=1)
    l = np.linalg.norm(e1, axis=1)
    h2 = np.maximum(l, np.linalg.norm(e2, axis=1)) ** 2
    ok = (A > 1e-14 * h2) & (l > 0)
    sgn = orient(U[:, 0], U[:, 1], U[:, 2])
    U32 = U.astype(np.float32).astype(np.float64)
    sgn32 = orient(U32[:, 0], U32[:, 1], U32[:, 2])
    lab, seam, bnd, nonman = charts_of(F, G)
    nch = int(lab.max()) + 1
    major = np.where(np.bincount(lab, weights=sgn, minlength=nch) < 0, -1, 1)
    wrong = sgn != major[lab]
    q1, q2 = U[:, 1] - U[:, 0], U[:, 2] - U[:, 0]
    AU = 0.5 * np.abs(q1[:, 0] * q2[:, 1] - q1[:, 1] * q2[:, 0])
    S, SU = A.sum(), AU.sum()
    k = metres if metres else math.sqrt(S / SU)
    ls, AA = np.where(ok, l, 1), np.where(ok, A, 1)
    x2, y2 = (e1 * e2).sum(1) / ls, 2 * AA / ls
    a, c = k * q1[:, 0] / ls, k * q1[:, 1] / ls
    b, d = (k * q2[:, 0] - a * x2) / y2, (k * q2[:, 1] - c * x2) / y2
    p, m = np.hypot(a + d, c - b) / 2, np.hypot(a - d, c + b) / 2
    s1, s2 = (p + m)[ok], (p - m)[ok]
    w = A[ok]
    W = w.sum()
    s2a = np.maximum(np.abs(s2), 1e-300)
    t2 = s2 * major[lab][ok]
    sd = float((w * (s1**2 + s2**2 + 1 / np.maximum(s1, 1e-300) ** 2 + 1 / s2a**2)).sum() / (4 * W))
    st = np.maximum(s1, 1 / s2a)
    err = np.maximum(np.abs(s1 - 1), np.abs(s2a - 1))
    g = math.sqrt(SU * k * k / S)
    good = sgn != 0
    P = np.where((sgn < 0)[:, None, None], U[:, ::-1], U)
    gi = np.nonzero(good)[0]
    cand, full = candidate_pairs(P[gi].min(1), P[gi].max(1), pair_limit)
    cand = gi[cand]
    hit = (
        np.concatenate(
            [
                cand[s : s + 500_000][meets(P[cand[s : s + 500_000, 0]], P[cand[s : s + 500_000, 1]])]
                for s in range(0, len(cand), 500_000)
            ]
        )
        if len(cand)
        else np.zeros((0, 2), int)
    )
    step = max(1, len(hit) // 20_000)
    ov = step * sum(clip_area(P[i], P[j]) for i, j in hit[::step])
    a3, au = np.bincount(lab, weights=A, minlength=nch), np.bincount(lab, weights=AU, minlength=nch)
    sc = np.sqrt(a3 / np.maximum(au, 1e-300))
    mean = float((a3 * sc).sum() / S)
    std = math.sqrt(float((a3 * (sc - mean) ** 2).sum() / S))
    length = lambda E: float(np.linalg.norm(V[E[:, 0]] - V[E[:, 1]], axis=1).sum())
    lo, hi = U.reshape(-1, 2).min(0), U.reshape(-1, 2).max(0)
    inside = bool((lo >= 0).all() and (hi <= 1).all())
    fin = lambda x: x if math.isfinite(x) else None
    r = dict(
        faces=len(F),
        charts=nch,
        surface_area=float(S),
        uv_area=float(SU),
        metres_per_uv=float(k),
        degenerate_surface=int((~ok).sum()),
        degenerate_uv=int((sgn == 0).sum()),
        non_manifold_edges=nonman,
        flips=int((sgn <= 0).sum()),
        flips_f32=int((sgn32 <= 0).sum()),
        flips_in_chart=int(wrong.sum()),
        mirrored_charts=int((major < 0).sum()),
        overlap_pairs=len(hit),
        overlap_complete=full,
        overlap_area_frac=float(ov / SU),
        arap=float((w * ((s1 - 1) ** 2 + (s2 - 1) ** 2)).sum() / W),
        arap_unmirrored=float((w * ((s1 - 1) ** 2 + (t2 - 1) ** 2)).sum() / W),
        sym_dirichlet=None if wrong.any() else fin(sd),
        l2_stretch=fin(float(np.sqrt((w * (1 / np.maximum(s1, 1e-300) ** 2 + 1 / s2a**2) / 2).sum() / W) * g)),
        stretch_p99=fin(float(np.quantile(st, 0.99))),
        stretch_p99_area=fin(wquantile(st, w, 0.99)),
        stretch_max=fin(float(st.max())),
        length_err_mean=float((w * err).sum() / W),
        length_err_p99=fin(wquantile(err, w, 0.99)),
        seam_len=length(seam),
        seam_ratio=length(seam) / math.sqrt(S),
        boundary_ratio=length(bnd) / math.sqrt(S),
        util_unit=float((SU - ov)) if inside else None,
        util_bbox=float((SU - ov) / np.prod(hi - lo)),
        scale_mean=mean,
        scale_std=std,
        scale_rel_std=std / mean,
        scale_min=float(sc.min()),
        scale_max=float(sc.max()),
    )
    if texel:
        r["atlas_px"] = [int(math.ceil(x)) for x in (hi - lo) * k / texel]
        r["length_err_p99_px_per_32px"] = None if r["length_err_p99"] is None else 32 * r["length_err_p99"]
    return r


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("obj")
    ap.add_argument("--metres-per-uv", type=float, help="one global scale to compare against (default: area-preserving)")
    ap.add_argument("--texel", type=float, help="texel edge in metres: adds the atlas size in pixels")
    ap.add_argument(
        "--pair-limit",
        type=int,
        default=20_000_000,
        help="stop after this many candidate pairs (then overlap_complete is false)",
    )
    a = ap.parse_args()
    try:
        r = evaluate(*read_obj(a.obj), a.metres_per_uv, a.texel, a.pair_limit)
    except (OSError, ValueError) as e:
        print(f"uv_evaluation: {a.obj}: {e}", file=sys.stderr)
        return 2
    print(json.dumps({k: (float(f"{v:.12g}") if isinstance(v, float) else v) for k, v in r.items()}, allow_nan=False))
    return 0


if __name__ == "__main__":
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        sys.exit(main())
