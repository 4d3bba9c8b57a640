"""The thesis' painting network in PyTorch: loss and gradients at given weights, pictures and noise, in double precision.

  pip install numpy torch
  python thesis_reference.py write ../../paint-net/tests/data/thesis_reference.txt    the file that `cargo test -p paint-net` compares with
  python thesis_reference.py step --steps 5                                           time of training steps, batch 100 (torch)

Both rows of Table 8.1 of the thesis. Weights, pictures and noise come from the hash of `paint_baselines.py`, so that the file
needs to hold results only: per row of the table the loss, its terms, steps used, and for every weight matrix and bias the sum,
the length and a few entries of its gradient.
"""

import argparse
import json
import time

import torch
import torch.nn.functional as F

ROWS = dict(
    mnist=dict(side=28, steps=64, latent=100, hidden=256, read=3, radius=3.0, stop=25.0, paint=64),
    paint=dict(side=32, steps=100, latent=200, hidden=400, read=6, radius=4.0, stop=45.0, paint=64),
)
STOP, VARIATION, PRIOR, FLOOR = 1.0, 0.1, -1.0, 1e-3
BATCH = 3
M = (1 << 64) - 1


def hashed(seed, xs, y):
    """uniform in [0, 1): splitmix64 of seed, column and row, as `paint_net::procedural::lattice`"""
    out = []
    base = (seed + 0xC2B2AE3D27D4EB4F * (y + 1)) & M
    for x in range(xs):
        z = (base + 0x9E3779B97F4A7C15 * (x + 1)) & M
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & M
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & M
        out.append(((z ^ (z >> 31)) >> 11) / (1 << 53))
    return torch.tensor(out, dtype=torch.float64)


def layers(r):
    """name, inputs, outputs"""
    h, g = r["hidden"], 2 * r["read"] ** 2
    return [
        ("attention", h, 5),
        ("encoder", g + 2 * h, 4 * h),
        ("latent", h, 2 * r["latent"]),
        ("decoder", r["latent"] + h, 4 * h),
        ("paint", h, r["paint"]),
        ("spray", r["paint"], 4),
        ("stop", h, 1),
    ]


def weights(r, seed=11):
    """uniform within 1.5 over the root of the inputs; biases within 0.3"""
    total = sum(i * o + o for _, i, o in layers(r))
    flat, at, w = hashed(seed, total, 0) * 2 - 1, 0, {}
    for name, i, o in layers(r):
        w[name + ".weight"] = (flat[at : at + i * o].reshape(i, o) * (1.5 / i**0.5)).clone()
        at += i * o
        w[name + ".bias"] = (flat[at : at + o] * 0.3).clone()
        at += o
    return w


def lstm(w, name, x, h, c):
    i, f, o, u = (torch.cat([x, h], 1) @ w[name + ".weight"] + w[name + ".bias"]).chunk(4, 1)
    c = torch.sigmoid(f) * c + torch.sigmoid(i) * torch.tanh(u)
    return torch.sigmoid(o) * torch.tanh(c), c


