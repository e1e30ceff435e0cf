#!/usr/bin/env bash
# Trains, or goes on training, and leaves weights.safetensors, state.safetensors and metrics.jsonl.
#   OUT=run [STATE=old/state.safetensors] [MINUTES=9] [SETTINGS=settings.json] scripts/train_on_device.sh
# STATE is what an earlier call left (with metrics.jsonl beside it); without it a run begins.
# PARTS_MB=15 cuts the state into files state.safetensors.aa, .ab ... for where large files cannot
# travel; `cat state.safetensors.?? >state.safetensors` puts it together.
# PYTHON names an interpreter with torch, numpy, scipy, safetensors and open3d or another ray caster.
set -euo pipefail
cd "$(dirname "$0")/.."
: "${OUT:?names the folder for what comes out}"
mkdir -p "$OUT"
if [ -n "${STATE:-}" ]; then
    cp "$STATE" "$OUT/state.safetensors"
    beside="$(dirname "$STATE")/metrics.jsonl"
    if [ -f "$beside" ]; then cp "$beside" "$OUT/metrics.jsonl"; fi
fi
PYTHONPATH="$PWD/src${PYTHONPATH:+:$PYTHONPATH}" PYTHONUNBUFFERED=1 \
    "${PYTHON:-python3}" scripts/train_on_device.py "$OUT" "${MINUTES:-9}" "${SETTINGS:-}"
if [ -n "${PARTS_MB:-}" ]; then
    split -b "${PARTS_MB}M" "$OUT/state.safetensors" "$OUT/state.safetensors."
    rm "$OUT/state.safetensors"
fi
