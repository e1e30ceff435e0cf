#!/usr/bin/env bash
# Sets everything up, then runs the main job on the sequence in examples/.
set -euo pipefail
cd "$(dirname "$0")/.."
bash scripts/setup.sh
.venv/bin/lidaraccum accumulate examples/street -o street.ply --overwrite "$@"
