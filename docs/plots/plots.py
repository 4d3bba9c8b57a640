"""Draws the plots of the book from the tables in docs/src/plots/*.csv and docs/src/generated/*.csv.

    python3 -m venv .venv && .venv/bin/pip install -r docs/plots/requirements.txt
    .venv/bin/python docs/plots/plots.py                # writes docs/src/plots/*.svg and docs/src/generated/*.svg
    .venv/bin/python docs/plots/plots.py --check        # also: the tables that results.md repeats are the same
    .venv/bin/python docs/plots/plots.py --png DIR      # the same as PNG, to look at

The same tables give the same bytes.
"""

import argparse
import csv
import re
import sys
from pathlib import Path

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt  # noqa: E402

SOURCE = Path(__file__).resolve().parent.parent / "src"
TABLES, GENERATED = SOURCE / "plots", SOURCE / "generated"
OURS, PEER, OTHER, PALE, RULE = "#1f6fb4", "#8a949e", "#d9822b", "#a9cbe8", "#c0392b"
# Tables that results.md repeats.
REPEATED = ["missions", "odometry"]

plt.rcParams.update({
    "svg.hashsalt": "paintcopter", "svg.fonttype": "path", "font.size": 9, "axes.titlesize": 9, "axes.spines.top": False,
    "axes.spines.right": False, "axes.axisbelow": True, "axes.grid": True, "grid.color": "#e3e6e9", "legend.frameon": False,
    "figure.facecolor": "white", "savefig.facecolor": "white",
})


def table(name, folder=TABLES):
    with open(folder / f"{name}.csv", newline="") as file:
        return list(csv.DictReader(file))


def numbers(rows, column):
    return [float(row[column]) for row in rows]


def bars(axes, names, series, **options):
    """Groups of horizontal bars, the first name at the top; `series` is a list of (label, values, colour)."""
    height = 0.8 / len(series)
    for k, (label, values, colour) in enumerate(series):
        places = [i + (k - (len(series) - 1) / 2) * height for i in range(len(names))]
        axes.barh(places, values, height * 0.92, label=label, color=colour, **options)
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.grid(axis="y", visible=False)


def columns(axes, names, series):
    width = 0.8 / len(series)
    for k, (label, values, colour) in enumerate(series):
        places = [i + (k - (len(series) - 1) / 2) * width for i in range(len(names))]
        axes.bar(places, values, width * 0.92, label=label, color=colour)
    axes.set_xticks(range(len(names)), names)
    axes.grid(axis="x", visible=False)


def missions():
    rows = table("missions")
    figure, axes = plt.subplots(figsize=(7.6, 2.7))
    places = range(len(rows))
    for label, column, mark, colour in [("here, worst of seeds 1 to 10", "here", "o", OURS),
                                        ("the papers, real robot", "papers", "s", OTHER), ("bound", "bound", "|", RULE)]:
        axes.plot(numbers(rows, column), places, mark, label=label, color=colour, markersize=12 if mark == "|" else 7,
                  markeredgewidth=2 if mark == "|" else 1, linestyle="none")
    axes.set_yticks(places, [row["figure"] for row in rows])
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xscale("log")
    axes.set_xticks([0.01, 0.1, 1, 10], ["0.01", "0.1", "1", "10"])
    axes.set_xlabel("centimetres (logarithmic; smaller is better)")
    axes.legend(loc="upper center", bbox_to_anchor=(0.35, 1.17), ncols=3)
    return figure


