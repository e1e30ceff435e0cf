#!/usr/bin/env bash
# Trains on simulated drives, or goes on training, and leaves weights.safetensors, metrics.jsonl and
# the state, cut into state.safetensors.aa, .ab ... for where large files cannot travel.
#   OUT=run [MINUTES=8] [BATCH=8] [WINDOWS=12] [SETTINGS=train.toml] scripts/train_on_device.sh
#   OUT=run2 STATE=run/state.safetensors scripts/train_on_device.sh            goes on
#
# The machine needs torch, numpy, scipy, safetensors and a ray caster, embreex or open3d; no other
# package of this project's. What it lacks travels as wheels: WHEELS=dir installs dir/*.whl, without
# a network and without their needs, into a folder of this run's own. For Python 3.12 on x86-64:
#   pip download --no-deps --only-binary=:all: --python-version 3.12 \
#       --platform manylinux_2_28_x86_64 -d wheels embreex==4.4.0.post1
#
# STATE     what an earlier call left, whole or in parts, with metrics.jsonl beside it. The settings
#           must be the same, BATCH and WINDOWS among them.
# MINUTES   of learning; allow one more for the start and the end. SIGTERM ends it earlier.
# BATCH     windows a step; WINDOWS cut out of each drive: more of them when the accelerator waits.
# SETTINGS  a file with a [train] table; it may name start_from, weights to begin with. With the
#           cosine schedule it must name steps.
# PARTS_MB  size of the state's parts (15). `cat state.safetensors.?? >state.safetensors` joins them.
# PYTHON    the interpreter (python3).
set -euo pipefail
: "${OUT:?names the folder for what comes out}"
python="${PYTHON:-python3}"
code="$(cd "$(dirname "$0")/.." && pwd)"
mkdir -p "$OUT"
scratch="$(mktemp -d)"
mkdir "$scratch/run" "$scratch/site"

deliver() {
    for file in weights.safetensors metrics.jsonl; do
        if [ -f "$scratch/run/$file" ]; then cp "$scratch/run/$file" "$OUT/"; fi
    done
    if [ -f "$scratch/run/state.safetensors" ]; then
        rm -f "$OUT"/state.safetensors*
        split -b "${PARTS_MB:-15}M" "$scratch/run/state.safetensors" "$OUT/state.safetensors."
    fi
    rm -rf "$scratch"
}
trap deliver EXIT
trap 'if [ -n "${trainer:-}" ]; then kill -TERM "$trainer"; else exit 143; fi' TERM

if [ -n "${WHEELS:-}" ]; then
    "$python" -m pip install -q --no-index --no-deps --no-compile --disable-pip-version-check \
        --target "$scratch/site" "$WHEELS"/*.whl
fi
if [ -n "${STATE:-}" ]; then
    if [ -f "$STATE" ]; then parts=("$STATE"); else parts=("$STATE".??); fi
    cat "${parts[@]}" >"$scratch/run/state.safetensors"
    beside="$(dirname "$STATE")/metrics.jsonl"
    if [ -f "$beside" ]; then cp "$beside" "$scratch/run/metrics.jsonl"; fi
fi

PYTHONPATH="$scratch/site:$code/src${PYTHONPATH:+:$PYTHONPATH}" PYTHONUNBUFFERED=1 \
    "$python" "$code/scripts/train_on_device.py" "$scratch/run" "${MINUTES:-8}" "${SETTINGS:-}" &
trainer=$!
result=0
wait "$trainer" || result=$?
# A signal ends `wait` before the trainer has saved its state.
while kill -0 "$trainer" 2>/dev/null; do
    result=0
    wait "$trainer" || result=$?
done
exit "$result"
