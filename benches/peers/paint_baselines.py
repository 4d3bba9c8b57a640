#!/usr/bin/env python3
"""Classical and learned spray painters that paint-net is compared with. One JSON line per figure.

  pip install numpy scipy scikit-image            (and torch for `conv` and `replica`)
  OMP_NUM_THREADS=1 python paint_baselines.py all                     the five skimage test pictures, every classical painter (about 2 min)
  python paint_baselines.py painters --set procedural                 the built-in textures instead (no picture needed; hash-seeded, same in any language)
  python paint_baselines.py painters slew noise --image FILE          one or more own pictures (grey, cropped square, resized)
  python paint_baselines.py colour --image FILE                       several paints, Beer-Lambert
  python paint_baselines.py export --to DIR                           the test pictures as PNG files, for `library_figures paint --image DIR`
  python paint_baselines.py check                                     gradients against central differences, reference values for unit tests
  python paint_baselines.py conv --budget 100 [--shared] [--additive] [--train procedural]     train and test the feedback painter (torch)
  python paint_baselines.py replica --steps 5                         time one training step of the thesis' DRAW/PAINT network (torch)

Paint model: ink = tanh(sum_k v_k exp(-dx^2/2s^2) exp(-dy^2/2s^2)), v_k >= 0, s = 2 px, each factor cut to |d| <= 4 px (a square cut; free splats are
not cut, psnr_cut re-renders them with |d| <= 2s). Target ink y = 1 - grey (dark paint on a white wall).
Metrics: psnr = -10 log10 mean((o-y)^2), o clipped to [0,1]; ssim = skimage default (7x7 uniform window, sample covariance, data_range 1), ssim_g = Gaussian
window sigma 1.5 (11x11), population covariance; bce in nats/pixel with o clipped to [1e-6, 1-1e-6]; bce_h = bce - entropy of y (its lower bound).
cpu_s is process time of one run; pin one thread, run A B A B, and quote ratios."""

import os

for _k in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_k, "1")
import argparse
import json
import struct
import time
import zlib

import numpy as np
from scipy import ndimage as ndi
from scipy.optimize import minimize

R, SIG = 4, 2.0
AX = np.arange(-R, R + 1)
K1 = np.exp(-(AX**2) / (2 * SIG**2))
NAMES = ("brick", "gravel", "grass", "coins", "camera")


def emit(image, method, **k):
    k = {a: (float(f"{b:.6g}") if isinstance(b, (float, np.floating)) else b) for a, b in k.items()}
    print(json.dumps(dict(image=image, method=method, **k), default=float), flush=True)


def G(v, k=K1):
    return ndi.convolve1d(ndi.convolve1d(v, k, axis=0, mode="constant"), k, axis=1, mode="constant")


def metrics(o, y):
    from skimage.metrics import structural_similarity as ssim

    o = np.clip(o, 0, 1)
    oc, yc = np.clip(o, 1e-6, 1 - 1e-6), np.clip(y, 1e-6, 1 - 1e-6)
    bce = -(y * np.log(oc) + (1 - y) * np.log(1 - oc)).mean()
    h = -(y * np.log(yc) + (1 - y) * np.log(1 - yc)).mean()
    return dict(
        psnr=psnr(o, y),
        ssim=float(ssim(o, y, data_range=1.0)),
        bce=bce,
        bce_h=bce - h,
        ssim_g=float(ssim(o, y, data_range=1.0, gaussian_weights=True, sigma=1.5, use_sample_covariance=False)),
    )


def run_export(a):
    """the pictures as 16-bit PNG files, so that others work on the same numbers"""
    from skimage import io

    os.makedirs(a.to, exist_ok=True)
    for name, y in pictures(a):
        path = os.path.join(a.to, name + ".png")
        io.imsave(path, np.round((1 - y) * 65535).astype(np.uint16), check_contrast=False)
        emit(name, "export", file=path)
    from skimage import data, transform

    os.makedirs(os.path.join(a.to, "colour"), exist_ok=True)
    for name in ("astronaut", "coffee"):
        picture = transform.resize(getattr(data, name)(), (a.size, a.size, 3), anti_aliasing=True).clip(0.02, 1)
        path = os.path.join(a.to, "colour", name + ".png")
        save_rgb16(path, np.round(picture * 65535).astype(np.uint16))
        emit(name, "export", file=path)