def quadratic_programs():
    rows = table("quadratic_programs")
    figure, axes = plt.subplots(figsize=(6.4, 3.4))
    looks = {"ours": (OURS, "o"), "PIQP": ("#4b9b6e", "s"), "Clarabel": (OTHER, "^"), "OSQP": ("#8e63b0", "D"), "DAQP": (PEER, "v")}
    for solver, (colour, mark) in looks.items():
        own = [row for row in rows if row["solver"] == solver]
        label = "PrimalDualActiveSet (ours)" if solver == "ours" else "OSQP at 1e-6" if solver == "OSQP" else solver
        axes.plot(numbers(own, "states"), numbers(own, "cpu_ms"), marker=mark, color=colour, label=label)
    axes.set(xscale="log", yscale="log", xlabel="states of the stroke", ylabel="CPU time of one program, ms")
    axes.set_xticks([20, 200, 2000, 20000], ["20", "200", "2000", "20,000"])
    axes.set_yticks([0.01, 0.1, 1, 10, 100, 1000], ["0.01", "0.1", "1", "10", "100", "1000"])
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def atlases():
    rows = table("atlases")
    meshes = list(dict.fromkeys(row["mesh"] for row in rows))
    looks = [("unwrap", "unwrap (ours)", OURS), ("xatlas", "xatlas 0.0.11", OTHER), ("uvunwrap", "uvunwrap 0.3.0", PEER)]
    figure, (seams, charts, times) = plt.subplots(1, 3, figsize=(8.4, 5), sharey=True)
    for axes, column in [(seams, "seam"), (charts, "charts"), (times, "cpu_s")]:
        for (tool, label, colour), mark in zip(looks, "os^"):
            found = {row["mesh"]: float(row[column]) for row in rows if row["tool"] == tool}
            axes.plot(found.values(), [meshes.index(mesh) for mesh in found], mark, color=colour, label=label, linestyle="none")
    seams.set(xlabel="length of the seams over\nsquare root of the area", xlim=(0, 50))
    seams.set_yticks(range(len(meshes)), meshes)
    seams.set_ylim(len(meshes) - 0.4, -0.6)
    charts.set(xscale="log", xlabel="charts (logarithmic)")
    charts.set_xticks([1, 10, 100, 1000], ["1", "10", "100", "1000"])
    times.set(xscale="log", xlabel="CPU time, s (logarithmic)")
    times.set_xticks([0.1, 1, 10], ["0.1", "1", "10"])
    charts.legend(loc="lower center", ncols=3, bbox_to_anchor=(0.5, 1.0))
    return figure


def painters():
    rows = table("painters")
    figure, (upper, lower) = plt.subplots(2, 1, figsize=(7.6, 5.2), sharex=True, height_ratios=[3, 1.3])
    # Beside the mark, where it meets no other: (x, y) in points, alignment.
    places = {"feedback, 6 passes": (3, 8, "right"), "feedback, 4 passes": (0, -13, "center"), "deconvolution, 40": (0, -13, "center"),
              "feedback, three coats": (0, 8, "center"), "deconvolution, 200": (0, 8, "center"), "L-BFGS, 200": (7, 3, "left"),
              "greedy, 1600": (0, -13, "center"), "400 splats": (0, 7, "center")}
    for side, colour, mark, label in [("ours", OURS, "o", "painters of paint-net"), ("peer", PEER, "s", "peers of paint_baselines.py")]:
        own = [row for row in rows if row["side"] == side]
        for axes, shown in [(upper, [row for row in own if float(row["psnr_db"]) > 24]), (lower, [row for row in own if float(row["psnr_db"]) <= 24])]:
            axes.plot(numbers(shown, "cpu_ms"), numbers(shown, "psnr_db"), mark, color=colour, linestyle="none", label=label)
        for row in own:
            x, y, align = places.get(row["painter"], (7, -3, "left"))
            axes = upper if float(row["psnr_db"]) > 24 else lower
            axes.annotate(row["painter"], (float(row["cpu_ms"]), float(row["psnr_db"])), (x, y), textcoords="offset points", ha=align,
                          fontsize=8, color=colour if side == "ours" else "#555c63")
    upper.set(xscale="log", xlim=(0.2, 20000), ylim=(24, 25.8), ylabel="PSNR, dB")
    lower.set(ylim=(18, 24), ylabel="PSNR, dB", xlabel="CPU time of a picture of 128 × 128 pixels, ms (logarithmic)")
    lower.set_xticks([1, 10, 100, 1000, 10000], ["1", "10", "100", "1000", "10,000"])
    upper.legend(loc="upper left")
    figure.subplots_adjust(hspace=0.08)
    return figure


