#!/bin/sh
# The table of the painters, ours beside the Python baselines, from one run: sh benches/peers/painting.sh [FOLDER]
# Needs the packages of requirements.txt in the python3 on the path (or $PYTHON). Ten minutes on an idle core; every line that
# was measured stays in FOLDER/*.jsonl.
set -e
cd "$(dirname "$0")/../.."
out=${1:-out/painting}
python=${PYTHON:-python3}
mkdir -p "$out"
export OMP_NUM_THREADS=1
cargo build --release -q -p paintcopter-benches --bin library_figures
ours=${CARGO_TARGET_DIR:-target}/release/library_figures
"$python" benches/peers/paint_baselines.py export --to "$out/five" >/dev/null
# In turn, so that a machine that is busy is busy for both.
"$python" benches/peers/paint_baselines.py colour >"$out/peers-colour.jsonl"
"$ours" colour --image "$out/five/colour" >"$out/ours-colour.jsonl"
"$python" benches/peers/paint_baselines.py painters >"$out/peers-painters.jsonl"
"$ours" paint --image "$out/five" >"$out/ours-painters.jsonl"
"$python" benches/peers/paint_baselines.py slew noise >"$out/peers-robot.jsonl"
"$python" benches/peers/painting_table.py "$out"/*.jsonl
