"""Every criterion bench of this working tree beside an earlier commit's: CPU-bound ratios from interleaved short runs.

    python3 benches/ratio.py COMMIT [--rounds 3] [--seconds 1] [NAME_PART ...]     from any folder

Builds the benches of both (the earlier commit in a worktree of its own), runs them in turns, and prints for each bench the
median time before and after and their ratio (above 1: faster now). Benches that bear another name than then, or that only one
side has, are listed at the end.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def executables(folder, target):
    """The bench binaries of a tree, by name."""
    environment = {**os.environ, "CARGO_TARGET_DIR": str(target)}
    command = ["cargo", "bench", "--no-run", "--workspace", "--all-features", "--benches", "--message-format", "json"]
    built = subprocess.run(command, cwd=folder, env=environment, check=True, stdout=subprocess.PIPE, text=True)
    found = {}
    for line in built.stdout.splitlines():
        message = json.loads(line)
        if message.get("reason") == "compiler-artifact" and message["target"]["kind"] == ["bench"]:
            found[message["target"]["name"]] = message["executable"]
    return found


def run(executable, folder, seconds):
    """Seconds per iteration of each bench in one binary: criterion's median."""
    with tempfile.TemporaryDirectory() as home:
        words = ["--bench", "--noplot", "--sample-size", "10", "--warm-up-time", "0.2", "--measurement-time", str(seconds)]
        done = subprocess.run([executable, *words], cwd=folder, env={**os.environ, "CRITERION_HOME": home}, capture_output=True)
        if done.returncode != 0:
            print(f"{Path(executable).name}: exit code {done.returncode}", file=sys.stderr)
        times = {}
        for estimates in Path(home).rglob("new/estimates.json"):
            name = str(estimates.parent.parent.relative_to(home))
            times[name] = json.loads(estimates.read_text())["median"]["point_estimate"] * 1e-9
        return times


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("commit")
    parser.add_argument("names", nargs="*")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=1.0)
    arguments = parser.parse_intermixed_args()
    with tempfile.TemporaryDirectory() as scratch:
        before = Path(scratch) / "before"
        git = lambda *words: subprocess.run(["git", "-C", str(ROOT), "worktree", *words], check=True, capture_output=True)
        git("add", "--detach", str(before), arguments.commit)
        try:
            target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")).resolve()
            sides = {"now": (ROOT, executables(ROOT, target)), "before": (before, executables(before, target / "before"))}
            return compare(sides, arguments)
        finally:
            git("remove", "--force", str(before))


def compare(sides, arguments):
    wanted = lambda name: not arguments.names or any(part in name for part in arguments.names)
    programs = sorted(name for name in sides["now"][1] if name in sides["before"][1] and wanted(name))
    times = {"before": {}, "now": {}}
    for program in programs:
        for turn in range(arguments.rounds):
            # The order changes, so that neither side always runs on the warmer machine.
            for side in ("before", "now") if turn % 2 == 0 else ("now", "before"):
                folder, found = sides[side]
                for bench, seconds in run(found[program], folder, arguments.seconds).items():
                    times[side].setdefault(f"{program}: {bench}", []).append(seconds)
    ratios = []
    for bench in sorted(times["before"].keys() & times["now"].keys()):
        before, now = (statistics.median(times[side][bench]) for side in ("before", "now"))
        ratios.append(before / now)
        print(f"{before / now:6.3f}  {1e3 * before:12.5f} ms  {1e3 * now:12.5f} ms  {bench}")
    for side in ("before", "now"):
        other = "now" if side == "before" else "before"
        for bench in sorted(times[side].keys() - times[other].keys()):
            print(f"only {side}: {1e3 * statistics.median(times[side][bench]):12.5f} ms  {bench}")
    if ratios:
        print(f"{len(ratios)} benches: least ratio {min(ratios):.3f}, median {statistics.median(ratios):.3f}")
    return 0 if ratios else 1


if __name__ == "__main__":
    sys.exit(main())