def equal_sprays():
    rows = table("equal_sprays", GENERATED)
    figure, axes = plt.subplots(figsize=(6.4, 3))
    columns(axes, [f"{row['texture']}\n{row['sprays']}" for row in rows],
            [("network of the thesis", numbers(rows, "thesis_db"), OTHER), ("feedback network", numbers(rows, "feedback_db"), OURS),
             ("free sprays", numbers(rows, "free_db"), PALE)])
    axes.set(ylabel="PSNR, dB", xlabel="texture, number of sprays")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.18), ncols=3)
    return figure


def integration():
    rows = table("integration")
    figure, axes = plt.subplots(figsize=(5.6, 2.2))
    bars(axes, [f"{row['voxel_mm']} mm" for row in rows],
         [("tsdf-hash", numbers(rows, "tsdf_hash_ms"), OURS), ("Open3D 0.20", numbers(rows, "open3d_ms"), OTHER)])
    for container in axes.containers:
        axes.bar_label(container, padding=3, fontsize=8)
    axes.set(xlabel="CPU time of one image of 640 × 480, ms", ylabel="voxel", xlim=(0, 1.12 * max(numbers(rows, "open3d_ms"))))
    axes.legend(loc="upper right")
    return figure


def odometry():
    rows = table("odometry")
    names = [row["sequence"] for row in rows]
    figure, (errors, nees) = plt.subplots(1, 2, figsize=(8.4, 3.1))
    columns(errors, names, [("one camera", numbers(rows, "ate_one_mm"), OURS), ("two cameras", numbers(rows, "ate_two_mm"), PALE)])
    errors.plot([i - 0.2 for i in range(len(rows))], numbers(rows, "ate_one_worst_mm"), "_", color=RULE, markersize=14, markeredgewidth=2,
                label="one camera, worst of five")
    errors.set(ylabel="position error (ATE), mm", ylim=(0, 50))
    errors.legend(loc="upper right", fontsize=8)
    groups = [("position", "nees_position", "o", OURS), ("attitude", "nees_attitude", "s", OTHER), ("velocity", "nees_velocity", "^", "#4b9b6e"),
              ("gyroscope bias", "nees_gyro_bias", "D", "#8e63b0"), ("accelerometer bias", "nees_accel_bias", "v", PEER)]
    for k, (label, column, mark, colour) in enumerate(groups):
        nees.plot([i + (k - 2) * 0.13 for i in range(len(rows))], numbers(rows, column), mark, color=colour, label=label, linestyle="none")
    nees.axhline(3, color=RULE, linewidth=1.2, label="3: consistent")
    nees.set(ylabel="mean NEES, 3 rows each (no unit)", ylim=(0, 6.2))
    nees.set_xticks(range(len(rows)), names)
    nees.grid(axis="x", visible=False)
    nees.legend(loc="upper center", ncols=2, fontsize=8)
    for axes in (errors, nees):
        axes.tick_params(axis="x", labelsize=8)
    return figure


def landmarks():
    rows = table("landmarks")
    counts = [int(row["landmarks"]) for row in rows]
    figure, (errors, times) = plt.subplots(1, 2, figsize=(7.8, 2.6), gridspec_kw={"wspace": 0.25})
    errors.plot(counts, numbers(rows, "ate_v1_02_mm"), "o-", color=OURS, label="V1_02")
    errors.plot(counts, numbers(rows, "ate_mh_03_mm"), "s-", color=OTHER, label="MH_03")
    errors.set(ylabel="position error (ATE), mm", ylim=(0, 24))
    errors.legend()
    times.plot(counts, numbers(rows, "image_ms"), "o-", color=OURS)
    times.set(ylabel="time of an image, median, ms", ylim=(0, 3))
    for axes in (errors, times):
        axes.set_xscale("log")
        axes.set_xticks(counts, [str(count) for count in counts])
        axes.minorticks_off()
        axes.set_xlabel("landmarks at most")
    return figure


