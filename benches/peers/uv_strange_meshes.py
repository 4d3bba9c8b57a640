#!/usr/bin/env python3
"""Eighteen meshes of kinds that no test has, made by formulas: a bumpy statue, a figure, a boot, bark, a wheel, a knot, cloth, spikes, a castle of
cubes, a shell, a cup, a chain, a facade, a gem, a coral, a noisy bowl, a mask with holes, a screw. Needs numpy and scipy.

    python3 uv_strange_meshes.py FOLDER                    writes FOLDER/NAME.obj
    python3 uv_atlas.py FOLDER/*.obj                       lays them out beside xatlas and uvunwrap and prints the table
"""

import os
import sys
from math import pi

import numpy as np
from scipy.spatial import ConvexHull

out = sys.argv[1]
os.makedirs(out, exist_ok=True)


def save(n, V, F):
    with open(f"{out}/{n}.obj", "w") as f:
        for v in V:
            f.write("v %.7f %.7f %.7f\n" % tuple(v))
        for t in F:
            f.write("f %d %d %d\n" % tuple(int(i) + 1 for i in t))
    print(n, len(V), len(F))


def grid(nu, nv, wu, wv):
    F = []
    for j in range(nv if wv else nv - 1):
        for i in range(nu if wu else nu - 1):
            a = j * nu + i
            b = j * nu + (i + 1) % nu
            c = ((j + 1) % nv) * nu + (i + 1) % nu
            d = ((j + 1) % nv) * nu + i
            F += [[a, b, c], [a, c, d]]
    return F


def noise(P, seed, f, oct=4):
    r = np.random.default_rng(seed)
    s = np.zeros(len(P))
    for o in range(oct):
        for _ in range(6):
            d = r.normal(size=3)
            d /= np.linalg.norm(d)
            s += np.sin(P @ d * f * 2**o + r.uniform(0, 6.28)) / 2**o / 2.4
    return s


# implicit -> marching tetrahedra
def iso(fn, lo, hi, n):
    ax = [np.linspace(lo[k], hi[k], n[k]) for k in range(3)]
    X, Y, Z = np.meshgrid(*ax, indexing="ij")
    P = np.stack([X, Y, Z], -1)
    D = fn(P.reshape(-1, 3)).reshape(n)
    idx = np.arange(np.prod(n)).reshape(n)
    Pf = P.reshape(-1, 3)
    Df = D.ravel()
    Df = np.where(np.abs(Df) < 1e-9, 1e-9, Df)
    c = [
        idx[a : n[0] - 1 + a, b : n[1] - 1 + b, e : n[2] - 1 + e].ravel()
        for a in (0, 1)
        for b in (0, 1)
        for e in (0, 1)
    ]
    tets = [(0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7)]
    verts = {}
    V = []
    F = []

    def cut(a, b):
        k = (min(a, b), max(a, b))
        if k not in verts:
            t = Df[a] / (Df[a] - Df[b])
            V.append(Pf[a] + t * (Pf[b] - Pf[a]))
            verts[k] = len(V) - 1
        return verts[k]

    for t in tets:
        T = np.stack([c[k] for k in t], 1)
        s = Df[T] < 0
        m = s.sum(1)
        for row, si in zip(T[(m > 0) & (m < 4)], s[(m > 0) & (m < 4)]):
            ins = [r for r, q in zip(row, si) if q]
            o = [r for r, q in zip(row, si) if not q]
            if len(ins) == 1 or len(o) == 1:
                p = ins[0] if len(ins) == 1 else o[0]
                q = o if len(ins) == 1 else ins
                tri = [cut(p, x) for x in q]
                tris = [tri]
            else:
                a, b = ins
                c2, d = o
                q = [cut(a, c2), cut(a, d), cut(b, d), cut(b, c2)]
                tris = [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]
            g = np.mean([Pf[x] for x in o], 0) - np.mean([Pf[x] for x in ins], 0)
            for tr in tris:
                if len(set(tr)) < 3:
                    continue
                n_ = np.cross(V[tr[1]] - V[tr[0]], V[tr[2]] - V[tr[0]])
                F.append(tr if n_ @ g > 0 else [tr[0], tr[2], tr[1]])
    V = np.array(V)
    # weld near-coincident, drop slivers by snapping
    return V, np.array(F)


def clean(V, F, e):
    q = np.round(V / e).astype(np.int64)
    _, first, inv = np.unique(q, axis=0, return_index=True, return_inverse=True)
    F = inv.ravel()[F]
    F = F[(F[:, 0] != F[:, 1]) & (F[:, 1] != F[:, 2]) & (F[:, 0] != F[:, 2])]
    return V[first], F