def loss(r, w, x, eps, u):
    """x: pictures B x side x side; eps: T x B x latent; u: T x B in (0, 1). Terms are sums over the batch."""
    S, N, H, B = r["side"], r["read"], r["hidden"], x.shape[0]
    dense = lambda name, v: v @ w[name + ".weight"] + w[name + ".bias"]
    pixels = torch.arange(S, dtype=x.dtype).view(1, 1, S)
    offsets = (torch.arange(N, dtype=x.dtype) - (N - 1) / 2).view(1, N)
    centre = lambda t: (S + 1) / 2 * (t + 1) - 1

    def bank(g, spacing, variance):
        f = torch.exp(-((pixels - (g + spacing * offsets)[:, :, None]) ** 2) / (2 * variance)[:, :, None])
        return f / f.sum(2, keepdim=True).clamp(min=1e-8)

    zeros = lambda n: torch.zeros(B, n, dtype=x.dtype)
    he, ce, hd, cd = zeros(H), zeros(H), zeros(H), zeros(H)
    canvas, spent, before = torch.zeros_like(x), zeros(1), None
    latent = stop = variation = 0.0
    used = torch.zeros(B)
    for t in range(r["steps"]):
        a = dense("attention", hd)
        variance, spacing = a[:, 2:3].clamp(-6, 6).exp(), (S - 1) / (N - 1) * a[:, 3:4].clamp(-5, 3).exp()
        fx, fy = bank(centre(a[:, 0:1]), spacing, variance), bank(centre(a[:, 1:2]), spacing, variance)
        glimpse = lambda image: (fy @ image @ fx.transpose(1, 2)).reshape(B, -1) * a[:, 4:5].exp()
        he, ce = lstm(w, "encoder", torch.cat([glimpse(x), glimpse(x - torch.tanh(canvas)), hd], 1), he, ce)
        mean, log_sd = dense("latent", he).chunk(2, 1)
        latent = latent + 0.5 * (mean**2 + (2 * log_sd).exp() - 2 * log_sd - 1).sum()
        hd, cd = lstm(w, "decoder", mean + log_sd.exp() * eps[t], hd, cd)
        p, logit = dense("spray", F.relu(dense("paint", hd))), dense("stop", hd)
        z = logit + torch.log(u[t])[:, None] - torch.log(1 - u[t])[:, None]
        log_q = lambda l: -z + l - 2 * F.softplus(l - z)
        stop = stop + (log_q(logit) - log_q(torch.full_like(logit, PRIOR))).sum()
        gate, paints = torch.sigmoid(z), (spent <= r["stop"]).to(x.dtype)
        v = F.softplus(p[:, 3:4]) * gate * paints
        sigma = r["radius"] / 2 * (0.5 + torch.sigmoid(p[:, 2:3]))
        profile = lambda m: torch.exp(-((pixels[:, 0] - centre(m)) ** 2) / (2 * sigma**2))
        canvas = canvas + v[:, :, None] * profile(p[:, 1:2])[:, :, None] * profile(p[:, 0:1])[:, None, :]
        if before is not None:
            variation = variation + (v - before).abs().sum()
        before, spent, used = v, spent + 1 - gate.detach(), used + paints[:, 0]
    ink = FLOOR + (1 - 2 * FLOOR) * torch.tanh(canvas)
    cross = -(x * ink.log() + (1 - x) * (1 - ink).log()).sum()
    return cross + latent + STOP * stop + VARIATION * variation, (cross, latent, stop, variation), used


def given(r):
    """pictures and noise of the comparison"""
    side, T, Z = r["side"], r["steps"], r["latent"]
    x = hashed(12, BATCH * side * side, 0).reshape(BATCH, side, side)
    eps = torch.stack([6**0.5 * (hashed(13, BATCH * Z, t) - 0.5).reshape(BATCH, Z) for t in range(T)])
    u = torch.stack([0.05 + 0.9 * hashed(14, BATCH, t) for t in range(T)])
    return x, eps, u


def write(path):
    lines = ["# by benches/peers/thesis_reference.py write; torch " + torch.__version__]
    for name, r in ROWS.items():
        w = {k: v.requires_grad_() for k, v in weights(r).items()}
        total, terms, used = loss(r, w, *given(r))
        total.backward()
        lines.append(f"row {name} " + " ".join(f"{float(v.detach()):.15e}" for v in (total, *terms)))
        lines.append("used " + " ".join(str(int(n)) for n in used))
        for key, v in w.items():
            g = v.grad.flatten()
            picked = [k * (len(g) - 1) // 4 for k in range(5)]
            entries = " ".join(f"{k}:{float(g[k]):.15e}" for k in picked)
            lines.append(f"gradient {key} {float(g.sum()):.15e} {float(g.norm()):.15e} {entries}")
    with open(path, "w") as f:
        f.write("\n".join(lines) + "\n")
    print("\n".join(line for line in lines if not line.startswith("gradient")))


def step(steps, threads):
    torch.set_num_threads(threads)
    for name, r in ROWS.items():
        w = {k: v.float().requires_grad_() for k, v in weights(r).items()}
        optimiser, batch = torch.optim.Adam(w.values(), 1e-4), 100 if name == "mnist" else 20
        x = (torch.rand(batch, r["side"], r["side"]) < 0.2).float()
        times = []
        for _ in range(steps):
            began = time.process_time()
            eps = torch.randn(r["steps"], batch, r["latent"])
            total, _, _ = loss(r, w, x, eps, torch.rand(r["steps"], batch).clamp(1e-6, 1 - 1e-6))
            optimiser.zero_grad()
            (total / batch).backward()
            optimiser.step()
            times.append(time.process_time() - began)
        median = sorted(times[1:] or times)[len(times[1:] or times) // 2]
        print(json.dumps(dict(row=name, batch=batch, cpu_s_median=median, threads=threads, torch=torch.__version__)))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    jobs = parser.add_subparsers(dest="job", required=True)
    jobs.add_parser("write").add_argument("path")
    job = jobs.add_parser("step")
    job.add_argument("--steps", type=int, default=5)
    job.add_argument("--threads", type=int, default=1)
    a = parser.parse_args()
    write(a.path) if a.job == "write" else step(a.steps, a.threads)