def cascade():
    rows = table("cascade")
    colours = [{"alone": PEER, "cascade": OTHER, "one": OURS}[row["kind"]] for row in rows]
    figure, panels = plt.subplots(1, 3, figsize=(8.4, 3), sharey=True)
    for axes, column, label in zip(panels, ["position_mm", "velocity_mm_per_s", "attitude_deg"],
                                   ["position error, mm", "velocity error, mm/s", "attitude error, degrees"]):
        bars(axes, [row["estimator"] for row in rows], [("", numbers(rows, column), colours)])
        axes.set_xlabel(label)
    return figure


def errors_over_time(axes, rows, curves):
    for column, label, colour in curves:
        axes.plot(numbers(rows, "time_s"), numbers(rows, column), color=colour, label=label, linewidth=1.1)
    axes.legend(loc="upper right", ncols=len(curves), fontsize=8)


def fig_6_9():
    rows = table("fig_6_9", GENERATED)
    figure, (hits, gun) = plt.subplots(2, 1, figsize=(7.6, 4.6), sharex=True)
    errors_over_time(hits, rows, [("hit_cm", "gun turning", OURS), ("locked_hit_cm", "gun locked", OTHER)])
    hits.set(ylabel="hit error, cm", ylim=(0, None))
    curves = [("yaw_deg", "yaw, degrees", OURS), ("pitch_deg", "pitch, degrees", OTHER), ("distance_cm", "distance, cm", PEER)]
    errors_over_time(gun, rows, curves)
    gun.set(ylabel="gun turning: off the plan", xlabel="time, s")
    return figure


def fig_7_4():
    rows = table("fig_7_4", GENERATED)
    figure, axes = plt.subplots(figsize=(6.4, 2.8))
    for column, label, colour, style in [("hand_ml_m", "hand, 0.1 to 1 m/s", PEER, "-"), ("uniform_ml_m", "uniform", OTHER, "-"),
                                         ("gradient_ml_m", "gradient preserving", OURS, "--")]:
        axes.plot(numbers(rows, "arc_length_m"), numbers(rows, column), style, color=colour, label=label, linewidth=2.5 if style == "-" else 1.5)
    axes.set(xlabel="length of the stroke, m", ylabel="paint, ml/m", ylim=(0, None))
    axes.legend()
    return figure


def fig_7_6():
    rows = table("fig_7_6", GENERATED)
    figure, panels = plt.subplots(2, 3, figsize=(8.4, 3.8), sharex=True, sharey="row")
    titles = ["1 m, robot 8 cm/s", "0.5 m, robot 15 cm/s", "0.1 m, robot 40 cm/s (ours)"]
    for k, title in enumerate(titles):
        own = [row for row in rows if row["run"] == str(k + 1)]
        for axes, curve in zip(panels[:, k], ["time_s", "distance_m"]):
            shown = [row for row in own if row["curve"] == curve]
            axes.plot(numbers(shown, "time_s"), numbers(shown, "value"), color=OURS, linewidth=1.2,
                      drawstyle="steps-post" if curve == "time_s" else "default")
        panels[0, k].set_title(title)
        panels[1, k].set_xlabel("time, s")
    panels[0, 0].set(ylabel="latency in time, s", ylim=(0, None))
    panels[1, 0].set(ylabel="in distance, m", ylim=(0, None))
    return figure


def fig_5_5():
    rows = table("fig_5_5", GENERATED)
    figure, axes = plt.subplots(figsize=(7.6, 2.6))
    for column, label, colour in [("before_mm", "by odometry", OTHER), ("after_mm", "loops closed", OURS)]:
        axes.plot(numbers(rows, "image"), numbers(rows, column), color=colour, label=label)
    axes.axvline(72, color=PALE, linewidth=1)
    axes.set(xlabel="image; from 72 on the camera sees the beginning again", ylabel="position error, mm", ylim=(0, None))
    axes.legend(loc="upper left")
    return figure


def fig_7_7():
    rows = table("fig_7_7", GENERATED)
    figure, panels = plt.subplots(2, 1, figsize=(7.6, 3.8), sharex=True, sharey=True)
    for axes, planner in zip(panels, ["smoothing", "optimal"]):
        errors_over_time(axes, rows, [(f"{planner}_pan_deg", "pan", OURS), (f"{planner}_tilt_deg", "tilt", OTHER)])
        axes.set(ylabel=f"{planner}, degrees", ylim=(-35, 45))
    panels[1].set_xlabel("time, s")
    return figure