def save_rgb16(path, picture):
    """a PNG file of 16 bits in three channels, which the usual writers cannot"""
    chunk = lambda kind, data: (
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    )
    height, width, _ = picture.shape
    rows = b"".join(b"\0" + row.astype(">u2").tobytes() for row in picture)
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 16, 2, 0, 0, 0)))
        file.write(chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def psnr(o, y):
    return float(-10 * np.log10(np.mean((o - y) ** 2) + 1e-20))


# ---------------------------------------------------------------- pictures
M64 = (1 << 64) - 1


def h01(seed, x, y):
    """splitmix64 finaliser of seed + A(x+1) + B(y+1) mod 2^64, top 53 bits -> [0,1)"""
    with np.errstate(over="ignore"):
        z = (
            np.uint64(seed & M64)
            + np.uint64(0x9E3779B97F4A7C15) * (np.asarray(x, np.int64) + 1).astype(np.uint64)
            + np.uint64(0xC2B2AE3D27D4EB4F) * (np.asarray(y, np.int64) + 1).astype(np.uint64)
        )
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        return ((z ^ (z >> np.uint64(31))) >> np.uint64(11)).astype(np.float64) * 2.0**-53


def value_noise(seed, x, y):
    i, j = np.floor(x), np.floor(y)
    q = lambda t: t * t * t * (t * (6 * t - 15) + 10)
    a, b = q(x - i), q(y - j)
    top = h01(seed, i, j) * (1 - a) + h01(seed, i + 1, j) * a
    bot = h01(seed, i, j + 1) * (1 - a) + h01(seed, i + 1, j + 1) * a
    return top * (1 - b) + bot * b


def fbm(seed, x, y, octaves=5):
    return sum(0.5**o * value_noise(seed + o, x * 2**o, y * 2**o) for o in range(octaves)) / (2 - 0.5 ** (octaves - 1))


def procedural(kind, seed, n):
    """ink pictures in [0,0.95]; x = column, y = row, in pixels"""
    y, x = np.mgrid[0:n, 0:n].astype(np.float64)
    if kind == "fbm":
        o = 1.6 * fbm(seed, x / 32, y / 32) - 0.3
    elif kind == "worley":
        c, o = 12.0, np.full((n, n), 9.0)
        for dx in (-1, 0, 1):
            for dy in (-1, 0, 1):
                i, j = np.floor(x / c) + dx, np.floor(y / c) + dy
                o = np.minimum(o, np.hypot(x / c - i - h01(seed, i, j), y / c - j - h01(seed + 1, i, j)))
        o = 1 - 1.1 * o
    elif kind == "brick":
        r = np.floor(y / 16)
        xx = x + 16 * (r % 2)
        mortar = (y % 16 < 2) | (xx % 32 < 2)
        o = np.where(mortar, 0.15, 0.35 + 0.5 * h01(seed, np.floor(xx / 32), r)) + 0.3 * (
            fbm(seed + 1, x / 8, y / 8) - 0.5
        )
    elif kind == "stripes":
        a = np.pi * h01(seed, 0, 0)
        o = 0.5 + 0.45 * np.sin(2 * np.pi * (x * np.cos(a) + y * np.sin(a)) / 14 + 6 * fbm(seed + 1, x / 40, y / 40))
    elif kind == "glyph":
        d = np.full((n, n), 1e9)
        for k in range(14):
            u = [h01(seed, k, m) for m in range(5)]
            ax, ay, bx, by = (n * t for t in u[:4])
            t = np.clip(((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / ((bx - ax) ** 2 + (by - ay) ** 2 + 1e-9), 0, 1)
            d = np.minimum(d, np.hypot(x - ax - t * (bx - ax), y - ay - t * (by - ay)) - 2 - 5 * u[4])
        s = np.clip(0.5 - d / 3, 0, 1)
        o = 0.9 * s * s * (3 - 2 * s)
    return np.clip(o, 0, 0.95)


KINDS = ("fbm", "worley", "brick", "stripes", "glyph")


def pictures(a):
    from skimage import color, data, io, transform

    if a.image:
        for f in a.image:
            g = io.imread(f)
            g = (
                color.rgb2gray(g[..., :3])
                if g.ndim == 3
                else g / (np.iinfo(g.dtype).max if g.dtype.kind == "u" else 1.0)
            )
            s = min(g.shape)
            g = g[(g.shape[0] - s) // 2 :, (g.shape[1] - s) // 2 :][:s, :s]
            yield os.path.basename(f), 1 - np.clip(transform.resize(g, (a.size, a.size), anti_aliasing=True), 0, 1)
    elif a.set == "procedural":
        for k in KINDS:
            yield "proc-" + k, procedural(k, 1000, a.size)
    else:
        for k in NAMES:
            g = transform.resize(getattr(data, k)(), (a.size, a.size), anti_aliasing=True)
            yield k, 1 - (g if g.max() <= 1 else g / 255)


# ---------------------------------------------------------------- painters
def lbfgs(f, x0, iters, ub=None):
    return minimize(
        f,
        x0,
        jac=True,
        method="L-BFGS-B",
        bounds=[(0, ub)] * len(x0),
        options=dict(maxiter=iters, maxfun=2 * iters, maxcor=10, ftol=1e-9, gtol=1e-7),
    )


def grid_mask(shape, stride):
    m, o = np.zeros(shape, bool), (stride - 1) // 2
    m[o::stride, o::stride] = True
    return m


def refit(y, mask, x0, iters, c0=0.0):
    """min over v >= 0 on the mask of 1/2 |tanh(c0 + G v) - y|^2"""

    def f(x):
        v = np.zeros_like(y)
        v[mask] = x
        o = np.tanh(c0 + G(v))
        r = o - y
        return 0.5 * (r * r).sum(), G(r * (1 - o * o))[mask]

    s = lbfgs(f, x0, iters)
    v = np.zeros_like(y)
    v[mask] = s.x
    return v, s.nit


def solve(y, stride, iters=200, convex=False):
    mask = grid_mask(y.shape, stride)
    t = np.arctanh(np.clip(y, 0, 0.995))
    x0 = np.full(mask.sum(), t.mean() / K1.sum() ** 2 * stride**2)
    if not convex:
        return refit(y, mask, x0, iters)

    def f(x):
        v = np.zeros_like(y)
        v[mask] = x
        r = G(v) - t
        return 0.5 * (r * r).sum(), G(r)[mask]

    s = lbfgs(f, x0, iters)
    v = np.zeros_like(y)
    v[mask] = s.x
    return v, s.nit


def layers(y, mode="relative", count=5):
    """thesis 3.2/3.3: base level = 20th percentile of the ink, then steps of 50/255; eroded 3x3, smoothed with sigma =
    R/2, accumulated"""
    lv = [0.0, np.percentile(y, 20)]
    while len(lv) < count and lv[-1] + 50 / 255 < y.max():
        lv.append(lv[-1] + 50 / 255)
    out = np.zeros_like(y)
    for k, lo in enumerate(lv):
        hi = lv[k + 1] if k + 1 < len(lv) else 1.0
        out += ndi.gaussian_filter(ndi.grey_erosion(np.clip(y - lo, 0, hi - lo), size=(3, 3)), R / 2)
    return np.clip(out, 0, 1)


def greedy(y, k, backfit=0):
    """one spray at a time on r = y - tanh c linearised at c: cell maximising (G^T(wr))^2/(G2^T w^2), w = 1 -
    tanh(c)^2, closed-form volume"""
    c, rec, stamp = np.zeros_like(y), [], np.outer(K1, K1)
    n, m = y.shape
    for _ in range(k):
        a = np.tanh(c)
        w = 1 - a * a
        num, den = G((y - a) * w), G(w * w, K1**2) + 1e-9
        q = np.where(num > 0, num * num / den, -1)
        i, j = np.unravel_index(q.argmax(), q.shape)
        if q[i, j] <= 0:
            break
        v = min(num[i, j] / den[i, j], 1.0)
        a0, a1, b0, b1 = max(0, i - R), min(n, i + R + 1), max(0, j - R), min(m, j + R + 1)
        c[a0:a1, b0:b1] += v * stamp[a0 - i + R : a1 - i + R, b0 - j + R : b1 - j + R]
        rec.append((i, j, v))
    if backfit:
        s0, mask = np.zeros_like(y), np.zeros_like(y, bool)
        for i, j, v in rec:
            s0[i, j] += v
            mask[i, j] = True
        return np.tanh(G(refit(y, mask, s0[mask], backfit)[0])), int(mask.sum())
    return np.tanh(c), len({(i, j) for i, j, _ in rec})


def splat_forward(y, px, py, v, s):
    n, m = y.shape
    dx, dy = np.arange(m)[None] - px[:, None], np.arange(n)[None] - py[:, None]
    gx, gy = np.exp(-(dx**2) / (2 * s**2)[:, None]), np.exp(-(dy**2) / (2 * s**2)[:, None])
    o = np.tanh((gy * v[:, None]).T @ gx)
    return o, (dx, dy, gx, gy)


def splat_grad(y, px, py, v, s):
    """L = mean((tanh(Gy^T diag(v) Gx) - y)^2) and its gradient, two more matrix products"""
    o, (dx, dy, gx, gy) = splat_forward(y, px, py, v, s)
    r = o - y
    D = 2 * r * (1 - o * o) / y.size
    A = gy @ D  # K x W
    B = gx @ D.T  # K x H
    gv = (A * gx).sum(1)
    gpx = v / s**2 * (A * gx * dx).sum(1)
    gpy = v / s**2 * (B * gy * dy).sum(1)
    gs = v / s**3 * ((A * gx * dx**2).sum(1) + (B * gy * dy**2).sum(1))
    return float((r * r).mean()), o, gpx, gpy, gv, gs


def splats(y, k, iters=400, free_sigma=False):
    n, m = int(round(k**0.5)), y.shape[0]
    g = (np.arange(n) + 0.5) * m / n - 0.5
    py, px = [t.ravel().astype(np.float32) for t in np.meshgrid(g, g, indexing="ij")]
    P = [
        px,
        py,
        np.full(n * n, -1.5, np.float32),
        np.full(n * n, np.log(np.expm1(max(0.3, 0.45 * m / n - SIG))), np.float32),
    ]
    lr0, mo, ve = [0.15, 0.15, 0.08, 0.08 if free_sigma else 0.0], [0] * 4, [0] * 4
    sp, sg, yy = (lambda t: np.log1p(np.exp(t))), (lambda t: 1 / (1 + np.exp(-t))), y.astype(np.float32)
    sigma = lambda: (SIG + sp(P[3]) if free_sigma else np.full_like(P[3], SIG))
    for it in range(iters):
        _, o, gpx, gpy, gv, gs = splat_grad(yy, P[0], P[1], sp(P[2]), sigma())
        lr = 0.5 * (1 + np.cos(np.pi * it / iters))
        for q, gr in enumerate((gpx, gpy, gv * sg(P[2]), gs * sg(P[3]))):
            mo[q] = 0.9 * mo[q] + 0.1 * gr
            ve[q] = 0.999 * ve[q] + 0.001 * gr * gr
            P[q] = (
                P[q] - lr0[q] * lr * (mo[q] / (1 - 0.9 ** (it + 1))) / (np.sqrt(ve[q] / (1 - 0.999 ** (it + 1))) + 1e-8)
            ).astype(np.float32)
    s, v = sigma(), sp(P[2])
    o, (dx, dy, gx, gy) = splat_forward(yy, P[0], P[1], v, s)
    cut = np.tanh((gy * (abs(dy) <= 2 * s[:, None]) * v[:, None]).T @ (gx * (abs(dx) <= 2 * s[:, None])))
    return o, cut


def run_painters(a):
    for name, y in pictures(a):

        def rec(tag, fn, **k):
            t = time.process_time()
            o = fn()
            t = time.process_time() - t
            if isinstance(o, tuple):
                o, extra = o
                k = dict(k, **extra)
            emit(name, tag, **metrics(o, y), cpu_s=t, **k)
            return o

        per = (y.size // 1024) * 100
        rec("gaussian_filter", lambda: ndi.gaussian_filter(y, SIG))
        rec("thesis_layers", lambda: layers(y))
        for st in (1, 2, 4):
            w = rec(
                f"lbfgs_tanh_grid{st}", lambda: np.tanh(G(solve(y, st)[0])), sprays=int(grid_mask(y.shape, st).sum())
            )
            whole = w if st == 2 else locals().get("whole")
        for it in (
            5,
            10,
            20,
            40,
            100,
        ):  # time-to-quality curve: quote a learned painter against the point of equal psnr
            rec(f"lbfgs_tanh_grid2_it{it}", lambda: np.tanh(G(solve(y, 2, it)[0])))
        rec("nnls_atanh_grid2", lambda: np.tanh(G(solve(y, 2, convex=True)[0])))
        p, V, o = 32, np.zeros_like(y), np.zeros_like(y)
        t = time.process_time()
        for i in range(0, y.shape[0], p):
            for j in range(0, y.shape[1], p):
                v = solve(y[i : i + p, j : j + p], 2)[0]
                V[i : i + p, j : j + p] = v
                o[i : i + p, j : j + p] = np.tanh(G(v))
        t = time.process_time() - t
        real = np.tanh(G(V))
        b = np.zeros(y.shape[0], bool)
        for k in range(p, y.shape[0], p):
            b[k - 4 : k + 4] = True
        strip = b[:, None] | b[None, :]
        emit(name, "patch32_clipped", **metrics(o, y), cpu_s=t)
        emit(
            name,
            "patch32_overspray",
            **metrics(real, y),
            cpu_s=t,
            strip_psnr=psnr(real[strip], y[strip]),
            strip_psnr_whole=psnr(whole[strip], y[strip]),
        )
        rec(f"greedy_{per}", lambda: (lambda r: (r[0], dict(cells=r[1])))(greedy(y, per)))
        rec(f"greedy_{per}_refit", lambda: (lambda r: (r[0], dict(cells=r[1])))(greedy(y, per, 60)))
        if not a.quick:
            for k, fs in ((per, False), (per // 4, True)):
                rec(
                    f"splats_{k}" + ("_sigma" if fs else ""),
                    lambda: (lambda r: (r[0], dict(psnr_cut=psnr(r[1], y))))(splats(y, k, free_sigma=fs)),
                )


def envelope(x, L):
    """largest sequence below x with |difference| <= L: one pass forward, one back; never violates"""
    x = x.copy()
    for k in range(1, len(x)):
        x[k] = min(x[k], x[k - 1] + L)
    for k in range(len(x) - 2, -1, -1):
        x[k] = min(x[k], x[k + 1] + L)
    return x


def run_slew(a):
    """boustrophedon over the grid, |v_k - v_(k-1)| <= limit * vmax by a quadratic penalty, continuation rho = .1 ..
    1000; psnr_exact after envelope()"""
    for name, y in pictures(a):
        for st in (2, 4):
            o, n = (st - 1) // 2, len(range((st - 1) // 2, y.shape[0], st))
            v0 = solve(y, st)[0][o::st, o::st]
            vmax = 1.5 * np.percentile(v0, 99)

            def path(x):
                q = x.reshape(n, n).copy()
                q[1::2] = q[1::2, ::-1].copy()
                return q

            for rel in (1, 0.2, 0.1, 0.05, 0.02):
                L, t0 = rel * vmax, time.process_time()
                x = path(v0).ravel().clip(0, vmax)
                for rho in (0.1, 1, 10, 100, 1000):

                    def f(x):
                        V = np.zeros_like(y)
                        V[o::st, o::st] = path(x)
                        q = np.tanh(G(V))
                        r = q - y
                        g = path(G(r * (1 - q * q))[o::st, o::st]).ravel()
                        d = np.diff(x)
                        e = np.sign(d) * np.maximum(abs(d) - L, 0)
                        g[1:] += rho * e
                        g[:-1] -= rho * e
                        return 0.5 * (r * r).sum() + 0.5 * rho * (e * e).sum(), g

                    x = lbfgs(f, x, 150, vmax).x
                V, E = np.zeros_like(y), np.zeros_like(y)
                V[o::st, o::st] = path(x)
                E[o::st, o::st] = path(envelope(x, L))
                emit(
                    name,
                    f"slew_grid{st}",
                    limit=rel,
                    **metrics(np.tanh(G(V)), y),
                    psnr_exact=psnr(np.tanh(G(E)), y),
                    violation=np.maximum(abs(np.diff(x)) - L, 0).max() / L,
                    cpu_s=time.process_time() - t0,
                )


def run_noise(a):
    """20 % volume noise and 0.5 px jitter per spray, raster on grid 2; closed: the rest re-solved (30 iterations) from
    the seen canvas every 8 rows"""
    for name, y in pictures(a):
        for closed in (False, True):
            rng, c, t0 = np.random.default_rng(a.seed), np.zeros_like(y), time.process_time()
            v = solve(y, 2)[0]
            for b in range(0, y.shape[0], 8):
                if closed and b:
                    rest = grid_mask(y.shape, 2)
                    rest[:b] = False
                    v = refit(y, rest, v[rest], 30, c)[0]
                V = np.zeros_like(y)
                V[b : b + 8] = v[b : b + 8]
                for i, j in zip(*np.nonzero(V)):
                    d = rng.normal(0, 0.5, 2)
                    k = (
                        np.outer(np.exp(-((AX - d[0]) ** 2) / (2 * SIG**2)), np.exp(-((AX - d[1]) ** 2) / (2 * SIG**2)))
                        * V[i, j]
                        * max(0, 1 + 0.2 * rng.normal())
                    )
                    a0, a1, b0, b1 = (
                        max(0, i - R),
                        min(y.shape[0], i + R + 1),
                        max(0, j - R),
                        min(y.shape[1], j + R + 1),
                    )
                    c[a0:a1, b0:b1] += k[a0 - i + R : a1 - i + R, b0 - j + R : b1 - j + R]
            emit(
                name,
                "noise_closed" if closed else "noise_open",
                **metrics(np.tanh(c), y),
                cpu_s=time.process_time() - t0,
            )


def run_colour(a):
    """sRGB I_c = exp(-sum_p A_cp (G v_p)), A = -ln(masstone), v >= 0, joint L-BFGS-B, 150 iterations, one plane per
    paint, grid 1"""
    from skimage import color, data, io, transform

    n, cmy = a.size, [[0.04, 0.52, 0.75], [0.75, 0.04, 0.35], [0.92, 0.85, 0.05]]
    pal = {"cmy": cmy, "cmyk": cmy + [[0.06] * 3], "six": cmy + [[0.06] * 3, [0.8, 0.15, 0.05], [0.1, 0.45, 0.15]]}
    for name, im in [(os.path.basename(f), io.imread(f)[..., :3]) for f in a.image] or [
        ("astronaut", data.astronaut()),
        ("coffee", data.coffee()),
    ]:
        T = np.clip(transform.resize(im, (n, n, 3), anti_aliasing=True), 0.02, 1)
        lab = color.rgb2lab(T)
        de = lambda I: color.deltaE_ciede2000(lab, color.rgb2lab(np.clip(I, 0, 1)))
        ref = np.stack([ndi.gaussian_filter(T[..., c], SIG) for c in range(3)], -1)
        emit(
            name,
            "colour_gaussian_filter",
            psnr=psnr(ref, T),
            de00_mean=de(ref).mean(),
            de00_p95=np.percentile(de(ref), 95),
        )
        for pn, P in pal.items():
            A, m, t0 = -np.log(np.array(P)), len(P), time.process_time()

            def render(x):
                C = np.stack([G(q) for q in x.reshape(m, n, n)])
                return np.exp(-np.tensordot(A.T, C, 1)).transpose(1, 2, 0)

            def f(x):
                I = render(x)
                r = I - T
                g = np.tensordot(A, -(r * I).transpose(2, 0, 1), 1)
                return 0.5 * (r * r).sum(), np.stack([G(q) for q in g]).ravel()

            s = lbfgs(f, np.full(m * n * n, 0.01), 150)
            d = de(render(s.x))
            emit(
                name,
                "colour_" + pn,
                psnr=psnr(render(s.x), T),
                de00_mean=d.mean(),
                de00_p95=np.percentile(d, 95),
                paint=s.x.sum() * K1.sum() ** 2 / n**2,
                cpu_s=time.process_time() - t0,
            )


# ---------------------------------------------------------------- reference values
def filterbank(n, size, g, delta, sigma2):
    """DRAW READ row filters, 0-based pixels: centre g, spacing delta, n rows normalised to sum 1"""
    mu = g + (np.arange(n) - (n - 1) / 2) * delta
    F = np.exp(-((np.arange(size)[None] - mu[:, None]) ** 2) / (2 * sigma2))
    return F / np.maximum(F.sum(1, keepdims=True), 1e-8)


def run_check(a):
    sp = lambda t: np.logaddexp(0, t)
    rng = np.random.default_rng(0)
    y = rng.uniform(0, 0.9, (12, 10))
    th = [rng.uniform(0, 9, 5), rng.uniform(0, 11, 5), rng.uniform(0.1, 1, 5), rng.uniform(1, 3, 5)]
    _, _, *g = splat_grad(y, *th)
    worst = 0
    for q in range(4):
        for k in range(5):
            lo, hi = [t.copy() for t in th], [t.copy() for t in th]
            lo[q][k] -= 1e-5
            hi[q][k] += 1e-5
            worst = max(worst, abs((splat_grad(y, *hi)[0] - splat_grad(y, *lo)[0]) / 2e-5 - g[q][k]))
    emit("-", "splat_gradient", worst_abs_error=worst)
    one = splat_grad(np.full((3, 4), 0.5), *[np.array([t]) for t in (1.25, 0.5, 0.8, 1.5)])
    emit(
        "-",
        "splat_reference",
        px=1.25,
        py=0.5,
        v=0.8,
        s=1.5,
        h=3,
        w=4,
        y=0.5,
        loss=one[0],
        **{k: float(t[0]) for k, t in zip(("d_px", "d_py", "d_v", "d_s"), one[2:])},
    )
    F = filterbank(3, 8, 3.5, 2.0, 1.0)
    x = np.arange(64).reshape(8, 8) / 64
    emit(
        "-",
        "read_reference",
        F_row0=[float(f"{t:.10g}") for t in F[0]],
        patch=[float(f"{t:.10g}") for t in (F @ x @ F.T).ravel()],
    )
    q = lambda z, l, t: np.log(t) - t * z + l - 2 * sp(-t * z + l)
    u, l, l0, tau = 0.3, 0.4, -0.5, 1.0
    z = (l + np.log(u) - np.log1p(-u)) / tau
    emit(
        "-",
        "concrete_reference",
        u=u,
        logit=l,
        prior_logit=l0,
        tau=tau,
        z=z,
        gate=1 / (1 + np.exp(-z)),
        kl_sample=q(z, l, tau) - q(z, l0, tau),
    )
    c = np.array([1e-3, 0.1, 1.0, 5.0, 20.0])
    emit(
        "-",
        "bce_terms",
        c=c.tolist(),
        log_a=[float(f"{t:.10g}") for t in np.log(-np.expm1(-2 * c)) - np.log1p(np.exp(-2 * c))],
        log_1_minus_a=[float(f"{t:.10g}") for t in np.log(2) - sp(2 * c)],
    )
    emit("-", "hash", h01_1000_0_0=float(h01(1000, 0, 0)).hex(), h01_1000_3_minus2=float(h01(1000, 3, -2)).hex())
    for k in KINDS:
        p = procedural(k, 1000, 128)
        emit("proc-" + k, "texture", mean=p.mean(), std=p.std(), at_10_20=float(f"{p[20, 10]:.10g}"))


# ---------------------------------------------------------------- torch
def run_conv(a):
    """K feedback passes; each adds volume on the stride-2 grid from (y, residual, G^T(r(1-o^2)), state). Tested on the
    pictures, whole, no tiling."""
    import torch
    import torch.nn as nn
    import torch.nn.functional as F
    from skimage import color, data, transform

    torch.set_num_threads(1)
    torch.manual_seed(a.seed)
    rng, K, C = np.random.default_rng(a.seed), a.passes, a.channels
    k1 = torch.tensor(K1, dtype=torch.float32)
    Gt = lambda v: F.conv2d(F.conv2d(v, k1.view(1, 1, 1, -1), padding=(0, R)), k1.view(1, 1, -1, 1), padding=(R, 0))
    pool = []
    if a.train == "mixed":
        t = [
            color.rgb2gray(getattr(data, f)())
            for f in ("astronaut", "coffee", "chelsea", "rocket", "immunohistochemistry")
        ] + [getattr(data, f)() / 255 for f in ("moon", "text", "page", "clock")]
        pool = [
            transform.resize(q, (int(q.shape[0] * s), int(q.shape[1] * s)), anti_aliasing=True)
            for q in t
            for s in (0.3, 0.5)
            if min(q.shape) * s > 70
        ]
    else:
        pool = [procedural(k, int(rng.integers(1 << 40)), 160) for k in KINDS for _ in range(12)]

    def batch(B, S=64):
        o = []
        for _ in range(B):
            if rng.random() < 0.4:
                q = ndi.gaussian_filter(rng.normal(size=(S, S)), rng.uniform(0.7, 6))
                q = ((q - q.min()) / (np.ptp(q) + 1e-9)) ** rng.uniform(0.5, 2)
            else:
                t = pool[rng.integers(len(pool))]
                i, j = rng.integers(t.shape[0] - S + 1), rng.integers(t.shape[1] - S + 1)
                q = np.rot90(t[i : i + S, j : j + S], rng.integers(4))
                q = q if rng.random() < 0.5 else 1 - q
            lo, hi = np.sort(rng.uniform(0, 1, 2))
            o.append(np.clip(q * (1 - 0.3 * lo) + 0.1 * (1 - hi), 0, 0.98))
        return torch.tensor(np.stack(o)[:, None].astype(np.float32))

    block = lambda: nn.Sequential(
        nn.Conv2d(16, C, 3, padding=1),
        nn.ReLU(),
        nn.Conv2d(C, C, 3, padding=1),
        nn.ReLU(),
        nn.Conv2d(C, C, 3, padding=1),
        nn.ReLU(),
        nn.Conv2d(C, 1, 3, padding=1),
    )
    nets = nn.ModuleList([block() for _ in range(1 if a.shared else K)])
    for m in nets:
        m[-1].weight.data *= 0.1

    def paint(y):
        B, _, h, w = y.shape
        vs, outs, v = torch.zeros(B, 1, h // 2, w // 2), [], torch.zeros(B, 1, h, w)
        for k in range(K):
            o = torch.tanh(Gt(v))
            r = y - o
            g = Gt(r * (1 - o * o))
            f = torch.cat(
                [F.pixel_unshuffle(t, 2) for t in (y, r, g)]
                + [
                    vs,
                    g[..., ::2, ::2],
                    F.avg_pool2d(y, 5, 1, 2)[..., ::2, ::2],
                    F.avg_pool2d(r, 5, 1, 2)[..., ::2, ::2],
                ],
                1,
            )
            d = nets[0 if a.shared else k](f)
            vs = vs + F.softplus(4 * d - 2) / 4 if a.additive else F.relu(vs + d + 0.02 * g[..., ::2, ::2])
            v = torch.zeros(B, 1, h, w)
            v[..., ::2, ::2] = vs
            outs.append(torch.tanh(Gt(v)))
        return outs

    opt, it = torch.optim.Adam(nets.parameters(), 2e-3), 0
    t0 = time.process_time()
    while (el := time.process_time() - t0) < a.budget:
        for g in opt.param_groups:
            g["lr"] = 2e-3 * (1 - el / a.budget) + 1e-5
        y = batch(8)
        loss = sum(((o - y) ** 2).mean() * (1.0 if k == K - 1 else 0.1) for k, o in enumerate(paint(y)))
        opt.zero_grad()
        loss.backward()
        opt.step()
        it += 1
    tag = "conv" + ("_shared" if a.shared else "") + ("_additive" if a.additive else "") + "_" + a.train
    emit("-", tag, steps=it, parameters=sum(p.numel() for p in nets.parameters()), train_cpu_s=a.budget)
    with torch.no_grad():
        for name, y in pictures(a):
            t, n = torch.tensor(y[None, None].astype(np.float32)), 5
            paint(t)
            t1 = time.process_time()
            for _ in range(n):
                o = paint(t)
            emit(
                name,
                tag,
                **metrics(o[-1][0, 0].double().numpy(), y),
                psnr_per_pass=[round(psnr(q[0, 0].numpy(), y), 2) for q in o],
                cpu_s=(time.process_time() - t1) / n,
            )


def run_replica(a):
    """one training step of the thesis' network, MNIST row of Table 8.1 (28x28, T 64, z 100, LSTM 256, READ 3x3, radius
    3), batch 100, random binary target"""
    import torch
    import torch.nn as nn
    import torch.nn.functional as F

    torch.set_num_threads(a.threads)
    torch.manual_seed(a.seed)
    S, N, H, Z, T, B, rad = 28, 3, 256, 100, a.T, 100, 3.0

    class Lstm(nn.Module):
        def __init__(s, i):
            super().__init__()
            s.lin = nn.Linear(i + H, 4 * H)

        def forward(s, x, h, c):
            i, f, o, u = s.lin(torch.cat([x, h], 1)).chunk(4, 1)
            c = torch.sigmoid(f) * c + torch.sigmoid(i) * torch.tanh(u)
            return torch.sigmoid(o) * torch.tanh(c), c

    L = nn.ModuleDict(
        dict(
            enc=Lstm(2 * N * N + H),
            dec=Lstm(Z),
            q=nn.Linear(H, 2 * Z),
            read=nn.Linear(H, 5),
            p1=nn.Linear(H, 64),
            p2=nn.Linear(64, 4),
            zp=nn.Linear(H, 1),
        )
    )
    offs, pix = (torch.arange(N) - (N - 1) / 2).view(1, N), torch.arange(S).view(1, 1, S).float()
    pos = lambda t: (t + 1) * ((S + 1) / 2) - 1  # DRAW's 1-based centre, made 0-based

    def bank(g, d, v):
        f = torch.exp((pix - (g + d * offs)[:, :, None]) ** 2 * (-0.5 / v)[:, :, None])
        return f / (f.sum(2, keepdim=True) + 1e-8)

    def step(x):
        z = lambda n: torch.zeros(B, n)
        he, ce, hd, cd, stop, prev = z(H), z(H), z(H), z(H), z(1), None
        canvas, x3, kl, klp, tv = torch.zeros(B, S, S), x.view(B, S, S), 0.0, 0.0, 0.0
        for t in range(T):
            a5 = L["read"](hd)
            fx = bank(pos(a5[:, 0:1]), a5[:, 3:4].exp() * ((S - 1) / (N - 1)), a5[:, 2:3].exp()).transpose(1, 2)
            fy = bank(pos(a5[:, 1:2]), a5[:, 3:4].exp() * ((S - 1) / (N - 1)), a5[:, 2:3].exp())
            rd = lambda im: (fy @ im @ fx).reshape(B, -1) * a5[:, 4:5].exp()
            he, ce = L["enc"](torch.cat([rd(x3), rd(x3 - torch.tanh(canvas)), hd], 1), he, ce)
            mu, ls = L["q"](he).chunk(2, 1)
            kl = kl + 0.5 * (mu * mu + (2 * ls).exp() - 2 * ls - 1).sum()
            hd, cd = L["dec"](mu + ls.exp() * torch.randn(B, Z), hd, cd)
            p, lo = L["p2"](F.relu(L["p1"](hd))), L["zp"](hd)
            u = torch.rand(B, 1).clamp(1e-6, 1 - 1e-6)
            zp = lo + torch.log(u) - torch.log1p(-u)  # temperature 1
            lq = lambda l: -zp + l - 2 * F.softplus(-zp + l)
            klp = klp + (lq(lo) - lq(torch.zeros_like(lo))).sum()
            gate = torch.sigmoid(zp)
            v = F.softplus(p[:, 3:4]) * gate * (stop <= 25).float()
            sg = (torch.sigmoid(p[:, 2:3]) + 0.5) * (rad / 2)
            ga = lambda m: torch.exp((pix - pos(m)[:, :, None]) ** 2 * (-0.5 / (sg * sg))[:, :, None])
            canvas = canvas + (ga(p[:, 1:2]).transpose(1, 2) @ ga(p[:, 0:1])) * v[:, :, None]
            tv = tv + ((v - prev).abs().sum() if prev is not None else 0.0)
            prev, stop = v, stop + 1 - gate.detach()
        o = 1e-3 + (1 - 2e-3) * torch.tanh(canvas)
        return (-(x3 * o.log() + (1 - x3) * (1 - o).log()).sum() + kl + klp + 0.1 * tv) / B

    opt, x, ts = torch.optim.Adam(L.parameters(), 1e-4), (torch.rand(B, S * S) < 0.2).float(), []
    for k in range(a.steps):
        t0, w0 = time.process_time(), time.perf_counter()
        loss = step(x)
        opt.zero_grad()
        loss.backward()
        opt.step()
        ts.append((time.process_time() - t0, time.perf_counter() - w0))
        emit(
            "-",
            "replica_step",
            step=k,
            loss=loss.item(),
            cpu_s=ts[-1][0],
            wall_s=ts[-1][1],
            torch=torch.__version__,
            threads=a.threads,
        )
    if len(ts) > 1:
        emit(
            "-",
            "replica_median",
            cpu_s=float(np.median([t[0] for t in ts[1:]])),
            wall_s=float(np.median([t[1] for t in ts[1:]])),
            parameters=sum(p.numel() for p in L.parameters()),
        )


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    jobs = dict(
        painters=run_painters,
        slew=run_slew,
        noise=run_noise,
        colour=run_colour,
        check=run_check,
        conv=run_conv,
        replica=run_replica,
        export=run_export,
    )
    p.add_argument("job", nargs="+", choices=["all", *jobs], help="all = check painters slew noise colour (no torch)")
    p.add_argument(
        "--image", action="append", default=[], metavar="FILE", help="own picture, may be given more than once"
    )
    p.add_argument(
        "--set", choices=["skimage", "procedural"], default="skimage", help="built-in pictures (without --image)"
    )
    p.add_argument("--size", type=int, default=128, help="side in pixels, a multiple of 32")
    p.add_argument("--quick", action="store_true", help="leave the free splats out")
    p.add_argument("--to", default="pictures", metavar="DIR", help="export: folder to write to")
    p.add_argument("--seed", type=int, default=0)
    p.add_argument("--budget", type=float, default=100, help="conv: training time, CPU seconds")
    p.add_argument("--passes", type=int, default=6)
    p.add_argument("--channels", type=int, default=24)
    p.add_argument("--shared", action="store_true", help="conv: one set of weights for all passes")
    p.add_argument("--additive", action="store_true", help="conv: paint can only be added")
    p.add_argument(
        "--train",
        choices=["mixed", "procedural"],
        default="procedural",
        help="conv: mixed adds nine skimage photographs, none of the test set",
    )
    p.add_argument("--steps", type=int, default=5)
    p.add_argument("--T", type=int, default=64)
    p.add_argument("--threads", type=int, default=1)
    a = p.parse_args()
    if a.size % 32 or a.size < 64:
        p.error("--size must be a multiple of 32, at least 64")
    for j in ("check", "painters", "slew", "noise", "colour") if "all" in a.job else a.job:
        jobs[j](a)


if __name__ == "__main__":
    main()