sd = lambda P, c, r: np.linalg.norm(P - np.array(c), axis=1) - r


def caps(P, a, b, r0, r1):
    a = np.array(a, float)
    b = np.array(b, float)
    t = np.clip(((P - a) @ (b - a)) / ((b - a) @ (b - a)), 0, 1)
    return np.linalg.norm(P - (a + t[:, None] * (b - a)), axis=1) - (r0 + (r1 - r0) * t)


def smin(a, b, k):
    h = np.clip(0.5 + 0.5 * (b - a) / k, 0, 1)
    return b + (a - b) * h - k * h * (1 - h)


# 1 bumpy statue open below
nu, nv = 120, 160
u = np.linspace(0, 2 * pi, nu, endpoint=False)
v = np.linspace(0, 1, nv)
U, T = np.meshgrid(u, v)
U = U.ravel()
T = T.ravel()
R = 0.35 + 0.12 * np.sin(5 * T) - 0.25 * T**6 + 0.02
P = np.stack([R * np.cos(U), R * np.sin(U) * 0.8, 1.8 * T], 1)
N = np.stack([np.cos(U), np.sin(U), 0 * U], 1)
save("statue_bumpy", P + N * (0.025 * noise(P, 1, 14, 3))[:, None], grid(nu, nv, 1, 0))


# 2 figure closed (metaball man)
def man(P):
    d = caps(P, (0, 0, 0.9), (0, 0, 1.4), 0.16, 0.2)
    for x in (-1, 1):
        d = smin(d, caps(P, (0.1 * x, 0, 0.9), (0.18 * x, 0.02, 0.08), 0.1, 0.07), 0.06)
        d = smin(d, caps(P, (0.2 * x, 0, 1.38), (0.5 * x, 0.05, 1.05), 0.07, 0.05), 0.05)
        d = smin(d, caps(P, (0.5 * x, 0.05, 1.05), (0.55 * x, -0.2, 0.95), 0.05, 0.04), 0.04)
        d = smin(d, caps(P, (0.18 * x, 0.02, 0.06), (0.2 * x, -0.15, 0.04), 0.06, 0.05), 0.04)
    d = smin(d, sd(P, (0, 0, 1.68), 0.13), 0.08)
    return d


V, F = iso(man, (-0.8, -0.4, -0.1), (0.8, 0.4, 1.95), (54, 30, 66))
save("figure", *clean(V, F, 0.004))


# 3 boot
def boot(P):
    o = caps(P, (0, 0, 0.12), (0, 0, 0.7), 0.16, 0.2)
    o = smin(o, caps(P, (0, 0, 0.1), (0, -0.45, 0.08), 0.14, 0.11), 0.1)
    i = caps(P, (0, 0, 0.2), (0, 0, 0.9), 0.12, 0.17)
    d = np.maximum(o, -i)
    d = np.maximum(d, P[:, 2] - 0.65)
    return np.maximum(d, -(P[:, 2] - 0.02)) + 0.004 * noise(P, 3, 40, 2)


V, F = iso(boot, (-0.3, -0.7, -0.05), (0.3, 0.3, 0.75), (36, 58, 46))
save("boot", *clean(V, F, 0.003))
# 4 trunk bark
nu, nv = 160, 120
u = np.linspace(0, 2 * pi, nu, endpoint=False)
v = np.linspace(0, 1, nv)
U, T = np.meshgrid(u, v)
U = U.ravel()
T = T.ravel()
R = (
    0.3
    + 0.1 * np.exp(-8 * T)
    + 0.02 * np.abs(np.sin(9 * U + 2 * np.sin(7 * T)))
    + 0.01 * noise(np.stack([U, T * 8, U * 0], 1), 4, 3, 3) * np.cos(U * 0)
)
P = np.stack([R * np.cos(U) + 0.1 * np.sin(2 * T), R * np.sin(U), 2 * T], 1)
P[:, 2] += 0
save("trunk", P, grid(nu, nv, 1, 0))
# 5 gear
n = 240
a = np.linspace(0, 2 * pi, n, endpoint=False)
r = np.where((np.arange(n) // 6) % 2 == 0, 1.0, 0.82)
ring = lambda r, z: np.stack([r * np.cos(a), r * np.sin(a), 0 * a + z], 1)
V = np.concatenate([ring(r, 0), ring(r, 0.3), ring(0.3 + 0 * r, 0.3), ring(0.3 + 0 * r, 0)])
save("gear", V, grid(n, 4, 1, 1))
# 6 trefoil tube
nu, nv = 24, 300
t = np.linspace(0, 2 * pi, nv, endpoint=False)
C = np.stack([np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)], 1) * 0.3
Tn = np.roll(C, -1, 0) - np.roll(C, 1, 0)
Tn /= np.linalg.norm(Tn, axis=1)[:, None]
B = np.cross(Tn, [0, 0, 1])
B /= np.linalg.norm(B, axis=1)[:, None]
M = np.cross(B, Tn)
u = np.linspace(0, 2 * pi, nu, endpoint=False)
V = (C[:, None] + 0.12 * (np.cos(u)[None, :, None] * B[:, None] + np.sin(u)[None, :, None] * M[:, None])).reshape(-1, 3)
save("trefoil", V, grid(nu, nv, 1, 1))
# 7 crumpled cloth
n = 90
x, y = np.meshgrid(np.linspace(0, 2, n), np.linspace(0, 2, n))
P = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1)
P[:, 2] = 0.12 * np.abs(noise(P, 7, 5, 3)) + 0.03 * noise(P, 8, 17, 2)
save("cloth", P, grid(n, n, 0, 0))
# 8 hedgehog: sphere with spikes
V, F = iso(
    lambda P: (
        sd(P, (0, 0, 0), 0.5)
        - 0.22 * np.maximum(0, noise(P / np.maximum(np.linalg.norm(P, axis=1, keepdims=True), 1e-6), 9, 7, 1))
    ),
    (-0.9,) * 3,
    (0.9,) * 3,
    (44, 44, 44),
)
save("hedgehog", *clean(V, F, 0.005))