def fig_7_8():
    rows = table("fig_7_8", GENERATED)
    # The source of the coefficients spells some names in two ways.
    tidy = lambda name: re.sub(r"^k | tints$| shade", "", name).replace("Phathalo", "Phthalo").replace("Phathlo", "Phthalo").lower()
    figure, (films, opaque) = plt.subplots(1, 2, figsize=(9.6, 4.2))
    layers = [1, 2, 4, 8, 16]
    for row in rows:
        films.plot(layers, [float(row[f"mean_{n}"]) for n in layers], "o-", color=OURS, markersize=3, linewidth=1, alpha=0.6)
    films.set_xscale("log", base=2)
    films.set_xticks(layers, layers)
    films.set(xlabel="layers on white paper", ylabel="mean distance from the measured film, %", ylim=(0, None))
    bars(opaque, [tidy(row["pigment"]) for row in rows],
         [("mean of 36 bands", numbers(rows, "mean_opaque"), OURS), ("greatest", numbers(rows, "greatest_opaque"), PALE)])
    opaque.axvline(1, color=OURS, linewidth=1, linestyle="--", label="asked of the mean: 1 %")
    opaque.axvline(4, color=RULE, linewidth=1, linestyle="--", label="asked of the greatest: 4 %")
    opaque.set_xlabel("opaque film: error of the reflectance, %")
    opaque.legend(loc="upper right")
    figure.tight_layout()
    return figure


def handheld_fig_5():
    rows = table("handheld_fig_5", GENERATED)
    figure, axes = plt.subplots(figsize=(6.4, 2.8))
    for column, label, colour in [("planned_percent", "proposed", OURS), ("greedy_percent", "greedy", OTHER), ("random_percent", "random", PEER)]:
        axes.plot(numbers(rows, "trial"), numbers(rows, column), color=colour, label=label)
    axes.set(xlabel="trials, the best rank first", ylabel="rank of all paths, %", ylim=(0, 105))
    axes.legend(loc="upper left")
    return figure


def digest(text):
    """FNV-1a of the bytes of a table: a plot carries that of the table it shows."""
    value = 0xCBF29CE484222325
    for byte in text:
        value = (value ^ byte) * 0x100000001B3 % 2**64
    return f"fnv1a:{value:016x}"


FROM_GENERATED = [fig_5_5, fig_6_9, fig_7_4, fig_7_6, fig_7_7, fig_7_8, equal_sprays, handheld_fig_5]
PLOTS = [missions, quadratic_programs, atlases, painters, integration, odometry, landmarks, cascade]


def check():
    """Names each figure of a table that results.md does not have."""
    text = (SOURCE / "results.md").read_text().replace("\u202f", "")
    known = {float(number.replace(",", "")) for number in re.findall(r"\d[\d,]*(?:\.\d+)?", text)}
    missing = []
    for name in REPEATED:
        for row in table(name):
            for column, value in row.items():
                try:
                    if float(value) not in known:
                        missing.append(f"{name}.csv: {column} {value}")
                except ValueError:
                    pass
    return missing


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="fail if a figure of a table that results.md repeats is not there")
    parser.add_argument("--png", type=Path, metavar="DIR", help="write PNG into DIR instead")
    arguments = parser.parse_args()
    for plot in PLOTS + FROM_GENERATED:
        figure = plot()
        name = plot.__name__
        if arguments.png:
            arguments.png.mkdir(parents=True, exist_ok=True)
            figure.savefig(arguments.png / f"{name}.png", dpi=110, bbox_inches="tight")
        elif plot in FROM_GENERATED:
            of = digest((GENERATED / f"{name}.csv").read_bytes())
            figure.savefig(GENERATED / f"{name}.svg", bbox_inches="tight", metadata={"Date": None, "Identifier": of})
        else:
            figure.savefig(TABLES / f"{name}.svg", bbox_inches="tight", metadata={"Date": None})
        plt.close(figure)
    missing = check() if arguments.check else []
    print("\n".join(missing), end="\n" if missing else "", file=sys.stderr)
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
