#!/usr/bin/env python3
"""Peer of paint-sim's calibrations on one core: scipy.optimize.least_squares on numpy. One JSON line per figure.

  library_figures calibration DIR        writes the data and prints ours
  python3 calibration_peers.py DIR       solves the same data

spray_calibration: sigma, flow, ellipse and direction of a jet from five photographed bursts. layer_chart: absorption and scattering of 36 bands
from patches of 1, 2, 4, 8 and 16 layers. jac: 2-point (scipy's default) or analytic, written in numpy as well. Both start where ours does not:
at a spray that is 10 to 30 % off, and at coefficients of one half. cpu_ms = median of the runs, CPU time of the process."""

import argparse
import json
import os
import statistics
import time

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
import numpy as np
import scipy
from scipy.optimize import least_squares

PEER = f"scipy_{scipy.__version__}"


def measure(fig, jac, runs, job, told):
    found = job()
    times = []
    for _ in range(runs):
        start = time.process_time()
        job()
        times.append(time.process_time() - start)
    print(json.dumps(dict(fig=fig, peer=PEER, jac=jac, runs=runs, cpu_ms=round(1e3 * statistics.median(times), 3), **told(found))))


def film(k, s, d, ground):
    """Reflectance (Kubelka and Munk)."""
    g = np.sqrt(k * (k + 2 * s))
    t = np.tanh(g * d) / g
    scattered = s * (1 - ground)
    return (ground + t * (scattered - k * ground)) / (1 + t * (scattered + k))


def gradient(k, s, d, ground):
    """Its derivatives by k, s and d."""
    g2 = k * (k + 2 * s)
    g = np.sqrt(g2)
    tanh = np.tanh(g * d)
    t = tanh / g
    scattered = s * (1 - ground)
    below = 1 + t * (scattered + k)
    r = (ground + t * (scattered - k * ground)) / below
    by_t = ((scattered - k * ground) - r * (scattered + k)) / below
    sech2 = 1 - tanh * tanh
    t_by_g2 = (d * sech2 - t) / (2 * g2)
    by_k = -t * (ground + r) / below + by_t * t_by_g2 * 2 * (k + s)
    by_s = t * (1 - ground) * (1 - r) / below + by_t * t_by_g2 * 2 * k
    return by_k, by_s, by_t * sech2


def by_thickness(k, s, d, ground):
    """Riccati's equation."""
    r = film(k, s, d, ground)
    return s - 2 * (k + s) * r + s * r * r


def spray(data, runs):
    k, s, card, weights = (np.array(data[name]) for name in ("absorption", "scattering", "card", "weights"))
    kept = 1 - np.exp(-0.5 * data["cut"] ** 2)
    slopes, factors, opened, measured = [], [], [], []
    for burst in data["bursts"]:
        rotation, tip = np.array(burst["rotation"]), np.array(burst["translation"])
        readings = np.array(burst["readings"]).reshape(-1, 3)
        columns = burst["columns"]
        rows = len(readings) // columns
        x, y = np.meshgrid(np.arange(columns) - (columns - 1) / 2, np.arange(rows) - (rows - 1) / 2)
        places = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], 1) * burst["pixel"]
        rays = (places - tip) @ rotation
        slopes.append(rays[:, 1:] / rays[:, :1])
        factors.append(-tip[2] / rays[:, 0] ** 3 / (2 * np.pi * kept))
        opened.append(np.full(x.size, burst["duration"]))
        measured.append(readings)
    slopes, factors, opened, measured = (np.concatenate(part) for part in (slopes, factors, opened, measured))

    def thickness(p):
        t, flow, aspect, turn = np.exp(p[0]), np.exp(p[1]), np.exp(p[2]), p[3]
        c, n = np.cos(turn), np.sin(turn)
        x, y = slopes[:, 0] - p[4], slopes[:, 1] - p[5]
        along, across = (c * x + n * y) / (t * np.sqrt(aspect)), (c * y - n * x) * np.sqrt(aspect) / t
        h = flow * opened * factors / t**2 * np.exp(-0.5 * (along**2 + across**2))
        return h, along, across, (t, aspect, c, n)

    def residuals(p):
        r = film(k, s, thickness(p)[0][:, None], card)
        return (r @ weights.T - measured).ravel() / data["noise"]

    def jacobian(p):
        h, along, across, (t, aspect, c, n) = thickness(p)
        slope = by_thickness(k, s, h[:, None], card) @ weights.T
        square, long, short = along**2 + across**2, t * np.sqrt(aspect), t / np.sqrt(aspect)
        columns = [
            square - 2, np.ones_like(h), 0.5 * (along**2 - across**2), along * across * (long / short - short / long),
            along * c / long - across * n / short, along * n / long + across * c / short,
        ]  # fmt: skip
        return np.stack([((h * column)[:, None] * slope).ravel() / data["noise"] for column in columns], 1)

    start = np.array(data["start"])

    def told(found):
        t, flow = np.exp(found.x[:2])
        return dict(sigma=float(np.arctan(t)), flow=float(flow), cost=float(2 * found.cost), readings=measured.size)

    for name, jac in (("2-point", "2-point"), ("analytic", jacobian)):
        measure("spray_calibration", name, runs, lambda: least_squares(residuals, start, jac=jac, x_scale="jac"), told)


def chart(data, runs):
    layers, ground, measured = (np.array(data[name]) for name in ("layers", "ground", "reflectance"))

    def fit(jac):
        found = np.empty((36, 2))
        for band in range(36):

            def residuals(p):
                return (film(np.exp(p[0]), np.exp(p[1]), layers, ground[band]) - measured[:, band]) / data["noise"]

            def jacobian(p):
                k, s = np.exp(p)
                by_k, by_s, _ = gradient(k, s, layers, ground[band])
                return np.stack([k * by_k, s * by_s], 1) / data["noise"]

            found[band] = least_squares(residuals, np.log([0.5, 0.5]), jac=jacobian if jac == "analytic" else jac).x
        return np.exp(found)

    def told(found):
        return dict(absorption_sum=float(found[:, 0].sum()), scattering_sum=float(found[:, 1].sum()))

    for jac in ("2-point", "analytic"):
        measure("layer_chart", jac, runs, lambda: fit(jac), told)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", help="what `library_figures calibration` wrote")
    parser.add_argument("--runs", type=int, default=5)
    a = parser.parse_args()
    if a.runs < 1:
        parser.error("--runs must be at least 1")
    for name, solve in (("bursts", spray), ("chart", chart)):
        with open(os.path.join(a.folder, f"{name}.json")) as file:
            solve(json.load(file), a.runs)


if __name__ == "__main__":
    main()