# 9 voxel castle
def vox(occ, s):
    V = {}
    L = []
    F = []

    def vid(p):
        if p not in V:
            V[p] = len(L)
            L.append([c * s for c in p])
        return V[p]

    O = set(occ)
    for x, y, z in occ:
        for d, q in {
            (1, 0, 0): [(1, 0, 0), (1, 1, 0), (1, 1, 1), (1, 0, 1)],
            (-1, 0, 0): [(0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0)],
            (0, 1, 0): [(0, 1, 0), (0, 1, 1), (1, 1, 1), (1, 1, 0)],
            (0, -1, 0): [(0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)],
            (0, 0, 1): [(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)],
            (0, 0, -1): [(0, 0, 0), (0, 1, 0), (1, 1, 0), (1, 0, 0)],
        }.items():
            if (x + d[0], y + d[1], z + d[2]) in O:
                continue
            k = [vid((x + a, y + b, z + c)) for a, b, c in q]
            F += [[k[0], k[1], k[2]], [k[0], k[2], k[3]]]
    return np.array(L), F


occ = [
    (x, y, z)
    for x in range(14)
    for y in range(14)
    for z in range(8)
    if (
        (x in (0, 1, 12, 13) or y in (0, 1, 12, 13))
        and (z < 5 or (z == 5 and (x + y) % 4 < 2) or ((x < 3 or x > 10) and (y < 3 or y > 10) and z < 8))
    )
]
save("castle", *vox(occ, 0.2))
# 10 shell spiral
nu, nv = 40, 240
t = np.linspace(0, 6 * pi, nv)
u = np.linspace(0, 2 * pi, nu, endpoint=False)
g = np.exp(0.12 * t)
U, Tt = np.meshgrid(u, t)
G = np.exp(0.12 * Tt)
r = 0.5 * G * 0.1
P = np.stack(
    [(G * 0.1 + r * np.cos(U)) * np.cos(Tt), (G * 0.1 + r * np.cos(U)) * np.sin(Tt), 0.16 * G + r * np.sin(U) * 1.0], -1
).reshape(-1, 3)
save("shell", P, grid(nu, nv, 1, 0))


# 11 cup with handle
def cup(P):
    rr = np.hypot(P[:, 0], P[:, 1])
    o = np.maximum(rr - 0.4, np.abs(P[:, 2] - 0.5) - 0.5)
    i = np.maximum(rr - 0.34, -(P[:, 2] - 0.08))
    d = np.maximum(o, -i)
    q = np.hypot(P[:, 0] - 0.42, P[:, 2] - 0.5) - 0.26
    h = np.hypot(q, P[:, 1]) - 0.06
    return np.minimum(d, np.maximum(h, -(rr - 0.37)))


