#!/usr/bin/env python3
"""Means over the pictures from the lines of `library_figures` and `paint_baselines.py`, as the table of docs/src/paint-net.md.

python painting_table.py FILE.jsonl...       see painting.sh, which makes the files"""

import json
import sys
from collections import defaultdict


def read(paths):
    """(method, image) -> figures; the last line of each counts"""
    lines = {}
    for path in paths:
        with open(path, encoding="utf-8") as file:
            for text in file:
                line = json.loads(text)
                method = line["method"]
                if "limit" in line:
                    method += f"_{line['limit']}"
                lines[method, line["image"]] = line
    figures = defaultdict(list)
    for (method, _), line in lines.items():
        figures[method].append(line)
    return figures


def mean(lines, key):
    values = [line[key] for line in lines if line.get(key) is not None]
    return sum(values) / len(values) if values else None


def cell(value, form):
    return "-" if value is None else form.format(value)


def grey(figures, rows):
    print("| painter | PSNR, dB | cut nozzle, dB | SSIM | sprays | CPU, ms | violations |\n|---|---|---|---|---|---|---|")
    for name, method in rows:
        lines = figures.get(method)
        if not lines:
            continue
        cut = mean(figures[method + "_cut"], "psnr") if method + "_cut" in figures else mean(lines, "psnr_cut")
        seconds = mean(lines, "cpu_s")
        psnr = mean(lines, "psnr_exact") if "psnr_exact" in lines[0] else mean(lines, "psnr")
        print(
            f"| {name} | {cell(psnr, '{:.2f}')} | {cell(cut, '{:.2f}')} | {cell(mean(lines, 'ssim'), '{:.3f}')} "
            f"| {cell(mean(lines, 'sprays'), '{:.0f}')} | {cell(seconds and 1e3 * seconds, '{:.1f}')} "
            f"| {cell(mean(lines, 'violations'), '{:.0f}')} |"
        )


def colour(figures):
    print("\n| picture, paints | ours: CIEDE2000, CPU ms | joint L-BFGS, every pixel a cell | ratio of times |\n|---|---|---|---|")
    for palette in ("cmy", "cmyk", "six"):
        theirs = {line["image"]: line for line in figures.get("colour_" + palette, [])}
        for line in figures.get("paint-net_colour_" + palette, []):
            peer = theirs.get(line["image"])
            if peer:
                print(
                    f"| {line['image']}, {palette} | {line['de00_mean']:.2f}, {1e3 * line['cpu_s']:.0f} "
                    f"| {peer['de00_mean']:.2f}, {1e3 * peer['cpu_s']:.0f} | {peer['cpu_s'] / line['cpu_s']:.0f} |"
                )


def main():
    figures = read(sys.argv[1:])
    grey(
        figures,
        [
            ("**feedback, 6 passes**", "paint-net_feedback_p6"),
            ("feedback, 4 passes", "paint-net_feedback_p4"),
            ("feedback in coats (closed loop), nothing taken back", "paint-net_closed_loop_plan"),
            ("deconvolution, 40 iterations", "paint-net_deconvolution_it40"),
            ("deconvolution, 200 iterations", "paint-net_deconvolution_it200"),
            ("matching pursuit", "paint-net_pursuit"),
            ("**400 free sprays**", "paint-net_free_sprays_400"),
            ("**1600 free sprays**", "paint-net_free_sprays_1600"),
            ("peer: Gaussian filter, the thesis' ideal", "gaussian_filter"),
            ("peer: thesis' layers", "thesis_layers"),
            ("peer: L-BFGS, 20 iterations", "lbfgs_tanh_grid2_it20"),
            ("peer: L-BFGS, 40 iterations", "lbfgs_tanh_grid2_it40"),
            ("peer: L-BFGS, 200 iterations", "lbfgs_tanh_grid2"),
            ("peer: NNLS", "nnls_atanh_grid2"),
            ("peer: greedy, 1600 sprays, refitted", "greedy_1600_refit"),
            ("peer: 400 splats of free spread", "splats_400_sigma"),
            ("peer: 1600 splats", "splats_1600"),
            ("**valve 5 % per waypoint, context-based path**", "paint-net_slew0.05_every2px_contextbased"),
            ("valve 5 %, boustrophedon path", "paint-net_slew0.05_every2px_boustrophedon"),
            ("valve 5 %, boustrophedon path, waypoints every pixel", "paint-net_slew0.05_every1px_boustrophedon"),
            ("peer: valve 5 %, boustrophedon path", "slew_grid2_0.05"),
            ("**valve 2 % per waypoint, context-based path**", "paint-net_slew0.02_every2px_contextbased"),
            ("valve 2 %, boustrophedon path", "paint-net_slew0.02_every2px_boustrophedon"),
            ("valve 2 %, row by row, waypoints every pixel", "paint-net_slew0.02_every1px_boustrophedon"),
            ("peer: valve 2 %, row by row", "slew_grid2_0.02"),
            ("noise, blind", "paint-net_noise_open"),
            ("**noise, a look after each coat**", "paint-net_noise_closed"),
            ("noise, flow 30 % too small", "paint-net_noise_closed_gain0.7"),
            ("noise, flow 30 % too large", "paint-net_noise_closed_gain1.3"),
            ("peer: noise, blind", "noise_open"),
            ("peer: noise, the rest solved anew every 8 rows", "noise_closed"),
        ],
    )
    colour(figures)


if __name__ == "__main__":
    main()
