#!/usr/bin/env bash
# Whether two states of the code give the same outputs: runs the binaries of both on the same inputs and compares every file.
#
#   bash benches/same_outputs.sh BASE [HEAD]           two revisions, built in worktrees of their own
#   bash benches/same_outputs.sh run BIN_DIR OUT [JOB]  only the runs, with binaries that are already built
#   python3 benches/same_outputs.py OUT_BASE OUT_HEAD   only the comparison
#
# Jobs: mission, scanned (a mission on its own scan), plan, unwrap, vio, paint-image, handheld, vr and scan; unwrap and scan read a
# mesh and a recording named by PAINTCOPTER_DATA (meshes/common3d/spot.obj, rgbd/7scenes_redkitchen_sparse20) and are left out, with
# a word, where there is none.
set -euo pipefail

run() {
    local bin out="$2" jobs="${3:-mission scanned plan unwrap vio paint-image handheld vr scan}"
    bin="$(cd "$1" && pwd)"
    mkdir -p "$out"
    out="$(cd "$out" && pwd)"
    for job in $jobs; do
        rm -rf "${out:?}/$job"
        mkdir -p "$out/$job"
        cd "$out/$job"
        # Paths within the results are relative, so that they are the same in both.
        case "$job" in
        mission) "$bin/paintcopter" --seed 3 --out paint >log 2>&1 ;;
        scanned) "$bin/paintcopter" --scan --seed 2 --out paint >log 2>&1 ;;
        plan) "$bin/plan" --seed 4 --painter feedback --out plan >log 2>&1 ;;
        unwrap)
            local mesh="${PAINTCOPTER_DATA:-}/meshes/common3d/spot.obj"
            if [ ! -f "$mesh" ]; then
                echo "unwrap: not compared: PAINTCOPTER_DATA names no folder with meshes/common3d/spot.obj"
                continue
            fi
            cp "$mesh" mesh.obj
            "$bin/unwrap" --mesh mesh.obj --out charts >log 2>&1
            ;;
        handheld) "$bin/handheld" --seed 2 --out handheld >log 2>&1 ;;
        vr)
            "$bin/vr" --experiment area-fill --seed 2 --out area >log 2>&1
            # Says with its exit code whether the plans are those of the version that recorded it.
            "$bin/vr" --replay "$root/examples/sessions/headset.mcap" --out replay >>log 2>&1 || true
            ;;
        vio)
            "$bin/vio" sim --flight wall --seconds 12 --stereo --mcap --seed 5 --out recording >log 2>&1
            "$bin/vio" --euroc recording --out mono >>log 2>&1
            "$bin/vio" --euroc recording --stereo --out stereo >>log 2>&1
            "$bin/vio" --mcap recording/recording.mcap --calibrate --out mcap >>log 2>&1
            "$bin/vio" eval recording/truth.tum mono/trajectory.tum >eval.txt 2>>log
            ;;
        paint-image)
            cp "$root/docs/src/images/rock.png" picture.png
            for painter in feedback deconvolution pursuit; do
                "$bin/paint-image" --image picture.png --painter $painter --out $painter >>log 2>&1
            done
            "$bin/paint-image" --image picture.png --palette cmyk --out colour >>log 2>&1
            # The option's former name, for a base that has it.
            local slew=--slew-limit
            "$bin/paint-image" --help | grep -q -- $slew || slew=--largest-change
            "$bin/paint-image" --image picture.png --layers $slew 0.05 --out layers >>log 2>&1
            ;;
        scan)
            local sequence="${PAINTCOPTER_DATA:-}/rgbd/7scenes_redkitchen_sparse20"
            if [ ! -d "$sequence" ]; then
                echo "scan: not compared: PAINTCOPTER_DATA names no folder with rgbd/7scenes_redkitchen_sparse20"
                continue
            fi
            ln -s "$sequence" sequence
            "$bin/scan" --sequence sequence --voxel 0.02 --device cpu --out plain >log 2>&1
            # Every twentieth frame: the camera is lost and found, and the exit code says that less than half was fused.
            "$bin/scan" --sequence sequence --voxel 0.02 --poses tracked --device cpu --out lost >>log 2>&1 || true
            "$bin/scan" --sequence sequence --voxel 0.02 --poses odometry --loops --device cpu --out loops >>log 2>&1
            "$bin/scan" --sequence sequence --voxel 0.02 --relocalise plain/map.tsdf --device cpu --out relocalised >>log 2>&1 || true
            "$bin/scan" --sequence sequence --voxel 0.02 --active-mib 8 --host-mib 64 --device cpu --out capped >>log 2>&1
            rm sequence
            ;;
        *) echo "no such job: $job"; exit 2 ;;
        esac
    done
}

root="$(cd "$(dirname "$0")/.." && pwd)"
if [ "${1:-}" = run ]; then
    run "$2" "$3" "${4:-}"
    exit
fi
[ $# -ge 1 ] || { sed -n '2,10s/^# \{0,1\}//p' "$0"; exit 2; }

work="$(mktemp -d)"
cd "$root"
trap 'for side in base head; do git worktree remove --force "$work/$side" 2>/dev/null || true; done; rm -rf "$work"' EXIT
for side in base head; do
    revision="$1"
    [ $side = base ] || revision="${2:-HEAD}"
    git worktree add --quiet --detach "$work/$side" "$revision"
    (cd "$work/$side" && CARGO_TARGET_DIR="$work/target" cargo build --quiet --release --all-features)
    mkdir -p "$work/bin-$side"
    cp "$work"/target/release/{paintcopter,plan,scan,unwrap,vio,paint-image,handheld,vr} "$work/bin-$side/"
    (run "$work/bin-$side" "$work/out-$side")
done
python3 "$root/benches/same_outputs.py" "$work/out-base" "$work/out-head"
