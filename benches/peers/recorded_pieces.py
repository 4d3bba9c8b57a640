#!/usr/bin/env python3
"""Pieces of a recording in the 7-Scenes layout, tracked as one tries a few frames of it: which of them `scan` does not take for usable,
and why. With the recording's own camera there should be none. Needs nothing but Python.

    python3 recorded_pieces.py KITCHEN --scan PROGRAM [-- --intrinsics 400,400,320,240]
"""

import argparse
import glob
import os
import subprocess
import tempfile

# Frames of a piece, and every which of them is taken.
PIECES = [(5, 1), (12, 1), (20, 1), (30, 1), (45, 1), (60, 2), (80, 4), (120, 3)]


def refusal(program, sequence, frames, more):
    with tempfile.TemporaryDirectory() as out:
        command = [program, "--sequence", sequence, "--poses", "tracked", "--voxel", "0.02"]
        command += ["--frames", frames, "--out", out, *more]
        run = subprocess.run(command, capture_output=True, text=True, check=False)
    return run.stderr.strip().splitlines()[-1] if run.returncode else None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequence")
    parser.add_argument("--scan", required=True, help="the program")
    parser.add_argument("--from", dest="first", type=int, default=5, help="first frame of the first piece")
    parser.add_argument("--by", type=int, default=13, help="frames from piece to piece")
    parser.add_argument("more", nargs="*", help="further arguments of the program")
    arguments = parser.parse_args()
    frames = len(glob.glob(os.path.join(arguments.sequence, "*.depth.png")))
    tried, refused = 0, 0
    for length, step in PIECES:
        for first in range(arguments.first, frames - length, arguments.by):
            piece = f"{first}..{first + length}:{step}"
            why = refusal(arguments.scan, arguments.sequence, piece, arguments.more)
            tried += 1
            if why:
                refused += 1
                print(f"{piece}: {why}")
    print(f"{refused} of {tried} pieces refused")


if __name__ == "__main__":
    main()