V, F = iso(cup, (-0.5, -0.5, -0.06), (0.85, 0.5, 1.06), (54, 42, 46))
save("cup", *clean(V, F, 0.004))
# 12 chain
nu, nv = 20, 60
Vs = []
Fs = []
o = 0
for k in range(5):
    u = np.linspace(0, 2 * pi, nu, endpoint=False)
    v = np.linspace(0, 2 * pi, nv, endpoint=False)
    U, W = np.meshgrid(u, v)
    P = np.stack(
        [(0.4 + 0.08 * np.cos(U)) * np.cos(W) * 1.4, (0.4 + 0.08 * np.cos(U)) * np.sin(W), 0.08 * np.sin(U)], -1
    ).reshape(-1, 3)
    if k % 2:
        P = P[:, [0, 2, 1]] * [1, -1, 1]
    P = P + [k * 0.85, 0, 0]
    Vs.append(P)
    Fs.append(np.array(grid(nu, nv, 1, 1)) + o)
    o += len(P)
save("chain", np.concatenate(Vs), np.concatenate(Fs))
# 13 facade with windows
n = 120
m = 80
x, z = np.meshgrid(np.linspace(0, 6, n), np.linspace(0, 4, m))
w = ((x % 1.5) > 0.4) & ((x % 1.5) < 1.1) & ((z % 1.3) > 0.35) & ((z % 1.3) < 1.0)
P = np.stack(
    [
        x,
        np.where(w, 0.15, 0)
        + 0.003 * noise(np.stack([x.ravel(), z.ravel(), 0 * x.ravel()], 1), 5, 20, 2).reshape(x.shape),
        z,
    ],
    -1,
).reshape(-1, 3)
save("facade", P, grid(n, m, 0, 0))
# 14 lowpoly gem
r = np.random.default_rng(3)
Q = r.normal(size=(60, 3))
Q /= np.linalg.norm(Q, axis=1)[:, None]
Q *= [1, 1, 1.4]
h = ConvexHull(Q)
F = []
for s, eq in zip(h.simplices, h.equations):
    a, b, c = s
    F.append([a, b, c] if np.cross(Q[b] - Q[a], Q[c] - Q[a]) @ eq[:3] > 0 else [a, c, b])
save("gem", Q, F)
# 15 coral
r = np.random.default_rng(5)
seg = []


def br(p, d, l, ra, k):
    q = p + d * l
    seg.append((p, q, ra, ra * 0.75))
    if k:
        for _ in range(3):
            e = d + r.normal(size=3) * 0.6
            e /= np.linalg.norm(e)
            e[2] = abs(e[2])
            br(q, e, l * 0.72, ra * 0.75, k - 1)


br(np.zeros(3), np.array([0, 0, 1.0]), 0.5, 0.12, 2)


def coral(P):
    d = np.full(len(P), 9.0)
    for s in seg:
        d = smin(d, caps(P, *s), 0.04)
    return d


V, F = iso(coral, (-1.1, -1.1, -0.2), (1.1, 1.1, 1.5), (60, 60, 48))
save("coral", *clean(V, F, 0.006))
# 16 noisy scan of a bowl half
n = 100
th, ph = np.meshgrid(np.linspace(0.05, 1.5, n), np.linspace(0, 2 * pi * 0.8, n))
P = np.stack([np.sin(th) * np.cos(ph), np.sin(th) * np.sin(ph), -np.cos(th)], -1).reshape(-1, 3)
P += np.random.default_rng(2).normal(size=P.shape) * 0.006
save("noisy_bowl", P, grid(n, n, 0, 0))
# 17 mask relief with eye holes
n = 110
x, y = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1.3, 1.3, n))
R = np.sqrt(np.maximum(0, 1.05 - (x**2 + (y / 1.35) ** 2) * 0.9))
z = (
    0.8 * R
    + 0.25 * np.exp(-(x**2 / 0.02 + (y + 0.1) ** 2 / 0.15))
    + 0.05 * np.exp(-(x**2 / 0.15 + (y + 0.6) ** 2 / 0.01))
)
P = np.stack([x, z, y], -1).reshape(-1, 3)
F = [
    f
    for f in grid(n, n, 0, 0)
    if not any(
        ((P[f][:, 0].mean() - s * 0.4) ** 2 / 0.03 + (P[f][:, 2].mean() - 0.3) ** 2 / 0.012) < 1 for s in (-1, 1)
    )
    and (P[f][:, 0].mean() ** 2 + (P[f][:, 2].mean() / 1.3) ** 2) < 0.98
]
save("mask", P, F)
# 18 screw
nu, nv = 48, 260
u = np.linspace(0, 2 * pi, nu, endpoint=False)
v = np.linspace(0, 2, nv)
U, W = np.meshgrid(u, v)
r = 0.3 + 0.06 * np.abs(((U / (2 * pi) + W * 4) % 1) - 0.5) * 2
P = np.stack([r * np.cos(U), r * np.sin(U), W], -1).reshape(-1, 3)
save("screw", P, grid(nu, nv, 1, 0))
