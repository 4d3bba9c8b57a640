"""Whether the tests see faults: puts each fault of `faults/*.toml` into a copy of the code and runs the test that must fail.

A fault is a piece of code, which must occur exactly once in its file, what stands there instead, and a command:

    [[fault]]
    name = "paint lands twice"
    file = "paint-sim/src/spray.rs"
    find = "canvas += depth"
    replace = "canvas += 2.0 * depth"
    test = "cargo test --release -p paint-sim --test deposit conserves_mass"

    python3 benches/faults.py [NAME_PART ...]     from any folder; the copy is a worktree of HEAD

The test must pass without the fault and fail with it; code that does not compile does not count. Exit code 1 if a fault was
not seen.
"""

import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def faults(parts):
    for path in sorted((ROOT / "benches" / "faults").glob("*.toml")):
        for fault in tomllib.loads(path.read_text())["fault"]:
            if not parts or any(part in f"{path.stem} {fault['name']}" for part in parts):
                yield path.stem, fault


def test(command, folder, target):
    """`passed`, `failed`, `ran nothing` or `does not compile`, and what was printed."""
    # Incremental: each fault changes one function.
    settings = {"CARGO_TARGET_DIR": str(target), "CARGO_TERM_COLOR": "never", "CARGO_INCREMENTAL": "1"}
    environment = {**os.environ, **settings}
    done = subprocess.run(shlex.split(command), cwd=folder, env=environment, capture_output=True, text=True, timeout=1800)
    if "could not compile" in done.stderr or "error: no test target" in done.stderr:
        return "does not compile", done.stderr
    ran = any(line.startswith("test ") and line.endswith(("ok", "FAILED")) for line in done.stdout.splitlines())
    if done.returncode == 0:
        return "passed" if ran else "ran nothing", done.stdout
    return "failed", done.stdout


def check(fault, folder, target, sound):
    """What is wrong with a fault's record or its test; None if the fault is seen."""
    path = folder / fault["file"]
    code = path.read_text()
    count = code.count(fault["find"])
    if count != 1:
        return f"`find` occurs {count} times in {fault['file']}"
    command = fault["test"]
    if command not in sound:
        sound[command], _ = test(command, folder, target)
    if sound[command] != "passed":
        return f"without the fault: {sound[command]}: {command}"
    path.write_text(code.replace(fault["find"], fault["replace"]))
    try:
        result, printed = test(command, folder, target)
    except subprocess.TimeoutExpired:
        result, printed = "failed", ""
    finally:
        path.write_text(code)
    if result == "does not compile":
        return f"{result}:\n{printed[-1500:]}"
    return None if result == "failed" else f"not seen by: {command}"


def main():
    # The same as ever: what the crates stand on is built already, and the copy's own crates have their own names there.
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")).resolve()
    folder = Path(tempfile.mkdtemp()) / "code"
    git = lambda *words: subprocess.run(["git", "-C", str(ROOT), "worktree", *words], check=True, capture_output=True)
    git("add", "--detach", str(folder), "HEAD")
    seen, missed, sound = 0, [], {}
    try:
        for crate, fault in faults(sys.argv[1:]):
            wrong = check(fault, folder, target, sound)
            print(f"{'MISSED' if wrong else 'seen  '} {crate}: {fault['name']}{f': {wrong}' if wrong else ''}", flush=True)
            seen += wrong is None
            if wrong:
                missed.append(fault["name"])
    finally:
        git("remove", "--force", str(folder))
        shutil.rmtree(folder.parent, ignore_errors=True)
    print(f"{seen} of {seen + len(missed)} faults seen")
    return 1 if missed or not seen else 0


if __name__ == "__main__":
    sys.exit(main())
