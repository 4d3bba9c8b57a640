"""Where our own programs are, for the scripts that run both sides in turn."""

import os
import subprocess

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))


def library_figures():
    """The path of `library_figures`, built here."""
    build = ["cargo", "build", "--release", "-q", "-p", "paintcopter-benches", "--bin", "library_figures"]
    subprocess.run(build, cwd=ROOT, check=True)
    return os.path.join(ROOT, os.environ.get("CARGO_TARGET_DIR", "target"), "release", "library_figures")
